"""Vibration: rms motion of the contact's pins above a cut-off frequency, as texture and stick-slip make it.

Rules
- The filter is two high-passes of first order in a row, by the bilinear transform: -3 dB at the cut-off,
  gain 1 at half the frame rate. A steady motion leaves nothing, one that gains speed slowly hardly anything.
  The coefficients follow from the time between two captures, so that the cut-off is the same at any rate.
- The square is averaged over the contact's pins, and over one period of the cut-off. The part that the
  centroids' noise has in it is known, as it passes the same filter, and is subtracted.
- A pin that joins the contact, or is found again, begins where the others are on average.
- NaN until a contact, or the frames after a gap, have lasted for that period, and where the frame rate is
  too low for the band. Zero without a contact.

Source  Oppenheim, Schafer, "Discrete-Time Signal Processing", section 7.1.2: the bilinear transform

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.features.params import PARAMS, FeatureParams
from edge.types import Array, Index

if cython.compiled:
    from cython.cimports.libc.math import M_PI, NAN, exp, isnan, sqrt, tan
else:
    from math import exp, isnan, sqrt, tan
    from math import nan as NAN  # noqa: N812
    from math import pi as M_PI  # noqa: N812

__all__ = ["Rms", "Vibration"]

#: rms in px, and the upper end of its band in Hz; None: there is none.
Rms = tuple[float | None, float | None]


@cython.final
@cython.cclass
class Vibration:
    """Follows the high-passed motion of the contact's pins, of those at rest_xy (n, 2)."""

    def __init__(self, rest_xy: Array, params: FeatureParams = PARAMS) -> None:
        n = len(rest_xy)
        self._from_hz = params.vibration_from_hz
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
        step_s: cython.double = (capture_ns - self._before_ns) * 1e-9
        self._before_ns = capture_ns
        if not 0.0 < 2.0 * step_s * self._from_hz < 1.0:
            self.forget()
        self._frame += 1
        w: cython.double = 0.0
        if step_s > 0.0:  # each filter's cut-off lies below that of both in a row
            w = sqrt(sqrt(2.0) - 1.0) * tan(M_PI * self._from_hz * step_s)
        pole: cython.double = (1.0 - w) / (1.0 + w) if w != -1.0 else 0.0
        power: cython.double = self._mean_square(motion, pins, n_pins, pole)
        if isnan(power):  # no pin was there before
            return NAN, None
        power -= sigma_px * sigma_px * (1.0 + pole) * (3.0 + pole) / 4.0  # white noise of two coordinates
        self._lasted_s += step_s
        share: cython.double = 1.0 - exp(-step_s * self._from_hz)
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
        gain: cython.double = 0.5 * (1.0 + pole)
        held_n: cython.Py_ssize_t = 0
        total: cython.double = 0.0
        axis: cython.Py_ssize_t
        i: cython.Py_ssize_t
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
        once: cython.double
        twice: cython.double
        axis: cython.Py_ssize_t
        i: cython.Py_ssize_t
        for axis in range(2):
            once = twice = 0.0
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
