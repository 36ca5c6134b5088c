"""Small facts about a set of pins."""

from __future__ import annotations

import numpy as np

from edge.errors import DegenerateLayout
from edge.types import Array

__all__ = ["affine_terms", "must_span", "spans"]

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
