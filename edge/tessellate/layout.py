"""Small facts about a set of pins."""

from __future__ import annotations

import numpy as np

from edge.errors import DegenerateLayout
from edge.types import Array

__all__ = ["affine_terms", "must_span", "pitch_of"]

# Directions in which pins spread less than this share of their longest extent count as a line.
LINE = 1e-9


def must_span(xy: Array, what: str) -> None:
    """Raises DegenerateLayout unless `xy` has three points off a line."""
    if not np.isfinite(xy).all():
        raise DegenerateLayout(f"{what}: a coordinate is not finite")
    if len(xy) < 3:
        raise DegenerateLayout(f"{what}: {len(xy)} pins; cells need at least 3 that span a plane")
    spread = np.linalg.svd(xy - xy.mean(axis=0), compute_uv=False)
    if not spread[1] > LINE * spread[0]:
        raise DegenerateLayout(f"{what}: all {len(xy)} pins on a line; cells need pins that span a plane")


def pitch_of(xy: Array) -> float:
    """Median distance of a pin to the nearest pin at another place, px."""
    nearest = np.empty(len(xy))
    for i, p in enumerate(xy):
        distance = np.hypot(*(xy - p).T)
        nearest[i] = distance[distance > 0].min()
    return float(np.median(nearest))


def affine_terms(xy: Array, centre: Array, scale: float) -> Array:
    """(n, 3): 1, x, y about `centre` in units of `scale`."""
    return np.column_stack([np.ones(len(xy)), (xy - centre) / scale])
