# cython: infer_types=True
"""Slip and vibration: the contact's pins from frame to frame.

Slip: how probable it is that much of the contact slides, and how fast its parts move against each other.

Skin that sticks to a rigid object can only move with it. A contact that is dragged, or twisted, slips from
its rim inwards. Its core still sticks and moves with the object, by s; the skin around it is dragged along
by q, which lags more and more behind s. For a round contact, of whose area a share x slides,

    dragged (Mindlin)   q ~ 1 - (1 - x)^1.75  s ~ x
    twisted (Lubkin)    q ~ 1 - (1 - x)^1.7   s ~ -log(1 - x), an angle, to 2 %

So the curvature of q over s shows x: no force, no stiffness and no coefficient of friction need be known. Of
a drag the power is 1.5 on a half-space (Hertz's pressure) and 2 on a layer that is thin for the contact (a
paraboloid of pressure, and each part sticks for itself); a tip is between them. s is a mean over the
contact's pins, with weights that fall off within a sixth of its area: 98 % of them lie where it still sticks
while a third slides. q is one over all pins around it, with the weights r^-3: what is near moves most, and
depends least on how the tip is held. Angles come from those weights over r. The contact's middle and radius
are those of its compression. The skin evens its motion over about a pitch, so that the core takes part in the
lag: of a disc evened by a Gaussian of that width, exp(-r^2 / 2) of the surroundings reach the middle, r its
radius in pitches. The smaller a contact, the less its curve shows.

The path since the touch (or since it was last pressed, released or turned back) is compared with the curves
of all x. It begins at the mean of the frames in which nothing moved. The factor between path and curve is
fitted, and is not negative: a drag takes its surroundings along. With the noise of the pins, and an error of
the model that is the spread of x within its step, this gives each x its likelihood. The model's error is one
of the whole path, so that a fast drag, of few points, is judged as a slow one. Before looking, x above a
third is improbable, and a path of n points has been looked at n times: the odds grow with the root of that.
Drag and twist each have their probability; the larger one is that of slip.

The speed is the residual of the motion over the last few frames, less what a load explains (a common
translation, rotation and linear strain): the expected one, its noise subtracted, times the probability.

Rules of slip
- While all of a contact's cells increase, or all decrease, by more than by noise and than it turns, it is
  pressed or released, which moves its pins too: after two such frames no slip is reported, and the path
  begins anew. A single one may be noise, of a contact of three pins: the probability stays.
- A touch that goes on after a gap, or after slip was not demanded, may slide already, and its curve would
  not show it: nothing is known until it turns back, or is pressed or released.
- A contact that slides as a whole at constant load moves no pin: the last share stays. The steady gliding of
  a large smooth plane has no speed for a camera behind the skin.

Vibration: rms motion of the contact's pins above a cut-off frequency, as texture and stick-slip make it.

Rules of vibration
- The filter is two high-passes of first order in a row, by the bilinear transform: -3 dB at the cut-off,
  gain 1 at half the frame rate. A steady motion leaves nothing, one that gains speed slowly hardly anything.
  The coefficients follow from the time between two captures, so that the cut-off is the same at any rate.
- The square is averaged over the contact's pins, and over one period of the cut-off. The part that the
  centroids' noise has in it is known, as it passes the same filter, and is subtracted.
- A pin that joins the contact, or is found again, begins where the others are on average.
- NaN until a contact, or the frames after a gap, have lasted for that period, and where the frame rate is
  too low for the band. Zero without a contact.

Source  Mindlin, "Compliance of elastic bodies in contact", J. Appl. Mech. 16, 259 (1949); Lubkin, "The
        torsion of elastic spheres in contact", J. Appl. Mech. 18, 183 (1951), by numbers; Oppenheim, Schafer,
        "Discrete-Time Signal Processing", section 7.1.2: the bilinear transform
"""

import cython
import numpy as np
from cython.cimports.libc.math import exp, fabs, hypot, isnan, sqrt, tan

from edge.features.params import CELL_NOISE, PARAMS
from edge.features.pin_motion import PinMotion
from edge.params import PARAMS as RUNTIME
from edge.types import Array, Index, Rest

if cython.compiled:
    from cython.cimports.edge.geometry.copies import numbers_of
else:
    from edge.geometry.copies import numbers_of

HUGE_VAL = cython.declare(cython.double, float("inf"))
M_PI = cython.declare(cython.double, np.pi)
NAN = cython.declare(cython.double, float("nan"))
#: Shares of the area that slides, in the middle of equal intervals; a path has as many points.
_SHARES = cython.declare(cython.Py_ssize_t, 24)


def _curves() -> Array:
    """(2, _SHARES, _SHARES + 1), q over s, evenly up to each share, of a drag and of a twist."""
    sticks = 1.0 - (np.arange(_SHARES)[:, None] + 0.5) / _SHARES
    s = np.arange(_SHARES + 1) / _SHARES
    return 1.0 - np.stack([(1.0 - (1.0 - sticks) * s) ** 1.75, sticks ** (1.7 * s)])


#: rms in px, and the upper end of its band in Hz; None: there is none.
Rms = tuple[float | None, float | None]


class Slip:
    """Slip of one touch, frame by frame.

    slip_px      expected rms over the contact's pins of the motion that no load explains since the last frame
    probability  0..1 that more than a third of the contact's area slides
    of_twist     the same of a twist alone
    unseen       the path did not begin with the touch, and may be one of a contact that slid already
    """

    def __init__(self, rest: Rest, motion: PinMotion) -> None:
        n = len(rest)
        self._n, self._motion = n, motion
        self._rest = np.ascontiguousarray(rest.xy_img, np.float64)
        self._span, self._pressing_rel = PARAMS.slip_span_frames, PARAMS.slip_pressing_rel
        self._gap_ns = self._span * RUNTIME.announced_s * 1e9  # The clock was set if more passes.
        self._begin = np.empty((n, 2))
        self._core, self._around = np.empty(n, np.int32), np.empty(n, np.int32)
        self._n_core, self._n_around = 0, 0
        self._is_around = np.empty(n, np.uint8)
        self._weight, self._across = np.empty(n), np.empty((n, 2))
        self._pitch_px, self._tip_radius_px = rest.pattern.pitch_px, rest.pattern.tip_radius_px
        self._curves = _curves()
        self._of_core, self._of_around = np.empty(3), np.empty(3)
        self._noise_s, self._noise_q, self._lag = np.empty(2), 0.0, 0.0
        self._n_path, self._spacing = np.zeros(2, np.int32), np.zeros(2)
        self._s, self._q = np.empty((2, _SHARES + 1)), np.empty((2, _SHARES + 1))
        self._weight_of, self._curve = np.empty(_SHARES + 1), np.empty(_SHARES + 1)
        self._square, self._probable = np.empty(_SHARES), np.zeros(2)
        self._sigmas, self._prior_odds = PARAMS.contact_sigma, PARAMS.slip_prior_odds
        self.forget()

    def forget(self, touched: cython.bint = False) -> None:
        """Drop the frames before: identities lost, or slip not demanded; touched: while something touched."""
        past: list[tuple[Array, Array, int]] = []
        self._past, self._presses = past, False
        self.slip_px = 0.0
        self._forget_path()
        self.unseen = touched

    def update(self, motion_px: Array, area_change: Array, sigma_px: float, at_ns: cython.longlong) -> None:
        """Compare with the frame `slip_span_frames` before this one, or with the oldest since the touch.

        motion_px    (n, 2) float64, that of the pins, in an array that stays as it is
        area_change  (n,) float64, relative, since rest; NaN where lost, or unknown; it stays, too
        sigma_px     noise of one coordinate of one pin in one frame
        at_ns        when it was taken; 0, or more than 0.1 s apart: the frames came evenly
        """
        self.slip_px = 0.0
        if self._past:
            self._compare(area_change, sigma_px, at_ns)
        if len(self._past) == self._span:
            del self._past[0]
        self._past.append((motion_px, area_change, at_ns))

    def _compare(self, area_change: Array, sigma_px: float, at_ns: cython.longlong) -> None:
        """Compare with the oldest frame that is kept."""
        motion_px, change, begun_ns = self._past[0]
        used = self._motion.fit_step(motion_px)
        n = self._motion.n_pins
        noise = self._sigmas * CELL_NOISE * sigma_px / self._pitch_px * sqrt(2.0 * n)
        turns = n * self._motion.curl / self._tip_radius_px
        least = max(noise, turns)
        if self._motion.is_pressing(area_change, change, self._pressing_rel, least):
            if self._presses:
                self._forget_path()
            self._presses = True
            return
        self._presses = False
        if self._begun:
            self._go_on(area_change, sigma_px)
        else:
            self._begin_path(area_change)
        free = 2 * used - 6  # two components, each with three unknowns
        if free >= 4:
            unexplained = self._motion.left_px2 - 2.0 * (sigma_px * sigma_px) * free
            n_past = len(self._past)
            before_ns: cython.longlong = self._past[n_past - 1][2]
            span_ns: cython.double = at_ns - begun_ns
            of_step = (at_ns - before_ns) / span_ns if 0.0 < span_ns < self._gap_ns else 1.0 / n_past
            self.slip_px = self.probability * sqrt(max(unexplained, 0.0) / used) * of_step

    def _forget_path(self) -> None:
        """Begin a new path with the next frame."""
        self._begun = self.unseen = False
        for k in range(2):
            self._n_path[k] = 0
            self._spacing[k] = 0.0
            self._probable[k] = 0.0
        self.probability = self.of_twist = 0.0

    def _begin_path(self, area_change: Array) -> None:
        """Weigh the pins of the contact, and those around it."""
        motion: cython.double[:, ::1] = self._motion.motion
        pins: cython.int[::1] = self._motion.pins
        changes = numbers_of(area_change, self._n)
        for i in range(self._n):
            self._begin[i, 0] = motion[i, 0]
            self._begin[i, 1] = motion[i, 1]
            self._is_around[i] = not isnan(motion[i, 0])
        n = 0  # seen pins in the contact
        compressed = x = y = square = 0.0
        for p in range(self._motion.n_pins):
            i = pins[p]
            if self._is_around[i]:
                self._is_around[i] = False
                self._core[n] = pins[p]
                n += 1
                c = changes[i] if changes[i] > 1e-9 else 1e-9  # all alike where they are unknown
                compressed += c
                x += c * self._rest[i, 0]
                y += c * self._rest[i, 1]
                square += c * (self._rest[i, 0] ** 2 + self._rest[i, 1] ** 2)
        self._n_core, self._n_around = n, 0
        for i in range(self._n):
            if self._is_around[i]:
                self._around[self._n_around] = cython.cast(cython.int, i)
                self._n_around += 1
        if n < 3 or self._n_around < 3:
            return
        x /= compressed
        y /= compressed
        pitch2 = self._pitch_px * self._pitch_px
        radius2 = max(2.0 * (square / compressed - x * x - y * y), 5.0 / 18.0 * pitch2)  # one cell's, or more
        self._lag = exp(-0.5 * radius2 / pitch2)
        for i in range(self._n):
            dx = self._rest[i, 0] - x
            dy = self._rest[i, 1] - y
            self._across[i, 0], self._across[i, 1] = -dy, dx
            self._weight[i] = dx * dx + dy * dy
        self._weigh(radius2, pitch2)
        self._begun, self._n_begin = True, 1

    def _weigh(self, radius2: float, pitch2: float) -> None:
        """Weights of the pins from their squared distances, and the noise of their means."""
        for part in range(2):
            rows: cython.int[::1] = self._around if part else self._core
            total: cython.double = 0.0
            turning: cython.double = 0.0
            square: cython.double = 0.0
            for p in range(self._n_around if part else self._n_core):
                i = rows[p]
                far2 = self._weight[i]
                w = 1.0 / max(far2, pitch2) if part else exp(-6.0 * far2 / radius2)
                of_turn = w * w if part else w
                w = w * sqrt(w) if part else w
                self._weight[i] = w
                self._across[i, 0] *= of_turn
                self._across[i, 1] *= of_turn
                total += w
                square += w * w
                turning += w * w * far2
            if part:
                self._noise_q = sqrt(square) / total
            else:
                self._noise_s[0], self._noise_s[1] = sqrt(square) / total, sqrt(turning) / total

    def _go_on(self, area_change: Array, sigma_px: float) -> None:
        """Follow the drag and the twist; where one turns back, the contact sticks again."""
        core: cython.double[::1] = self._of_core
        around: cython.double[::1] = self._of_around
        self._measure(self._core, self._n_core, core)
        self._measure(self._around, self._n_around, around)
        drag = hypot(core[0], core[1])
        twist = fabs(core[2])
        sigma = sigma_px * sqrt(1.0 + 1.0 / self._n_begin)
        least = self._sigmas * sigma
        is_new: cython.bint = self._n_path[0] + self._n_path[1] == 0 and self._n_begin < _SHARES
        if is_new and drag < least * self._noise_s[0] and twist < least * self._noise_s[1]:
            self._n_begin += 1
            for i in range(self._n):
                for d in range(2):
                    step = self._motion.motion[i, d] - self._begin[i, d]
                    if not isnan(step):
                        self._begin[i, d] += step / self._n_begin
            return
        goes_on: cython.bint = True
        if drag > 0.0:
            goes_on = self._follow(0, drag, (around[0] * core[0] + around[1] * core[1]) / drag, sigma)
        if twist > 0.0 and goes_on:
            goes_on = self._follow(1, twist, around[2] * core[2] / twist, sigma)
        if not goes_on:
            self._forget_path()
            self._begin_path(area_change)
            return
        self.of_twist = self._probable[1]
        self.probability = max(self._probable[0], self.of_twist)

    def _measure(self, rows: Index, n: cython.Py_ssize_t, out: Array) -> None:
        """Write the weighted mean step, x and y, of the first n of these pins since the path began, and its
        moment about their middle; NaN: none is seen."""
        motion: cython.double[:, ::1] = self._motion.motion
        begin: cython.double[:, ::1] = self._begin
        across: cython.double[:, ::1] = self._across
        total = x = y = turn = across_x = across_y = 0.0
        for p in range(n):
            i = rows[p]
            dx = motion[i, 0] - begin[i, 0]
            dy = motion[i, 1] - begin[i, 1]
            if not isnan(dx):
                w = self._weight[i]
                total += w
                x += w * dx
                y += w * dy
                turn += across[i, 0] * dx + across[i, 1] * dy
                across_x += across[i, 0]
                across_y += across[i, 1]
        share = 1.0 / total if total > 0.0 else NAN
        out[0], out[1] = x * share, y * share
        out[2] = (turn - across_x * out[0] - across_y * out[1]) * share

    def _follow(self, kind: cython.Py_ssize_t, s: float, q: float, sigma: float) -> bool:
        """A new point of the path if the core has gone on; when there are many, every second one goes.

        kind     0: drag, 1: twist
        Returns  whether it has not turned back
        """
        n = self._n_path[kind]
        noise = sigma * self._noise_s[kind]
        farthest = self._s[kind, n - 1] if n > 0 else 0.0
        if s < farthest - self._sigmas * noise:
            return False
        if s > farthest + max(self._spacing[kind], noise) and not isnan(q):
            self._s[kind, n] = s
            self._q[kind, n] = q
            n += 1
            self._evaluate(kind, n, noise, sigma * self._noise_q)
            if n > _SHARES:
                n //= 2
                for p in range(n):
                    self._s[kind, p] = self._s[kind, 2 * p + 1]
                    self._q[kind, p] = self._q[kind, 2 * p + 1]
                self._spacing[kind] = s / n
            self._n_path[kind] = n
        return True

    def _evaluate(
        self, kind: cython.Py_ssize_t, n: cython.Py_ssize_t, noise_s: float, noise_q: float
    ) -> None:
        """Likelihood of each share, from n points of the path."""
        s: cython.double[::1] = self._s[kind]
        q: cython.double[::1] = self._q[kind]
        weight: cython.double[::1] = self._weight_of
        curve: cython.double[::1] = self._curve
        least = HUGE_VAL
        of_points = cython.cast(cython.double, n) / _SHARES  # a full path has the model's error once
        for p in range(n):
            of_s = q[p] / s[p] * noise_s
            of_model = q[p] / (sqrt(12.0) * _SHARES)  # the standard deviation within one share
            weight[p] = 1.0 / (noise_q * noise_q + of_s * of_s + of_points * of_model * of_model)
        for k in range(_SHARES):
            along: cython.double = 0.0
            across: cython.double = 0.0
            sticking = self._curves[kind, k, 1] * (1.0 - self._lag)  # of a step of the core
            scale = (sticking * _SHARES + self._lag * self._curves[kind, k, _SHARES]) / s[n - 1]
            j: cython.Py_ssize_t = 0
            below: cython.double = 0.0
            above: cython.double = 0.0
            for p in range(n):
                core = s[p] * scale
                while j < _SHARES and (j == 0 or above < core):
                    j += 1
                    below = above
                    above = sticking * j + self._lag * self._curves[kind, k, j]
                part = (core - below) / (above - below)
                curve[p] = (1.0 - part) * self._curves[kind, k, j - 1] + part * self._curves[kind, k, j]
                along += curve[p] * q[p] * weight[p]
                across += curve[p] * curve[p] * weight[p]
            factor = max(along, 0.0) / across
            square: cython.double = 0.0
            for p in range(n):
                square += (q[p] - factor * curve[p]) ** 2 * weight[p]
            self._square[k] = square
            least = min(least, square)
        odds = self._prior_odds * sqrt(of_points * _SHARES)
        total: cython.double = 0.0
        most: cython.double = 0.0
        for k in range(_SHARES):
            likelihood = exp(0.5 * (least - self._square[k]))
            if 3 * k >= _SHARES:
                most += likelihood
            else:
                likelihood *= odds
            total += likelihood
        self._probable[kind] = most / total


class Vibration:
    """Follows the high-passed motion of the contact's pins, of those at rest_xy (n, 2)."""

    def __init__(self, rest_xy: Array) -> None:
        n = len(rest_xy)
        self._from_hz = PARAMS.vibration_from_hz
        self._before, self._once, self._twice = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2))
        self._frame_of = np.zeros(n, np.int64)
        self._frame = 1
        self._before_ns = 0
        self.forget()

    def forget(self) -> None:
        """The next frame does not follow from the last one: the contact was lost."""
        self._frame += 2  # nothing was followed in the frame before
        self._lasted_s = self._power_px2 = 0.0

    def update(
        self,
        motion: Array,
        pins: Index,
        n_pins: cython.Py_ssize_t,
        sigma_px: float,
        capture_ns: cython.longlong,
    ) -> Rms:
        """Take a frame in contact.

        motion        (n, 2) float64 px since rest; NaN where lost
        pins, n_pins  (n_pins or more,) int32, rows of the pins in the contact
        sigma_px      noise of one coordinate of one pin in one frame
        capture_ns    start of its exposure
        Returns       rms in px, NaN while it is not known; upper end of its band in Hz, None while it is not
        """
        step_s = (capture_ns - self._before_ns) * 1e-9
        self._before_ns = capture_ns
        if not 0.0 < 2.0 * step_s * self._from_hz < 1.0:
            self.forget()
        self._frame += 1
        w: cython.double = 0.0
        if step_s > 0.0:  # each filter's cut-off lies below that of both in a row
            w = sqrt(sqrt(2.0) - 1.0) * tan(M_PI * self._from_hz * step_s)
        pole = (1.0 - w) / (1.0 + w) if w != -1.0 else 0.0
        power = self._mean_square(motion, pins, n_pins, pole)
        if isnan(power):  # no pin was there before
            return NAN, None
        power -= sigma_px * sigma_px * (1.0 + pole) * (3.0 + pole) / 4.0  # white noise of two coordinates
        self._lasted_s += step_s
        share = 1.0 - exp(-step_s * self._from_hz)
        if self._lasted_s * share < step_s:
            share = step_s / self._lasted_s  # a plain mean at first
        self._power_px2 += share * (power - self._power_px2)
        if self._lasted_s * self._from_hz < 1.0:
            return NAN, None
        return sqrt(max(self._power_px2, 0.0)), 0.5 / step_s

    def _mean_square(self, motion: Array, pins: Index, n_pins: cython.Py_ssize_t, pole: float) -> float:
        """One step of both filters, of each pin; NaN: no pin was followed in the frame before."""
        # Local names: the compiler knows that a store does not change where these lie.
        before: cython.double[:, ::1] = self._before
        once_of: cython.double[:, ::1] = self._once
        twice_of: cython.double[:, ::1] = self._twice
        frame_of: cython.longlong[::1] = self._frame_of
        frame: cython.longlong = self._frame
        gain = 0.5 * (1.0 + pole)
        held_n = 0
        total: cython.double = 0.0
        for k in range(n_pins):
            i = pins[k]
            if frame_of[i] != frame - 1 or isnan(motion[i, 0]):
                continue
            held_n += 1
            for axis in range(2):
                once = pole * once_of[i, axis] + gain * (motion[i, axis] - before[i, axis])
                twice = pole * twice_of[i, axis] + gain * (once - once_of[i, axis])
                once_of[i, axis], twice_of[i, axis] = once, twice
                before[i, axis] = motion[i, axis]
                total += twice * twice
            frame_of[i] = frame
        if held_n < n_pins:
            self._join(motion, pins, n_pins, held_n)
        return total / held_n if held_n else NAN

    def _join(self, motion: Array, pins: Index, n_pins: cython.Py_ssize_t, held_n: cython.Py_ssize_t) -> None:
        """Let the other pins begin where the held ones are on average."""
        for axis in range(2):
            once: cython.double = 0.0
            twice: cython.double = 0.0
            for k in range(n_pins if held_n else 0):
                i = pins[k]
                if self._frame_of[i] == self._frame:
                    once += self._once[i, axis] / held_n
                    twice += self._twice[i, axis] / held_n
            for k in range(n_pins):
                i = pins[k]
                if self._frame_of[i] != self._frame:
                    self._once[i, axis], self._twice[i, axis] = once, twice
                    self._before[i, axis] = motion[i, axis]
        for k in range(n_pins):
            i = pins[k]
            self._frame_of[i] = self._frame if not isnan(motion[i, 0]) else 0
