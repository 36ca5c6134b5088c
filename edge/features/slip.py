"""Slip: how probable it is that most of the contact slides, and how fast its parts move against each other.

Skin that sticks to a rigid object can only move with it. A contact that is dragged slips from its rim
inwards. Its core still sticks and moves with the object, by s; the skin around it is dragged along by q,
which lags more and more behind s. For a round contact with Hertz's pressure (Mindlin)

    q(s) ~ 1 - (1 - x)^(3/2),   x = s / s_slip

where s_slip is the motion at which all of it slides, and x is also the share of the contact's area that
slides. So the curvature of q over s, of pins in the contact's core and around it, shows x: no force, no
stiffness and no coefficient of friction need be known.

The path since the touch (or since it was last pressed, released or turned back) is compared with the curves
of all x; the factor between the two is fitted, and is not negative: a drag takes its surroundings along. With
the noise of the pins and an error of the model that is a share of q, this gives each x its likelihood. Before
looking, x above one half is improbable.

The speed is the residual of the motion over the last few frames, less what a load explains (a common
translation, rotation and linear strain): the expected one, its noise subtracted, times the probability.

Rules
- While all of a contact's cells increase, or all decrease, it is pressed or released, which moves its pins
  too: no slip is reported, and the path begins anew.
- A contact that slides as a whole at constant load moves no pin: the last share stays. The steady gliding of
  a large smooth plane has no speed for a camera behind the skin.
- A twist has no core that moves: it is not seen.

Source  Mindlin, "Compliance of elastic bodies in contact", J. Appl. Mech. 16, 259 (1949).

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.features.params import PARAMS, FeatureParams
from edge.types import Array, Index, Rest

if cython.compiled:
    from cython.cimports.edge.features.pin_motion import PinMotion
    from cython.cimports.edge.geometry.select import select_kth
    from cython.cimports.libc.math import HUGE_VAL, NAN, exp, hypot, isnan, sqrt
else:
    from math import exp, hypot, isnan, sqrt
    from math import inf as HUGE_VAL  # noqa: N812
    from math import nan as NAN  # noqa: N812

    from edge.features.pin_motion import PinMotion
    from edge.geometry.select import select_kth

__all__ = ["Slip"]

#: Shares of the area that slides, in the middle of equal intervals; a path has as many points.
_SHARES = cython.declare(cython.Py_ssize_t, 24)


@cython.final
@cython.cclass
class Slip:
    """Slip of one touch, frame by frame.

    slip_px      expected rms over the contact's pins of the motion that no load explains, per frame
    share        of the contact's area that slides; most probable mean
    probability  0..1 that it is more than half
    """

    def __init__(self, rest: Rest, motion: PinMotion, params: FeatureParams = PARAMS) -> None:
        n = len(rest)
        self._n, self._motion = n, motion
        self._rest = np.ascontiguousarray(rest.xy_img, np.float64)
        self._span, self._pressing_rel = params.slip_span_frames, params.slip_pressing_rel
        self._past_px, self._past_change = np.empty((self._span, n, 2)), np.empty((self._span, n))
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
        """Drop the frames before this one: contact lost, identities lost, or slip not demanded."""
        self._n_kept = 0
        self.slip_px = 0.0
        self._forget_path()

    def update(self, area_change: Array, sigma_px: float) -> None:
        """Compare with the frame `slip_span_frames` before this one, or with the oldest since the touch.

        area_change  (n,) float64, relative, since rest; NaN where lost, or unknown
        sigma_px     noise of one coordinate of one pin in one frame
        """
        at: cython.Py_ssize_t = self._n_kept % self._span
        self.slip_px = 0.0
        if self._n_kept > 0:
            self._compare(area_change, sigma_px, min(self._n_kept, self._span))
        for i in range(self._n):
            self._past_px[at, i, 0] = self._motion.motion[i, 0]
            self._past_px[at, i, 1] = self._motion.motion[i, 1]
            self._past_change[at, i] = area_change[i]
        self._n_kept += 1

    def _compare(self, area_change: Array, sigma_px: float, span: cython.Py_ssize_t) -> None:
        """With the frame of so many before."""
        oldest: cython.Py_ssize_t = (self._n_kept - span) % self._span
        if self._motion.is_pressing(area_change, self._past_change[oldest], self._pressing_rel):
            self._forget_path()
            return
        if self._begun:
            self._go_on(sigma_px)
        else:
            self._begin_path(sigma_px)
        used: cython.Py_ssize_t = self._motion.fit_step(self._past_px[oldest])
        free: cython.Py_ssize_t = 2 * used - 6  # two components, each with three unknowns
        if free >= 4:
            unexplained: cython.double = self._motion.left_px2 - 2.0 * (sigma_px * sigma_px) * free
            self.slip_px = self.probability * sqrt(max(unexplained, 0.0) / used) / span

    def _forget_path(self) -> None:
        """Begin a new path with the next frame."""
        self._begun = False
        self._n_path = 0
        self._spacing_px = 0.0
        self.share = self.probability = 0.0

    def _begin_path(self, sigma_px: float) -> None:
        """Choose the pins of the core, an eighth of the contact or one, and those around it."""
        motion: cython.double[:, ::1] = self._motion.motion
        pins: cython.int[::1] = self._motion.pins
        for i in range(self._n):
            self._begin[i, 0] = motion[i, 0]
            self._begin[i, 1] = motion[i, 1]
            self._is_around[i] = not isnan(motion[i, 0])
        n: cython.Py_ssize_t = 0  # seen pins in the contact
        x: cython.double = 0.0
        y: cython.double = 0.0
        for p in range(self._motion.n_pins):
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

    def _go_on(self, sigma_px: float) -> None:
        """A new point of the path if the core has gone on; when there are many, every second one goes."""
        p: cython.Py_ssize_t
        x: cython.double = self._mean_step(0, self._core, self._n_core)
        y: cython.double = self._mean_step(1, self._core, self._n_core)
        s: cython.double = hypot(x, y)
        farthest: cython.double = self._s[self._n_path - 1] if self._n_path > 0 else 0.0
        if s < farthest - self._turned_sigma * self._noise_s:  # turned back: it sticks again
            self._forget_path()
            self._begin_path(sigma_px)
            return
        if not s > farthest + max(self._spacing_px, self._noise_s):
            return
        q: cython.double = (
            self._mean_step(0, self._around, self._n_around) * x
            + self._mean_step(1, self._around, self._n_around) * y
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

    def _mean_step(self, d: cython.Py_ssize_t, rows: Index, n: cython.Py_ssize_t) -> float:
        """Mean of the first n of these pins' step since the path began, in x or y; NaN: none is seen."""
        total: cython.double = 0.0
        used: cython.double = 0.0
        for p in range(n):
            step = self._motion.motion[rows[p], d] - self._begin[rows[p], d]
            if not isnan(step):
                total += step
                used += 1.0
        return total / used if used > 0.0 else NAN

    def _evaluate(self) -> None:
        """Likelihood of each share, from the path."""
        k: cython.Py_ssize_t
        n: cython.Py_ssize_t = self._n_path
        s: cython.double[::1] = self._s
        q: cython.double[::1] = self._q
        weight: cython.double[::1] = self._weight
        curve: cython.double[::1] = self._curve
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
