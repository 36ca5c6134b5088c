# cython: infer_types=True
"""Which points are near which, whether they still stand apart, and weighted sums of the motion of those near.

A kernel: compiled by Cython, and the same when it is not; other kernels import it through `neighbours.pxd`.

A search tree would be no faster for the points of one tip: they are sorted along one axis.
"""

import cython
import numpy as np
from cython.cimports.libc.math import sqrt
from numpy.typing import NDArray

from edge.limits import POINTS_MAX
from edge.types import Array, Index

HUGE_VAL = cython.declare(cython.double, float("inf"))


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
    distance, row = np.full((len(xy), k), HUGE_VAL), np.full((len(xy), k), len(points), np.int32)
    order = np.argsort(points[:, 0], kind="stable").astype(np.int32)
    begin = np.searchsorted(points[order, 0], xy[:, 0])
    _nearest(points[order], order, xy, begin, distance, row)
    return distance, row


def pairs_within(xy: Array, reach: float) -> Index:
    """(p, 2) int32 rows of the points no further apart than `reach`, each pair once, the lower row first.

    Raises  ValueError: not (n, 2), a coordinate that is not finite
    """
    xy = _checked(xy)
    order = np.argsort(xy[:, 0]).astype(np.int32)
    xy = xy[order]
    counted: cython.Py_ssize_t = _pairs(xy, reach, np.empty((0, 2), np.int32))
    pairs = np.empty((counted, 2), np.int32)
    _pairs(xy, reach, pairs)
    pairs = np.sort(order[pairs], axis=1)
    return np.ascontiguousarray(pairs[np.argsort(pairs @ np.array([len(xy), 1]))])


def short_rows(rows: Index) -> NDArray[np.uint16]:
    """Rows of a table in half the memory. Raises ValueError: a row that 16 bits do not hold."""
    most = np.iinfo(np.uint16).max
    if rows.size and not (rows.min() >= 0 and rows.max() <= most):
        raise ValueError(f"rows of 0 to {most} are wanted, not {rows.min()} to {rows.max()}")
    return np.ascontiguousarray(rows, np.uint16)


def weighted_rows(near: Index, weight: Array) -> tuple[Index, NDArray[np.uint16], NDArray[np.float32]]:
    """Neighbours (n, k) and their weights, 0 beyond those that there are, as `weighted_sums` takes them.

    Returns  (n + 1,) where those of each point begin in the next two; twice the row of each; their weights.
             They are an even number, the last one may have no weight.
    Raises   ValueError: a row that 16 bits do not hold
    """
    near, weight = np.pad(near, ((0, 0), (0, 1))), np.pad(weight, ((0, 0), (0, 1)))
    count = np.count_nonzero(weight, axis=1)
    count += count % 2
    order = np.argsort(weight == 0.0, axis=1, kind="stable")
    taken = np.arange(weight.shape[1]) < count[:, None]
    near, weight = np.take_along_axis(near, order, 1)[taken], np.take_along_axis(weight, order, 1)[taken]
    return np.cumsum([0, *count], dtype=np.int32), short_rows(2 * near), weight.astype(np.float32)


def weighted_sums(
    start: cython.const[cython.int][::1],
    near: cython.const[cython.ushort][::1],
    weight: cython.const[cython.float][::1],
    motion: cython.const[cython.float][::1],
    sums: cython.float[::1],
) -> cython.void:
    """Weighted sum of the motion of the neighbours of each point.

    start, near, weight  of `weighted_rows`, for n points
    motion               (2 m,) px, x and y of each point in turn; finite
    sums                 (2 n,) px, likewise; written
    """
    # Every second neighbour into the same sums: these do not wait for the others.
    a: cython.Py_ssize_t
    b: cython.Py_ssize_t
    x: cython.float
    y: cython.float
    other_x: cython.float
    other_y: cython.float
    for i in range(start.shape[0] - 1):
        x = y = other_x = other_y = 0.0
        for k in range(start[i], start[i + 1], 2):
            a = near[k]
            b = near[k + 1]
            x += weight[k] * motion[a]
            y += weight[k] * motion[a + 1]
            other_x += weight[k + 1] * motion[b]
            other_y += weight[k + 1] * motion[b + 1]
        sums[2 * i] = x + other_x
        sums[2 * i + 1] = y + other_y


def _checked(xy: Array) -> Array:
    xy = np.ascontiguousarray(xy, np.float64)
    if xy.ndim != 2 or xy.shape[1] != 2 or not np.isfinite(xy).all():
        raise ValueError(f"finite (n, 2) are wanted, not {xy.shape} with {np.isfinite(xy).sum()} finite")
    return xy


@cython.cfunc
def _nearest(
    points: cython.const[cython.double][:, ::1],
    row_of: cython.const[cython.int][::1],
    xy: cython.const[cython.double][:, ::1],
    begin: cython.const[cython.Py_ssize_t][::1],
    distance: cython.double[:, ::1],
    row: cython.int[:, ::1],
) -> cython.void:
    """The points come by ascending x, with their rows; `begin`: the first one that is not left of each place.

    From there to either side, until the next along x is too far.
    """
    n: cython.Py_ssize_t = points.shape[0]
    k: cython.Py_ssize_t = distance.shape[1]
    for i in range(xy.shape[0]):
        for side in range(2):
            j = begin[i] - side
            while 0 <= j < n:
                dx = points[j, 0] - xy[i, 0]
                if dx * dx > distance[i, k - 1]:
                    break
                dy = points[j, 1] - xy[i, 1]
                d2 = dx * dx + dy * dy
                c = k
                while c > 0 and not distance[i, c - 1] < d2:
                    if distance[i, c - 1] == d2 and row[i, c - 1] < row_of[j]:
                        break
                    c -= 1
                    if c < k - 1:
                        distance[i, c + 1] = distance[i, c]
                        row[i, c + 1] = row[i, c]
                if c < k:
                    distance[i, c] = d2
                    row[i, c] = row_of[j]
                j += 1 - 2 * side
        for c in range(k):
            distance[i, c] = sqrt(distance[i, c])


@cython.cfunc
def _pairs(
    xy: cython.const[cython.double][:, ::1], reach: cython.double, pairs: cython.int[:, ::1]
) -> cython.Py_ssize_t:
    """How many pairs of points by ascending x there are; as many as fit are written."""
    counted: cython.Py_ssize_t = 0
    for i in range(xy.shape[0]):
        for j in range(i + 1, xy.shape[0]):
            dx = xy[j, 0] - xy[i, 0]
            if dx * dx > reach * reach:
                break
            dy = xy[j, 1] - xy[i, 1]
            if dx * dx + dy * dy > reach * reach:
                continue
            if counted < pairs.shape[0]:
                pairs[counted, 0] = i
                pairs[counted, 1] = j
            counted += 1
    return counted


class Separation:
    """Whether n moving points that were compared and stood apart still do.

    Two of them approach each other by no more than both move: while none has moved by half of the smallest
    gap, no pair need be compared.

    Raises  ValueError: too many points
    """

    def __init__(self, n: int) -> None:
        if not 0 <= n <= POINTS_MAX:
            raise ValueError(f"n: 0 to {POINTS_MAX} are wanted, not {n}")
        self.n = n
        self.at = np.full((n, 2), np.nan)  # when they were compared
        self.far2 = self.moved = 0.0

    def holds(self, xy: cython.const[cython.double][:, ::1], step: cython.double) -> cython.bint:
        """Whether no two points can have come too near to each other.

        xy       (n, 2) px; NaN: not there, near to none
        step     px, none has moved by more since the last call, when all were there; infinite: not known
        Returns  False: they are to be compared; so is a point that was not there then
        """
        longest2: cython.double = 0.0
        self.moved += step
        if self.moved * self.moved < self.far2:
            return True
        for i in range(self.n):
            x = xy[i, 0] - self.at[i, 0]
            y = xy[i, 1] - self.at[i, 1]
            if not x * x + y * y < self.far2 and xy[i, 0] == xy[i, 0]:
                return False
            longest2 = x * x + y * y if x * x + y * y > longest2 else longest2
        self.moved = sqrt(longest2)
        return True

    def renew(self, xy: cython.const[cython.double][:, ::1], gap: cython.double) -> cython.void:
        """They were compared; `gap`, px: the least distance of two, less what would be too near."""
        self.at[:, :] = xy
        self.moved = 0.0
        self.far2 = 0.25 * gap * gap if gap > 0.0 else 0.0
