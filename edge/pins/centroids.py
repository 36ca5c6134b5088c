# cython: infer_types=True
"""Where each pin is now: one call over all pins, reading only their windows. Compiled; runs uncompiled too.

Idea: a pin is a blurred disc of known radius d(r) on a local plane. Around a guess c the image is

    I = b + g.(u,v) + A d + A (dx tx + dy ty) + noise,      tx = -d(d)/du: minus the disc's slope

which is linear in b, g, A, A dx, A dy. tx and ty are nonzero on the disc's edge alone, where all information
about its place is. Their least-squares solution is the maximum-likelihood step and reaches the Cramer-Rao
bound; the standard deviation of a plain centroid is twice that. Steps are repeated until one is below
0.75 of a phase, so the result hardly depends on where the window started.

Rules
- Templates (`templates.py`) are in 16-bit integers for PHASES x PHASES subpixel offsets, zero outside of the
  support circle. d is orthogonal to 1; tx and ty to 1 and d.
- One pass over the pixels of the support, which are copied from the image without the gaps between its rows
  (`centroid_steps`), large pins' as sums of blocks; then the step. Nine pins in ten need one.
- All sums are exact integers. What depends on the template alone is precomputed in `norms`.
- Dark pins are bright ones in the inverted image, whose sums follow from the image's own: the result is the
  same to the last bit.
- A pin that the image's border cuts takes its steps alone, by what there is of its templates.
- Which of the centroids count is decided afterwards, over all pins (`_reject`). Whether two of them are on
  one blob, `edge.tracking.follow` decides, which knows the neighbours; among new spots, `edge.pins.detect`.
"""

from __future__ import annotations

import cython
import numpy as np
from cython.cimports.libc.math import sqrt
from numpy.typing import NDArray

from edge.pins.centroid_steps import FETCH, KIND
from edge.pins.templates import BLOCK, FAR_PX, HALF_MAX, NORM, PHASES, SIDE, STEP_MAX, TemplateSet
from edge.types import Array, Image, Index

if cython.compiled:
    from cython.cimports.edge.geometry.select import select_kth
    from cython.cimports.edge.pins import centroid_steps as loops
else:
    from edge.geometry.select import select_kth
    from edge.pins import centroid_steps as loops

HUGE_VAL = cython.declare(cython.double, float("inf"))
NAN = cython.declare(cython.double, float("nan"))

INT_MAX = cython.declare(cython.Py_ssize_t, np.iinfo(np.int32).max)
N_PHASES = cython.declare(cython.int, PHASES)
LEVEL_MAX = cython.declare(cython.int, STEP_MAX)


@cython.final
@cython.cclass
class CentroidKernel:
    """Centroids of the n pins of one tip. All arrays are good until the next image.

    predicted       (n, 2) px, where pins are to be searched for; to be written
    xy, sigma       (n, 2) and (n,) px; NaN where a pin is lost
    amplitude, fit  (n,) levels, and the share of the window's variation that the disc explained
    """

    predicted = cython.declare(cython.double[:, ::1], visibility="readonly")
    xy = cython.declare(cython.double[:, ::1], visibility="readonly")
    sigma = cython.declare(cython.double[::1], visibility="readonly")
    amplitude = cython.declare(cython.double[::1], visibility="readonly")
    fit = cython.declare(cython.double[::1], visibility="readonly")
    n: cython.Py_ssize_t
    _reach2: cython.double
    _noise2: cython.double
    _steps_max: cython.int
    _share_min: cython.double  # `pin_share_min`
    _near2: cython.double  # px2: a step this short is the last
    _far2: cython.double  # px2: of a longer one the slopes alone are enough
    _sign: cython.int  # -1: dark pins
    _shift: cython.int  # right shift that brings 16-bit images to 12 bits
    _gain: cython.double  # which it takes from the levels
    _wide: cython.bint
    _rows: cython.Py_ssize_t
    _columns: cython.Py_ssize_t
    _stride: cython.Py_ssize_t  # bytes from row to row; 0: not of 8 bits
    _image8: cython.const[cython.uchar][:, :]
    _image16: cython.const[cython.ushort][:, :]
    _kind_of: cython.int[::1]
    _norm_of: cython.int[::1]  # row of its first phase in `_norms`
    _kinds: loops.Kind[::1]
    _spans: cython.int[:, ::1]  # of all kinds
    _pieces: cython.int[:, ::1]  # of these: first column and row, and place among the pixels
    _steps: cython.Py_ssize_t[:, ::1]  # as `reading_of` takes it, in 8-bit images of this shape
    _inner: cython.double[::1]  # phases: least x and y of pins whose windows are within them, least beyond
    _side: cython.Py_ssize_t  # px, of the blocks that are a window's pixels
    _to_middle: cython.double  # phases, from where a window's middle pixel begins; 0: it is between two
    _half: cython.Py_ssize_t  # px, of the largest window
    _fetch: loops.Fetch[::1]  # likewise
    _reading: loops.Reading  # of the image in hand
    _every: cython.int[::1]  # 0 to n - 1
    _who: cython.int[::1]  # pins that have to take a step, and what `take_steps` says of them
    _one: cython.int[::1]  # the same of one pin
    _values: cython.short[::1]  # of the templates
    _uv: cython.schar[::1]
    _norms: cython.double[:, ::1]
    _rest_amplitude: cython.double[::1]
    _ratio: cython.double[::1]  # of the amplitude to that at rest
    _pixels: cython.uchar[::1]
    _window: cython.short[::1]
    _sums: cython.double[::1]  # of the window in hand
    _is_in_view: cython.uchar[::1]  # of its pixels; and how many are
    _in_view: cython.Py_ssize_t
    _energy: cython.double  # of these; the least-squares fit to them
    _basis: cython.double[::1]
    _normal: cython.double[:, ::1]
    _inverse: cython.double[:, ::1]
    _right: cython.double[::1]
    _solution: cython.double[::1]

    def __init__(
        self,
        templates: TemplateSet,
        kind_of: Index,
        rest_amplitude: Array,
        limits: dict[str, float],
        dark: bool = False,
    ) -> None:
        """Constants of one tip.

        templates       of k kinds of pins
        kind_of         (n,) int32, which of the kinds each pin is
        rest_amplitude  (n,) float64, levels
        limits          share_min, reach_px, near_phases, steps_max, noise (levels), spare_bits
        dark            the pins are darker than the skin
        Raises          ValueError: arrays that do not belong together, an index out of range
        """
        self._kind_of = np.array(kind_of, np.int32)
        self.n = self._kind_of.shape[0]
        _check(templates, np.asarray(self._kind_of), np.asarray(rest_amplitude))
        self._norm_of = np.asarray(self._kind_of) * np.int32(PHASES * PHASES)
        self._spans = np.concatenate(templates.spans)
        self._kinds, self._pieces = _kinds_of(templates)
        self._side, self._fetch = templates.side, np.zeros(1, FETCH).view(np.recarray)
        self._half = templates.side * max(templates.half) + templates.side // 2
        self._to_middle = PHASES / 2 * (templates.side % 2)
        self._values, self._uv = templates.values, templates.uv
        self._sign = -1 if dark else 1
        self._norms = np.concatenate(templates.norms)
        self._rows = self._columns = self._stride = -1  # none yet
        self._image8, self._steps = np.zeros((1, 1), np.uint8), np.zeros((1, 2), np.intp)
        self._inner, self._who, self._one = np.zeros(4), np.zeros(self.n, np.int32), np.zeros(1, np.int32)
        self._every = np.arange(self.n, dtype=np.int32)
        if not 0 <= limits["spare_bits"] <= 12:
            raise ValueError(f"spare_bits of 0 to 12 are wanted, not {limits['spare_bits']}")
        self._reach2 = limits["reach_px"] ** 2
        self._shift = int(limits["spare_bits"])
        self._gain = 2.0**self._shift / self._side**2
        self._noise2 = limits["noise"] ** 2 * self._side**2 / 4.0**self._shift
        self._steps_max = int(limits["steps_max"])
        self._near2, self._far2 = (limits["near_phases"] / PHASES) ** 2, FAR_PX**2
        self._share_min = limits["share_min"]
        self._rest_amplitude, self._ratio = np.array(rest_amplitude, np.float64), np.empty(self.n)
        self.predicted = np.full((self.n, 2), np.nan)
        self.xy = np.full((self.n, 2), np.nan)
        self.sigma = np.full(self.n, np.nan)
        self.amplitude = np.full(self.n, np.nan)
        self.fit = np.full(self.n, np.nan)
        plane_max = int(np.max(templates.plane))
        self._pixels = np.zeros(2 * (plane_max + 2 * HALF_MAX + loops.LANES), np.uint8)
        self._window = np.zeros(plane_max, np.int16)
        self._sums = np.zeros(NORM.index("inv_d"))
        self._is_in_view = np.zeros(plane_max, np.uint8)
        self._normal, self._inverse = np.empty((2, 4, 4))
        self._basis, self._right, self._solution = np.empty((3, 4))

    def read(self, image: Image) -> None:
        """Find the pins of one image (h, w) uint8 or uint16. Raises ValueError: another kind of image."""
        if image.dtype == np.uint8 and image.ndim == 2:
            self._wide = False
            self._image8 = image
            if self._image8.strides[1] != 1 or self._image8.strides[0] < self._image8.shape[1]:
                self._image8 = np.ascontiguousarray(image)
            self._set_shape(self._image8.shape[0], self._image8.shape[1], self._image8.strides[0])
        elif image.dtype == np.uint16 and image.ndim == 2:
            self._wide = True
            self._image16 = image
            self._set_shape(self._image16.shape[0], self._image16.shape[1], 0)
        else:
            raise ValueError(f"image of {image.ndim} axes, {image.dtype}: 2 axes, uint8 or uint16 wanted")
        self._read()
        self._reject()

    @cython.cfunc
    @cython.inline
    def _set_shape(
        self, rows: cython.Py_ssize_t, columns: cython.Py_ssize_t, stride: cython.Py_ssize_t
    ) -> cython.void:
        """The image has this shape now; raises ValueError: nothing or too much for indices of 32 bits.

        stride  of an 8-bit image, bytes from row to row; else 0
        """
        if rows == self._rows and columns == self._columns and stride == self._stride:
            return
        if not 0 < rows * columns <= INT_MAX or rows * stride > INT_MAX:
            raise ValueError(f"an image of {rows} x {columns} pixels, {stride} bytes a row")
        self._rows, self._columns, self._stride = rows, columns, stride
        if stride:
            self._make_steps()

    @cython.cfunc
    def _make_steps(self) -> cython.void:
        """Make the steps of 8-bit images of this shape, and say where the largest window is within them: its
        last piece must not end beyond the image.
        """
        rows, columns, stride = self._rows, self._columns, self._stride
        column, row, to = np.asarray(self._pieces, np.intp).T
        side, half = self._side, self._half
        begin = side * column - (side - 1) // 2 + (side * row - (side - 1) // 2) * stride
        last = begin.max() + side * _piece_of(side) + (side - 1) * stride
        low = ((rows - 1) * stride + half + 1 - last) // stride
        self._inner = PHASES * np.array([half, half, columns - half, min(rows - half, low + 1)], np.float64)
        self._steps = np.stack([begin, to], axis=1)

    @cython.cfunc
    def _read(self) -> cython.void:
        """Each pin steps from its prediction to its centroid."""
        n: cython.Py_ssize_t = self.n  # that have to take the next step
        iteration: cython.int = 0
        if n == 0:
            return
        self._reading = loops.reading_of(
            self._image8, self._fetch, self._kinds, self._steps, self._values, self._uv, self._norms,
            self._pixels, self._sums, self.predicted, self._inner, self._norm_of, self._stride, self._side,
            self._reach2, self._noise2, self._gain, self._sign < 0, self.xy, self.sigma, self.amplitude,
            self.fit,
        )  # fmt: skip
        if self._wide:
            for i in range(n):
                self._find(i, 0)
            return
        self._begin_to_fetch()
        self._who[:] = self._every
        far2 = self._far2_of(iteration)
        while n > 0:
            asked = loops.take_steps(self._reading, self._who, n, self._near2, far2, iteration == 0)
            iteration += 1
            far2 = self._far2_of(iteration)
            n = 0
            for k in range(asked):
                i = self._who[k] >> 1
                taken = self._who[k] & 1
                if taken and far2 < HUGE_VAL:
                    self._who[n] = i
                    n += 1
                else:
                    self._find(i, iteration - 1 + taken)

    @cython.cfunc
    def _reject(self) -> cython.void:
        """NaN in `xy` and `sigma` of the pins whose disc explains too little of its window, or is too dim
        beside the pin at rest. Illumination may have changed for all pins at once: brightness is compared
        after the gain that they share, their median.
        """
        xy: cython.double[:, ::1] = self.xy
        sigma: cython.double[::1] = self.sigma
        amplitude: cython.double[::1] = self.amplitude
        at_rest: cython.double[::1] = self._rest_amplitude
        fit: cython.double[::1] = self.fit
        ratio: cython.double[::1] = self._ratio
        m: cython.Py_ssize_t = 0
        low = worst = HUGE_VAL
        high = 0.0
        for i in range(self.n):
            gain = amplitude[i] / at_rest[i]
            low, high, worst = min(gain, low), max(gain, high), min(fit[i], worst)
        if worst > self._share_min and low > self._share_min * high:  # none is too dim, whatever the gain
            return
        for i in range(self.n):
            if fit[i] > self._share_min:
                ratio[m] = amplitude[i] / at_rest[i]
                m += 1
            else:
                xy[i, 0] = xy[i, 1] = sigma[i] = NAN
        least = self._share_min * select_kth(ratio, m, m // 2)
        for i in range(self.n):
            if amplitude[i] < least * at_rest[i]:
                xy[i, 0] = xy[i, 1] = sigma[i] = NAN

    @cython.cfunc
    @cython.inline
    def _far2_of(self, iteration: cython.int) -> cython.double:
        """Far off, slopes alone give a coarse step first."""
        return self._far2 if iteration + 3 < self._steps_max else HUGE_VAL

    @cython.cfunc
    @cython.exceptval(check=False)
    def _find(self, i: cython.Py_ssize_t, iteration: cython.int) -> cython.void:
        """Steps of pin i, which has taken `iteration` of them.

        Beside a glint the slope of the surroundings changes with the template's place, and steps would lead
        to and fro for ever. One that leads back at least as far as the last one came ends where both would be
        zero if they changed evenly between their beginnings, and those that follow are shortened likewise.
        Coarse steps lead to other places, so that they are not compared.
        """
        part: cython.double = 1.0
        old_x = old_y = old_step_x = old_step_y = NAN  # where the step before began, and itself
        x, y = self.predicted[i, 0], self.predicted[i, 1]
        if iteration:
            x, y = self.xy[i, 0], self.xy[i, 1]
        while iteration < self._steps_max:
            far2 = self._far2_of(iteration)
            if not self._step(i, x, y, far2, iteration == 0):
                return
            iteration += 1
            if far2 == HUGE_VAL:
                x, y = middle_of(x, self._to_middle), middle_of(y, self._to_middle)
                step_x, step_y = self.xy[i, 0] - x, self.xy[i, 1] - y
                way_x, way_y = x - old_x, y - old_y
                came = way_x * old_step_x + way_y * old_step_y
                back = -(way_x * step_x + way_y * step_y)
                if back >= came > 0.0:
                    part = square(way_x, way_y) / (came + back)
                old_x, old_y, old_step_x, old_step_y = x, y, step_x, step_y
                self.xy[i, 0], self.xy[i, 1] = x + part * step_x, y + part * step_y
                if part * part * square(step_x, step_y) < self._near2:
                    return
            x, y = self.xy[i, 0], self.xy[i, 1]

    @cython.cfunc
    def _begin_to_fetch(self) -> cython.void:
        """Begin to fetch the image round the predictions, while windows are read: pins come in rows."""
        left: cython.double = self._columns
        right: cython.double = 0.0
        top: cython.double = self._rows
        bottom: cython.double = 0.0
        for i in range(0, self.n, 8):  # near enough: what is not fetched is only read later
            x, y = self.predicted[i, 0], self.predicted[i, 1]
            left, right = min(left, x), max(right, x)
            top, bottom = min(top, y), max(bottom, y)
        half: cython.Py_ssize_t = self._half
        first_row: cython.Py_ssize_t = max(cython.cast(cython.Py_ssize_t, max(top, 0.0)) - half, 0)
        end_row: cython.Py_ssize_t = cython.cast(cython.Py_ssize_t, min(bottom, self._rows)) + half + 1
        end_row = min(end_row, self._rows)
        f: loops.Fetch = self._fetch[0]
        f.row, f.end, f.stride = first_row * self._stride, end_row * self._stride, self._stride
        f.first = max(cython.cast(cython.Py_ssize_t, max(left, 0.0)) - half, 0)
        f.beyond = cython.cast(cython.Py_ssize_t, min(right, self._columns)) + half + 1
        f.beyond = min(f.beyond, self._columns)
        # More than the mean, to get ahead where pins are few; to a window and a half below the one in hand.
        f.rows = 1 + 8 * (end_row - first_row) // max(self.n, 1)
        f.ahead = 2 * (2 * half + 1) * self._stride
        self._fetch[0] = f

    @cython.cfunc
    @cython.inline
    def _level(self, x: cython.Py_ssize_t, y: cython.Py_ssize_t) -> cython.int:
        """Sum of the block that begins there."""
        total: cython.int = 0
        for j in range(self._side):
            for i in range(self._side):
                level = self._image16[y + j, x + i] if self._wide else self._image8[y + j, x + i]
                total += cython.cast(cython.int, level)
        return total

    @cython.cfunc
    def _step(
        self, i: cython.Py_ssize_t, px: cython.double, py: cython.double, far2: cython.double,
        first: cython.bint,
    ) -> cython.bint:  # fmt: skip
        """A step of pin i from a place, px. Returns that it has to go on.

        far2   px2: of a longer one the slopes alone are enough
        first  it is its first step
        """
        x4: cython.double = N_PHASES * px + self._to_middle
        y4: cython.double = N_PHASES * py + self._to_middle
        kind: cython.Py_ssize_t = self._kind_of[i]
        if not self._wide and self._inner[0] <= x4 < self._inner[2] and self._inner[1] <= y4 < self._inner[3]:
            self._one[0] = i
            return loops.take_steps(self._reading, self._one, 1, self._near2, far2, first) > 0
        self.amplitude[i] = self.fit[i] = 0
        if not (0 <= px <= self._columns - 1 and 0 <= py <= self._rows - 1):  # NaN is not
            return False
        x: cython.int = cython.cast(cython.int, x4)
        y: cython.int = cython.cast(cython.int, y4)
        cx: cython.Py_ssize_t = x >> 2
        cy: cython.Py_ssize_t = y >> 2
        phase: cython.Py_ssize_t = (y & 3) * 4 + (x & 3)
        norm: cython.Py_ssize_t = self._norm_of[i] + phase
        at_x = middle_of(px, self._to_middle)
        at_y = middle_of(py, self._to_middle)
        self._take_window(cx, cy, kind)
        if self._in_view < self._kinds[kind].pixels:
            return self._step_cut(i, kind, phase, at_x, at_y)
        self._sum_levels(kind, phase, norm)
        return loops.take_step(self._reading, i, norm, at_x, at_y, self._near2, far2, first)

    @cython.cfunc
    def _sum_levels(
        self, kind: cython.Py_ssize_t, phase: cython.Py_ssize_t, norm: cython.Py_ssize_t
    ) -> cython.void:
        """`_sums` of the levels in `_window`, whose squares may have 24 bits."""
        k: loops.Kind = self._kinds[kind]
        t: cython.Py_ssize_t = k.first + 3 * k.plane * phase
        d: cython.int = 0
        tx: cython.int = 0
        ty: cython.int = 0
        one: cython.int = 0
        u: cython.int = 0
        v: cython.int = 0
        square_sum: cython.longlong = 0
        for i in range(k.plane):
            level = cython.cast(cython.int, self._window[i])  # uncompiled, NumPy's numbers overflow
            d += level * cython.cast(cython.int, self._values[t + i])
            tx += level * cython.cast(cython.int, self._values[t + k.plane + i])
            ty += level * cython.cast(cython.int, self._values[t + 2 * k.plane + i])
            one += level
            u += level * cython.cast(cython.int, self._uv[k.first_uv + i])
            v += level * cython.cast(cython.int, self._uv[k.first_uv + k.plane + i])
            square_sum += level * level
        self._sums[0], self._sums[1], self._sums[2], self._sums[3] = d, tx, ty, one
        self._sums[4], self._sums[5], self._sums[6], self._sums[7] = u, v, square_sum, 1.0
        for i in range(8):
            self._sums[i] *= self._norms[norm, i]

    @cython.cfunc
    def _take_window(
        self, cx: cython.Py_ssize_t, cy: cython.Py_ssize_t, kind: cython.Py_ssize_t
    ) -> cython.void:
        """Pixels of the support less the middle's level, as of bright pins; zero outside of the image."""
        k: loops.Kind = self._kinds[kind]
        side: cython.Py_ssize_t = self._side
        at: cython.Py_ssize_t = 0
        right: cython.Py_ssize_t = self._columns - side
        low: cython.Py_ssize_t = self._rows - side
        cx -= (side - 1) // 2
        cy -= (side - 1) // 2
        level: cython.int = self._level(min(max(cx, 0), right), min(max(cy, 0), low))
        self._in_view = 0
        for j in range(k.first_span, k.end_span):
            y = cy + side * self._spans[j, 1]
            for i in range(self._spans[j, 2]):
                x = cx + side * (self._spans[j, 0] + i)
                step = 0
                self._is_in_view[at] = 0 <= y <= low and 0 <= x <= right
                if self._is_in_view[at]:
                    step = (self._sign * (self._level(x, y) - level)) >> self._shift
                    self._in_view += 1
                self._window[at] = cython.cast(cython.short, min(max(step, -LEVEL_MAX), LEVEL_MAX))
                at += 1
        while at < k.plane:
            self._window[at] = 0
            at += 1

    @cython.cfunc
    def _step_cut(
        self, i: cython.Py_ssize_t, kind: cython.Py_ssize_t, phase: cython.Py_ssize_t,
        middle_x: cython.double, middle_y: cython.double,
    ) -> cython.bint:  # fmt: skip
        """The same for a pin that the border cuts: the fit of 1, d, tx, ty over the pixels there are."""
        n: cython.Py_ssize_t = self._norm_of[i] + phase
        step_max: cython.double = self._norms[n, loops.LONGEST]
        freedom: cython.double = self._in_view - 4
        self._gather_cut(kind, phase, n)
        least = self._share_min * self._norms[n, loops.D2]
        if self._normal[1, 1] < least or freedom <= 0 or not self._solve():
            return False
        level = self._right[0] * self._right[0] / self._in_view
        energy = self._energy - level
        explained = -level
        for r in range(4):
            explained += self._solution[r] * self._right[r]
        amplitude = self._solution[1]
        if not (amplitude > 0) or not (energy > 0):
            return False
        rest = energy - explained
        variance = max(rest, 0.0) / freedom + 1.0 / 12.0
        ex = self._solution[2] / amplitude
        ey = self._solution[3] / amplitude
        far = sqrt(square(ex, ey))
        shorten = step_max / far if far > step_max else 1.0
        self.xy[i, 0] = middle_x + shorten * ex
        self.xy[i, 1] = middle_y + shorten * ey
        went2 = square(self.xy[i, 0] - self.predicted[i, 0], self.xy[i, 1] - self.predicted[i, 1])
        if went2 > self._reach2:
            return False
        self.amplitude[i] = amplitude * self._gain
        self.sigma[i] = loops.sigma_of(
            variance * 0.5 * (self._inverse[2, 2] + self._inverse[3, 3]) / (amplitude * amplitude),
            rest, freedom, energy, self._noise2, self._norms[n, loops.RADIUS],
        )  # fmt: skip
        self.fit[i] = explained / energy
        return far * far >= self._near2

    @cython.cfunc
    def _gather_cut(
        self, kind: cython.Py_ssize_t, phase: cython.Py_ssize_t, norm: cython.Py_ssize_t
    ) -> cython.void:
        """Normal equations of 1, d, tx, ty over the pixels in view, and their energy."""
        k: loops.Kind = self._kinds[kind]
        t: cython.Py_ssize_t = k.first + 3 * k.plane * phase
        unit_t: cython.double = self._norms[norm, loops.UNIT_T]
        self._normal[:, :] = 0
        self._right[:] = 0
        self._energy = 0
        for at in range(k.pixels):
            if not self._is_in_view[at]:
                continue
            level = cython.cast(cython.double, self._window[at])
            self._basis[0] = 1
            self._basis[1] = self._norms[norm, loops.UNIT_D] * self._values[t + at]
            self._basis[2] = unit_t * self._values[t + k.plane + at]
            self._basis[3] = unit_t * self._values[t + 2 * k.plane + at]
            for r in range(4):
                for c in range(4):
                    self._normal[r, c] += self._basis[r] * self._basis[c]
                self._right[r] += self._basis[r] * level
            self._energy += level * level

    @cython.cfunc
    def _solve(self) -> cython.bint:
        """Gauss-Jordan on the small symmetric matrix; the inverse gives sigma. False: singular."""
        for r in range(4):
            for c in range(4):
                self._inverse[r, c] = 1 if r == c else 0
        for r in range(4):
            pivot = self._normal[r, r]
            if not (pivot > 1e-9):
                return False
            for c in range(4):
                self._normal[r, c] /= pivot
                self._inverse[r, c] /= pivot
            for o in range(4):
                if o != r:
                    f = self._normal[o, r]
                    for c in range(4):
                        self._normal[o, c] -= f * self._normal[r, c]
                        self._inverse[o, c] -= f * self._inverse[r, c]
        for r in range(4):
            self._solution[r] = 0
            for c in range(4):
                self._solution[r] += self._inverse[r, c] * self._right[c]
        return True


@cython.cfunc
@cython.inline
def middle_of(at: cython.double, to_middle: cython.double) -> cython.double:
    """Where the template is that stands for this place of a pin, px."""
    return 0.25 * (cython.cast(cython.int, N_PHASES * at + to_middle) - to_middle) + 0.125


@cython.cfunc
@cython.inline
def square(x: cython.double, y: cython.double) -> cython.double:
    """Squared length."""
    return x * x + y * y


def _kinds_of(templates: TemplateSet) -> tuple[NDArray[np.void], Index]:
    """`KIND` of each kind of pins, and all their pieces, which are copied UNROLL at a time."""
    kinds = np.zeros(len(templates.half), KIND).view(np.recarray)
    kinds.first, kinds.first_uv, kinds.plane = templates.first, templates.first_uv, templates.plane
    kinds.end_span = np.cumsum([len(spans) for spans in templates.spans])
    kinds.first_span[1:] = kinds.end_span[:-1]
    kinds.pixels = [spans[:, 2].sum() for spans in templates.spans]
    pieces, size = [], _piece_of(templates.side)
    for column, row, length in (spans.T for spans in templates.spans):
        to = np.cumsum(length) - length
        some = [np.stack([column + k, row, to + k])[:, length > k] for k in range(0, length.max(), size)]
        every = np.concatenate(some, axis=1).T
        every = every[np.argsort(every[:, 2])]
        lacking = (loops.UNROLL - 1) * len(every) % loops.UNROLL
        pieces.append(np.concatenate([every, np.repeat(every[-1:], lacking, axis=0)]))
    kinds.end_step = np.cumsum([len(some) for some in pieces])
    kinds.first_step[1:] = kinds.end_step[:-1]
    return kinds, np.concatenate(pieces).astype(np.int32)


def _piece_of(side: int) -> int:
    """Pixels of a window that are copied at once."""
    return loops.LANES if side == 1 else BLOCK // side


def _check(templates: TemplateSet, kind_of: Index, rest_amplitude: Array) -> None:
    """Raises ValueError: constants with which the loops would index out of range."""
    if kind_of.ndim != 1 or rest_amplitude.shape != kind_of.shape:
        raise ValueError("kinds and amplitudes of pins are of different numbers of pins")
    n_kinds = len(templates.half)
    if templates.side not in (1, SIDE):
        raise ValueError(f"blocks of {templates.side} px: 1 or {SIDE} is wanted")
    if kind_of.size and (kind_of.min() < 0 or kind_of.max() >= n_kinds):
        raise ValueError(f"a pin's kind is out of range: 0 to {n_kinds - 1}")
    for half, spans, first, first_uv, plane in zip(
        templates.half, templates.spans, templates.first, templates.first_uv, templates.plane, strict=True
    ):
        if not 1 <= half <= HALF_MAX // templates.side:
            raise ValueError(f"a template of half width {half}: 1 to {HALF_MAX // templates.side} is wanted")
        column, row, length = spans.T
        if np.abs(row).max() > half or column.min() < -half or length.min() < 1:
            raise ValueError(f"spans of a template beyond its half width {half}")
        if (column + length).max() > half + 1 or (np.diff(row) != 1).any():
            raise ValueError(f"spans of a template beyond its half width {half}, or with a row left out")
        if plane % BLOCK or plane < length.sum():
            raise ValueError(f"a template's plane of {plane} numbers is too short for its rows")
        if first < 0 or first + 3 * plane * PHASES * PHASES > templates.values.size:
            raise ValueError("a template that does not fit its table")
        if first_uv < 0 or first_uv + 2 * plane > templates.uv.size:
            raise ValueError("a template whose columns and rows do not fit their table")
    if templates.norms.shape != (n_kinds, PHASES * PHASES, len(NORM)) or templates.norms.dtype != np.float64:
        raise ValueError("norms do not fit the templates")
