"""How much of a contact slides under a tangential load, before all of it does.

A contact that is dragged slips from its rim inwards. Its core still sticks and moves with the object, by s;
the skin around it is dragged along by q, which lags more and more behind s. For a
round contact with Hertz's pressure (Mindlin)

    q(s) ~ 1 - (1 - x)^(3/2),   x = s / s_slip

where s_slip is the motion at which all of it slides, and x is also the share of the contact's area that
slides. So the curvature of q over s, of pins in the contact's core and around it, shows x: no force, no
stiffness and no coefficient of friction need be known.

The path since the touch (or since it was last pressed, released or turned back) is compared with the curves
of all x; the factor between the two is fitted, and is not negative: a drag takes its surroundings along. With
the noise of the pins and an error of the model that is a share of q, this gives each x its likelihood. Before
looking, x above one half is improbable.

Rules
- A contact that is pressed or released moves its pins too: the path begins anew.
- A contact that slides as a whole at constant load moves no pin: the last share stays.
- A twist has no core that moves: it is not seen.

Source  Mindlin, "Compliance of elastic bodies in contact", J. Appl. Mech. 16, 259 (1949).

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.features.params import PARAMS, FeatureParams
from edge.types import Array, Index

if cython.compiled:
    from cython.cimports.edge.geometry.select import select_kth
    from cython.cimports.edge.geometry.views import PointsView, RowsView
    from cython.cimports.libc.math import HUGE_VAL, NAN, exp, hypot, isnan, sqrt
else:
    from math import exp, hypot, isnan, sqrt
    from math import inf as HUGE_VAL  # noqa: N812
    from math import nan as NAN  # noqa: N812

    from edge.geometry.select import select_kth
    from edge.geometry.views import PointsView, RowsView

__all__ = ["PartialSlip"]

#: Shares of the area that slides, in the middle of equal intervals; a path has as many points.
_SHARES = cython.declare(cython.Py_ssize_t, 24)


@cython.cclass
class PartialSlip:
    """The path of one touch.

    share        of the contact's area that slides; most probable mean
    probability  that it is more than half

    rest_xy      (n, 2) px
    Raises       ValueError: sizes that do not fit
    """

    share = cython.declare(cython.double, visibility="readonly")
    probability = cython.declare(cython.double, visibility="readonly")
    _n: cython.Py_ssize_t
    _rest: cython.const[cython.double][:, ::1]
    _motion_view: PointsView
    _pins_view: RowsView
    _begun: cython.bint
    _begin: cython.double[:, ::1]  # motion where the path begins
    _core: cython.int[::1]  # rows of the pins in the core, and of those around the contact
    _n_core: cython.Py_ssize_t
    _around: cython.int[::1]
    _n_around: cython.Py_ssize_t
    _is_around: cython.uchar[::1]
    _far2: cython.double[::1]  # of the contact's pins, px2 from its middle
    _some: cython.double[::1]
    _noise_s: cython.double  # px
    _noise_q: cython.double
    _s: cython.double[::1]  # the path
    _q: cython.double[::1]
    _n_path: cython.Py_ssize_t
    _spacing_px: cython.double
    _weight: cython.double[::1]  # of its points
    _curve: cython.double[::1]
    _square: cython.double[::1]  # of each share: of the path's distance from its curve, in sigmas
    _turned_sigma: cython.double
    _model_rel: cython.double
    _prior_odds: cython.double

    def __init__(self, rest_xy: Array, params: FeatureParams = PARAMS) -> None:
        n = len(rest_xy)
        if rest_xy.shape != (n, 2):
            raise ValueError(f"rest_xy ({n}, 2) is wanted, not {rest_xy.shape}")
        self._n = n
        self._rest = np.ascontiguousarray(rest_xy, np.float64)
        self._motion_view, self._pins_view = PointsView(), RowsView()
        self._begin = np.empty((n, 2))
        self._core, self._around = np.empty(n, np.int32), np.empty(n, np.int32)
        self._n_core, self._n_around = 0, 0
        self._is_around = np.empty(n, np.uint8)
        self._far2, self._some = np.empty(n), np.empty(n)
        self._noise_s = self._noise_q = 0.0
        self._s, self._q = np.empty(_SHARES + 1), np.empty(_SHARES + 1)
        self._weight, self._curve = np.empty(_SHARES + 1), np.empty(_SHARES + 1)
        self._square = np.empty(_SHARES)
        self._turned_sigma = params.contact_sigma
        self._model_rel, self._prior_odds = params.slip_model_rel, params.slip_prior_odds
        self.forget()

    def forget(self) -> None:
        """Begin a new path with the next frame."""
        self._forget()

    def update(self, motion_px: Array, pins: Index, sigma_px: cython.double) -> None:
        """The next frame of a contact that is not being pressed or released.

        motion_px  (n, 2) float64 px since rest; NaN where lost
        pins       (k,) int32, rows of the pins in the contact
        sigma_px   noise of one coordinate of one pin
        Raises     ValueError: sizes that do not fit, no such pin
        """
        motion: cython.const[cython.double][:, ::1] = self._motion_view.of(motion_px)
        rows: cython.const[cython.int][::1] = self._pins_view.of(pins)
        p: cython.Py_ssize_t
        if motion.shape[0] != self._n or motion.shape[1] != 2:
            raise ValueError(f"motion_px ({self._n}, 2) is wanted")
        for p in range(rows.shape[0]):
            if rows[p] < 0 or rows[p] >= self._n:
                raise ValueError(f"pins: rows of 0 to {self._n - 1} are wanted, not {rows[p]}")
        if self._begun:
            self._go_on(motion, rows, sigma_px)
        else:
            self._begin_with(motion, rows, sigma_px)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _forget(self) -> cython.void:
        self._begun = False
        self._n_path = 0
        self._spacing_px = 0.0
        self.share = self.probability = 0.0

    @cython.cfunc
    @cython.exceptval(check=False)
    def _begin_with(
        self,
        motion: cython.const[cython.double][:, ::1],
        pins: cython.const[cython.int][::1],
        sigma_px: cython.double,
    ) -> cython.void:
        """Choose the pins of the core, an eighth of the contact or one, and those around it."""
        i: cython.Py_ssize_t
        p: cython.Py_ssize_t
        for i in range(self._n):
            self._begin[i, 0] = motion[i, 0]
            self._begin[i, 1] = motion[i, 1]
            self._is_around[i] = not isnan(motion[i, 0])
        n: cython.Py_ssize_t = 0  # seen pins in the contact
        x: cython.double = 0.0
        y: cython.double = 0.0
        for p in range(pins.shape[0]):
            i = pins[p]
            if self._is_around[i]:
                self._is_around[i] = False
                self._core[n] = pins[p]
                n += 1
                x += self._rest[i, 0]
                y += self._rest[i, 1]
        self._n_around = 0
        for i in range(self._n):
            if self._is_around[i]:
                self._around[self._n_around] = cython.cast(cython.int, i)
                self._n_around += 1
        if n < 3 or self._n_around < 3:
            return
        x /= n
        y /= n
        for p in range(n):
            i = self._core[p]
            self._far2[p] = (self._rest[i, 0] - x) ** 2 + (self._rest[i, 1] - y) ** 2
            self._some[p] = self._far2[p]
        wanted: cython.Py_ssize_t = max(1, n // 8)
        farthest: cython.double = select_kth(self._some, n, wanted - 1)
        self._n_core = 0
        for p in range(n):
            if self._n_core < wanted and self._far2[p] <= farthest:
                self._core[self._n_core] = self._core[p]
                self._n_core += 1
        self._begun = True
        # These are of a mean over the pins, at the beginning and now.
        self._noise_s = sigma_px * sqrt(2.0 / self._n_core)
        self._noise_q = sigma_px * sqrt(2.0 / self._n_around)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _go_on(
        self,
        motion: cython.const[cython.double][:, ::1],
        pins: cython.const[cython.int][::1],
        sigma_px: cython.double,
    ) -> cython.void:
        """A new point of the path if the core has gone on; when there are many, every second one goes."""
        p: cython.Py_ssize_t
        x: cython.double = self._mean_step(motion, 0, self._core, self._n_core)
        y: cython.double = self._mean_step(motion, 1, self._core, self._n_core)
        s: cython.double = hypot(x, y)
        farthest: cython.double = self._s[self._n_path - 1] if self._n_path > 0 else 0.0
        if s < farthest - self._turned_sigma * self._noise_s:  # turned back: it sticks again
            self._forget()
            self._begin_with(motion, pins, sigma_px)
            return
        if not s > farthest + max(self._spacing_px, self._noise_s):
            return
        q: cython.double = (
            self._mean_step(motion, 0, self._around, self._n_around) * x
            + self._mean_step(motion, 1, self._around, self._n_around) * y
        ) / s
        if isnan(q):
            return
        self._s[self._n_path] = s
        self._q[self._n_path] = q
        self._n_path += 1
        self._evaluate()
        if self._n_path > _SHARES:
            self._n_path //= 2
            for p in range(self._n_path):
                self._s[p] = self._s[2 * p + 1]
                self._q[p] = self._q[2 * p + 1]
            self._spacing_px = s / self._n_path

    @cython.cfunc
    @cython.exceptval(check=False)
    def _mean_step(
        self,
        motion: cython.const[cython.double][:, ::1],
        d: cython.Py_ssize_t,
        rows: cython.int[::1],
        n: cython.Py_ssize_t,
    ) -> cython.double:
        """Mean of the first n of these pins' step since the path began, in x or y; NaN: none is seen."""
        p: cython.Py_ssize_t
        step: cython.double
        total: cython.double = 0.0
        used: cython.double = 0.0
        for p in range(n):
            step = motion[rows[p], d] - self._begin[rows[p], d]
            if not isnan(step):
                total += step
                used += 1.0
        return total / used if used > 0.0 else NAN

    @cython.cfunc
    @cython.exceptval(check=False)
    def _evaluate(self) -> cython.void:
        """Likelihood of each share, from the path."""
        k: cython.Py_ssize_t
        p: cython.Py_ssize_t
        n: cython.Py_ssize_t = self._n_path
        s: cython.double[::1] = self._s
        q: cython.double[::1] = self._q
        weight: cython.double[::1] = self._weight
        curve: cython.double[::1] = self._curve
        of_s: cython.double
        of_model: cython.double
        sticks: cython.double
        along: cython.double
        across: cython.double
        factor: cython.double
        square: cython.double
        least: cython.double = HUGE_VAL
        for p in range(n):
            of_s = q[p] / s[p] * self._noise_s
            of_model = self._model_rel * q[p]
            weight[p] = 1.0 / (self._noise_q * self._noise_q + of_s * of_s + of_model * of_model)
        for k in range(_SHARES):
            along = 0.0
            across = 0.0
            for p in range(n):
                sticks = 1.0 - (k + 0.5) / _SHARES * (s[p] / s[n - 1])
                curve[p] = 1.0 - sticks * sqrt(sticks)
                along += curve[p] * q[p] * weight[p]
                across += curve[p] * curve[p] * weight[p]
            factor = max(along, 0.0) / across
            square = 0.0
            for p in range(n):
                square += (q[p] - factor * curve[p]) ** 2 * weight[p]
            self._square[k] = square
            least = min(least, square)
        likelihood: cython.double
        total: cython.double = 0.0
        most: cython.double = 0.0
        mean: cython.double = 0.0
        for k in range(_SHARES):
            likelihood = exp(0.5 * (least - self._square[k]))
            if k + 0.5 > 0.5 * _SHARES:
                most += likelihood
            else:
                likelihood *= self._prior_odds
            total += likelihood
            mean += likelihood * (k + 0.5) / _SHARES
        self.share = mean / total
        self.probability = most / total
