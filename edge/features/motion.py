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

from edge.types import Array, Mask, Rest

__all__ = ["Slip", "SlipState", "contact_pins", "mean_motion", "torsion"]


def mean_motion(motion_px: Array, seen: Mask) -> Array:
    """Plain mean of the seen pins' motion: the paper's global shear.

    motion_px  (n, 2), NaN where lost
    Returns    (2,) px; NaN when no pin is seen
    """
    if seen.all():
        mean: Array = motion_px.mean(axis=0)
        return mean
    if not seen.any():
        return np.full(2, np.nan)
    mean = motion_px[seen].mean(axis=0)
    return mean


def contact_pins(xy_rest: Array, compression: Array) -> Array:
    """Weight of each pin in the contact: 1 within the ellipse of the compressed pins' spread, 0 outside.

    xy_rest      (n, 2) px
    compression  (n,) >= 0, 0 where nothing presses or the pin is lost
    Returns      (n,) float64; all ones when nothing is compressed

    The ellipse has semi-axes of two standard deviations, that of a uniform disc's own edge; so the low
    middle of a flat contact's ring belongs to it.
    """
    total = float(compression.sum())
    if total <= 0.0:
        return np.ones(len(xy_rest))
    r = xy_rest - (compression @ xy_rest) / total
    xx, yy = (compression @ (r * r)) / total
    xy = float(compression @ (r[:, 0] * r[:, 1])) / total
    det = xx * yy - xy * xy
    if det <= 0.0:
        return (compression > 0.0).astype(np.float64)
    x, y = r[:, 0], r[:, 1]
    distance = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / det
    weight: Array = (distance <= 4.0).astype(np.float64)
    return weight


def torsion(xy_rest: Array, motion_px: Array, weight: Array) -> float:
    """Rotation of the weighted pins about their own centre.

    motion_px  (n, 2) px, finite where weight > 0
    Returns    rad, positive from x towards y (clockwise on the screen); NaN for fewer than two pins
    """
    total = float(weight.sum())
    if total <= 1.0:
        return math.nan
    w = weight / total
    before = xy_rest - w @ xy_rest
    after = before + motion_px - w @ motion_px
    cross = w @ (before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    dot = w @ (before * after).sum(axis=1)
    return math.atan2(float(cross), float(dot))


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


class Slip:
    """Remembers the motion of the last frames."""

    def __init__(self, rest: Rest) -> None:
        self._plane = np.column_stack([np.ones(len(rest)), rest.xy_img - rest.pattern.centre_img])
        self._past: deque[Array] = deque(maxlen=SPAN)

    def forget(self) -> None:
        """No frame before this one: contact lost, identities lost, or nobody asks."""
        self._past.clear()

    def update(self, motion_px: Array, weight: Array, sigma_px: float) -> SlipState:
        """Compare with the frame `SPAN` before this one, or with the oldest since the touch.

        motion_px  (n, 2) px since rest; NaN where lost; kept, not copied
        weight     (n,) of `contact_pins`
        sigma_px   noise of one coordinate of one pin in one frame
        """
        past = self._past
        if not past:
            past.append(motion_px)
            return SlipState(0.0, 0.0)
        span = len(past)
        step = motion_px - past[0]
        past.append(motion_px)
        use = np.flatnonzero((weight > 0.0) & np.isfinite(step[:, 0]))
        free = 2 * len(use) - 6  # two components, each with three unknowns
        if free < 4:
            return SlipState(0.0, 0.0)
        step = step[use]
        affine, _ = np.linalg.qr(self._plane[use])
        left = step - affine @ (affine.T @ step)
        unexplained = float((left * left).sum())
        explained = max(float((step * step).sum()) - unexplained, 0.0)
        expected = 2.0 * sigma_px**2 * free + UNEXPLAINED**2 * explained
        if not expected > 0.0:
            return SlipState(0.0, 0.0)
        ratio = max(unexplained / expected, 1.0)
        # Log likelihood ratio of a larger variance, at its best, against the expected one, less the
        # penalty for having chosen it (BIC).
        evidence = 0.5 * free * (ratio - 1.0 - math.log(ratio)) - 0.5 * math.log(free)
        probability = 1.0 / (1.0 + math.exp(min(math.log(PRIOR_ODDS) - evidence, 700.0)))
        slip = math.sqrt(max(unexplained - expected, 0.0) / len(use)) / span
        return SlipState(slip, probability)
