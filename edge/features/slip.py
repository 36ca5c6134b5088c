"""Slip: parts of the contact that move against each other.

Skin that sticks to a rigid object can only move with it. Within the contact, the motion over the last few
frames is therefore split into what a load explains (a common translation, rotation and linear strain) and a
residual. The residual shows slip that creeps in from the rim of a contact, a probe that wanders over the
skin, or stick-slip. The steady gliding of a large smooth plane moves no pin and cannot be seen by a camera
behind the skin. Nor can creep be distinguished from the bending of a contact that is being pressed or
released: while all its cells' areas increase, or all decrease, no slip is reported.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from edge.features.params import PARAMS, FeatureParams
from edge.features.pin_motion import PinMotion
from edge.types import Array, Index

__all__ = ["Slip", "SlipState"]


@dataclass(frozen=True, slots=True)
class SlipState:
    """Motion within the contact that a load does not explain.

    slip_px      rms over the contact's pins, per frame, noise subtracted
    probability  0..1 that there was any, given the noise
    """

    slip_px: float
    probability: float


NO_SLIP = SlipState(0.0, 0.0)


class Slip:
    """Remembers the motion of the last frames."""

    def __init__(self, motion: PinMotion, params: FeatureParams = PARAMS) -> None:
        self._motion, self._params = motion, params
        self._past: deque[tuple[Array, Array]] = deque(maxlen=params.slip_span_frames)

    def forget(self) -> None:
        """Drop the frames before this one: contact lost, identities lost, or slip not demanded."""
        self._past.clear()

    def update(self, motion_px: Array, area_change: Array, pins: Index, sigma_px: float) -> SlipState:
        """Compare with the frame `slip_span_frames` before this one, or with the oldest since the touch.

        motion_px    (n, 2) px since rest; NaN where lost; kept, not copied
        area_change  (n,) relative, since rest; NaN where lost, or unknown; kept too
        pins         (k,) int32, rows of the pins in the contact
        sigma_px     noise of one coordinate of one pin in one frame
        """
        params, past = self._params, self._past
        if not past:
            past.append((motion_px, area_change))
            return NO_SLIP
        span = len(past)
        before_px, area_change_before = past[0]
        used, square, unexplained = self._motion.fit_step(motion_px, before_px, pins)
        past.append((motion_px, area_change))
        free = 2 * used - 6  # two components, each with three unknowns
        if free < 4:
            return NO_SLIP
        explained = max(square - unexplained, 0.0)
        expected = 2.0 * sigma_px**2 * free + params.slip_unexplained_rel**2 * explained
        if not expected > 0.0:
            return NO_SLIP
        ratio = max(unexplained / expected, 1.0)
        if ratio > 1.0 and self._is_pressing(area_change[pins] - area_change_before[pins]):
            return NO_SLIP
        # Log likelihood ratio of a larger variance, at its best, against the expected one, less the
        # penalty for having chosen it (BIC).
        evidence = 0.5 * free * (ratio - 1.0 - math.log(ratio)) - 0.5 * math.log(free)
        probability = 1.0 / (1.0 + math.exp(min(math.log(params.slip_prior_odds) - evidence, 700.0)))
        slip = math.sqrt(max(unexplained - expected, 0.0) / used) / span
        return SlipState(slip, probability)

    def _is_pressing(self, area_change: Array) -> bool:
        """Whether the areas of a contact's cells increase, or decrease, together; area_change (k,), NaN where
        not known.
        """
        return bool(
            abs(np.nansum(area_change)) > self._params.slip_pressing_rel * np.nansum(np.abs(area_change))
        )
