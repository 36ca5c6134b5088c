"""What the pins' motion says: shear, torsion, slip. (Its polynomial modes: `modes`.)

Torsion. The rotation that best carries the contact's rest pins onto the current ones (weighted Procrustes),
exact for a rigid turn of any size and blind to translation and to uniform growth. It is the skin's turn as
the pins show it; the object's is that times a factor of the tip (1.4 on the simulated one, flat contact).

Slip. Skin that sticks to a rigid thing can only move with it. Within the contact, the motion over the last
few frames is therefore split into what a load explains - a common translation, turn and linear stretch -
and the rest: parts of the contact that move against each other. That is what the slip that creeps in from
the rim of a contact looks like, a probe that wanders over the skin, or stick-slip. The steady gliding of a
large smooth plane moves no pin and cannot be seen by any camera behind the skin. Nor can creep be told from
the bending of a contact that is being pressed or let go: while its cells grow or shrink as one, none is said.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from edge import _features
from edge.types import Array, Index, Rest

__all__ = ["ContactPins", "Slip", "SlipState", "torsion"]


class ContactPins:
    """Which pins are in the contact: those in the ellipse of the compressed pins' spread.

    The ellipse has semi-axes of two standard deviations, that of a uniform disc's own edge; so the low
    middle of a flat contact's ring belongs to it.
    """

    def __init__(self, rest: Rest) -> None:
        self._unit = (rest.xy_img - rest.pattern.centre_img) / rest.pattern.tip_radius_px
        self._rows = np.empty(len(rest), dtype=np.int32)

    def select(self, change: Array, least: float) -> Index:
        """Rows of the contact's pins.

        change   (n,) relative area change; NaN where lost
        least    below this nothing presses
        Returns  (k,) int32 ascending, good until the next call; all pins when nothing is compressed
        """
        return self._rows[: _features.contact_pins(change, least, self._unit, self._rows)]


def torsion(xy_rest: Array, motion_px: Array, pins: Index) -> float:
    """Rotation of these pins about their own centre.

    xy_rest, motion_px  (n, 2) px; NaN where lost
    pins     (k,) int32, rows
    Returns  rad, positive from x towards y (clockwise on the screen); NaN for fewer than two seen pins
    """
    return _features.torsion(xy_rest, motion_px, pins, len(pins))


@dataclass(frozen=True, slots=True)
class SlipState:
    """Motion within the contact that the load does not explain.

    slip_px      rms over the contact's pins, per frame, noise taken off
    probability  0..1 that there was any, given the noise
    """

    slip_px: float
    probability: float


#: Share of the motion that a contact that sticks may leave unexplained, as it grows and its shape changes.
#: On the simulated tip (flat and spheres, pressed, then dragged 1.8 mm): 0.02..0.18 where everything
#: sticks, 0.2 when 0.6 of the contact slides, 0.7 and more when nearly all of it does.
UNEXPLAINED = 0.2
#: Odds against slip before looking, per frame.
PRIOR_ODDS = 100.0
#: Frames over which motion is taken: slip adds up from frame to frame, the noise of two frames does not.
SPAN = 4
#: Net over total growth of the contact's cells within the span, above which it is being pressed or let go.
#: Simulated balls, pairs and flats that are pressed: 0.75 and more; dragged over the skin: up to 0.65.
PRESSING = 0.7
#: A weak ridge for pins on one line; of 1e-9 pins, it costs no pin its freedom.
_RIDGE = 1e-9


class Slip:
    """Remembers the motion of the last frames."""

    def __init__(self, rest: Rest) -> None:
        self._unit = (rest.xy_img - rest.pattern.centre_img) / rest.pattern.tip_radius_px
        self._past: deque[tuple[Array, Array]] = deque(maxlen=SPAN)

    def forget(self) -> None:
        """No frame before this one: contact lost, identities lost, or nobody asks."""
        self._past.clear()

    def update(self, motion_px: Array, change: Array, pins: Index, sigma_px: float) -> SlipState:
        """Compare with the frame `SPAN` before this one, or with the oldest since the touch.

        motion_px  (n, 2) px since rest; NaN where lost; kept, not copied
        change     (n,) relative area change since rest; NaN where lost, or unknown; kept too
        pins       (k,) int32, of `ContactPins`
        sigma_px   noise of one coordinate of one pin in one frame
        """
        past = self._past
        if not past:
            past.append((motion_px, change))
            return SlipState(0.0, 0.0)
        span = len(past)
        before_px, change_before = past[0]
        used, size, unexplained = _features.slip_sums(
            motion_px, before_px, self._unit, pins, len(pins), _RIDGE
        )
        past.append((motion_px, change))
        free = 2 * used - 6  # two components, each with three unknowns
        if free < 4:
            return SlipState(0.0, 0.0)
        explained = max(size - unexplained, 0.0)
        expected = 2.0 * sigma_px**2 * free + UNEXPLAINED**2 * explained
        if not expected > 0.0:
            return SlipState(0.0, 0.0)
        ratio = max(unexplained / expected, 1.0)
        if ratio > 1.0 and _pressing(change[pins] - change_before[pins]):
            return SlipState(0.0, 0.0)
        # Log likelihood ratio of a larger variance, at its best, against the expected one, less the
        # penalty for having chosen it (BIC).
        evidence = 0.5 * free * (ratio - 1.0 - math.log(ratio)) - 0.5 * math.log(free)
        probability = 1.0 / (1.0 + math.exp(min(math.log(PRIOR_ODDS) - evidence, 700.0)))
        slip = math.sqrt(max(unexplained - expected, 0.0) / used) / span
        return SlipState(slip, probability)


def _pressing(growth: Array) -> bool:
    """Whether a contact's cells grow or shrink as one; growth (k,), NaN where not known."""
    return bool(abs(np.nansum(growth)) > PRESSING * np.nansum(np.abs(growth)))
