"""Numerical checks of cells; shared by the tests and the stability report."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from edge.cells import Tessellator
from edge.cells.mesh import Mesh
from edge.types import Cells
from tests.support.layouts import hexagonal, rest_of, tracks_of

Points = NDArray[np.float64]


def points_of(cells: Cells) -> Points:
    """(n + b, 2): the pins and the artificial points that were tessellated."""
    return np.concatenate([cells.xy_img, cells.boundary_img])


def fresh_areas(tessellator: Tessellator) -> Points:
    """Areas of the last frame's points from a triangulation made from scratch."""
    n, b = len(tessellator.rest_area_px2), len(tessellator._around)
    points, areas = np.concatenate([tessellator._last_img, tessellator._points[n:]]), np.empty(n)
    Mesh(n, b, len(points) - n - b).update(points, areas)
    return areas


def worst_relative(values: Points, wanted: Points) -> float:
    """Largest |value - wanted| / |wanted|; inf where only one of the two is finite."""
    with np.errstate(invalid="ignore"):
        error = np.abs(values - wanted) / np.abs(wanted)
    error[np.isnan(values) & np.isnan(wanted)] = 0.0
    return float(np.nan_to_num(error, nan=np.inf).max())


def polygon_area(corners: Points) -> float:
    """Area of a polygon, px2."""
    if len(corners) == 0:
        return 0.0
    x, y = (corners - corners[0]).T
    return float(abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2)


@dataclass
class Walks:
    """Results of random walks."""

    walks: int
    flips: int  # of the kept triangulation
    builds: int  # triangulations from scratch on the kept side; one a walk is the start
    worst_difference: float  # kept against fresh, relative


def random_walks(walks: int, steps: int, step_px: float, seed: int) -> Walks:
    """331 pins on random walks: kept cells against fresh ones."""
    rng = np.random.default_rng(seed)
    rest = hexagonal()
    n = len(rest)
    result = Walks(walks, 0, 0, 0.0)
    tessellator = Tessellator(rest_of(rest))
    for _ in range(walks):
        xy = rest + rng.normal(0, 2.0, rest.shape)
        counts = tessellator._mesh.counts()
        tessellator.cells(tracks_of(xy))
        for _ in range(steps):
            angle = rng.uniform(0, 2 * np.pi, n)
            xy = xy + step_px * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            xy += 0.05 * (rest - xy)  # stay round the rest place: no two pins pass one another
            cells = tessellator.cells(tracks_of(xy))
            difference = worst_relative(cells.area_px2, fresh_areas(tessellator))
            result.worst_difference = max(result.worst_difference, difference)
        after = tessellator._mesh.counts()
        result.flips += after[1] - counts[1]
        result.builds += after[2] - counts[2]
    return result
