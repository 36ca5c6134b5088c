"""Motion of the pins: mean, the pins in the contact, torsion, and what a rigid load does not explain.

Mean motion is the paper's global shear.

Torsion is the rotation that best maps the contact's pins from rest to their present places (Procrustes):
exact for a rigid rotation of any size, independent of translation and uniform expansion. It is the rotation
of the skin at the pins; that of the object is larger by a factor of the tip (1.4 on the simulated one, flat
contact).

A step of the motion, from one frame to a later one, is split into a plane in each component (translation,
rotation and linear strain, which a load on sticking skin explains) and the residual, which `slip` tests.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.geometry.lattice import residual_stencil
from edge.geometry.neighbours import weighted_rows
from edge.geometry.select import SIGMA_OF_MAD
from edge.types import Array, Index, Rest

if cython.compiled:
    from cython.cimports.edge.geometry.neighbours import weighted_sums
    from cython.cimports.edge.geometry.select import median
    from cython.cimports.edge.geometry.views import NumbersView, PointsView, RowsView
    from cython.cimports.libc.math import NAN, atan2, fabs, isnan
else:
    from math import atan2, fabs, isnan
    from math import nan as NAN  # noqa: N812

    from edge.geometry.neighbours import weighted_sums
    from edge.geometry.select import median
    from edge.geometry.views import NumbersView, PointsView, RowsView

#: Ridge on a plane's equations, for pins on one line: 1e-9 of a pin's weight changes no other fit.
_RIDGE = cython.declare(cython.double, 1e-9)
#: Determinant of the compressed pins' covariance on the unit disc below which they are one pin, or on a line.
_FLAT = cython.declare(cython.double, 1e-12)
#: Squared semi-axes of the contact's ellipse in variances: two standard deviations, a uniform disc's own
#: edge.
_ELLIPSE = cython.declare(cython.double, 4.0)

#: Standard deviation of normal noise over the median of its size.
_SIGMA_OF_MAD = cython.declare(cython.double, SIGMA_OF_MAD)


@cython.cclass
class PinMotion:
    """Motion of the n pins of one tip.

    xy, mean  (n, 2) and (2,) px: the last places given to `since_rest`, and the mean motion; good until the
              next call
    """

    xy = cython.declare(object, visibility="readonly")
    mean = cython.declare(object, visibility="readonly")
    _xy: cython.double[:, ::1]  # the same memory
    _mean: cython.double[::1]
    _n: cython.Py_ssize_t
    _rest: cython.const[cython.double][:, ::1]
    _motion: cython.double[:, ::1]  # of `since_rest`, given last
    _motion_array: object  # the same memory
    _change_view: NumbersView
    _motion_view: PointsView
    _pins_view: RowsView
    _centre_x: cython.double  # of the tip, px
    _centre_y: cython.double
    _per_px: cython.double  # over the tip's radius
    _pins: cython.int[::1]  # of `in_contact`
    _pins_array: Index  # the same memory
    _chosen: Index  # the first of these: kernels need not look at an array again that is the same object
    _chosen_n: cython.Py_ssize_t
    _g: cython.double[:, ::1]  # (3, 5), equations of a plane: three unknowns, two right sides

    def __init__(self, rest: Rest) -> None:
        """Raises ValueError: other places than of the pins, a tip without a radius."""
        n = len(rest)
        if rest.xy_img.shape != (n, 2):
            raise ValueError(f"rest places ({n}, 2) are wanted, not {rest.xy_img.shape}")
        if not rest.pattern.tip_radius_px > 0.0:
            raise ValueError(f"a tip's radius above 0 px is wanted, not {rest.pattern.tip_radius_px:g}")
        self._n = n
        self.xy = self._xy = np.empty((n, 2))
        self.mean = self._mean = np.empty(2)
        self._rest = np.ascontiguousarray(rest.xy_img, np.float64)
        self._motion_array = None
        self._change_view, self._motion_view, self._pins_view = NumbersView(), PointsView(), RowsView()
        self._centre_x, self._centre_y = rest.pattern.centre_img.tolist()
        self._per_px = 1.0 / rest.pattern.tip_radius_px
        self._pins_array = np.empty(n, np.int32)
        self._pins = self._chosen = self._pins_array
        self._chosen_n = n
        self._g = np.empty((3, 5))

    def since_rest(
        self,
        xy: cython.const[cython.double][:, ::1],
        sigma_px: cython.const[cython.double][:],
        motion: Array,
    ) -> tuple[float, int]:
        """Motion since rest into `motion`, and its mean over the seen pins into `mean`, NaN if none is seen.

        xy, motion  (n, 2) float64 px; xy is NaN where lost, and so is the motion
        sigma_px    (n,) float64; of the seen pins finite
        Returns     mean sigma of the seen pins (0 where none is), their number
        Raises      ValueError: sizes that do not fit
        """
        n: cython.Py_ssize_t = self._n
        if motion is not self._motion_array:
            self._motion = self._motion_array = motion
        out: cython.double[:, ::1] = self._motion
        if xy.shape[0] != n or xy.shape[1] != 2 or out.shape[0] != n or out.shape[1] != 2:
            raise ValueError(f"xy and motion ({n}, 2) are wanted")
        if sigma_px.shape[0] != n:
            raise ValueError(f"sigma_px ({n},) is wanted")
        i: cython.Py_ssize_t
        n_seen: cython.Py_ssize_t = 0
        x: cython.double = 0.0
        y: cython.double = 0.0
        sigma: cython.double = 0.0
        kept: cython.double[:, ::1] = self._xy
        rest: cython.const[cython.double][:, ::1] = self._rest
        for i in range(n):
            kept[i, 0] = xy[i, 0]
            kept[i, 1] = xy[i, 1]
            out[i, 0] = xy[i, 0] - rest[i, 0]
            out[i, 1] = xy[i, 1] - rest[i, 1]
            if not isnan(xy[i, 0]):
                x += out[i, 0]
                y += out[i, 1]
                sigma += sigma_px[i]
                n_seen += 1
        if n_seen == 0:
            self._mean[0] = self._mean[1] = NAN
            return 0.0, 0
        self._mean[0] = x / n_seen
        self._mean[1] = y / n_seen
        return sigma / n_seen, n_seen

    def in_contact(self, area_change: Array, least: cython.double) -> Index:
        """Which pins are in the contact: those in the ellipse of the compressed pins' spread.

        So the middle of a flat contact, where the pins are less compressed than on its rim, belongs to it.

        area_change  (n,) float64, relative; NaN where lost
        least        smallest area change that counts as compressed
        Returns      (k,) int32 ascending, good until the next call; all pins when nothing is compressed
        Raises       ValueError: sizes that do not fit
        """
        change: cython.const[cython.double][::1] = self._change_view.of(area_change)
        if change.shape[0] != self._n:
            raise ValueError(f"area_change ({self._n},) is wanted")
        chosen_n: cython.Py_ssize_t = self._select(change, max(least, 0.0))
        if chosen_n != self._chosen_n:
            self._chosen, self._chosen_n = self._pins_array[:chosen_n], chosen_n
        return self._chosen

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def _x_disc(self, i: cython.Py_ssize_t) -> cython.double:
        """Place of a pin at rest on the tip's unit disc."""
        return (self._rest[i, 0] - self._centre_x) * self._per_px

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def _y_disc(self, i: cython.Py_ssize_t) -> cython.double:
        return (self._rest[i, 1] - self._centre_y) * self._per_px

    @cython.cfunc
    @cython.exceptval(check=False)
    def _select(
        self, area_change: cython.const[cython.double][::1], least: cython.double
    ) -> cython.Py_ssize_t:
        i: cython.Py_ssize_t
        n_pins: cython.Py_ssize_t = 0
        c: cython.double
        u: cython.double
        v: cython.double
        total: cython.double = 0.0
        x: cython.double = 0.0
        y: cython.double = 0.0
        xx: cython.double = 0.0
        xy: cython.double = 0.0
        yy: cython.double = 0.0
        for i in range(self._n):
            c = area_change[i]
            if c > least:
                u = self._x_disc(i)
                v = self._y_disc(i)
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
        det: cython.double = xx * yy - xy * xy
        pins: cython.int[::1] = self._pins
        is_ellipse: cython.bint = total > 0.0 and det > _FLAT
        for i in range(self._n):
            pins[n_pins] = cython.cast(cython.int, i)  # written over if it is not chosen
            if is_ellipse:
                u = self._x_disc(i) - x
                v = self._y_disc(i) - y
                n_pins += u * u * yy - 2.0 * u * v * xy + v * v * xx <= _ELLIPSE * det
            else:
                n_pins += not total > 0.0 or area_change[i] > least
        return n_pins

    def torsion(self, motion_px: Array, pins: Index) -> float:
        """Rotation of these pins about their own centre.

        motion_px  (n, 2) float64 px since rest; NaN where lost
        pins       (k,) int32, rows
        Returns    rad, positive from x towards y (clockwise on the screen); NaN for fewer than two seen pins
        Raises     ValueError: sizes that do not fit, no such pin
        """
        motion: cython.const[cython.double][:, ::1] = self._motion_view.of(motion_px)
        rows: cython.const[cython.int][::1] = self._pins_view.of(pins)
        self._check(motion, rows)
        i: cython.Py_ssize_t
        p: cython.Py_ssize_t
        used: cython.Py_ssize_t = 0
        x: cython.double = 0.0
        y: cython.double = 0.0
        for p in range(rows.shape[0]):
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
        bx: cython.double
        by: cython.double
        ax: cython.double
        ay: cython.double
        for p in range(rows.shape[0]):  # conj(before) after; a common shift of `after` cancels
            i = rows[p]
            if not isnan(motion[i, 0]):
                bx = self._rest[i, 0] - x
                by = self._rest[i, 1] - y
                ax = bx + motion[i, 0]
                ay = by + motion[i, 1]
                re += bx * ax + by * ay
                im += bx * ay - by * ax
        return atan2(im, re)

    def is_pressing(
        self,
        now_rel: Array,
        before: cython.const[cython.double][::1],
        pins: Index,
        least_rel: cython.double,
    ) -> bool:
        """Whether the areas of these pins' cells increase, or decrease, together.

        now_rel, before  (n,) float64, relative area change; NaN where lost
        pins             (k,) int32, rows
        least_rel        share of the sum of the changes' sizes that the size of their sum exceeds then
        Raises           ValueError: sizes that do not fit, no such pin
        """
        now: cython.const[cython.double][::1] = self._change_view.of(now_rel)
        rows: cython.const[cython.int][::1] = self._pins_view.of(pins)
        if now.shape[0] != self._n or before.shape[0] != self._n:
            raise ValueError(f"now_rel and before ({self._n},) are wanted")
        self._check_pins(rows)
        p: cython.Py_ssize_t
        change: cython.double
        total: cython.double = 0.0
        size: cython.double = 0.0
        for p in range(rows.shape[0]):
            change = now[rows[p]] - before[rows[p]]
            if not isnan(change):
                total += change
                size += fabs(change)
        return fabs(total) > least_rel * size

    def fit_step(
        self,
        now_px: Array,
        before: cython.const[cython.double][:, ::1],
        pins: Index,
    ) -> tuple[int, float, float]:
        """Fit a plane to each component of these pins' step from `before` to `now_px`.

        now_px, before  (n, 2) float64 px, motion since rest; NaN where lost
        pins            (k,) int32, rows
        Returns         number of pins seen in both; sum of their steps' squares, px2; sum of the squared
                        residuals of the planes
        Raises          ValueError: sizes that do not fit, no such pin
        """
        now: cython.const[cython.double][:, ::1] = self._motion_view.of(now_px)
        rows: cython.const[cython.int][::1] = self._pins_view.of(pins)
        self._check(now, rows)
        if before.shape[0] != self._n or before.shape[1] != 2:
            raise ValueError(f"before ({self._n}, 2) is wanted")
        i: cython.Py_ssize_t
        p: cython.Py_ssize_t
        used: cython.Py_ssize_t = 0
        dx: cython.double
        dy: cython.double
        square: cython.double = 0.0
        left: cython.double = 0.0
        self._g[:, :] = 0.0
        for p in range(rows.shape[0]):
            i = rows[p]
            dx = now[i, 0] - before[i, 0]
            dy = now[i, 1] - before[i, 1]
            if not isnan(dx):
                self._add(self._x_disc(i), self._y_disc(i), dx, dy)
                square += dx * dx + dy * dy
                used += 1
        if used == 0:
            return 0, 0.0, 0.0
        for i in range(3):
            self._g[i, i] += _RIDGE
        self._solve_plane()
        for p in range(rows.shape[0]):
            i = rows[p]
            dx = now[i, 0] - before[i, 0]
            dy = now[i, 1] - before[i, 1]
            if not isnan(dx):
                dx = dx - self._g[0, 3] - self._g[1, 3] * self._x_disc(i) - self._g[2, 3] * self._y_disc(i)
                dy = dy - self._g[0, 4] - self._g[1, 4] * self._x_disc(i) - self._g[2, 4] * self._y_disc(i)
                left += dx * dx + dy * dy
        return used, square, left

    @cython.cfunc
    def _check(
        self, motion: cython.const[cython.double][:, ::1], pins: cython.const[cython.int][::1]
    ) -> cython.bint:
        """Raises ValueError: sizes that do not fit, no such pin."""
        if motion.shape[0] != self._n or motion.shape[1] != 2:
            raise ValueError(f"motion ({self._n}, 2) is wanted")
        return self._check_pins(pins)

    @cython.cfunc
    def _check_pins(self, pins: cython.const[cython.int][::1]) -> cython.bint:
        """Raises ValueError: no such pin."""
        p: cython.Py_ssize_t
        for p in range(pins.shape[0]):
            if pins[p] < 0 or pins[p] >= self._n:
                raise ValueError(f"pins: rows of 0 to {self._n - 1} are wanted, not {pins[p]}")
        return True

    @cython.cfunc
    @cython.exceptval(check=False)
    def _add(self, u: cython.double, v: cython.double, dx: cython.double, dy: cython.double) -> cython.void:
        """Add one pin to the planes' equations; upper triangle."""
        self._g[0, 0] += 1.0
        self._g[0, 1] += u
        self._g[0, 2] += v
        self._g[1, 1] += u * u
        self._g[1, 2] += u * v
        self._g[2, 2] += v * v
        self._g[0, 3] += dx
        self._g[1, 3] += u * dx
        self._g[2, 3] += v * dx
        self._g[0, 4] += dy
        self._g[1, 4] += u * dy
        self._g[2, 4] += v * dy

    @cython.cfunc
    @cython.exceptval(check=False)
    def _solve_plane(self) -> cython.void:
        """Gauss-Jordan on `_g`: its right sides become the coefficients of 1, x, y for each component."""
        g: cython.double[:, ::1] = self._g
        r: cython.Py_ssize_t
        c: cython.Py_ssize_t
        row: cython.Py_ssize_t
        pivot: cython.double
        factor: cython.double
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


@cython.cclass
class PinNoise:
    """Measures the noise of the n pins of one tip: behind glare it is 3 to 10 times what their sigmas claim.

    Over two pitches the motion of the skin is nearly a quadratic of the rest place. A pin's residual from the
    quadratic through its two rings is its error.
    """

    _rest: cython.const[cython.double][:, ::1]
    _start: cython.int[::1]
    _near: cython.ushort[::1]
    _weight: cython.float[::1]
    _motion: cython.float[::1]  # (2 n,), single precision: its error is 1e-6 px
    _residual: cython.float[::1]
    _sizes: cython.double[::1]

    def __init__(self, rest_xy: Array, pitch_px: float) -> None:
        self._rest = np.ascontiguousarray(rest_xy, np.float64)
        self._start, self._near, self._weight = weighted_rows(*residual_stencil(rest_xy, pitch_px))
        self._motion, self._residual = np.zeros((2, 2 * len(rest_xy)), np.float32)
        self._sizes = np.empty(2 * len(rest_xy))

    def sigma_px(
        self, xy: cython.const[cython.double][:, ::1], seen: cython.const[cython.uchar][::1]
    ) -> float:
        """Noise of one coordinate of a pin: robust to a few outliers.

        xy       (n, 2) float64 px, where the pins are; finite
        seen     (n,) bool
        Returns  px, one sigma; 0 where no pin is seen
        Raises   ValueError: sizes that do not fit
        """
        n: cython.Py_ssize_t = self._rest.shape[0]
        if xy.shape[0] != n or xy.shape[1] != 2 or seen.shape[0] != n:
            raise ValueError(f"xy ({n}, 2) and seen ({n},) are wanted")
        i: cython.Py_ssize_t
        n_sizes: cython.Py_ssize_t = 0
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
        return _SIGMA_OF_MAD * median(sizes, n_sizes) if n_sizes else 0.0
