"""Where each pin is now: one call over all pins, reading only their windows. Compiled; runs uncompiled too.

Idea: a pin is a blurred disc of known radius d(r) on a local plane. Around a guess c the image is

    I = b + g.(u,v) + A d + A (dx tx + dy ty) + noise,      tx = -d(d)/du: minus the disc's slope

which is linear in b, g, A, A dx, A dy. tx and ty are nonzero on the disc's edge alone, where all information
about its place is. Their least-squares solution is the maximum-likelihood step and reaches the Cramer-Rao
bound; the standard deviation of a plain centroid is twice that. Steps are repeated until one is below half a
phase, so the result does not depend on where the window started.

Rules
- Templates (`templates.py`) are in 16-bit integers for PHASES x PHASES subpixel offsets, zero outside of the
  support circle. d is orthogonal to 1; tx and ty to 1 and d.
- One pass over the pixels of the support, which are copied from the image without the gaps between its rows
  (`windows`); then the steps, four pins at a time (`steps`); TOGETHER pins in turn. Nine in ten need one.
- All sums are exact integers. What depends on the template alone is precomputed in `norms`.
- Dark pins are bright ones in the inverted image, whose sums follow from the image's own: the result is the
  same to the last bit.
- A pin that the image's border cuts takes its steps alone, by what there is of its templates.
- Which of the centroids count is decided afterwards, over all pins (`rejection`).
"""

# mypy: disable-error-code="untyped-decorator,valid-type,index,attr-defined,assignment"

from __future__ import annotations

import cython
import numpy as np
from numpy.typing import NDArray

from edge.pins.templates import BLOCK, FAR_PX, HALF_MAX, LANES, NORM, PHASES, STEP_MAX, TemplateSet
from edge.pins.windows import FETCH, KIND
from edge.types import Array, Image, Index

#: Pins of which the sums are at hand together: they stay in the first-level cache.
TOGETHER = 64

if cython.compiled:
    from cython.cimports.edge.pins.rejection import CentroidFilter
    from cython.cimports.edge.pins.steps import take_steps
    from cython.cimports.edge.pins.windows import Fetch, Kind, place, sum_shorts, sum_windows
    from cython.cimports.libc.math import HUGE_VAL, sqrt
else:
    from math import inf as HUGE_VAL  # noqa: N812
    from math import sqrt

    from edge.pins.rejection import CentroidFilter
    from edge.pins.steps import take_steps
    from edge.pins.windows import place, sum_shorts, sum_windows

INT_MAX = cython.declare(cython.Py_ssize_t, np.iinfo(np.int32).max)
N_PHASES = cython.declare(cython.int, PHASES)
MANY = cython.declare(cython.Py_ssize_t, TOGETHER)
LEVEL_MAX = cython.declare(cython.int, STEP_MAX)

#: Columns of `norms`.
RADIUS = cython.declare(cython.int, NORM.index("radius"))
STEP = cython.declare(cython.int, NORM.index("step_max"))
D2 = cython.declare(cython.int, NORM.index("d2"))
UNIT_D = cython.declare(cython.int, NORM.index("unit_d"))
UNIT_T = cython.declare(cython.int, NORM.index("unit_t"))


@cython.final
@cython.cclass
class CentroidKernel:
    """Centroids of the n pins of one tip. All arrays are good until the next image.

    xy, sigma       (n, 2) and (n,) px; NaN where a pin is lost
    amplitude, fit  (n,) levels, and the share of the window's variation that the disc explained
    """

    xy = cython.declare(object, visibility="readonly")
    sigma = cython.declare(object, visibility="readonly")
    amplitude = cython.declare(object, visibility="readonly")
    fit = cython.declare(object, visibility="readonly")
    n: cython.Py_ssize_t
    _xy: cython.double[:, ::1]  # the same memory
    _sigma: cython.double[::1]
    _amplitude: cython.double[::1]
    _fit: cython.double[::1]
    _reach2: cython.double
    _noise2: cython.double
    _steps_max: cython.int
    _share_min: cython.double  # of a disc at the image's border
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
    _kinds: Kind[::1]
    _spans: cython.int[:, ::1]  # of all kinds
    _steps: cython.Py_ssize_t[:, ::1]  # as `sum_windows` takes it, in 8-bit images of this shape
    _inner: cython.double[::1]  # as `place` takes it
    _half: cython.Py_ssize_t  # of the largest window
    _fetch: Fetch[::1]  # as `sum_windows` takes it
    _values: cython.short[::1]  # of the templates
    _uv: cython.schar[::1]
    _norms: cython.double[:, ::1]
    _predicted: cython.double[:, ::1]
    _predicted_array: object  # the same memory
    _filter: CentroidFilter
    _pixels: cython.uchar[::1]
    _window: cython.short[::1]
    _asked: cython.int[::1]  # the pins that take a step
    _who: cython.int[::1]  # TOGETHER of them, or fewer
    _others: cython.int[::1]  # of these, those that `sum_windows` does not read
    _taken: cython.Py_ssize_t  # how many have sums
    _at: cython.int[::1]
    _begin: cython.int[::1]
    _middle: cython.double[:, ::1]
    _sums: cython.double[:, ::1]
    _normal: cython.double[:, ::1]
    _inverse: cython.double[:, ::1]
    _basis: cython.double[::1]
    _energy: cython.double
    _in_view: cython.double  # pixels

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
        limits          share_min, reach_px, clash_px, near_phases, steps_max, noise (levels), spare_bits
        dark            the pins are darker than the skin
        Raises          ValueError: arrays that do not belong together, an index out of range
        """
        self._kind_of = np.array(kind_of, np.int32)
        self.n = self._kind_of.shape[0]
        _check(templates, np.asarray(self._kind_of), np.asarray(rest_amplitude))
        self._norm_of = np.asarray(self._kind_of) * np.int32(PHASES * PHASES)
        self._spans = np.concatenate(templates.spans)
        self._kinds = _kinds_of(templates)
        self._half, self._fetch = max(templates.half), np.zeros(1, FETCH).view(np.recarray)
        self._values, self._uv = templates.values, templates.uv
        self._sign = -1 if dark else 1
        self._norms = np.concatenate(templates.norms)
        self._rows = self._columns = self._stride = -1  # none yet
        if not 0 <= limits["spare_bits"] <= 8:
            raise ValueError(f"spare_bits of 0 to 8 are wanted, not {limits['spare_bits']}")
        self._reach2 = limits["reach_px"] ** 2
        self._shift = int(limits["spare_bits"])
        self._gain = 2.0**self._shift
        self._noise2 = limits["noise"] ** 2 / 4.0 ** int(limits["spare_bits"])
        self._steps_max = int(limits["steps_max"])
        self._near2, self._far2 = (limits["near_phases"] / PHASES) ** 2, FAR_PX**2
        self._share_min = limits["share_min"]
        self._filter = CentroidFilter(rest_amplitude, limits["share_min"], limits["clash_px"])
        self.xy = self._xy = np.full((self.n, 2), np.nan)
        self.sigma = self._sigma = np.full(self.n, np.nan)
        self.amplitude = self._amplitude = np.full(self.n, np.nan)
        self.fit = self._fit = np.full(self.n, np.nan)
        plane_max = int(np.max(templates.plane))
        self._pixels = np.zeros(plane_max + 2 * HALF_MAX + LANES, np.uint8)
        self._window = np.zeros(plane_max, np.int16)
        self._asked = np.zeros(self.n, np.int32)
        rows = TOGETHER + LANES  # they are taken four at a time
        self._who, self._others, self._at, self._begin = np.zeros((4, rows), np.int32)
        self._middle, self._sums = np.zeros((2, rows)), np.zeros((rows, NORM.index("inv_d")))
        self._predicted_array = None
        self._normal = np.empty((4, 5))
        self._inverse = np.empty((4, 4))
        self._basis = np.empty(4)

    def read(self, image: Image, predicted: Array) -> None:
        """Find the pins of one image.

        image      (h, w) uint8 or uint16
        predicted  (n, 2) float64, px
        Raises     ValueError: another kind of image, another number of predictions
        """
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
        if predicted is not self._predicted_array:  # to take an array costs 2,000 instructions
            self._predicted = self._predicted_array = predicted
        if self._predicted.shape[0] != self.n or self._predicted.shape[1] != 2:
            raise ValueError(f"predictions of {self.n} pins are wanted, not of {self._predicted.shape[0]}")
        self._read()
        self._filter.reject(self._xy, self._sigma, self._amplitude, self._fit, self._predicted)

    @cython.cfunc
    @cython.inline
    def _set_shape(
        self, rows: cython.Py_ssize_t, columns: cython.Py_ssize_t, stride: cython.Py_ssize_t
    ) -> cython.bint:
        """The image has this shape now; raises ValueError: nothing or too much for indices of 32 bits.

        stride  of an 8-bit image, bytes from row to row; else 0
        """
        if rows == self._rows and columns == self._columns and stride == self._stride:
            return False
        if not 0 < rows * columns <= INT_MAX or rows * stride > INT_MAX:
            raise ValueError(f"an image of {rows} x {columns} pixels, {stride} bytes a row")
        self._rows, self._columns, self._stride = rows, columns, stride
        if stride:
            self._make_steps()
        return True

    @cython.cfunc
    def _make_steps(self) -> cython.bint:
        """Make the steps of 8-bit images of this shape, and say where the largest window is within them: its
        last copy must not end beyond the image.
        """
        rows, columns, stride = self._rows, self._columns, self._stride
        column, row, length = np.asarray(self._spans, np.intp).T
        begin = column + row * stride
        kinds = np.asarray(self._kinds)
        half = int(kinds["half"].max())
        last = int((begin[kinds["end_span"] - 1] + kinds["row_bytes"]).max())
        low = ((rows - 1) * stride + half + 1 - last) // stride
        self._inner = PHASES * np.array([half, half, columns - half, min(rows - half, low + 1)], np.float64)
        self._steps = np.zeros((kinds["end_step"].max() + LANES, 2), np.intp)
        steps = np.asarray(self._steps)
        for k in kinds:
            n, spans = k["end_span"] - k["first_span"], slice(k["first_span"], k["end_span"])
            steps[k["first_step"] :][:n] = np.stack([np.diff(begin[spans], prepend=0), length[spans]], axis=1)
        return True

    @cython.cfunc
    @cython.exceptval(check=False)
    def _read(self) -> cython.void:
        """All pins step from their predictions to their centroids, those of them that are not there yet."""
        i: cython.Py_ssize_t
        n: cython.Py_ssize_t = self.n
        iteration: cython.int
        for i in range(n):
            self._asked[i] = i
        if not self._wide:
            self._begin_to_fetch()
        for iteration in range(self._steps_max):
            n = self._step_all(n, iteration)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _begin_to_fetch(self) -> cython.void:
        """What lies round the predictions is to be fetched while windows are read: pins come in rows."""
        i: cython.Py_ssize_t
        x: cython.double
        y: cython.double
        left: cython.double = self._columns
        right: cython.double = 0.0
        top: cython.double = self._rows
        bottom: cython.double = 0.0
        for i in range(self.n):
            x, y = self._predicted[i, 0], self._predicted[i, 1]
            left, right = min(left, x), max(right, x)
            top, bottom = min(top, y), max(bottom, y)
        half: cython.Py_ssize_t = self._half
        first_row: cython.Py_ssize_t = max(cython.cast(cython.Py_ssize_t, max(top, 0.0)) - half, 0)
        end_row: cython.Py_ssize_t = cython.cast(cython.Py_ssize_t, min(bottom, self._rows)) + half + 1
        end_row = min(end_row, self._rows)
        f: Fetch = self._fetch[0]
        f.row, f.end, f.stride = first_row * self._stride, end_row * self._stride, self._stride
        f.first = max(cython.cast(cython.Py_ssize_t, max(left, 0.0)) - half, 0)
        f.beyond = cython.cast(cython.Py_ssize_t, min(right, self._columns)) + half + 1
        f.beyond = min(f.beyond, self._columns)
        # More than the mean, to get ahead where pins are few; to a window and a half below the one in hand.
        f.rows = 1 + 3 * (end_row - first_row) // max(self.n, 1)
        f.ahead = 2 * (2 * half + 1) * self._stride
        self._fetch[0] = f

    @cython.cfunc
    @cython.exceptval(check=False)
    def _step_all(self, n: cython.Py_ssize_t, iteration: cython.int) -> cython.Py_ssize_t:
        """A step of the first n of `_asked`. Returns how many, put first there, have to go on."""
        i: cython.Py_ssize_t
        first: cython.Py_ssize_t = 0
        many: cython.Py_ssize_t
        on: cython.Py_ssize_t = 0
        while first < n:
            many = min(n - first, MANY)
            for i in range(many):
                self._who[i] = self._asked[first + i]
            first += many
            many = self._step(many, iteration)
            for i in range(many):
                self._asked[on + i] = self._who[i]
            on += many
        return on

    @cython.cfunc
    @cython.exceptval(check=False)
    def _step(self, n: cython.Py_ssize_t, iteration: cython.int) -> cython.Py_ssize_t:
        """A step of the first n of `_who`. Returns how many, put first there, have to go on."""
        xy: cython.double[:, ::1] = self._xy if iteration else self._predicted
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        others: cython.Py_ssize_t
        on: cython.Py_ssize_t = 0
        # Far off, slopes alone give a coarse step first. The last step that is allowed ends everywhere.
        far2: cython.double = self._far2 if iteration < self._steps_max - 3 else HUGE_VAL
        near2: cython.double = self._near2 if iteration < self._steps_max - 1 else HUGE_VAL
        if self._wide:
            self._taken = 0
            for j in range(n):
                self._others[j] = self._who[j]
        else:
            self._taken = place(
                self._norm_of, self._inner, self._stride, xy, self._who, n, self._others, self._at,
                self._begin, self._middle,
            )  # fmt: skip
            sum_windows(
                self._image8, self._fetch, self._begin, self._at, self._taken, self._kinds, self._steps,
                self._values, self._uv, self._norms, self._pixels, self._sign < 0, self._sums,
            )  # fmt: skip
        others = n - self._taken
        for j in range(others):
            i = self._others[j]
            if self._step_other(i, xy[i, 0], xy[i, 1], near2):
                self._others[on] = i
                on += 1
        n = 0
        if self._taken:
            n = take_steps(
                self._who, self._taken, self._at, self._middle, self._sums, self._norms, self._predicted,
                iteration == 0, near2, far2, self._reach2, self._noise2, self._gain, self._xy, self._sigma,
                self._amplitude, self._fit,
            )  # fmt: skip
        for j in range(on):
            self._who[n + j] = self._others[j]
        return n + on

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def _level(self, x: cython.Py_ssize_t, y: cython.Py_ssize_t) -> cython.int:
        if self._wide:
            return cython.cast(cython.int, self._image16[y, x])
        return cython.cast(cython.int, self._image8[y, x])

    @cython.cfunc
    @cython.exceptval(check=False)
    def _step_other(
        self, i: cython.Py_ssize_t, px: cython.double, py: cython.double, near2: cython.double
    ) -> cython.bint:
        """The sums of pin i where its window is within the image, else its step. Returns it has to go on."""
        j: cython.Py_ssize_t = self._taken
        kind: cython.Py_ssize_t = self._kind_of[i]
        k: Kind = self._kinds[kind]
        x4: cython.double = N_PHASES * px + 2
        y4: cython.double = N_PHASES * py + 2
        self._amplitude[i] = self._fit[i] = 0
        if not (0 <= px <= self._columns - 1 and 0 <= py <= self._rows - 1):  # NaN is not
            return False
        x: cython.int = cython.cast(cython.int, x4)
        y: cython.int = cython.cast(cython.int, y4)
        cx: cython.Py_ssize_t = x // N_PHASES
        cy: cython.Py_ssize_t = y // N_PHASES
        phase: cython.Py_ssize_t = y % N_PHASES * N_PHASES + x % N_PHASES
        self._take_window(cx, cy, kind)
        self._at[j] = kind * N_PHASES * N_PHASES + phase
        self._middle[0, j] = 0.25 * x - 0.375
        self._middle[1, j] = 0.25 * y - 0.375
        if cx < k.half or cy < k.half or cx + k.half >= self._columns or cy + k.half >= self._rows:
            return self._step_cut(i, kind, cx, cy, phase, j, near2)
        sum_shorts(
            self._window, self._wide, self._values, k.first + 3 * k.plane * phase, self._uv, k.first_uv,
            k.plane, self._norms[self._at[j]], self._sums[j],
        )  # fmt: skip
        self._who[j] = i
        self._taken = j + 1
        return False

    @cython.cfunc
    @cython.exceptval(check=False)
    def _take_window(
        self, cx: cython.Py_ssize_t, cy: cython.Py_ssize_t, kind: cython.Py_ssize_t
    ) -> cython.void:
        """Pixels of the support less the middle's level, as of bright pins; zero outside of the image."""
        k: Kind = self._kinds[kind]
        level: cython.int = self._level(cx, cy)
        i: cython.int
        j: cython.Py_ssize_t
        x: cython.Py_ssize_t
        y: cython.Py_ssize_t
        at: cython.Py_ssize_t = 0
        step: cython.int
        for j in range(k.first_span, k.end_span):
            y = cy + self._spans[j, 1]
            for i in range(self._spans[j, 2]):
                x = cx + self._spans[j, 0] + i
                step = 0
                if 0 <= y < self._rows and 0 <= x < self._columns:
                    step = (self._sign * (self._level(x, y) - level)) >> self._shift
                self._window[at] = cython.cast(cython.short, min(max(step, -LEVEL_MAX), LEVEL_MAX))
                at += 1
        while at < k.plane:
            self._window[at] = 0
            at += 1

    @cython.cfunc
    @cython.exceptval(check=False)
    def _step_cut(
        self, i: cython.Py_ssize_t, kind: cython.Py_ssize_t, cx: cython.Py_ssize_t, cy: cython.Py_ssize_t,
        phase: cython.Py_ssize_t, j: cython.Py_ssize_t, near2: cython.double,
    ) -> cython.bint:  # fmt: skip
        """The same for a pin that the border cuts: the fit of 1, d, tx, ty over the pixels there are."""
        n: cython.Py_ssize_t = self._at[j]
        step_max: cython.double = self._norms[n, STEP]
        self._gather_cut(kind, cx, cy, phase)
        energy: cython.double = self._energy
        seen: cython.double = self._in_view
        total: cython.double = self._normal[0, 4]
        if self._normal[1, 1] < self._share_min * self._norms[n, D2] or seen <= 4 or not self._invert():
            return False
        energy -= total * total / seen
        explained: cython.double = -total * total / seen
        amplitude: cython.double = 0
        ex: cython.double = 0
        ey: cython.double = 0
        solved: cython.double
        r: cython.int
        c: cython.int
        for r in range(4):
            solved = 0
            for c in range(4):
                solved += self._inverse[r, c] * self._normal[c, 4]
            explained += solved * self._normal[r, 4]
            if r == 1:
                amplitude = solved
            elif r == 2:
                ex = solved
            elif r == 3:
                ey = solved
        if not (amplitude > 0) or not (energy > 0):
            return False
        rest: cython.double = energy - explained
        variance: cython.double = (rest if rest > 0 else 0.0) / (seen - 4) + 1.0 / 12.0
        ex /= amplitude
        ey /= amplitude
        far: cython.double = sqrt(square(ex, ey))
        shorten: cython.double = step_max / far if far > step_max else 1.0
        self._xy[i, 0] = self._middle[0, j] + shorten * ex
        self._xy[i, 1] = self._middle[1, j] + shorten * ey
        if (
            square(self._xy[i, 0] - self._predicted[i, 0], self._xy[i, 1] - self._predicted[i, 1])
            > self._reach2
        ):
            return False
        if far * far >= near2:
            return True
        self._amplitude[i] = amplitude * self._gain
        self._sigma[i] = sigma_of(
            variance * 0.5 * (self._inverse[2, 2] + self._inverse[3, 3]) / (amplitude * amplitude),
            rest, seen - 4, energy, self._noise2, self._norms[n, RADIUS],
        )  # fmt: skip
        self._fit[i] = explained / energy
        return False

    @cython.cfunc
    @cython.exceptval(check=False)
    def _gather_cut(
        self, kind: cython.Py_ssize_t, cx: cython.Py_ssize_t, cy: cython.Py_ssize_t, phase: cython.Py_ssize_t
    ) -> cython.void:
        """Normal equations of 1, d, tx, ty over the pixels in view, their energy and number."""
        k: Kind = self._kinds[kind]
        n: cython.Py_ssize_t = kind * N_PHASES * N_PHASES + phase
        t: cython.Py_ssize_t = k.first + 3 * k.plane * phase
        unit_d: cython.double = self._norms[n, UNIT_D]
        unit_t: cython.double = self._norms[n, UNIT_T]
        i: cython.int
        j: cython.int
        r: cython.int
        c: cython.int
        x: cython.Py_ssize_t
        y: cython.Py_ssize_t
        at: cython.Py_ssize_t = -1
        basis: cython.double
        level: cython.double
        for r in range(4):
            for c in range(5):
                self._normal[r, c] = 0
        self._energy = self._in_view = 0
        for j in range(k.first_span, k.end_span):
            y = cy + self._spans[j, 1]
            for i in range(self._spans[j, 2]):
                x = cx + self._spans[j, 0] + i
                at += 1
                if x < 0 or y < 0 or x >= self._columns or y >= self._rows:
                    continue
                level = cython.cast(cython.double, self._window[at])
                self._basis[0] = 1
                self._basis[1] = unit_d * self._values[t + at]
                self._basis[2] = unit_t * self._values[t + k.plane + at]
                self._basis[3] = unit_t * self._values[t + 2 * k.plane + at]
                for r in range(4):
                    basis = self._basis[r]
                    for c in range(4):
                        self._normal[r, c] += basis * self._basis[c]
                    self._normal[r, 4] += basis * level
                self._energy += level * level
                self._in_view += 1

    @cython.cfunc
    @cython.exceptval(check=False)
    def _invert(self) -> cython.bint:
        """Gauss-Jordan on the small symmetric matrix; the inverse gives sigma. False: singular."""
        r: cython.int
        c: cython.int
        o: cython.int
        pivot: cython.double
        f: cython.double
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
                if o == r:
                    continue
                f = self._normal[o, r]
                for c in range(4):
                    self._normal[o, c] -= f * self._normal[r, c]
                    self._inverse[o, c] -= f * self._inverse[r, c]
        return True


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
def square(x: cython.double, y: cython.double) -> cython.double:
    """Squared length."""
    return x * x + y * y


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
def sigma_of(
    noise_variance: cython.double, rest: cython.double, freedom: cython.double,
    energy: cython.double, noise2: cython.double, radius: cython.double,
) -> cython.double:  # fmt: skip
    """Sigma of a coordinate, px: the noise left by the fit, plus the bias that a blob unlike a disc may hide.

    The share m of the variation that the disc does not explain counts as radius x m^2 (docs/tuning.md).
    """
    missing: cython.double = rest - freedom * (noise2 + 1.0 / 12.0)
    m: cython.double = missing / energy if missing > 0 and energy > 0 else 0.0
    hidden: cython.double = radius * m * m
    return sqrt(noise_variance + hidden * hidden)


def _kinds_of(templates: TemplateSet) -> NDArray[np.void]:
    """`KIND` of each kind of pins, for images of no stride yet."""
    lengths = np.array([len(spans) for spans in templates.spans])
    end = np.cumsum(lengths)
    kinds = np.zeros(len(templates.half), KIND).view(np.recarray)
    kinds.half, kinds.plane = templates.half, templates.plane
    kinds.first, kinds.first_uv = templates.first, templates.first_uv
    kinds.first_span, kinds.end_span = end - lengths, end
    space = LANES * np.arange(len(lengths))  # behind each kind's steps
    kinds.first_step, kinds.end_step = end - lengths + space, end + space
    kinds.pixels = [spans[:, 2].sum() for spans in templates.spans]
    kinds.row_bytes = [-(-int(spans[:, 2].max()) // LANES) * LANES for spans in templates.spans]
    return kinds


def _check(templates: TemplateSet, kind_of: Index, rest_amplitude: Array) -> None:
    """Raises ValueError: constants with which the loops would index out of range."""
    if kind_of.ndim != 1 or rest_amplitude.shape != kind_of.shape:
        raise ValueError("kinds and amplitudes of pins are of different numbers of pins")
    n_kinds = len(templates.half)
    if kind_of.size and (kind_of.min() < 0 or kind_of.max() >= n_kinds):
        raise ValueError(f"a pin's kind is out of range: 0 to {n_kinds - 1}")
    for half, spans, first, first_uv, plane in zip(
        templates.half, templates.spans, templates.first, templates.first_uv, templates.plane, strict=True
    ):
        if not 1 <= half <= HALF_MAX:
            raise ValueError(f"a template of half width {half}: 1 to {HALF_MAX} is wanted")
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
