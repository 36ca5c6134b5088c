"""Which points are near which. A kernel: compiled by Cython, and the same when it is not.

All distances are taken: for the points of one tip that is as fast as a search tree.
"""

# mypy: disable-error-code="attr-defined,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.types import Array, Index

if cython.compiled:
    from cython.cimports.libc.math import HUGE_VAL, sqrt
else:
    from math import inf as HUGE_VAL  # noqa: N812
    from math import sqrt


def nearest_of(points: Array, xy: Array, k: int = 1) -> tuple[Array, Index]:
    """The k points nearest to each place.

    points   (n, 2), xy (m, 2) places, same unit
    Returns  (m, k) float64 distances, ascending; (m, k) int32 rows of points, the lower row first of two at
             one distance. Fewer columns where there are fewer points.
    Raises   ValueError: no points, sizes that do not fit, a coordinate that is not finite
    """
    points, xy = _checked(points), _checked(xy)
    if not len(points) or k < 1:
        raise ValueError(f"at least one of at least one point is wanted, not {k} of {len(points)}")
    k = min(k, len(points))
    distance, row = np.full((len(xy), k), HUGE_VAL), np.empty((len(xy), k), np.int32)
    _nearest(points, xy, distance, row)
    return distance, row


def pairs_within(xy: Array, reach: float) -> Index:
    """(p, 2) int32 rows of the points no further apart than `reach`, each pair once, the lower row first.

    xy      (n, 2), same unit
    Raises  ValueError: sizes that do not fit, a coordinate that is not finite
    """
    xy = _checked(xy)
    counted: cython.Py_ssize_t = _pairs(xy, reach, np.empty((0, 2), np.int32))
    pairs = np.empty((counted, 2), np.int32)
    _pairs(xy, reach, pairs)
    return pairs


def _checked(xy: Array) -> Array:
    xy = np.ascontiguousarray(xy, np.float64)
    if xy.ndim != 2 or xy.shape[1] != 2 or not np.isfinite(xy).all():
        raise ValueError(f"finite (n, 2) are wanted, not {xy.shape} with {np.isfinite(xy).sum()} finite")
    return xy


@cython.cfunc
@cython.exceptval(check=False)
def _nearest(
    points: cython.const[cython.double][:, ::1],
    xy: cython.const[cython.double][:, ::1],
    distance: cython.double[:, ::1],
    row: cython.int[:, ::1],
) -> cython.void:
    k: cython.Py_ssize_t = distance.shape[1]
    i: cython.Py_ssize_t
    j: cython.Py_ssize_t
    c: cython.Py_ssize_t
    dx: cython.double
    dy: cython.double
    d2: cython.double
    for i in range(xy.shape[0]):
        for j in range(points.shape[0]):
            dx = points[j, 0] - xy[i, 0]
            dy = points[j, 1] - xy[i, 1]
            d2 = dx * dx + dy * dy
            if not d2 < distance[i, k - 1]:
                continue
            c = k - 1
            while c > 0 and distance[i, c - 1] > d2:
                distance[i, c] = distance[i, c - 1]
                row[i, c] = row[i, c - 1]
                c -= 1
            distance[i, c] = d2
            row[i, c] = j
        for c in range(k):
            distance[i, c] = sqrt(distance[i, c])


@cython.cfunc
@cython.exceptval(check=False)
def _pairs(
    xy: cython.const[cython.double][:, ::1], reach: cython.double, pairs: cython.int[:, ::1]
) -> cython.Py_ssize_t:
    """How many pairs there are; as many as fit are written."""
    counted: cython.Py_ssize_t = 0
    i: cython.Py_ssize_t
    j: cython.Py_ssize_t
    dx: cython.double
    dy: cython.double
    for i in range(xy.shape[0]):
        for j in range(i + 1, xy.shape[0]):
            dx = xy[j, 0] - xy[i, 0]
            dy = xy[j, 1] - xy[i, 1]
            if dx * dx + dy * dy > reach * reach:
                continue
            if counted < pairs.shape[0]:
                pairs[counted, 0] = i
                pairs[counted, 1] = j
            counted += 1
    return counted
