"""What the pins' motion says: shear, torsion, slip. (Its polynomial modes: `modes`.)

Torsion. The rotation that best carries the contact's rest pins onto the current ones (weighted Procrustes),
exact for a rigid turn of any size and blind to translation and to uniform growth. It is the skin's turn as
the pins show it; the object's is that times a factor of the tip (1.4 on the simulated one, flat contact).

Slip. Skin that sticks to a rigid thing can only move with it. Within the contact, the motion over the last
few frames is therefore split into what a load explains - a common translation, turn and linear stretch -
and the rest: parts of the contact that move against each other. That is what the slip that creeps in from
the rim of a contact looks like, a probe that wanders over the skin, or stick-slip. The steady gliding of a
large smooth plane moves no pin and cannot be seen by any camera behind the skin.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Mask, Rest

__all__ = ["ContactPins", "Slip", "SlipState", "mean_motion", "torsion"]

Places = NDArray[np.intp]


def mean_motion(motion_px: Array, seen: Mask | None = None) -> Array:
    """Plain mean of the seen pins' motion: the paper's global shear.

    motion_px  (n, 2), NaN where lost
    seen       None: all of them
    Returns    (2,) px; NaN when no pin is seen
    """
    if seen is not None:
        motion_px = motion_px[seen]
    if not len(motion_px):
        return np.full(2, np.nan)
    mean: Array = np.add.reduce(motion_px, axis=0) / len(motion_px)
    return mean


class ContactPins:
    """Which pins are in the contact: those in the ellipse of the compressed pins' spread.

    The ellipse has semi-axes of two standard deviations, that of a uniform disc's own edge; so the low
    middle of a flat contact's ring belongs to it.
    """

    def __init__(self, rest: Rest) -> None:
        x, y = ((rest.xy_img - rest.pattern.centre_img) / rest.pattern.tip_radius_px).T
        self._terms = np.column_stack([np.ones(len(x)), x, y, x * x, x * y, y * y])

    def select(self, compression: Array) -> Places:
        """Rows of the contact's pins.

        compression  (n,) >= 0, 0 where nothing presses or the pin is lost
        Returns      (k,) ascending; all pins when nothing is compressed
        """
        total, x, y, xx, xy, yy = (compression @ self._terms).tolist()
        if not total > 0.0:
            return np.arange(len(compression))
        x, y = x / total, y / total
        xx, xy, yy = xx / total - x * x, xy / total - x * y, yy / total - y * y
        det = xx * yy - xy * xy
        if not det > 1e-12:  # one pin, or all on a line
            return np.flatnonzero(compression)
        # ((X - x)^2 yy - 2 (X - x)(Y - y) xy + (Y - y)^2 xx) / det <= 4, as a polynomial in X and Y.
        limit = 4.0 * det
        form = [
            x * x * yy - 2.0 * x * y * xy + y * y * xx,
            2.0 * (y * xy - x * yy),
            2.0 * (x * xy - y * xx),
            yy,
            -2.0 * xy,
            xx,
        ]
        return np.flatnonzero(self._terms @ np.array(form) <= limit)


def torsion(xy_rest: Array, motion_px: Array) -> float:
    """Rotation of these pins about their own centre.

    xy_rest, motion_px  (k, 2) px, finite
    Returns             rad, positive from x towards y (clockwise on the screen); NaN for fewer than two pins
    """
    if len(xy_rest) < 2:
        return math.nan
    before = np.ascontiguousarray(xy_rest).view(np.complex128)[:, 0]
    after = before + np.ascontiguousarray(motion_px).view(np.complex128)[:, 0]
    # The sum of conj(before) after, both about their means, points along the rotation.
    before = before - before.mean()
    turn = complex(np.vdot(before, after))
    return math.atan2(turn.imag, turn.real)


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
#: Net over total growth of the contact's cells above which it is being pressed or let go.
PRESSING = 0.7
_RIDGE = 1e-9 * np.eye(3)


class Slip:
    """Remembers the motion of the last frames."""

    def __init__(self, rest: Rest) -> None:
        xy = (rest.xy_img - rest.pattern.centre_img) / rest.pattern.tip_radius_px
        self._plane = np.column_stack([np.ones(len(rest)), xy])
        self._past: deque[tuple[Array, Array]] = deque(maxlen=SPAN)

    def forget(self) -> None:
        """No frame before this one: contact lost, identities lost, or nobody asks."""
        self._past.clear()

    def update(self, motion_px: Array, change: Array, pins: Places, sigma_px: float) -> SlipState:
        """Compare with the frame `SPAN` before this one, or with the oldest since the touch.

        motion_px  (n, 2) px since rest; NaN where lost; kept, not copied
        change     (n,) relative area change since rest; NaN where lost
        pins       of `ContactPins`
        sigma_px   noise of one coordinate of one pin in one frame
        """
        past = self._past
        if not past:
            past.append((motion_px, change))
            return SlipState(0.0, 0.0)
        span = len(past)
        step = motion_px[pins] - past[0][0][pins]
        growth = change[pins] - past[0][1][pins]
        past.append((motion_px, change))
        plane = self._plane[pins]
        lost = np.isnan(step[:, 0])
        if lost.any():
            step, plane = step[~lost], plane[~lost]
        free = 2 * len(step) - 6  # two components, each with three unknowns
        if free < 4:
            return SlipState(0.0, 0.0)
        # A weak ridge for pins on one line; of 1e-9 pins, it costs no pin its freedom.
        gram = plane.T @ plane + _RIDGE
        left = step - plane @ np.linalg.solve(gram, plane.T @ step)
        unexplained = float(np.vdot(left, left))
        explained = max(float(np.vdot(step, step)) - unexplained, 0.0)
        expected = 2.0 * sigma_px**2 * free + UNEXPLAINED**2 * explained
        if not expected > 0.0:
            return SlipState(0.0, 0.0)
        ratio = max(unexplained / expected, 1.0)
        if ratio > 1.0 and abs(np.nansum(growth)) > PRESSING * np.nansum(np.abs(growth)):
            return SlipState(0.0, 0.0)
        # Log likelihood ratio of a larger variance, at its best, against the expected one, less the
        # penalty for having chosen it (BIC).
        evidence = 0.5 * free * (ratio - 1.0 - math.log(ratio)) - 0.5 * math.log(free)
        probability = 1.0 / (1.0 + math.exp(min(math.log(PRIOR_ODDS) - evidence, 700.0)))
        slip = math.sqrt(max(unexplained - expected, 0.0) / len(step)) / span
        return SlipState(slip, probability)
