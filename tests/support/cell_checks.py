"""Numerical checks of cells; shared by the tests and the stability report."""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from edge.cells import Tessellator
from edge.cells.mesh import Mesh
from edge.types import Cells
from tests.support import exact
from tests.support.layouts import hexagonal, rest_of, tracks_of

Points = NDArray[np.float64]
Index = NDArray[np.int32]


def points_of(cells: Cells) -> Points:
    """(n + b, 2): the pins and the artificial points that were tessellated."""
    return np.concatenate([cells.xy_img, cells.boundary_img])


def fresh_areas(tessellator: Tessellator) -> Points:
    """Areas of the last frame's points from a triangulation made from scratch."""
    n, b, points = len(tessellator.rest_area_px2), len(tessellator._around), tessellator._points
    areas = np.empty(n)
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


def bounded_polygon_area(cells: Cells) -> Fraction:
    """Area of the set of places nearer to a pin than to an artificial point, exactly.

    Its border is walked: the Voronoi edges between a pin and an artificial point, each from the centre
    of the circle of the triangle on its right to that on its left.
    """
    n, points = len(cells.xy_img), points_of(cells)
    left: dict[tuple[int, int], int] = {}
    for t, corners in enumerate(cells.triangles.tolist()):
        for k in range(3):
            left[corners[k], corners[(k + 1) % 3]] = t
    twice = Fraction(0)
    for (p, q), t in left.items():
        if p < n <= q:
            ax, ay = exact.circumcentre(*points[cells.triangles[left[q, p]]])
            bx, by = exact.circumcentre(*points[cells.triangles[t]])
            twice += ax * by - bx * ay
    return twice / 2


class CellEdges:
    """The Voronoi edges of the pins' cells, for bounds on what motion does to areas."""

    def __init__(self, cells: Cells) -> None:
        points, triangles = points_of(cells), cells.triangles
        self.n_pins = len(cells.xy_img)
        corner = [points[triangles[:, k]] for k in range(3)]
        u, v = corner[1] - corner[0], corner[2] - corner[0]
        cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        u2, v2 = (u * u).sum(axis=1), (v * v).sum(axis=1)
        offset = np.stack([v[:, 1] * u2 - u[:, 1] * v2, u[:, 0] * v2 - v[:, 0] * u2], axis=1)
        centre = corner[0] + offset / (2 * cross[:, None])
        start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
        triangle = np.repeat(np.arange(len(triangles)), 3)
        n = len(points)
        of_edge = np.full(n * n, -1)
        of_edge[start * n + end] = triangle
        there = of_edge[end * n + start]
        wanted = (there >= 0) & (start < self.n_pins)
        self.start, self.end, here, there = start[wanted], end[wanted], triangle[wanted], there[wanted]
        a, b, p = centre[here], centre[there], points[self.start]
        reach = np.sqrt(np.maximum(((a - p) ** 2).sum(axis=1), ((b - p) ** 2).sum(axis=1)))
        self.rate = _length(a - b) * reach / _length(p - points[self.end])

    def area_rates(self, motion: Points) -> Points:
        """(n_pins,): upper bound of an area's change when point i moves by motion[i], to first order.

        The bisector of p and q moves, at the place y on it, by ((y - p) v_p - (y - q) v_q) / |p - q|:
        at most |y - p| (|v_p| + |v_q|) / |p - q|. Summed over the Voronoi edges of each cell.
        """
        rate = self.rate * (motion[self.start] + motion[self.end])
        return np.bincount(self.start, weights=rate, minlength=self.n_pins).astype(np.float64)


def _length(vectors: Points) -> Points:
    length: Points = np.sqrt((vectors * vectors).sum(axis=1))
    return length


@dataclass
class Walks:
    """Results of random walks."""

    walks: int
    steps: int
    flips: int  # of the kept triangulation
    builds: int  # triangulations from scratch on the kept side; one a walk is the start
    worst_difference: float  # kept against fresh, relative
    worst_share: float  # change of an area over what the motion explains


def random_walks(walks: int, steps: int, step_px: float, seed: int, *, explain: bool = True) -> Walks:
    """331 pins on random walks: kept cells against fresh ones, and each change against its cause."""
    rng = np.random.default_rng(seed)
    rest = hexagonal()
    n = len(rest)
    result = Walks(walks, steps, 0, 0, 0.0, 0.0)
    tessellator = Tessellator(rest_of(rest))
    for _ in range(walks):
        xy = rest + rng.normal(0, 2.0, rest.shape)
        counts = tessellator._mesh.counts()
        cells = tessellator.cells(tracks_of(xy))
        edges = CellEdges(cells)
        for _ in range(steps):
            angle = rng.uniform(0, 2 * np.pi, n)
            xy = xy + step_px * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            xy += 0.05 * (rest - xy)  # stay round the rest place: no two pins pass one another
            before, cells = cells, tessellator.cells(tracks_of(xy))
            fresh = fresh_areas(tessellator)
            result.worst_difference = max(result.worst_difference, worst_relative(cells.area_px2, fresh))
            if explain:
                motion = _length(points_of(cells) - points_of(before))
                edges_before, edges = edges, CellEdges(cells)
                bound = np.maximum(edges_before.area_rates(motion), edges.area_rates(motion))
                share = np.abs(cells.area_px2 - before.area_px2) / bound
                result.worst_share = max(result.worst_share, float(share.max()))
        after = tessellator._mesh.counts()
        result.flips += after[1] - counts[1]
        result.builds += after[2] - counts[2]
    return result
