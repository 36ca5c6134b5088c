"""How `mesh` takes the coordinates of a frame, for uncompiled runs; `coordinates.pxd` has it in C.

Both give exactly the same.
"""

from __future__ import annotations

import numpy as np

from edge.types import Array


def extent(points: Array, low: Array, high: Array) -> bool:
    """Whether all points (n, 2) are finite; if so, least x and y into low (2,), largest into high."""
    if not np.isfinite(points).all():
        return False
    low[:], high[:] = points.min(axis=0), points.max(axis=0)
    return True


def take(points: Array, tiny: float, x: Array, y: Array) -> None:
    """Write x and y of points (n, 2) into the first n; 0 where they are smaller than `tiny`."""
    x[: len(points)], y[: len(points)] = np.where(np.abs(points) < tiny, 0.0, points).T
