"""Point sets that are hard on a tessellation, and tips made of them."""

from collections.abc import Callable
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from edge.types import Mask, PinPattern, Pins, Rest, Tracks

Points = NDArray[np.float64]

PITCH_PX = 19.0  # of the 331-pin tips in 640x480 images
CENTRE: Points = np.array([320.0, 240.0])


def hexagonal(rings: int = 10, pitch: float = PITCH_PX) -> Points:
    """A hexagon of pins: 1 + 3 rings (rings + 1) of them, 331 for 10 rings."""
    rows = [
        (pitch * (q + r / 2), pitch * r * np.sqrt(3) / 2)
        for q in range(-rings, rings + 1)
        for r in range(max(-rings, -q - rings), min(rings, -q + rings) + 1)
    ]
    return np.array(rows, float) + CENTRE


def concentric(rings: int = 6, pitch: float = PITCH_PX) -> Points:
    """Rings of 6k pins round one in the middle: 127 for 6 rings."""
    rows = [(0.0, 0.0)]
    for k in range(1, rings + 1):
        angle = 2 * np.pi * np.arange(6 * k) / (6 * k)
        rows += list(zip(k * pitch * np.cos(angle), k * pitch * np.sin(angle), strict=True))
    return np.array(rows, float) + CENTRE


def square(side: int = 12, pitch: float = PITCH_PX) -> Points:
    """A square grid: every four neighbours lie on one circle, exactly."""
    return np.array([(i * pitch, j * pitch) for j in range(side) for i in range(side)], float) + CENTRE


def horseshoe(pitch: float = PITCH_PX) -> Points:
    """A square grid with a bay: the outline is not convex."""
    grid = square(15, pitch)
    bay = (np.abs(grid[:, 0] - grid[:, 0].mean()) < 3.5 * pitch) & (grid[:, 1] > grid[:, 1].mean())
    kept: Points = grid[~bay]
    return kept


_KINDS: tuple[Callable[[], Points], ...] = (hexagonal, concentric, square, horseshoe)
TIPS = {kind.__name__: kind for kind in _KINDS}


def pressed(xy: Points, depth_px: float = 6.0) -> Points:
    """A smooth press beside the middle: pins spread from it, the rim is widened and sheared."""
    from_contact = xy - CENTRE - [30.0, -20.0]
    near = np.exp(-(from_contact**2).sum(axis=1) / (2 * 60.0**2))
    now: Points = xy + depth_px * near[:, None] * from_contact / 30.0 + 0.04 * (xy - CENTRE) + [5.0, -3.0]
    return now


def moved(xy: Points, angle: float = 0.0, scale: float = 1.0, shift: float = 0.0) -> Points:
    """Rotated about the tip's centre by `angle` rad, then scaled about the origin, then shifted."""
    c, s = np.cos(angle), np.sin(angle)
    now: Points = scale * ((xy - CENTRE) @ np.array([[c, s], [-s, c]]) + CENTRE) + shift
    return now


def pins_at(xy: Points, radius_px: float = 4.0, brightness: float = 100.0) -> Pins:
    """Equal pins, with a centroid's sigma."""
    return Pins(xy, *(np.full(len(xy), value) for value in (0.05, radius_px, brightness)))


def rest_of(xy: Points) -> Rest:
    """An untouched tip with pins at `xy`."""
    radius = float(np.hypot(*(xy - xy.mean(axis=0)).T).max())
    return Rest(pins_at(xy), PinPattern(4.0, PITCH_PX, xy.mean(axis=0), radius, 20.0, 100.0, 2.0, (640, 480)))


def only(rest: Rest, rows: NDArray[np.generic]) -> Rest:
    """The same tip with these of its pins, by number or mask."""
    return Rest(Pins(*(getattr(rest.pins, f.name)[rows] for f in fields(Pins))), rest.pattern)


def tracks_of(xy: Points) -> Tracks:
    """Pins at `xy`; NaN rows are lost."""
    seen: Mask = np.isfinite(xy[:, 0] + xy[:, 1])
    return Tracks.of(xy, np.where(seen, 0.05, np.nan), seen)


# ---- sets for the mesh alone: pins inside of the unit disc, and the points that bound them


def _cocircular(rng: np.random.Generator) -> Points:
    """24 points 1e-15 off one circle, and its centre's neighbourhood empty."""
    angle = 2 * np.pi * (np.arange(24) + rng.uniform(-0.3, 0.3, 24)) / 24
    radius = 0.5 + 1e-15 * rng.uniform(-1, 1, 24)
    points: Points = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return points


def _collinear(rng: np.random.Generator) -> Points:
    """24 points 1e-15 off a line that is not an axis."""
    along = np.sort(rng.uniform(-0.8, 0.8, 24))
    across = 1e-15 * rng.uniform(-1, 1, 24)
    points: Points = along[:, None] * [0.6, 0.8] + across[:, None] * [-0.8, 0.6]
    return points


def _collinear_exact(rng: np.random.Generator) -> Points:
    along = np.linspace(-0.75, 0.75, 13)
    return np.stack([along, np.zeros(13)], axis=1)


def _duplicate(rng: np.random.Generator) -> Points:
    points = _in_disc(rng, 25)
    return np.concatenate([points, points[:6], points[:2]])


def _nearly_duplicate(rng: np.random.Generator) -> Points:
    points = _in_disc(rng, 20)
    return np.concatenate([points, points[:10] + 1e-14 * rng.uniform(-1, 1, (10, 2))])


def _clustered(rng: np.random.Generator) -> Points:
    """Four clusters of 10, spread over 1e-2 .. 1e-8 of the disc."""
    centres = _in_disc(rng, 4)
    return np.concatenate(
        [c + w * _in_disc(rng, 10) for c, w in zip(centres, (1e-2, 1e-4, 1e-6, 1e-8), strict=True)]
    )


def _in_disc(rng: np.random.Generator, n: int, radius: float = 0.9) -> Points:
    r, angle = radius * np.sqrt(rng.uniform(0, 1, n)), rng.uniform(0, 2 * np.pi, n)
    return np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)


HARD_SETS: dict[str, Callable[[np.random.Generator], Points]] = {
    "random": lambda rng: _in_disc(rng, 40),
    "hexagonal": lambda rng: (hexagonal(3) - CENTRE) / (4 * PITCH_PX),
    "square": lambda rng: np.array([(i, j) for i in range(-3, 4) for j in range(-3, 4)], float) / 6.0,
    "cocircular, 1e-15 off": _cocircular,
    "collinear, 1e-15 off": _collinear,
    "collinear": _collinear_exact,
    "duplicate": _duplicate,
    "duplicate, 1e-14 off": _nearly_duplicate,
    "clustered": _clustered,
}


def bounded(pins: Points, n_boundary: int = 40) -> Points:
    """The pins, and a ring of points of radius 1.2 that bounds the cells of pins in the unit disc."""
    angle = 2 * np.pi * np.arange(n_boundary) / n_boundary
    return np.concatenate([pins, 1.2 * np.stack([np.cos(angle), np.sin(angle)], axis=1)])
