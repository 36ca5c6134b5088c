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
- One pass over the pixels of the support, which are copied from the image without the gaps between its rows;
  nine pins in ten need only one step. Divisions here are those of the pin; what depends on the template alone
  is precomputed in `norms`.
- All sums are exact integers.
- Dark pins are bright ones in the inverted image, whose sums follow from the image's own: the result is the
  same to the last bit.
- Which of the centroids count is decided afterwards, over all pins (`rejection`).
"""

# mypy: disable-error-code="untyped-decorator,valid-type,index,attr-defined,assignment"

from __future__ import annotations

import cython
import numpy as np
from numpy.typing import NDArray

from edge.pins.templates import BLOCK, HALF_MAX, LANES, NORM, PHASES, STEP_MAX, TemplateSet
from edge.types import Array, Image, Index

if cython.compiled:
    from cython.cimports.edge.pins.rejection import CentroidFilter
    from cython.cimports.edge.pins.windows import sums_of_bytes, sums_of_shorts
    from cython.cimports.libc.math import NAN, ldexp, sqrt
else:
    from math import ldexp, sqrt
    from math import nan as NAN  # noqa: N812

    from edge.pins.rejection import CentroidFilter
    from edge.pins.windows import sums_of_bytes, sums_of_shorts

N_PHASES = cython.declare(cython.int, PHASES)
LEVEL_MAX = cython.declare(cython.int, STEP_MAX)

#: One row of `templates.NORM`: what is known of one phase of one template.
Norm = cython.struct(
    x=cython.double, y=cython.double, by_d=cython.double, by_tx=cython.double, by_ty=cython.double,
    d2=cython.double, tx2=cython.double, ty2=cython.double, u_d=cython.double, v_d=cython.double,
    u_tx=cython.double, v_ty=cython.double, inv_u2=cython.double, inv_v2=cython.double, tx_u=cython.double,
    ty_v=cython.double, spread=cython.double, spread_x=cython.double, spread_y=cython.double,
    pixels=cython.double, inv_pixels=cython.double, freedom=cython.double, inv_freedom=cython.double,
    radius=cython.double, unit_d=cython.double, unit_t=cython.double,
)  # fmt: skip
#: One row of `KIND`: what is known of one kind of pins.
Kind = cython.struct(
    half=cython.Py_ssize_t, first_span=cython.Py_ssize_t, end_span=cython.Py_ssize_t,
    row_bytes=cython.Py_ssize_t, reach=cython.Py_ssize_t, first=cython.Py_ssize_t, plane=cython.Py_ssize_t,
    step_max=cython.double,
)  # fmt: skip
#: half           px, half width of its window
#: first_span, end_span  its rows in the spans of all kinds
#: row_bytes      copied of each row of a window: the longest, filled up to LANES
#: reach          bytes from a window's middle to the end of its last copy
#: first, plane   as in `TemplateSet`
#: step_max       px
KIND = np.dtype(
    [
        *(
            (name, np.intp)
            for name in ("half", "first_span", "end_span", "row_bytes", "reach", "first", "plane")
        ),
        ("step_max", np.float64),
    ]
)


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
    _near: cython.double  # px: a step this short is the last
    _far: cython.double  # px: of a longer one the slopes alone are enough
    _sign: cython.int  # -1: dark pins
    _shift: cython.int  # right shift that brings 16-bit images to 12 bits
    _wide: cython.bint
    _rows: cython.Py_ssize_t
    _columns: cython.Py_ssize_t
    _image8: cython.const[cython.uchar][:, :]
    _image16: cython.const[cython.ushort][:, :]
    _size: cython.Py_ssize_t  # bytes from the first pixel to the end of the last
    _x_max: cython.double
    _y_max: cython.double
    _kind_of: cython.int[::1]
    _kinds: Kind[::1]
    _spans: cython.int[:, ::1]  # of all kinds
    _steps: cython.Py_ssize_t[:, ::1]  # for `sums_of_bytes`, in images of `_stride`
    _stride: cython.Py_ssize_t  # bytes from row to row
    _templates: cython.short[::1]
    _norms: Norm[:, ::1]
    _predicted: cython.double[:, ::1]
    _predicted_array: object  # the same memory
    _filter: CentroidFilter
    _pixels: cython.uchar[::1]
    _window: cython.short[::1]
    _sums: cython.double[::1]
    _normal: cython.double[:, ::1]
    _inverse: cython.double[:, ::1]
    _basis: cython.double[::1]

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
        limits          share_min, reach_px, clash_px, far_px, near_phases, steps_max, noise (levels),
                        spare_bits
        dark            the pins are darker than the skin
        Raises          ValueError: arrays that do not belong together, an index out of range
        """
        self._kind_of = np.array(kind_of, np.int32)
        self.n = self._kind_of.shape[0]
        self._spans = np.concatenate(templates.spans)
        self._kinds = _kinds_of(templates)
        self._steps, self._stride = np.zeros((len(self._spans), 2), np.intp), 0
        self._templates = templates.values
        self._norms = templates.norms
        _check(templates, np.asarray(self._kind_of), np.asarray(rest_amplitude))
        if not 0 <= limits["spare_bits"] <= 8:
            raise ValueError(f"spare_bits of 0 to 8 are wanted, not {limits['spare_bits']}")
        self._sign = -1 if dark else 1
        self._reach2 = limits["reach_px"] ** 2
        self._shift = int(limits["spare_bits"])
        self._noise2 = limits["noise"] ** 2 / 4.0 ** int(limits["spare_bits"])
        self._steps_max = int(limits["steps_max"])
        self._near, self._far = limits["near_phases"] / PHASES, limits["far_px"]
        self._share_min = limits["share_min"]
        self._filter = CentroidFilter(rest_amplitude, limits["share_min"], limits["clash_px"])
        self.xy = self._xy = np.full((self.n, 2), np.nan)
        self.sigma = self._sigma = np.full(self.n, np.nan)
        self.amplitude = self._amplitude = np.full(self.n, np.nan)
        self.fit = self._fit = np.full(self.n, np.nan)
        plane_max = int(np.max(templates.plane))
        self._pixels = np.zeros(plane_max + 2 * HALF_MAX + LANES, np.uint8)
        self._window = np.zeros(plane_max, np.int16)
        self._sums = np.empty(7)
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
            self._image8 = image if image.strides[1] == 1 else np.ascontiguousarray(image)
            if self._image8.strides[0] != self._stride:
                self._set_stride(self._image8.strides[0])
        elif image.dtype == np.uint16 and image.ndim == 2:
            self._wide = True
            self._image16 = image
        else:
            raise ValueError(f"image of {image.ndim} axes, {image.dtype}: 2 axes, uint8 or uint16 wanted")
        self._rows, self._columns = image.shape
        if self._rows < 1 or self._columns < 1:
            raise ValueError("an image without pixels")
        self._size = (self._rows - 1) * self._stride + self._columns
        self._x_max, self._y_max = self._columns - 1, self._rows - 1
        if predicted is not self._predicted_array:  # to take an array costs 2,000 instructions
            self._predicted = self._predicted_array = predicted
        if self._predicted.shape[0] != self.n or self._predicted.shape[1] != 2:
            raise ValueError(f"predictions of {self.n} pins are wanted, not of {self._predicted.shape[0]}")
        self._read()
        self._filter.reject(self._xy, self._sigma, self._amplitude, self._fit, self._predicted)

    @cython.cfunc
    def _set_stride(self, stride: cython.Py_ssize_t) -> cython.bint:
        """Make the steps of 8-bit images of this stride."""
        column, row, length = np.asarray(self._spans, np.intp).T
        begin = column + row * stride
        step = np.diff(begin, prepend=0)
        kinds = np.asarray(self._kinds)
        step[kinds["first_span"]] = begin[kinds["first_span"]]
        kinds["reach"] = begin[kinds["end_span"] - 1] + kinds["row_bytes"]
        self._steps, self._stride = np.stack([step, length], axis=1), stride
        return True

    @cython.cfunc
    @cython.exceptval(check=False)
    def _read(self) -> cython.void:
        i: cython.Py_ssize_t
        for i in range(self.n):
            if not self._follow(i):
                self._xy[i, 0] = self._xy[i, 1] = self._sigma[i] = NAN
                self._amplitude[i] = self._fit[i] = 0.0

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def _level(self, x: cython.Py_ssize_t, y: cython.Py_ssize_t) -> cython.int:
        if self._wide:
            return cython.cast(cython.int, self._image16[y, x])
        return cython.cast(cython.int, self._image8[y, x])

    @cython.cfunc
    @cython.exceptval(check=False)
    def _follow(self, i: cython.Py_ssize_t) -> cython.bint:
        """Steps from the prediction of pin i to its centroid; False: lost, they do not converge."""
        kind: cython.Py_ssize_t = self._kind_of[i]
        k: Kind = self._kinds[kind]
        x: cython.double = self._predicted[i, 0]
        y: cython.double = self._predicted[i, 1]
        iteration: cython.int
        cx: cython.Py_ssize_t
        cy: cython.Py_ssize_t
        phase: cython.int
        done: cython.int
        for iteration in range(self._steps_max):
            if not (x >= 0.0 and y >= 0.0 and x <= self._x_max and y <= self._y_max):  # NaN is not
                return False
            cx = cython.cast(cython.Py_ssize_t, x + 0.5)
            cy = cython.cast(cython.Py_ssize_t, y + 0.5)
            phase = phase_of(y + 0.5 - cy) * N_PHASES + phase_of(x + 0.5 - cx)
            if cx < k.half or cy < k.half or cx + k.half >= self._columns or cy + k.half >= self._rows:
                self._take_window(cx, cy, kind)
                done = self._step_cut(i, kind, cx, cy, phase, k.step_max, iteration)
            else:
                if self._wide or cy * self._stride + cx + k.reach > self._size:
                    self._sum_window(cx, cy, kind, phase)
                else:
                    self._sum_bytes(cx, cy, kind, phase)
                done = self._step(i, kind, x, y, cx, cy, phase, k.step_max, iteration)
            if done < 0:
                return False
            x = self._xy[i, 0]
            y = self._xy[i, 1]
            if square(x - self._predicted[i, 0], y - self._predicted[i, 1]) > self._reach2:
                return False
            if done:
                return True
        return False

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def _sum_bytes(
        self, cx: cython.Py_ssize_t, cy: cython.Py_ssize_t, kind: cython.Py_ssize_t, phase: cython.Py_ssize_t
    ) -> cython.void:
        """The sums of a window of an 8-bit image with the templates of this phase, as of bright pins."""
        k: Kind = self._kinds[kind]
        i: cython.Py_ssize_t
        sums_of_bytes(
            self._image8, cx, cy, self._steps, k.first_span, k.end_span,
            cython.cast(cython.int, k.row_bytes), self._pixels, self._templates,
            self._phase_at(kind, phase), k.first, cython.cast(cython.int, k.plane), self._sums,
        )  # fmt: skip
        if self._sign < 0:  # of 255 less each level; the sums of the other templates are zero
            n: cython.double = self._norms[kind, phase].pixels
            self._sums[6] += 255.0 * (255.0 * n - 2.0 * self._sums[3])
            self._sums[3] -= 255.0 * n
            for i in range(6):
                self._sums[i] = -self._sums[i]

    @cython.cfunc
    @cython.exceptval(check=False)
    def _sum_window(
        self, cx: cython.Py_ssize_t, cy: cython.Py_ssize_t, kind: cython.Py_ssize_t, phase: cython.Py_ssize_t
    ) -> cython.void:
        """The same of an image with more bits, or where copies of whole rows would end beyond the image."""
        k: Kind = self._kinds[kind]
        self._take_window(cx, cy, kind)
        sums_of_shorts(
            self._window, self._wide, self._templates, self._phase_at(kind, phase), k.first,
            cython.cast(cython.int, k.plane), self._sums,
        )  # fmt: skip

    @cython.cfunc
    @cython.exceptval(check=False)
    def _take_window(
        self, cx: cython.Py_ssize_t, cy: cython.Py_ssize_t, kind: cython.Py_ssize_t
    ) -> cython.void:
        """Pixels of the support less the middle's level, as of bright pins, zero outside of the image."""
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

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def _phase_at(self, kind: cython.Py_ssize_t, phase: cython.Py_ssize_t) -> cython.Py_ssize_t:
        return self._kinds[kind].first + 3 * self._kinds[kind].plane * (1 + phase)

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def _step(
        self, i: cython.Py_ssize_t, kind: cython.Py_ssize_t, x: cython.double, y: cython.double,
        cx: cython.Py_ssize_t, cy: cython.Py_ssize_t, phase: cython.Py_ssize_t,
        step_max: cython.double, iteration: cython.int,
    ) -> cython.int:  # fmt: skip
        """One step by the sums of a window within the image: -1 lost, 0 go on from here, 1 arrived."""
        n: Norm = self._norms[kind, phase]
        amplitude: cython.double = self._sums[0] * n.by_d
        if not (amplitude > 0):
            return -1
        inverse: cython.double = 1 / amplitude
        # The step times the amplitude, as if the surroundings had no slope.
        tx: cython.double = self._sums[1] * n.by_tx
        ty: cython.double = self._sums[2] * n.by_ty
        ex: cython.double = tx * inverse
        ey: cython.double = ty * inverse
        shorten: cython.double
        if iteration < self._steps_max - 3:  # far off: a coarse step by the slopes alone first
            far2: cython.double = square(ex, ey)
            if far2 > self._far * self._far:
                shorten = step_max / sqrt(far2) if far2 > step_max * step_max else 1
                self._xy[i, 0] = cx + n.x + shorten * ex
                self._xy[i, 1] = cy + n.y + shorten * ey
                return 0
        # What the slope of the surroundings explains besides. It is shrunk by its uncertainty:
        # where it is within its own noise, leaving it out costs nothing and saves a fifth of the noise.
        su: cython.double = self._sums[4] - n.u_d * amplitude
        sv: cython.double = self._sums[5] - n.v_d * amplitude
        u: cython.double = su - n.u_tx * tx
        v: cython.double = sv - n.v_ty * ty
        gx: cython.double = u * n.inv_u2
        gy: cython.double = v * n.inv_v2
        by_gx: cython.double = gx * u
        by_gy: cython.double = gy * v
        energy: cython.double = self._sums[6] - self._sums[3] * self._sums[3] * n.inv_pixels
        by_disc: cython.double = n.d2 * amplitude * amplitude
        rest: cython.double = energy - by_disc - n.tx2 * tx * tx - n.ty2 * ty * ty - by_gx - by_gy
        variance: cython.double = (rest if rest > 0 else 0.0) * n.inv_freedom + 1.0 / 12.0
        limit: cython.double = 4 * variance
        keep_x: cython.double = 1 - limit / by_gx if by_gx > limit else 0.0
        keep_y: cython.double = 1 - limit / by_gy if by_gy > limit else 0.0
        ex -= n.tx_u * gx * keep_x * inverse
        ey -= n.ty_v * gy * keep_y * inverse
        dx: cython.double = n.x + cx + ex - x
        dy: cython.double = n.y + cy + ey - y
        step2: cython.double = square(dx, dy)
        if step2 > step_max * step_max:
            shorten = step_max / sqrt(step2)
            dx *= shorten
            dy *= shorten
        self._xy[i, 0] = x + dx
        self._xy[i, 1] = y + dy
        if square(ex, ey) >= self._near * self._near and iteration < self._steps_max - 1:
            return 0
        # variation that the slope of the surroundings explains does not count against the disc
        level_energy: cython.double = energy - gx * su - gy * sv
        spread: cython.double = n.spread + keep_x * n.spread_x + keep_y * n.spread_y
        self._amplitude[i] = ldexp(amplitude, self._shift) if self._shift else amplitude
        self._sigma[i] = sigma_of(
            variance * spread * inverse * inverse, rest, n.freedom, level_energy, self._noise2, n.radius
        )
        self._fit[i] = by_disc / level_energy if level_energy > 0 else 0.0
        return 1

    @cython.cfunc
    @cython.exceptval(check=False)
    def _step_cut(
        self, i: cython.Py_ssize_t, kind: cython.Py_ssize_t, cx: cython.Py_ssize_t, cy: cython.Py_ssize_t,
        phase: cython.int, step_max: cython.double, iteration: cython.int,
    ) -> cython.int:  # fmt: skip
        """The same for a pin that the border cuts: the fit of 1, d, tx, ty over the pixels there are."""
        n: Norm = self._norms[kind, phase]
        self._gather_cut(kind, cx, cy, phase)
        energy: cython.double = self._sums[0]
        seen: cython.double = self._sums[1]
        total: cython.double = self._normal[0, 4]
        if self._normal[1, 1] < self._share_min * n.d2 or seen <= 4 or not self._invert():
            return -1
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
            return -1
        rest: cython.double = energy - explained
        variance: cython.double = (rest if rest > 0 else 0.0) / (seen - 4) + 1.0 / 12.0
        ex /= amplitude
        ey /= amplitude
        far: cython.double = sqrt(square(ex, ey))
        shorten: cython.double = step_max / far if far > step_max else 1.0
        self._xy[i, 0] = cx + n.x + shorten * ex
        self._xy[i, 1] = cy + n.y + shorten * ey
        if far >= self._near and iteration < self._steps_max - 1:
            return 0
        self._amplitude[i] = ldexp(amplitude, self._shift)
        self._sigma[i] = sigma_of(
            variance * 0.5 * (self._inverse[2, 2] + self._inverse[3, 3]) / (amplitude * amplitude),
            rest, seen - 4, energy, self._noise2, n.radius,
        )  # fmt: skip
        self._fit[i] = explained / energy
        return 1

    @cython.cfunc
    @cython.exceptval(check=False)
    def _gather_cut(
        self, kind: cython.Py_ssize_t, cx: cython.Py_ssize_t, cy: cython.Py_ssize_t, phase: cython.int
    ) -> cython.void:
        """Normal equations of 1, d, tx, ty over the pixels in view; `_sums` takes their energy and number."""
        k: Kind = self._kinds[kind]
        t: cython.Py_ssize_t = self._phase_at(kind, phase)
        unit_d: cython.double = self._norms[kind, phase].unit_d
        unit_t: cython.double = self._norms[kind, phase].unit_t
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
        self._sums[0] = 0
        self._sums[1] = 0
        for j in range(k.first_span, k.end_span):
            y = cy + self._spans[j, 1]
            for i in range(self._spans[j, 2]):
                x = cx + self._spans[j, 0] + i
                at += 1
                if x < 0 or y < 0 or x >= self._columns or y >= self._rows:
                    continue
                level = cython.cast(cython.double, self._window[at])
                self._basis[0] = 1
                self._basis[1] = unit_d * self._templates[t + at]
                self._basis[2] = unit_t * self._templates[t + k.plane + at]
                self._basis[3] = unit_t * self._templates[t + 2 * k.plane + at]
                for r in range(4):
                    basis = self._basis[r]
                    for c in range(4):
                        self._normal[r, c] += basis * self._basis[c]
                    self._normal[r, 4] += basis * level
                self._sums[0] += level * level
                self._sums[1] += 1

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
def phase_of(part: cython.double) -> cython.int:
    """Index of the subpixel offset nearest to a place of [0, 1) within its pixel."""
    return cython.cast(cython.int, part * N_PHASES)


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
    kinds.half, kinds.first, kinds.plane = templates.half, templates.first, templates.plane
    kinds.first_span, kinds.end_span = end - lengths, end
    kinds.row_bytes = [-(-int(spans[:, 2].max()) // LANES) * LANES for spans in templates.spans]
    kinds.step_max = np.maximum(np.asarray(templates.half) - 2, 2) / 2
    return kinds


def _check(templates: TemplateSet, kind_of: Index, rest_amplitude: Array) -> None:
    """Raises ValueError: constants with which the loops would index out of range."""
    if kind_of.ndim != 1 or rest_amplitude.shape != kind_of.shape:
        raise ValueError("kinds and amplitudes of pins are of different numbers of pins")
    n_kinds = len(templates.half)
    if kind_of.size and (kind_of.min() < 0 or kind_of.max() >= n_kinds):
        raise ValueError(f"a pin's kind is out of range: 0 to {n_kinds - 1}")
    for half, spans, first, plane in zip(
        templates.half, templates.spans, templates.first, templates.plane, strict=True
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
        if first < 0 or first + 3 * plane * (PHASES * PHASES + 1) > templates.values.size:
            raise ValueError("a template that does not fit its table")
    if templates.norms.shape != (n_kinds, PHASES * PHASES) or templates.norms.dtype != NORM:
        raise ValueError("norms do not fit the templates")
