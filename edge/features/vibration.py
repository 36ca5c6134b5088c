"""Vibration: rms motion of the contact's pins above a cut-off frequency, as texture and stick-slip make it.

Rules
- The filter is two high-passes of first order in a row, by the bilinear transform: -3 dB at the cut-off,
  gain 1 at half the frame rate. A steady motion leaves nothing, one that gains speed slowly hardly anything.
  The coefficients follow from the time between two captures, so that the cut-off is the same at any rate.
- The square is averaged over the contact's pins, and over one period of the cut-off. The part that the
  centroids' noise has in it is known, as it passes the same filter, and is subtracted.
- NaN until a contact, or the frames after a gap, have lasted for that period, and where the frame rate is
  too low for the band. Zero without a contact.

Source  Oppenheim, Schafer, "Discrete-Time Signal Processing", section 7.1.2: the bilinear transform
"""

from __future__ import annotations

from math import exp, nan, pi, sqrt, tan

import numpy as np

from edge.features.params import PARAMS, FeatureParams
from edge.types import Array, Index

__all__ = ["NO_VIBRATION", "Rms", "Vibration"]

#: rms in px, and its band in Hz; None: there is none.
Rms = tuple[float | None, tuple[float, float] | None]
#: What a frame without contact has.
NO_VIBRATION: Rms = (0.0, None)
#: Cut-off of each of two equal high-passes, in the one of both together.
_OF_EACH = sqrt(sqrt(2.0) - 1.0)


class Vibration:
    """Follows the high-passed motion of n pins while a contact lasts."""

    def __init__(self, n: int, params: FeatureParams = PARAMS) -> None:
        self._from_hz = params.vibration_from_hz
        self._once, self._twice = np.zeros((n, 2)), np.zeros((n, 2))  # filtered, over their gains
        self._before_px: Array | None = None
        self._before_ns = 0
        self._gain = 1.0
        self._lasted_s = self._power_px2 = 0.0

    def forget(self) -> None:
        """The next frame does not follow from the last one: the contact was lost."""
        self._before_px = None

    def update(self, motion_px: Array, pins: Index, sigma_px: float, capture_ns: int) -> Rms:
        """Take a frame in contact.

        motion_px   (n, 2) px since rest, in an array that stays; NaN where lost
        pins        (k,) int32, rows of the pins in the contact
        sigma_px    noise of one coordinate of one pin in one frame
        capture_ns  start of its exposure
        Returns     rms in px, NaN while it is not known; its band in Hz, None while there is none
        """
        before_px, self._before_px = self._before_px, motion_px
        step_s = (capture_ns - self._before_ns) * 1e-9
        self._before_ns = capture_ns
        if before_px is None or not 0.0 < 2.0 * step_s * self._from_hz < 1.0:
            self._once.fill(0.0)
            self._twice.fill(0.0)
            self._lasted_s = self._power_px2 = 0.0
            return nan, None
        w = _OF_EACH * tan(pi * self._from_hz * step_s)
        pole, gain = (1.0 - w) / (1.0 + w), 1.0 / (1.0 + w)
        power = gain**4 * self._filtered(motion_px, before_px, pins, pole, self._gain / gain)
        self._gain = gain
        power -= sigma_px * sigma_px * (1.0 + pole) * (3.0 + pole) / 4.0  # white noise of two coordinates
        self._lasted_s += step_s
        share = max(1.0 - exp(-step_s * self._from_hz), step_s / self._lasted_s)  # a plain mean at first
        self._power_px2 += share * (power - self._power_px2)
        if self._lasted_s * self._from_hz < 1.0:
            return nan, None
        return sqrt(max(self._power_px2, 0.0)), (self._from_hz, 0.5 / step_s)

    def _filtered(
        self, motion_px: Array, before_px: Array, pins: Index, pole: float, rescale: float
    ) -> float:
        """One step of both filters; the pins' mean square, over the gains."""
        once, twice = self._once, self._twice
        once *= rescale
        twice *= pole * rescale * rescale
        twice -= once
        once *= pole
        once += motion_px
        once -= before_px
        twice += once
        chosen = twice.take(pins, axis=0)
        total = float(np.vdot(chosen, chosen))
        if total != total:  # pins that are or were lost begin anew
            lost = np.isnan(twice)
            once[lost] = twice[lost] = 0.0
            total = float(np.nansum(chosen * chosen))
        return total / max(len(pins), 1)
