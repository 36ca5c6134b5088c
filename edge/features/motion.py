"""What the pins' motion says: shear, torsion, slip. (Polynomial modes: `modes`.)

Torsion. The rotation that best carries the contact's rest pins onto the current ones (weighted Procrustes),
exact for a rigid turn of any size and blind to translation and to uniform growth.

Slip. Skin that sticks to a rigid thing can only move with it. Within the contact the motion since the last
frame is therefore split into what a load explains - a common translation, turn and linear stretch, and the
growth or decay of the pattern that is there - and the rest: parts of the contact that move against each
other. That is what a partial slip, the wandering of a probe over the skin, or stick-slip looks like. The
steady gliding of a large smooth plane moves no pin and cannot be seen by any camera behind the skin.
"""

from __future__ import annotations

import math
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

    slip_px      rms over the contact's pins, noise taken off
    probability  0..1 that there was any, given the noise
    """

    slip_px: float
    probability: float


#: A load's own pattern is not exactly linear: this share of the explained motion may be left over.
UNEXPLAINED = 0.15
#: Odds against slip before looking, per frame.
PRIOR_ODDS = 100.0


class Slip:
    """Remembers the last frame's motion."""

    def __init__(self, rest: Rest) -> None:
        self._xy = (rest.xy_img - rest.pattern.centre_img) / rest.pattern.tip_radius_px
        self._last: Array | None = None

    def forget(self) -> None:
        """No frame before this one: contact lost, identities lost, or nobody asks."""
        self._last = None

    def update(self, motion_px: Array, weight: Array, sigma_px: float) -> SlipState:
        """Compare with the frame before.

        motion_px  (n, 2) px since rest; NaN where lost
        weight     (n,) of `contact_pins`
        sigma_px   noise of one coordinate of one pin in one frame
        """
        last, self._last = self._last, motion_px
        if last is None:
            return SlipState(0.0, 0.0)
        step = motion_px - last
        use = np.flatnonzero((weight > 0.0) & np.isfinite(step[:, 0]))
        free = 2 * len(use) - 7  # two affine components of three unknowns and one common scale
        if free < 4:
            return SlipState(0.0, 0.0)
        step, pattern = step[use], motion_px[use]
        affine, _ = np.linalg.qr(np.column_stack([np.ones(len(use)), self._xy[use]]))
        left = step - affine @ (affine.T @ step)
        shape = pattern - affine @ (affine.T @ pattern)
        power = float((shape * shape).sum())
        if power > 0.0:
            left -= shape * (float((left * shape).sum()) / power)
        unexplained = float((left * left).sum())
        explained = max(float((step * step).sum()) - unexplained, 0.0)
        expected = 2.0 * sigma_px**2 * free + UNEXPLAINED**2 * explained
        if expected <= 0.0:
            return SlipState(math.sqrt(unexplained / len(use)), float(unexplained > 0.0))
        ratio = max(unexplained / expected, 1.0)
        # Log likelihood ratio of a larger variance at its best against the expected one, with the
        # penalty for having chosen it (BIC).
        evidence = 0.5 * free * (ratio - 1.0 - math.log(ratio)) - 0.5 * math.log(free)
        probability = 1.0 / (1.0 + math.exp(min(math.log(PRIOR_ODDS) - evidence, 700.0)))
        slip = math.sqrt(max(unexplained - expected, 0.0) / len(use))
        return SlipState(slip, probability)
