"""Split test of a long, small contact: one touch, or two that are too close for the contact field?

Two probes less than two and a half pitches apart make one long region in the contact field. So a region that
is long and small is tested again in a sharper and noisier field (`geometry.motion_field`), within the
region alone: it is two if that field has two peaks, one on each side of the middle along the region's axis,
separated by a valley as deep as one between contacts.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np
from numpy.typing import NDArray

from edge.features.contact_field import ContactField
from edge.features.params import PARAMS, FeatureParams
from edge.features.peaks import PeakFinder
from edge.features.regions import Regions
from edge.types import Array

if cython.compiled:
    from cython.cimports.edge.features.quantized_operator import QuantizedOperator
    from cython.cimports.libc.math import cos, hypot, sin
else:
    from math import cos, hypot, sin

    from edge.features.quantized_operator import QuantizedOperator

_NOTHING = cython.declare(cython.float, -np.inf)


@cython.cclass
class SplitTest:
    """Tests regions of one tip's contact field in the sharper field; m points of a finer grid.

    first, second  places in the contact field's padded grid of the two peaks that `find_pair` found

    x, y           (g,) float64 px, the finer grid's columns and rows
    point          (g, g) int, which of the contact field's k points each of its points lies at; -1: outside
    divergences    (m, 2 n): the sharper field from the pins' motion, at the points that lie at one, row by
                   row
    """

    first = cython.declare(cython.Py_ssize_t, visibility="readonly")
    second = cython.declare(cython.Py_ssize_t, visibility="readonly")
    _operator: QuantizedOperator
    _peaks: PeakFinder  # of the sharper field
    _place: cython.int[::1]  # (m,) in the finer padded grid
    _grid: cython.float[::1]
    _at: cython.int[::1]
    _height: cython.float[::1]
    _found: cython.int[::1]  # which of the m points each peak is
    _values: cython.float[::1]
    _result: cython.float[::1]
    _noise: cython.float[::1]  # (m,) of the sharper field, per px of a pin's
    _coarse: cython.int[::1]  # (m,) place in the contact field's padded grid
    _is_member: cython.uchar[::1]  # (m,) within the region
    _is_member_in_grid: cython.uchar[::1]  # the same, by place
    _active: cython.int[::1]  # the points that are members or touch one
    _n_active: cython.Py_ssize_t
    _i: cython.Py_ssize_t  # the contact under test
    _around: cython.int[::1]
    _field: ContactField
    _detrended: cython.float[::1]
    _regions: Regions
    _owner: cython.int[::1]
    _middle: cython.double[:, ::1]
    _direction: cython.double[::1]
    _x0: cython.double
    _y0: cython.double
    _step_px: cython.double
    _max_distance_px: cython.double
    _min_prominence_rel: cython.double
    _min_prominence_sigma: cython.double

    def __init__(
        self,
        grid: tuple[Array, Array, NDArray[np.intp]],
        divergences: Array,
        field: ContactField,
        peaks: PeakFinder,
        regions: Regions,
        pitch_px: float,
        params: FeatureParams = PARAMS,
    ) -> None:
        x, y, point = grid
        inside = point >= 0
        n = len(field.detrended)
        if divergences.shape != (np.count_nonzero(inside), n) or point.shape != (len(y), len(x)):
            raise ValueError(
                f"divergences ({np.count_nonzero(inside)}, {n}) are wanted, not {divergences.shape}"
            )
        if point.max() >= len(peaks.place):
            raise ValueError(f"point: 0 to {len(peaks.place) - 1} are wanted, not {point.max()}")
        self._operator = QuantizedOperator(divergences)
        self._values, self._result = self._operator.values, self._operator.result
        self._noise = np.sqrt((divergences**2).sum(axis=1)).astype(np.float32)
        self._peaks = PeakFinder(inside)
        self._place, self._grid = self._peaks.place, self._peaks.grid
        self._at, self._height, self._found = self._peaks.at, self._peaks.height, self._peaks.point
        self._coarse = np.asarray(peaks.place)[point[inside]]
        self._is_member = np.zeros(len(divergences), np.uint8)
        self._is_member_in_grid = np.zeros(len(self._grid), np.uint8)
        self._active = np.zeros(len(divergences), np.int32)
        w = self._peaks.width
        self._around = np.array([-w - 1, -w, -w + 1, -1, 1, w - 1, w, w + 1], np.int32)
        self._field, self._detrended = field, field.detrended
        self._regions, self._owner = regions, regions.owner
        self._middle, self._direction = regions.middle, regions.direction
        self._x0, self._y0, self._step_px = x[0], y[0], x[1] - x[0]
        self._max_distance_px = params.close_pitch * pitch_px
        self._min_prominence_rel = params.min_prominence_rel
        self._min_prominence_sigma = 2.0 * params.contact_sigma
        self.first = self.second = self._n_active = self._i = 0

    def find_peaks(self, i: cython.Py_ssize_t) -> int:
        """Find the peaks of the sharper field within contact i's region; how many. Of fewer than two none are
        a pair.

        Raises ValueError: no such contact
        """
        if i < 0 or i >= self._regions.n_contacts:
            raise ValueError(f"i: a contact of 0 to {self._regions.n_contacts - 1} is wanted, not {i}")
        p: cython.Py_ssize_t
        even: cython.float = self._field.plane_divergence
        for p in range(self._n_active):
            self._grid[self._place[self._active[p]]] = _NOTHING
        self._find_points(i)
        self._values[:] = self._detrended
        self._operator.apply_rows(self._active, self._n_active)
        for p in range(self._n_active):
            self._grid[self._place[self._active[p]]] = self._result[p] + even
        self._i = i
        return self._peaks.find_within(self._is_member, self._active, self._n_active)

    def find_pair(self, noise_px: cython.double) -> bool:
        """Whether two of the peaks found make the contact two; then `first` and `second` are set.

        noise_px  of a pin
        """
        j: cython.Py_ssize_t
        k: cython.Py_ssize_t
        h: cython.double
        depth: cython.double
        for j in range(1, self._peaks.n_peaks):
            h = cython.cast(cython.double, self._height[j])
            depth = (
                self._min_prominence_sigma
                * noise_px
                * cython.cast(cython.double, self._noise[self._found[j]])
            )
            depth = max(depth, self._min_prominence_rel * h)
            if not h > 0.0 or self._peaks.first_connected(j, h - depth) != j:
                continue
            for k in range(j):
                if self._are_apart(self._at[k], self._at[j]):
                    self.first = self._coarse[self._found[k]]
                    self.second = self._coarse[self._found[j]]
                    return self.first != self.second
        return False

    @cython.cfunc
    @cython.exceptval(check=False)
    def _find_points(self, i: cython.Py_ssize_t) -> cython.void:
        """The points within region i and those that touch it, into `_active`."""
        p: cython.Py_ssize_t
        d: cython.Py_ssize_t
        n: cython.Py_ssize_t = 0
        for p in range(self._place.shape[0]):
            self._is_member[p] = self._owner[self._coarse[p]] == i
            self._is_member_in_grid[self._place[p]] = self._is_member[p]
        for p in range(self._place.shape[0]):
            if not self._is_member[p]:
                for d in range(8):
                    if self._is_member_in_grid[self._place[p] + self._around[d]]:
                        break
                else:
                    continue
            self._active[n] = cython.cast(cython.int, p)
            n += 1
        self._n_active = n

    @cython.cfunc
    @cython.exceptval(check=False)
    def _are_apart(self, a: cython.int, b: cython.int) -> cython.bint:
        """Whether two places of the grid are close, with the region's middle between them along its axis."""
        i: cython.Py_ssize_t = self._i
        width: cython.int = self._peaks.width
        ax: cython.double = self._x0 + self._step_px * (a % width - 1) - self._middle[i, 0]
        ay: cython.double = self._y0 + self._step_px * (a // width - 1) - self._middle[i, 1]
        bx: cython.double = self._x0 + self._step_px * (b % width - 1) - self._middle[i, 0]
        by: cython.double = self._y0 + self._step_px * (b // width - 1) - self._middle[i, 1]
        along_x: cython.double = cos(self._direction[i])
        along_y: cython.double = sin(self._direction[i])
        s: cython.double = ax * along_x + ay * along_y
        t: cython.double = bx * along_x + by * along_y
        return s * t < 0.0 and hypot(bx - ax, by - ay) <= self._max_distance_px
