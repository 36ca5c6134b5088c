# cython: infer_types=True
"""Motion of the pins, and area changes of their cells: mean motion, the pins in the contact, torsion, what a
rigid load does not explain; volume.

Mean motion is the paper's global shear.

Torsion is the rotation that best maps the contact's pins from rest to their present places (Procrustes):
exact for a rigid rotation of any size, independent of translation and uniform expansion. It is the rotation
of the skin at the pins; that of the object is larger by a factor of the tip (1.4 on the simulated one, flat
contact).

A step of the motion, from one frame to a later one, is split into a plane in each component (translation,
rotation and linear strain, which a load on sticking skin explains) and the residual, which `slip` tests.

A lost pin's cell changes as the skin between its neighbours does: by the determinant of the motion's
gradient.

The volume is the paper's, the integral of the surface through the area changes. The pins' cells at rest tile
the tip, so the sum over them is that integral; a grid adds nothing (docs/tuning.md, "Volume"). With a fixed
boundary the areas sum to a constant and so does the plain integral. The volume is therefore that of the
compressed (positive) part. Rectified noise has a positive mean: changes below the noise's threshold count as
zero, those above twice the threshold in full (firm shrinkage; Gao and Bruce, WaveShrink with firm shrinkage,
Statistica Sinica 7, 1997), so that an untouched tip has volume zero and a pressed one no bias.
"""

import cython
import numpy as np
from cython.cimports.libc.math import atan2, fabs, isnan, sqrt

from edge.features.modes import MODE_MIRROR
from edge.geometry.lattice import residual_stencil, slope_stencil
from edge.geometry.neighbours import weighted_rows
from edge.types import Array, Complex, Mask, Rest

if cython.compiled:
    from cython.cimports.edge.geometry.copies import Copies, numbers_of
    from cython.cimports.edge.geometry.neighbours import weighted_sums
    from cython.cimports.edge.geometry.select import sigma_of
else:
    from edge.geometry.copies import Copies, numbers_of
    from edge.geometry.neighbours import weighted_sums
    from edge.geometry.select import sigma_of

NAN = cython.declare(cython.double, float("nan"))
#: Ridge on a plane's equations, for pins on one line: 1e-9 of a pin's weight changes no other fit.
_RIDGE = cython.declare(cython.double, 1e-9)
#: Determinant of the compressed pins' covariance on the unit disc below which they are one pin, or on a line.
_FLAT = cython.declare(cython.double, 1e-12)
#: Squared semi-axes of the contact's ellipse in variances: two standard deviations, a uniform disc's own
#: edge.
_ELLIPSE = cython.declare(cython.double, 4.0)
#: The number of modes.
ROW = 21


class PinMotion:
    """Motion of the n pins of one tip. Good until the next frame:

    xy, motion  (n, 2) px: the last places given to `since_rest`, and the motion since rest; NaN where lost
    mean        (2,) px: mean motion of the seen pins; NaN if none is seen
    sigma_px, sigma_max_px  mean and largest sigma of the seen pins; 0 if none is seen
    longest_px, step_px  px: longest motion of a pin since rest, and since the last places
    pins        (n,) int32, ascending: the first n_pins are those in the contact, of `find_contact`
    """

    def __init__(self, rest: Rest) -> None:
        """Raises ValueError: other places than of the pins, a tip without a radius."""
        n = len(rest)
        if rest.xy_img.shape != (n, 2):
            raise ValueError(f"rest places ({n}, 2) are wanted, not {rest.xy_img.shape}")
        if not rest.pattern.tip_radius_px > 0.0:
            raise ValueError(f"a tip's radius above 0 px is wanted, not {rest.pattern.tip_radius_px:g}")
        self._n = n
        xy, motion = np.zeros((2, n, 2))
        self.xy, self.motion, self.mean = xy, motion, np.zeros(2)
        self._xy, self._motion = xy.ravel(), motion.ravel()
        self.sigma_px = self.sigma_max_px = self.longest_px = self.step_px = 0.0
        self._rest, self._no_offset = np.ascontiguousarray(rest.xy_img, np.float64), np.zeros(2)
        self._at_rest = np.ravel(self._rest)
        self._x0, self._y0 = rest.pattern.centre_img.tolist()
        self._per_px = 1.0 / rest.pattern.tip_radius_px
        self.pins, self.n_pins = np.arange(n, dtype=np.int32), n
        self._g = np.empty((3, 5))

    def since_rest(self, xy: Array, sigma_px: Array, offset_px: Array | None = None) -> int:
        """Take the places of a frame's pins; how many are seen.

        xy         (n, 2) float64 px; NaN where lost
        sigma_px   (n,) float64; of the seen pins finite
        offset_px  (n, 2) float64 px, finite, to be subtracted from the places; None: nothing is
        Raises     ValueError: sizes that do not fit
        """
        n = n_seen = self._n
        x = y = sigma = widest = longest2 = step2 = 0.0
        kept: cython.double[::1] = self._xy
        out: cython.double[::1] = self._motion
        rest: cython.const[cython.double][::1] = self._at_rest
        at, sigmas = numbers_of(xy, 2 * n), numbers_of(sigma_px, n)
        is_still: cython.bint = offset_px is None
        offset = numbers_of(self._no_offset, 2) if is_still else numbers_of(offset_px, 2 * n)
        kept_bits: cython.Py_ssize_t = 0 if is_still else -1  # of an index of the offset
        for i in range(n):
            k = 2 * i & kept_bits
            at_x, at_y = at[2 * i] - offset[k], at[2 * i + 1] - offset[k + 1]
            u, v = at_x - rest[2 * i], at_y - rest[2 * i + 1]
            du, dv = u - out[2 * i], v - out[2 * i + 1]  # all is read first: in vectors of two
            kept[2 * i], kept[2 * i + 1] = at_x, at_y
            out[2 * i], out[2 * i + 1] = u, v
            step2 = du * du + dv * dv if du * du + dv * dv > step2 else step2
            longest2 = u * u + v * v if u * u + v * v > longest2 else longest2
            widest = sigmas[i] if sigmas[i] > widest else widest
            x += u
            y += v
            sigma += sigmas[i]
        if isnan(x):  # some are lost
            x = y = sigma = 0.0
            n_seen = 0
            for i in range(n):
                if not isnan(out[2 * i]):
                    x, y = x + out[2 * i], y + out[2 * i + 1]
                    sigma += sigmas[i]
                    n_seen += 1
        self.longest_px, self.step_px, self.sigma_max_px = sqrt(longest2), sqrt(step2), widest
        self.mean[0] = x / n_seen if n_seen else NAN
        self.mean[1] = y / n_seen if n_seen else NAN
        self.sigma_px = sigma / n_seen if n_seen else 0.0
        return n_seen

    def find_contact(self, area_change: Array, least: float) -> int:
        """Which pins are in the contact: those in the ellipse of the compressed pins' spread; how many.

        So the middle of a flat contact, where the pins are less compressed than on its rim, belongs to it.

        area_change  (n,) float64, relative; NaN where lost
        least        smallest area change that counts as compressed, 0 or more; all pins are in the contact
                     when nothing is compressed
        """
        n_pins: cython.Py_ssize_t = 0
        total = x = y = xx = xy = yy = 0.0
        rest: cython.const[cython.double][:, ::1] = self._rest
        for i in range(self._n):
            c = area_change[i]
            if c > least:
                u = (rest[i, 0] - self._x0) * self._per_px
                v = (rest[i, 1] - self._y0) * self._per_px
                total += c
                x += c * u
                y += c * v
                xx += c * u * u
                xy += c * u * v
                yy += c * v * v
        if total > 0.0:
            x /= total
            y /= total
            xx = xx / total - x * x
            xy = xy / total - x * y
            yy = yy / total - y * y
        det = xx * yy - xy * xy
        pins: cython.int[::1] = self.pins
        is_ellipse: cython.bint = total > 0.0 and det > _FLAT
        px: cython.double = 1.0 / self._per_px
        x, y = x * px + self._x0, y * px + self._y0  # from here on in px
        for i in range(self._n):
            pins[n_pins] = cython.cast(cython.int, i)  # written over if it is not chosen
            if is_ellipse:
                u, v = rest[i, 0] - x, rest[i, 1] - y
                n_pins += u * (u * yy - 2.0 * v * xy) + v * v * xx <= _ELLIPSE * det * px * px
            else:
                n_pins += not total > 0.0 or area_change[i] > least
        self.n_pins = n_pins
        return n_pins

    def torsion(self) -> float:
        """Rotation of the contact's pins about their centre, rad, from x to y; NaN for fewer than two."""
        rows: cython.int[::1] = self.pins
        motion: cython.double[:, ::1] = self.motion
        used = 0
        x: cython.double = 0.0
        y: cython.double = 0.0
        for p in range(self.n_pins):
            i = rows[p]
            if not isnan(motion[i, 0]):
                x += self._rest[i, 0]
                y += self._rest[i, 1]
                used += 1
        if used < 2:
            return NAN
        x /= used
        y /= used
        re: cython.double = 0.0
        im: cython.double = 0.0
        for p in range(self.n_pins):  # conj(before) after; a common shift of `after` cancels
            i = rows[p]
            if not isnan(motion[i, 0]):
                bx = self._rest[i, 0] - x
                by = self._rest[i, 1] - y
                ax = bx + motion[i, 0]
                ay = by + motion[i, 1]
                re += bx * ax + by * ay
                im += bx * ay - by * ax
        return atan2(im, re)

    def is_pressing(self, now: Array, before: Array, least_rel: float, least: float) -> bool:
        """Whether the areas of the cells in the contact increase, or decrease, together.

        now, before  (n,) float64, relative area change; NaN where lost
        least_rel    share of the sum of the changes' sizes that the size of their sum exceeds then
        least        what it exceeds, too
        """
        rows: cython.int[::1] = self.pins
        of_now, of_before = numbers_of(now, self._n), numbers_of(before, self._n)
        total: cython.double = 0.0
        size: cython.double = 0.0
        for p in range(self.n_pins):
            change = of_now[rows[p]] - of_before[rows[p]]
            if not isnan(change):
                total += change
                size += fabs(change)
        return fabs(total) > max(least_rel * size, least)

    def fit_step(self, before: Array) -> int:
        """Fit a plane to each component of the step of the contact's pins since an earlier frame; how many
        are seen in both. `left_px2` is the sum of the planes' squared residuals, `curl` the size of their
        curl over the unit disc.

        before  (n, 2) float64 px, motion since rest; NaN where lost
        """
        rows: cython.int[::1] = self.pins
        now: cython.double[:, ::1] = self.motion
        rest: cython.const[cython.double][:, ::1] = self._rest
        was = numbers_of(before, 2 * self._n)
        used = 0
        dx: cython.double
        dy: cython.double
        left: cython.double = 0.0
        row: cython.double[5] = [1.0] * 5  # 1, x, y, and the two right sides
        self._g[:, :] = 0.0
        for p in range(self.n_pins):
            i = rows[p]
            dx = now[i, 0] - was[2 * i]
            dy = now[i, 1] - was[2 * i + 1]
            if not isnan(dx):
                row[1], row[2] = (
                    (rest[i, 0] - self._x0) * self._per_px,
                    (rest[i, 1] - self._y0) * self._per_px,
                )
                row[3], row[4] = dx, dy
                for j in range(3):
                    for k in range(j, 5):
                        self._g[j, k] += row[j] * row[k]
                used += 1
        for i in range(3):
            self._g[i, i] += _RIDGE
        self._solve_plane()
        for p in range(self.n_pins):
            i = rows[p]
            dx = now[i, 0] - was[2 * i]
            dy = now[i, 1] - was[2 * i + 1]
            if not isnan(dx):
                u = (rest[i, 0] - self._x0) * self._per_px
                v = (rest[i, 1] - self._y0) * self._per_px
                dx = dx - self._g[0, 3] - self._g[1, 3] * u - self._g[2, 3] * v
                dy = dy - self._g[0, 4] - self._g[1, 4] * u - self._g[2, 4] * v
                left += dx * dx + dy * dy
        self.left_px2 = left
        self.curl = fabs(self._g[1, 4] - self._g[2, 3])
        return used

    def _solve_plane(self) -> None:
        """Gauss-Jordan on `_g`: its right sides become the coefficients of 1, x, y for each component."""
        g: cython.double[:, ::1] = self._g
        g[1, 0], g[2, 0], g[2, 1] = g[0, 1], g[0, 2], g[1, 2]
        for r in range(3):
            pivot = g[r, r]
            for c in range(r, 5):
                g[r, c] /= pivot
            for row in range(3):
                if row != r:
                    factor = g[row, r]
                    for c in range(r, 5):
                        g[row, c] -= factor * g[r, c]


class ModeProduct:
    """The modes of all n pins' motion: a product with `Modes.of_all` in single precision, whose error is 1e-7
    of the motion.

    Mode (b, a) is the conjugate of mode (a, b): real sums, of the latter's real and imaginary part, give the
    coefficients of both.
    """

    def __init__(self, of_all: Complex) -> None:
        rows = np.zeros((of_all.shape[1], ROW), np.float32)
        for column, mirror in enumerate(MODE_MIRROR):
            rows[:, column] = of_all[column].real if column <= mirror else -of_all[mirror].imag
        self._rows = rows
        self._mirror = np.array(MODE_MIRROR, np.int32)
        self._result = result = np.zeros(len(MODE_MIRROR), np.complex128)
        self._results = Copies(result)

    def fit(self, motion: Array) -> Complex:
        """Coefficients (21,) complex128 px of the motion (n, 2) float64 px."""
        of_x: cython.float[21] = [0.0] * 21  # these stay in registers until all pins are in: ROW numbers each
        of_y: cython.float[21] = [0.0] * 21
        rows: cython.const[cython.float][:, ::1] = self._rows
        for i in range(rows.shape[0]):
            x = cython.cast(cython.float, motion[i, 0])
            y = cython.cast(cython.float, motion[i, 1])
            for j in range(21):
                of_x[j] += rows[i, j] * x
                of_y[j] += rows[i, j] * y
        for j in range(self._mirror.shape[0]):
            m = self._mirror[j]
            if j == m:
                self._result[j] = of_x[j] + 1j * of_y[j]
            elif j < m:
                self._result[j] = (of_x[j] + of_y[m]) + 1j * (of_y[j] - of_x[m])
                self._result[m] = (of_x[j] - of_y[m]) + 1j * (of_y[j] + of_x[m])
        return self._results.take()


class AreaChange:
    """Area changes of one frame of one tip with n pins; `values` (n,) float64, good until the next frame.

    rest_xy, pitch_px  (n, 2) px, and their pitch
    rest_area_px2      (n,) of each pin's cell at rest
    Raises             ValueError: sizes that do not fit
    """

    def __init__(self, rest_xy: Array, pitch_px: float, rest_area_px2: Array) -> None:
        n = len(rest_xy)
        if rest_xy.shape != (n, 2) or rest_area_px2.shape != (n,):
            raise ValueError(f"rest_xy (n, 2) and rest_area_px2 (n,) are wanted, not {rest_area_px2.shape}")
        self._n = n
        self._rest = np.ascontiguousarray(rest_xy, np.float64)
        self._rest_area = np.array(rest_area_px2, np.float64)
        self._inverse_area = 1.0 / rest_area_px2
        self._ring, self._slope = slope_stencil(rest_xy, pitch_px)
        self.values = np.zeros(n)

    def since_rest(self, area_px2: Array, out: Array) -> None:
        """Relative change of each cell's area, written to `out`; NaN where lost.

        area_px2, out  (n,) float64
        Raises         ValueError: another number of cells
        """
        areas = numbers_of(area_px2, self._n)
        for i in range(self._n):
            out[i] = areas[i] * self._inverse_area[i] - 1.0

    def fill(self, change: Array, xy: Array) -> None:
        """`values`: the area changes, gaps filled.

        change  (n,) float64, relative; NaN where lost
        xy      (n, 2) float64 px, where the pins are; finite
        """
        for i in range(self._n):
            self.values[i] = change[i]
            if isnan(change[i]):
                self.values[i] = self._between(xy, i)

    def volume(self, threshold: float) -> float:
        """Integral of the compressed part of `values`, px2; changes below the threshold are noise."""
        total: cython.double = 0.0
        for i in range(self._n):
            ramp = self.values[i] - threshold
            if ramp > 0.0:
                total += self._rest_area[i] * min(ramp + ramp, self.values[i])
        return total

    def _between(self, xy: Array, i: cython.Py_ssize_t) -> float:
        """Area change at pin i by the motion of its ring: the determinant of the gradient, less 1."""
        xx = xy_ = yx = yy = 0.0
        for k in range(self._ring.shape[1]):
            j = self._ring[i, k]
            x = xy[j, 0] - self._rest[j, 0]
            y = xy[j, 1] - self._rest[j, 1]
            xx += self._slope[i, 0, k] * x
            xy_ += self._slope[i, 1, k] * x
            yx += self._slope[i, 0, k] * y
            yy += self._slope[i, 1, k] * y
        return (1.0 + xx) * (1.0 + yy) - xy_ * yx - 1.0


class PinNoise:
    """Measures the noise of the n pins of one tip: behind glare it is 3 to 10 times what their sigmas claim.

    Over two pitches the motion of the skin is nearly a quadratic of the rest place. A pin's residual from the
    quadratic through its two rings is its error.
    """

    def __init__(self, rest_xy: Array, pitch_px: float) -> None:
        self._rest = np.ascontiguousarray(rest_xy, np.float64)
        self._start, self._near, self._weight = weighted_rows(*residual_stencil(rest_xy, pitch_px))
        self._motion, self._residual = np.zeros((2, 2 * len(rest_xy)), np.float32)
        self._sizes = np.empty(2 * len(rest_xy))

    def sigma_px(self, xy: Array, seen: Mask) -> float:
        """Noise of one coordinate of a pin: robust to a few outliers.

        xy       (n, 2) float64 px, where the pins are; finite
        seen     (n,) bool
        Returns  px, one sigma; 0 where no pin is seen
        """
        n = self._rest.shape[0]
        n_sizes = 0
        motion: cython.float[::1] = self._motion
        residual: cython.float[::1] = self._residual
        sizes: cython.double[::1] = self._sizes
        for i in range(n):
            motion[2 * i] = cython.cast(cython.float, xy[i, 0] - self._rest[i, 0])
            motion[2 * i + 1] = cython.cast(cython.float, xy[i, 1] - self._rest[i, 1])
        weighted_sums(self._start, self._near, self._weight, motion, residual)
        for i in range(n):
            if seen[i]:
                sizes[n_sizes] = fabs(residual[2 * i])
                sizes[n_sizes + 1] = fabs(residual[2 * i + 1])
                n_sizes += 2
        return sigma_of(sizes, n_sizes) if n_sizes else 0.0
