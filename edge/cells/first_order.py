"""Areas of cells near rest: linear in the motion of each pin and its neighbours.

A kernel (`CONTRIBUTING.md`, "Kernels"): compiled by Cython, and the same when it is not.

Idea: most frames show an untouched tip, whose pins move by their noise. A neighbour that moves by d relative
to the pin shifts the edge of length l between their cells, whose middle is m:

    area = area at rest + sum over neighbours of l (q - m) . d / |q - p|      p, q: the two at rest

What is left out is of second order, at most c times the sum of |d|^2. Each cell's c is measured when the tip
is made, against the exact areas of random motions.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

from collections.abc import Callable

import cython
import numpy as np

from edge.cells.params import PARAMS, CellsParams
from edge.geometry.layout import circumcentres
from edge.types import Array, Index

if cython.compiled:
    from cython.cimports.edge.cells.area_sums import area_sums
    from cython.cimports.edge.geometry.pin_loops import subtract
    from cython.cimports.edge.geometry.views import PointsView
else:
    from edge.cells.area_sums import area_sums
    from edge.geometry.pin_loops import subtract
    from edge.geometry.views import PointsView


@cython.cclass
class FirstOrderAreas:
    """Areas of the n pins' cells of one tip.

    rest       (n + b, 2) px, the pins and the boundary points
    area_px2   (n,) of the cells at rest, finite
    triangles  (t, 3), Delaunay triangles that touch a pin
    Raises     ValueError: sizes that do not fit, no such point
    """

    _n: cython.Py_ssize_t
    _points_view: PointsView
    _areas: cython.double[::1]  # given last
    _areas_array: Array | None  # the same memory
    _rest: cython.double[:, ::1]
    _motion: cython.double[:, ::1]  # (n + b, 2)
    _area: cython.double[::1]
    _start: cython.int[::1]  # (n + 1,) in the next two: neighbours of the first pin, of the second, ...
    # twice the neighbour's row; an even number of them, the last may be the pin itself
    _near: cython.int[::1]
    _slope: cython.double[:, ::1]  # (k, 2) px, of the area over a neighbour's motion
    _square_max: cython.double[::1]  # (n,) px2, of the sum of |d|^2
    _moved: cython.Py_ssize_t  # the cell that was last found to have moved too much

    def __init__(self, rest: Array, area_px2: Array, triangles: Index) -> None:
        n = len(area_px2)
        if rest.ndim != 2 or rest.shape[1] != 2 or len(rest) < n or not np.isfinite(area_px2).all():
            raise ValueError(f"rest (n + b, 2) and {n} finite areas are wanted, not {rest.shape}")
        if triangles.size and (triangles.min() < 0 or triangles.max() >= len(rest)):
            raise ValueError(f"triangles: points of 0 to {len(rest) - 1} are wanted")
        self._n, self._moved = n, 0
        self._points_view, self._areas_array = PointsView(), None
        self._rest = np.array(rest, np.float64, order="C")
        self._area = np.array(area_px2, np.float64)
        pin, neighbour, slope = _slopes(rest, triangles, n)
        if not len(pin):
            raise ValueError("triangles: a cell with an edge between two of them is wanted")
        odd = np.flatnonzero(np.bincount(pin, minlength=n) % 2)
        end = np.searchsorted(pin, odd, side="right")
        pin, neighbour, slope = (
            np.insert(pin, end, odd),
            np.insert(neighbour, end, odd),
            np.insert(slope, end, 0.0, 0),
        )
        self._near, self._slope = 2 * neighbour, slope
        self._start = np.searchsorted(pin, np.arange(n + 1)).astype(np.int32)
        self._square_max = np.full(n, np.inf)
        self._motion = np.zeros(rest.shape)

    def measure(
        self,
        place: Callable[[Array], Array],
        exact: Callable[[Array], Array],
        trials: Array,
        params: CellsParams = PARAMS,
    ) -> None:
        """Measure how far the cells may move.

        place    from pins' places (n, 2) to all points (n + b or more, 2)
        exact    from all points to areas (n,)
        trials   (t, n, 2) motions to try, of standard deviation 1
        """
        n = self._n
        rest, area = np.asarray(self._rest), np.asarray(self._area)
        pin = np.repeat(np.arange(n), np.diff(self._start))
        curvature, areas = np.zeros(n), np.empty(n)
        for trial in trials:
            sigma_px = params.first_order_error**0.5 * np.sqrt(area)[:, None]
            points = place(rest[:n] + sigma_px * trial)
            self.update(points, areas)
            motion = points[: len(rest)] - rest
            moved = motion[np.asarray(self._near) // 2] - motion[pin]
            square = np.bincount(pin, (moved**2).sum(axis=1), n)
            off = np.abs(exact(points) - areas)
            curvature = np.maximum(curvature, off / np.maximum(square, np.finfo(np.float64).tiny))
        limit = params.first_order_error * area
        self._square_max = limit / np.maximum(curvature, np.finfo(np.float64).tiny)

    def update(self, points: Array, areas: Array) -> bool:
        """Write the areas of one frame; False, and not all are written: a cell has moved too much.

        points   (n + b or more, 2) px, finite
        areas    (n,) px2
        Raises   ValueError: sizes that do not fit
        """
        k: cython.Py_ssize_t = self._rest.shape[0]
        at: cython.const[cython.double][:, ::1] = self._points_view.of(points)
        if areas is not self._areas_array:
            self._areas = self._areas_array = areas
        if at.shape[0] < k or at.shape[1] != 2 or self._areas.shape[0] != self._n:
            raise ValueError(f"points ({k} or more, 2) and areas ({self._n},) are wanted")
        return self._update(at, self._areas)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _update(self, points: cython.const[cython.double][:, ::1], areas: cython.double[::1]) -> cython.bint:
        i: cython.Py_ssize_t = self._moved
        k: cython.Py_ssize_t
        # Within a touch this cell alone is looked at in most frames.
        self._take(points, i)
        for k in range(self._start[i], self._start[i + 1]):
            self._take(points, self._near[k] // 2)
        if self._sum(i, i + 1, areas) == i:
            return False
        subtract(points, self._rest, self._motion)
        i = self._sum(0, self._n, areas)
        if i == self._n:
            return True
        self._moved = i
        return False

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def _take(self, points: cython.const[cython.double][:, ::1], i: cython.Py_ssize_t) -> cython.void:
        """The motion of one point."""
        self._motion[i, 0] = points[i, 0] - self._rest[i, 0]
        self._motion[i, 1] = points[i, 1] - self._rest[i, 1]

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def _sum(
        self, first: cython.Py_ssize_t, n: cython.Py_ssize_t, areas: cython.double[::1]
    ) -> cython.Py_ssize_t:
        """Areas of the cells from `first` up to n; the cell that has moved too much, or n."""
        return area_sums(
            self._start, self._near, self._slope, self._motion, self._area, self._square_max, first, n, areas
        )


def _slopes(rest: Array, triangles: Index, n: int) -> tuple[Index, Index, Array]:
    """Pin and neighbour (k,) of each edge of a cell, in the pins' order, and the area's slope (k, 2) px."""
    centre = circumcentres(rest, triangles)
    # Round each triangle, counter-clockwise: an edge's two triangles have it in opposite directions.
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    left = {(int(p), int(q)): centre[k // 3] for k, (p, q) in enumerate(zip(start, end, strict=True))}
    edges = sorted(edge for edge in left if edge[0] < n and edge[::-1] in left)
    pin, neighbour = np.array(edges, np.int32).reshape(-1, 2).T.copy()
    ends = np.array([[left[edge], left[edge[::-1]]] for edge in edges]).reshape(-1, 2, 2)
    along = rest[neighbour] - rest[pin]
    distance = np.hypot(along[:, 0], along[:, 1])
    # Counter-clockwise about the pin the edge is passed from right to left of the way to the neighbour.
    way = ends[:, 0] - ends[:, 1]
    length = (along[:, 0] * way[:, 1] - along[:, 1] * way[:, 0]) / distance
    slope = (rest[neighbour] - ends.mean(axis=1)) * (length / distance)[:, None]
    return pin, neighbour, np.ascontiguousarray(slope)
