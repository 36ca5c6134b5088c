"""Is anything touching? Decided on the area changes and their noise, which is learnt while nothing does.

Idea: a contact makes neighbouring cells grow together; noise does not: the area that one cell gains by a
pin's jitter its neighbours lose. So the mean over a pin and its six neighbours is compared with its noise.
And a contact moves neighbouring pins alike, which a reflection that draws one pin aside, or two, does not:
if each pin moves as the median of its ring does, the skin must still have grown.

Rules
- Areas decide, where there are any: a camera that shakes in its mount moves all pins, but no area. Without
  cells (nobody asked for an area) the motion about its own median decides, by the ring's median.
- The second question is only put when the first says yes, and first where the cells have grown most: a
  touch costs a hundredth of a scan. A frame that fails it is an untouched one.
- The noise follows from the pins' own sigma until untouched frames have taught a better value; what is
  learnt stays within a factor of the prediction, so that a slow touch can never teach the gate to be deaf.
- Fewer cells than the ring's average less noise away: their mean counts in proportion; fewer than four are
  not listened to.
- A touch begins above `ON` and ends below `OFF` sigmas. That bit is the only state that a single frame
  can change.
"""

from __future__ import annotations

import math

import numpy as np

from edge import _features
from edge.features.local import Neighbourhood
from edge.types import Array, Mask, Rest

#: Relative noise of a cell's area, and of its mean over seven cells, for independent pin noise sigma_px:
#: noise = FACTOR * sigma_px / pitch_px. Measured on a hexagonal lattice (60 draws of 576 pins, sigma
#: 0.005 pitch). The mean's factor is 6 standard errors below 0.83 / sqrt(7): neighbours' noise cancels.
CELL_NOISE = 0.83
MEAN_NOISE = 0.33
#: 331 pins at 240 frames/s: one false touch in some 20 hours of Gaussian noise at 6 sigma.
ON, OFF = 6.0, 5.0
#: Share of that limit by which the skin must have grown in the medians' motion: where the cells have grown
#: most, or else anywhere. On simulated tips (127, 331 pins) a ball 0.1..0.6 mm deep has 0.7..0.9 of its
#: areas' growth left there. Noise has a sixth of the limit, so one place in 10^4 passes the first by chance,
#: where it is asked at all, and one frame in 10^4 the second.
COHERENT, ANYWHERE = 5.0 / 6.0, 1.0
#: A median's noise over a mean's, for normal noise.
MEDIAN_NOISE = 1.25
#: Learnt noise may leave the predicted one by this factor up and down.
TRUST = 3.0
#: Weight of one untouched frame in the learnt noise: 64 frames, a quarter of a second at 240 frames/s.
RATE = 1.0 / 64.0


class Gate:
    """Touched or not, frame by frame."""

    def __init__(self, rest: Rest, near: Neighbourhood) -> None:
        self._near = near
        self._ring = near.ring
        self._rest_img = np.ascontiguousarray(rest.xy_img)
        self._width = self._ring.shape[1]
        self._pitch_px = rest.pattern.pitch_px
        self._rest_var = float(np.median(rest.pins.sigma_px)) ** 2
        self._learnt = 1.0  # measured over predicted noise
        self._touched = False
        self._scratch = np.empty(len(rest))
        self._centred = np.empty((len(rest), 2))

    def sigma_px(self, now_px: float) -> float:
        """Noise of one coordinate of a pin's motion since rest, from its mean in this frame's positions."""
        return math.sqrt(now_px * now_px + self._rest_var)

    def cell_noise(self, sigma_px: float) -> float:
        """One-sigma noise of a single cell's relative area change."""
        return CELL_NOISE / self._pitch_px * sigma_px * self._learnt

    def touched_by_area(self, change: Array, xy_img: Array, sigma_px: float) -> bool:
        """Decide on one frame's area changes, and learn from it if nothing touches.

        change    (n,) relative area change; NaN where lost
        xy_img    (n, 2) px, where the pins are; finite
        sigma_px  of `sigma_px`
        """
        highest, row = _features.ring_peak(change, 1, self._ring)
        if math.isnan(highest):
            return self._touched  # a dark frame says nothing
        predicted = sigma_px / self._pitch_px
        limit = (OFF if self._touched else ON) * MEAN_NOISE * predicted * self._learnt
        self._touched = highest > limit and _features.coherent(
            xy_img, self._rest_img, self._ring, self._near.slope, self._near.scratch,
            COHERENT * limit, ANYWHERE * limit, row,
        )  # fmt: skip
        if not self._touched:
            # 1.4826 MAD = sigma; the median of |x| rather than about the median: a drift is noise too.
            typical = _features.typical_size(change, self._scratch)
            spread = 1.4826 * typical / (CELL_NOISE * predicted) if predicted > 0.0 else 1.0
            if math.isfinite(spread):
                self._learnt += RATE * (min(max(spread, 1.0 / TRUST), TRUST) - self._learnt)
        return self._touched

    def touched_by_motion(self, motion_px: Array, seen: Mask, sigma_px: float) -> bool:
        """Decide without areas: do pins move against each other beyond their noise?

        motion_px  (n, 2) since rest; NaN where lost
        """
        if np.count_nonzero(seen) < 4:
            return self._touched
        _features.centred(motion_px, self._scratch, self._centred)
        limit = (OFF if self._touched else ON) * MEDIAN_NOISE * sigma_px / math.sqrt(self._width)
        self._touched = _features.ring_peak(self._centred, 2, self._ring)[0] > limit
        return self._touched
