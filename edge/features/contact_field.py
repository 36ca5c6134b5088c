# cython: infer_types=True
"""One frame's contact field, where it may hold a contact: heights through the area changes, divergence of
the motion, and their blend; and its peaks.

    area change --> heights -----.
                                  >-- contact field --> peaks
    motion ------> divergence ---'

Rules
- The contact field is a blend. The divergence is sharp, while a cell's area averages over two pitches; but
  areas are less noisy where pins are poorly seen.
- Most of the skin does nothing in most frames. The fields are computed at the active points alone, those near
  a pin whose cell has grown by more than drift; everywhere else they are zero. A share of the most grown cell
  would leave out a shallow contact beside a deep one.
- Peaks are regional maxima with plateaus, as MATLAB's `imregionalmax` and `skimage.morphology.local_maxima`
  have them: connected grid points (8 neighbours) of one height, all of whose other neighbours are lower.
- The grid of the peaks has a border of -inf: every point has eight neighbours, and no search leaves it.
"""

import cython
import numpy as np
from numpy.typing import NDArray

from edge.features.params import PARAMS
from edge.types import Array, Heights, Index, Mask

_NOTHING = cython.declare(cython.float, -np.inf)
_LOWEST = cython.declare(cython.float, float(np.finfo(np.float32).min))
# Marks of a point.
_UNKNOWN = cython.declare(cython.int, 0)
_SLOPE = cython.declare(cython.int, 1)
_TOP = cython.declare(cython.int, 2)
_PLATEAU = cython.declare(cython.int, 3)  # visited, not decided yet
_REACHED = cython.declare(cython.int, 4)  # and upwards: reached from peak 0, 1, ...
#: Largest weight, and largest value of a vector, in steps.
_WEIGHT_MAX = 32767.0
_VALUE_MAX = cython.declare(cython.float, 32767.0)
#: Largest sum of a row's weights: with values of 15 bits the sums then fit 32.
_ROW_MAX = 65000.0
#: Adding and subtracting it rounds a single-precision number below 2**22 to the nearest integer, ties to
#: even.
_ROUND = cython.declare(cython.float, 1.5 * 2.0**23)
#: Columns that are kept or left out together, for long runs.
BLOCK = 16


class QuantizedOperator:
    """A constant (k, m) matrix times a vector, in 16-bit integers; `values` in, `result` out, both good until
    the next call.

    As integers with one step a row the matrices stream through the cache in half the time of single
    precision. Sums are exact; rounding and what is left out add an error of 1e-4 of the highest area change,
    2e-4 at most (a tour over 331 pins), a tenth of the noise of an area. Weights of pins far away are small:
    where columns of pins that lie together follow each other, each row leaves out the smallest blocks of
    them, as many as add no more to its error than rounding does.

    values   (m,) float32, finite; to be written before `apply_rows`
    result   (k,) float32
    """

    def __init__(self, matrix: Array) -> None:
        """Raises ValueError: the matrix is empty, or a weight is not finite."""
        if matrix.ndim != 2 or not matrix.size or not np.isfinite(matrix).all():
            raise ValueError(f"a matrix (k, m) of finite numbers is wanted, not {matrix.shape}")
        k, m = matrix.shape
        size = np.abs(matrix)
        least = np.maximum(size.max(axis=1) / _WEIGHT_MAX, size.sum(axis=1) / _ROW_MAX)
        step = np.where(least > 0.0, least, 1.0)
        self._weights, self._start, self._begin, self._ahead = _in_runs(matrix, step)
        self._row_step = step.astype(np.float32)
        self._vector = np.zeros(-(-m // BLOCK) * BLOCK, np.int16)
        self._padded = np.zeros(self._vector.shape[0], np.float32)
        self.values, self.result = self._padded[:m], np.empty(k, np.float32)

    def apply_rows(self, which: Index, n: cython.Py_ssize_t) -> None:
        """The first n of `result`: the first n of these rows, (at least n,) int32, times `values`."""
        step: cython.float = self._quantize()
        row_step: cython.float[::1] = self._row_step
        result: cython.float[::1] = self.result
        weights: cython.short[::1] = self._weights
        vector: cython.short[::1] = self._vector
        start: cython.int[::1] = self._start
        begin: cython.int[::1] = self._begin
        ahead: cython.int[::1] = self._ahead
        for p in range(n):
            total: cython.int = 0  # whole steps, which fit 32 bits
            for r in range(start[which[p]], start[which[p] + 1]):
                w: cython.Py_ssize_t = begin[r]
                v: cython.Py_ssize_t = w + ahead[r]
                for i in range((begin[r + 1] - w) & -16):  # so that the compiler knows it, too: BLOCK
                    total += cython.cast(cython.int, weights[w + i]) * cython.cast(cython.int, vector[v + i])
            result[p] = cython.cast(cython.float, total) * row_step[which[p]] * step

    def _quantize(self) -> float:
        """The values in whole steps; returns the step."""
        highest: cython.float = 0.0
        largest: cython.float[16] = [0.0] * 16
        values: cython.float[::1] = self._padded
        vector: cython.short[::1] = self._vector
        for begin in range(0, values.shape[0], 16):
            for i in range(16):
                largest[i] = max(largest[i], abs(values[begin + i]))
        for i in range(16):
            highest = max(highest, largest[i])
        scale: cython.float = _VALUE_MAX / highest if highest > 0.0 else 0.0
        for i in range(values.shape[0]):
            size = values[i] * scale + _ROUND
            vector[i] = cython.cast(cython.short, size - _ROUND)
        return highest / _VALUE_MAX


class ContactField:
    """Fields of one frame of one tip; n pins, k points of the grid. All arrays are good until the next frame.

    area_change       (n,) float32, as set last
    active            (k,) int32, the first n_active: points at which the fields are computed, ascending
    heights           (k,) float32, the surface through the area changes; zero where not active
    plane_divergence, plane_curl  floats, the plane's share of `divergence` and of the curl
    divergence        (k,) float32, relative change of area, to first order; zero where not active
    blend             (k,) float32, of both: the contact field
    curl              (k,) float32, of `find_curl`
    points            (k, 2) float64 px, of the grid

    rest_xy, pitch_px  (n, 2) px, and their pitch
    interpolator       (k, n): heights from the area changes
    divergences        (k, 2 n): divergence from the motion, x and y of the first pin, of the second, ...
    Raises             ValueError: sizes that do not fit
    """

    def __init__(
        self, rest_xy: Array, pitch_px: float, points: Array, interpolator: Array, divergences: Array
    ) -> None:
        n, k = len(rest_xy), len(interpolator)
        shapes = rest_xy.shape, points.shape, interpolator.shape, divergences.shape
        if shapes != ((n, 2), (k, 2), (k, n), (k, 2 * n)):
            raise ValueError(
                f"pins (n, 2), points (k, 2), interpolator (k, n), divergences (k, 2 n) are wanted: {shapes}"
            )
        self._n = n
        self._rest = np.ascontiguousarray(rest_xy, np.float64)
        near, near_both = _in_patches(rest_xy, BLOCK), _in_patches(rest_xy, BLOCK // 2)
        columns = np.argsort(near), 2 * np.argsort(near_both)
        self._column, self._column_both = (column.astype(np.int32) for column in columns)
        self._interpolator = QuantizedOperator(interpolator[:, near])
        self._divergences = QuantizedOperator(divergences[:, (2 * near_both[:, None] + [0, 1]).ravel()])
        self.area_change = np.zeros(n, np.float32)
        self._change_row, self._height_row = self._interpolator.values, self._interpolator.result
        self._detrended, self._divergence_row = self._divergences.values, self._divergences.result
        self.curl = self._divergences.result
        self.heights, self.divergence = np.zeros(k, np.float32), np.zeros(k, np.float32)
        self.blend = np.zeros(k, np.float32)
        self.active, self.n_active = np.zeros(k, np.int32), 0
        self._is_active = np.zeros((k + 7) // 8 * 8, np.uint8)
        self._are_active = np.asarray(self._is_active).view(np.uint64)
        self._min_area_change = PARAMS.min_area_change
        self._near_start, self._near = _points_near(rest_xy, points, pitch_px)
        self.plane_divergence = self.plane_curl = 0.0
        self.points = np.array(points, np.float64, order="C")
        terms = np.column_stack([np.ones(n), rest_xy - rest_xy[0]])
        self._inverse = np.linalg.inv(terms.T @ terms)
        self._divergence_rel, self._heights_rel = PARAMS.divergence_rel, 1.0 - PARAMS.divergence_rel

    def set_area_change(self, change: Array) -> None:
        """The area changes of a frame, (n,) float64, relative; finite. Raises ValueError: another number."""
        if change.shape[0] != self._n:
            raise ValueError(f"area_change ({self._n},) is wanted")
        single: cython.float[::1] = self.area_change
        row: cython.float[::1] = self._change_row
        column: cython.int[::1] = self._column
        for i in range(self._n):
            single[i] = cython.cast(cython.float, change[i])
            row[column[i]] = single[i]

    def find(self, xy: Array) -> None:
        """All fields of the frame whose area changes were set.

        xy       (n, 2) float64 px, where the pins are; finite
        Raises   ValueError: sizes that do not fit
        """
        if xy.shape[0] != self._n or xy.shape[1] != 2:
            raise ValueError(f"xy ({self._n}, 2) is wanted")
        active: cython.int[::1] = self.active
        height_row: cython.float[::1] = self._height_row
        divergence_row: cython.float[::1] = self._divergence_row
        heights: cython.float[::1] = self.heights
        divergence: cython.float[::1] = self.divergence
        blend: cython.float[::1] = self.blend
        self._find_active()
        self._detrend(xy)
        self._interpolator.apply_rows(active, self.n_active)
        self._divergences.apply_rows(active, self.n_active)
        for i in range(self.n_active):
            p = active[i]
            heights[p] = height_row[i]
            divergence[p] = divergence_row[i] + self.plane_divergence
            blend[p] = self._divergence_rel * divergence[p] + self._heights_rel * heights[p]

    def find_curl(self, which: Index, n: cython.Py_ssize_t) -> None:
        """The first n of `curl`: the motion's rotation per length at the first n of these points, int32."""
        # The rows make, of motion (u, v), du/dx + dv/dy; with (v, -u) they make dv/dx - du/dy.
        u: cython.float
        motion: cython.float[::1] = self._detrended
        result: cython.float[::1] = self._divergence_row
        for i in range(self._n):
            u = motion[2 * i]
            motion[2 * i] = motion[2 * i + 1]
            motion[2 * i + 1] = -u
        self._divergences.apply_rows(which, n)
        for i in range(self._n):
            u = motion[2 * i]
            motion[2 * i] = -motion[2 * i + 1]
            motion[2 * i + 1] = u
        for i in range(n):
            result[i] += self.plane_curl

    def whole_surface(self) -> Heights:
        """The surface through the frame's area changes at all points, (k,) float32; good until the next."""
        self._interpolator.apply_rows(np.arange(len(self.points), dtype=np.int32), len(self.points))
        return np.asarray(self._height_row)

    def _find_active(self) -> None:
        """`active`, and zero in all fields where it was before."""
        is_active: cython.uchar[::1] = self._is_active
        active: cython.int[::1] = self.active
        near: cython.int[::1] = self._near
        n_active = 0
        most: cython.float = 0.0
        level: cython.float = _NOTHING
        for i in range(self.n_active):
            p = active[i]
            self.heights[p] = 0.0
            self.divergence[p] = 0.0
            self.blend[p] = 0.0
            is_active[p] = False
        for i in range(self._n):
            most = max(most, self.area_change[i])
        if most > self._min_area_change:  # otherwise no area has increased, and all are taken
            level = self._min_area_change
        for i in range(self._n):
            if self.area_change[i] > level:
                for p in range(self._near_start[i], self._near_start[i + 1]):
                    is_active[near[p]] = True
        for eight in range(self._are_active.shape[0]):
            if self._are_active[eight]:
                for p in range(8 * eight, 8 * eight + 8):
                    if is_active[p]:
                        active[n_active] = cython.cast(cython.int, p)
                        n_active += 1
        self.n_active = n_active

    def _detrend(self, xy: Array) -> None:
        """Motion less its plane, whose divergence is added later: the smaller values quantize more finely."""
        g: cython.double[:, ::1] = self._inverse
        rest: cython.const[cython.double][:, ::1] = self._rest
        detrended: cython.float[::1] = self._detrended
        column: cython.int[::1] = self._column_both
        # Sums, then coefficients, in x and y.
        x0 = xx = xy_ = y0 = yx = yy = 0.0
        for i in range(self._n):
            x, y = rest[i, 0], rest[i, 1]
            dx = xy[i, 0] - x
            dy = xy[i, 1] - y
            x0 += dx
            xx += x * dx
            xy_ += y * dx
            y0 += dy
            yx += x * dy
            yy += y * dy
        u, v = rest[0, 0], rest[0, 1]  # the equations are about the first pin
        xx, xy_, yx, yy = xx - u * x0, xy_ - v * x0, yx - u * y0, yy - v * y0
        dx, dy = x0, y0
        x0, y0 = g[0, 0] * dx + g[0, 1] * xx + g[0, 2] * xy_, g[0, 0] * dy + g[0, 1] * yx + g[0, 2] * yy
        x, y = xx, yx
        xx, yx = g[1, 0] * dx + g[1, 1] * x + g[1, 2] * xy_, g[1, 0] * dy + g[1, 1] * y + g[1, 2] * yy
        xy_, yy = g[2, 0] * dx + g[2, 1] * x + g[2, 2] * xy_, g[2, 0] * dy + g[2, 1] * y + g[2, 2] * yy
        x0, y0 = x0 - xx * u - xy_ * v, y0 - yx * u - yy * v
        for i in range(self._n):
            x, y = rest[i, 0], rest[i, 1]
            dx = xy[i, 0] - x
            dy = xy[i, 1] - y
            detrended[column[i]] = dx - x0 - xx * x - xy_ * y
            detrended[column[i] + 1] = dy - y0 - yx * x - yy * y
        self.plane_divergence = xx + yy
        self.plane_curl = yx - xy_


class PeakFinder:
    """Peaks on the points of a grid; k points. All arrays are good until the next field.

    width    points of a padded row: point p lies in column place[p] % width, row place[p] // width
    place    (k,) int32, where in the padded grid each point lies
    grid     (h * width,) float32, the field, -inf outside
    active   (k,) int32, the first n_active: points at which the field may be other than zero, ascending
    mark     (h * width,) int32, scratch
    n_peaks  of the last field; at (k,) int32, place of each, highest first;
             point (k,) int32, which of the k points it is; height (k,) float32

    inside   (rows, columns) bool: the k points, row by row
    """

    def __init__(self, inside: Mask) -> None:
        padded = np.pad(inside, 1)
        self.width = padded.shape[1]
        self.place = np.flatnonzero(padded).astype(np.int32)
        self.grid = np.full(padded.size, -np.inf, np.float32)
        self.mark, self._stack = np.zeros(padded.size, np.int32), np.empty(padded.size, np.int32)
        self.active = np.arange(len(self.place), dtype=np.int32)
        self.n_active = len(self.place)  # of no field yet: its first one is written everywhere
        self.at, self.point = np.zeros_like(self.place), np.zeros_like(self.place)
        self.height = np.zeros(len(self.place), np.float32)
        self.n_peaks = 0
        w = self.width
        self._around = np.array([-w - 1, -w, -w + 1, -1, 1, w - 1, w, w + 1], np.int32)

    def set_field(self, field: Heights, active: Index, n_active: cython.Py_ssize_t) -> None:
        """The field (k,) float32 at the points; it is zero but at the first n_active of these, ascending."""
        place: cython.int[::1] = self.place
        grid: cython.float[::1] = self.grid
        mine: cython.int[::1] = self.active
        for i in range(self.n_active):
            grid[place[mine[i]]] = 0.0
        for i in range(n_active):
            mine[i] = active[i]
            grid[place[active[i]]] = field[active[i]]
        self.n_active = n_active

    def find(self, noise: Heights, noise_factor: cython.float, least: cython.float) -> cython.Py_ssize_t:
        """Find the peaks, of the active points, above noise_factor times the noise there, and above `least`.

        noise    (k,) float32
        Returns  number of peaks
        """
        place: cython.int[::1] = self.place
        grid: cython.float[::1] = self.grid
        for i in range(self.n_active):  # all peaks, and plateaus on the way, are among these
            self.mark[place[self.active[i]]] = _UNKNOWN
        self.n_peaks = 0
        for i in range(self.n_active):
            p = self.active[i]
            h = grid[place[p]]
            # The height first: most points lie below the noise, and their neighbours need not be read.
            if h > least and h > noise[p] * noise_factor and self._is_maximum(place[p]):
                self._insert(p, h)
        return self.n_peaks

    def forget_searches(self) -> cython.void:
        """The next question does not depend on those before. Each peak is asked about once."""
        self.mark[:] = _UNKNOWN

    def first_connected(
        self, j: cython.Py_ssize_t, given: cython.float, any_will_do: cython.bint
    ) -> cython.Py_ssize_t:
        """The first, and so highest, of the peaks before j that is connected with it at or above a level; j:
        none.

        any_will_do  return 0 as soon as any of them is met
        """
        i = 0
        n = 1
        reached: cython.int = _REACHED + cython.cast(cython.int, j)
        # The border is -inf: no search reaches it.
        level: cython.float = _LOWEST if given < _LOWEST else given
        self._stack[0] = self.at[j]
        self.mark[self.at[j]] = reached
        while i < n:
            for d in range(8):
                to = self._stack[i] + self._around[d]
                if self.grid[to] >= level and self.mark[to] != reached:
                    if any_will_do and self._is_peak(to, j):
                        return 0
                    self.mark[to] = reached
                    self._stack[n] = to
                    n += 1
            i += 1
        for i in range(j):
            if self.mark[self.at[i]] == reached:
                return i
        return j

    def _is_peak(self, place: cython.int, n: cython.Py_ssize_t) -> cython.bint:
        """Whether one of the first n peaks lies there."""
        for i in range(n):  # noqa: SIM110 (no generators in a kernel)
            if self.at[i] == place:
                return True
        return False

    def _insert(self, p: cython.Py_ssize_t, h: cython.float) -> cython.void:
        """Insert point p into the list of peaks; of equal heights the first comes first."""
        i = self.n_peaks
        self.n_peaks += 1
        while i > 0 and self.height[i - 1] < h:
            self.height[i] = self.height[i - 1]
            self.at[i] = self.at[i - 1]
            self.point[i] = self.point[i - 1]
            i -= 1
        self.height[i] = h
        self.at[i] = self.place[p]
        self.point[i] = p

    def _is_maximum(self, here: cython.Py_ssize_t) -> cython.bint:
        """Whether a place is a regional maximum; it, or the plateau it is on, is marked _TOP or _SLOPE."""
        h: cython.float = self.grid[here]
        equal: cython.bint = False
        if self.mark[here] != _UNKNOWN:
            return self.mark[here] == _TOP
        self.mark[here] = _TOP
        for d in range(8):
            other = self.grid[here + self._around[d]]
            if other > h or h == _NOTHING:
                self.mark[here] = _SLOPE
                return False
            equal = equal or other == h
        if equal:
            self._mark_plateau(here)
        return self.mark[here] == _TOP

    def _mark_plateau(self, start: cython.Py_ssize_t) -> cython.void:
        """All connected points of one height are _TOP if nothing round them is higher, else _SLOPE."""
        h: cython.float = self.grid[start]
        i = 0
        n = 1
        verdict: cython.int = _TOP
        self._stack[0] = cython.cast(cython.int, start)
        self.mark[start] = _PLATEAU
        while i < n:
            for d in range(8):
                to = self._stack[i] + self._around[d]
                if self.grid[to] > h:
                    verdict = _SLOPE
                elif self.grid[to] == h and self.mark[to] != _PLATEAU:
                    self.mark[to] = _PLATEAU
                    self._stack[n] = to
                    n += 1
            i += 1
        for i in range(n):
            self.mark[self._stack[i]] = verdict


def _in_patches(xy: Array, n: int) -> Index:
    """An order of places (k, 2) in which n that follow each other fill about a square."""
    size = np.ptp(xy, axis=0)
    side = max(float(np.sqrt(n * size.prod() / len(xy))), np.finfo(np.float64).tiny)
    strip = np.floor((xy[:, 1] - xy[:, 1].min()) / side)
    return np.lexsort((xy[:, 0], strip)).astype(np.int32)


def _points_near(pins: Array, points: Array, radius: float) -> tuple[Index, Index]:
    """Which points each pin makes active: those within a radius, and those to which it is the nearest pin.

    Returns  starts (n + 1,) int32 in the second: points of the first pin, of the second, ...
    """
    distance = np.hypot(*(pins[:, None] - points).transpose(2, 0, 1))
    pin, point = np.nonzero(distance <= np.maximum(distance.min(axis=0), radius))
    return np.searchsorted(pin, np.arange(len(pins) + 1)).astype(np.int32), point.astype(np.int32)


def _in_runs(matrix: Array, step: Array) -> tuple[NDArray[np.int16], Index, Index, Index]:
    """The blocks of each row that are kept, in whole steps, those that follow each other as one run.

    Returns  their weights, row after row; where each row's runs begin in the next two, and the last one's
             end; where each run's weights begin, and the last one's end; how far ahead of them its
             columns are
    """
    k, m = matrix.shape
    whole = np.zeros((k, -(-m // BLOCK) * BLOCK))
    whole[:, :m] = matrix / step[:, None]
    blocks = whole.reshape(k, -1, BLOCK)
    size2 = (blocks**2).sum(axis=2)
    smallest = np.argsort(size2, axis=1)
    left_out = np.cumsum(np.take_along_axis(size2, smallest, axis=1), axis=1) <= m / 12.0
    left_out[:, -1] = False  # a row has one block at least
    kept = np.empty_like(left_out)
    np.put_along_axis(kept, smallest, ~left_out, axis=1)
    first = kept & ~np.pad(kept, ((0, 0), (1, 0)))[:, : kept.shape[1]]
    start = np.cumsum([0, *first.sum(axis=1)], dtype=np.int32)
    begin = BLOCK * np.append(np.flatnonzero(first[kept]), kept.sum()).astype(np.int32)
    ahead = BLOCK * np.nonzero(first)[1].astype(np.int32) - begin[: len(begin) - 1]
    return np.rint(blocks[kept]).ravel().astype(np.int16), start, begin, ahead
