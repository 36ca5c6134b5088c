"""Slip: how probable it is that most of the contact slides, and how fast its parts move against each other.

Skin that sticks to a rigid object can only move with it. The probability is that of `partial_slip`: from the
rim inwards, more than half of the contact slides. The speed is a residual: within the contact, the motion
over the last few frames less what a load explains (a common translation, rotation and linear strain).

Rules
- While all of a contact's cells increase, or all decrease, it is pressed or released and no slip is
  reported: it cannot be distinguished from the bending then.
- The speed is the expected one: the residual, noise subtracted, times the probability.
- The steady gliding of a large smooth plane moves no pin, and has no speed for a camera behind the skin.
"""

from __future__ import annotations

import math
from collections import deque

from edge.features.params import PARAMS, FeatureParams
from edge.features.partial_slip import PartialSlip
from edge.features.pin_motion import PinMotion
from edge.types import Array, Index, Rest, per_frame

__all__ = ["Slip", "SlipState"]


@per_frame
class SlipState:
    """Slip of one frame.

    slip_px      expected rms over the contact's pins of the motion that no load explains, per frame
    probability  0..1 that more than half of the contact's area slides
    """

    slip_px: float
    probability: float


NO_SLIP = SlipState(0.0, 0.0)


class Slip:
    """Remembers the motion of the last frames, and the path of the touch."""

    def __init__(self, rest: Rest, motion: PinMotion, params: FeatureParams = PARAMS) -> None:
        self._motion, self._params = motion, params
        self._past: deque[tuple[Array, Array]] = deque(maxlen=params.slip_span_frames)
        self._partial = PartialSlip(rest.xy_img, params)

    def forget(self) -> None:
        """Drop the frames before this one: contact lost, identities lost, or slip not demanded."""
        self._past.clear()
        self._partial.forget()

    def update(
        self,
        motion_px: Array,
        area_change: Array,
        pins: Index,
        sigma_px: float,
        kept: tuple[Array, Array] | None = None,
    ) -> SlipState:
        """Compare with the frame `slip_span_frames` before this one, or with the oldest since the touch.

        motion_px    (n, 2) px since rest; NaN where lost
        area_change  (n,) relative, since rest; NaN where lost, or unknown
        pins         (k,) int32, rows of the pins in the contact
        sigma_px     noise of one coordinate of one pin in one frame
        kept         the first two in arrays that stay; None: copies are made
        """
        past = self._past
        if kept is None:
            kept = motion_px.copy(), area_change.copy()
        if not past:
            past.append(kept)
            return NO_SLIP
        span = len(past)
        before_px, area_change_before = past[0]
        past.append(kept)
        pressing_rel = self._params.slip_pressing_rel
        if self._motion.is_pressing(area_change, area_change_before, pins, pressing_rel):
            self._partial.forget()
            return NO_SLIP
        self._partial.update(motion_px, pins, sigma_px)
        probability = self._partial.probability
        used, _, unexplained = self._motion.fit_step(motion_px, before_px, pins)
        free = 2 * used - 6  # two components, each with three unknowns
        if free < 4:
            return SlipState(0.0, probability)
        rms = math.sqrt(max(unexplained - 2.0 * sigma_px**2 * free, 0.0) / used)
        return SlipState(probability * rms / span, probability)
