"""Regular layouts of pins, and small facts about a set of pins."""

import cv2
import numpy as np

from edge.errors import DegenerateLayout
from edge.limits import PINS_MAX, PINS_MIN
from edge.types import Array, Index

LAYOUTS = ("hex", "rings", "square")
# Directions in which pins spread less than this share of their longest extent count as a line.
LINE = 1e-9
# Determinant over squared trace of the scatter matrix beyond which the pins certainly span a plane: 1e-3 to 1
# in extent.
CLEARLY_FLAT = 1e-6


def must_span(xy: Array, what: str) -> None:
    """Raises DegenerateLayout unless `xy` has three points off a line."""
    if not np.isfinite(xy).all():
        raise DegenerateLayout(f"{what}: a coordinate is not finite")
    if len(xy) < 3:
        raise DegenerateLayout(f"{what}: {len(xy)} pins; cells need at least 3 that span a plane")
    if not spans(xy):
        raise DegenerateLayout(f"{what}: all {len(xy)} pins on a line; cells need pins that span a plane")


def spans(xy: Array) -> bool:
    """Whether finite points are not all on a line or at one place."""
    about_mean = xy - xy.mean(axis=0)
    scatter = about_mean.T @ about_mean
    if scatter[0, 0] * scatter[1, 1] - scatter[0, 1] ** 2 > CLEARLY_FLAT * np.trace(scatter) ** 2:
        return True  # the common case: no decomposition needed
    spread = np.linalg.svd(about_mean, compute_uv=False)
    return bool(spread[1] > LINE * spread[0])


def affine_terms(xy: Array, centre: Array, scale: float) -> Array:
    """(n, 3): 1, x, y about `centre` in units of `scale`."""
    return np.column_stack([np.ones(len(xy)), (xy - centre) / scale])


def circle_of(xy: Array, radius: float) -> tuple[Array, float]:
    """Middle (2,) and radius of the smallest circle round discs of one radius at places (n, 2)."""
    centre, _ = cv2.minEnclosingCircle(xy.astype(np.float32))  # It is in single precision.
    size = np.hypot(*(xy - centre).T)
    on_it = size >= (1.0 - 1e-5) * size.max()
    rows = np.insert((xy - centre)[on_it] / max(size.max(), 1e-9), 2, 1.0, axis=1)
    x, y, reach = np.linalg.lstsq(rows, size[on_it], rcond=1e-3)[0]
    return centre + np.array([x, y]), float(reach) + radius


def pin_layout(kind: str, n_pins: int) -> Array:
    """Regular pattern of pins, scaled so that the outermost lies on the unit circle.

    kind     "hex": hexagonal lattice; "rings": 1 + 6 + 12 + ... on concentric circles; "square": grid
    n_pins   hex and rings: 1 + 3 k (k + 1), thus 127 (k = 6) and 331 (k = 10); square: a square number
    Returns  (n, 2) float64, row 0 nearest to the centre, then by radius and angle
    Raises   ValueError: no such kind, or a number that makes no whole pattern
    """
    if not 1 <= n_pins <= PINS_MAX:
        raise ValueError(f"{n_pins} pins; give {PINS_MIN} to {PINS_MAX}")
    if kind == "square":
        side = round(n_pins**0.5)
        if side * side != n_pins or side < 2:
            raise ValueError(f"layout square: {n_pins} pins is no square number; try {max(side, 2) ** 2}")
        line = np.arange(side) - (side - 1) / 2
        xy = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    elif kind in ("hex", "rings"):
        k = round((-3 + (9 + 12 * (n_pins - 1)) ** 0.5) / 6)
        if 1 + 3 * k * (k + 1) != n_pins or k < 1:
            k = max(k, 1)
            raise ValueError(f"layout {kind}: {n_pins} pins makes no whole rings; try {1 + 3 * k * (k + 1)}")
        if kind == "hex":
            i, j = (a.ravel() for a in np.mgrid[-k : k + 1, -k : k + 1])
            keep = np.abs(i + j) <= k
            xy = np.stack([i + 0.5 * j, j * 3**0.5 / 2], axis=1)[keep]
        else:
            rings = [np.zeros((1, 2))]
            for ring in range(1, k + 1):
                angle = 2 * np.pi * np.arange(6 * ring) / (6 * ring)
                rings.append(ring * np.stack([np.cos(angle), np.sin(angle)], axis=1))
            xy = np.concatenate(rings)
    else:
        raise ValueError(f"layout {kind!r} is unknown; one of {', '.join(LAYOUTS)}")
    radius = np.hypot(xy[:, 0], xy[:, 1])
    angle = np.arctan2(xy[:, 1], xy[:, 0])
    order = np.lexsort((np.round(angle, 9), np.round(radius, 9)))
    return np.asarray(xy[order] / radius.max(), dtype=np.float64)


def circumcentres(points: Array, triangles: Index) -> Array:
    """(t, 2) centre of each triangle's circle, of rows (t, 3) of points; not finite where it is a line."""
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    u, v = b - a, c - a
    twice_cross = 2.0 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    u2, v2 = (u * u).sum(axis=1), (v * v).sum(axis=1)
    offset = np.stack([v[:, 1] * u2 - u[:, 1] * v2, u[:, 0] * v2 - v[:, 0] * u2], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(a + offset / twice_cross[:, None])
