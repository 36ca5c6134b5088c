"""Is anything touching? Decided on the area changes and their noise, which is learnt while nothing does.

Idea: a contact makes neighbouring cells grow together; noise does not: the area that one cell gains by a
pin's jitter its neighbours lose. So the mean over a pin and its six neighbours is compared with its noise.

Rules
- Areas alone decide, where there are any: a camera that shakes in its mount moves all pins, but no area.
  Without cells (nobody asked for an area) the motion about its own median decides.
- The noise follows from the pins' own sigma until untouched frames have taught a better value; what is
  learnt stays within a factor of the prediction, so that a slow touch can never teach the gate to be deaf.
- A touch begins above `ON` and ends below `OFF` sigmas. That bit is the only state that a single frame
  can change.
"""

from __future__ import annotations

import math
import warnings

import numpy as np

from edge.features.gate import ANYWHERE, COHERENT, MEDIAN_NOISE
from edge.features.local import Neighbourhood
from edge.types import Array, Index, Mask, Rest, Tracks

#: Relative noise of a cell's area, and of its mean over seven cells, for independent pin noise sigma_px:
#: noise = FACTOR * sigma_px / pitch_px. Measured on a hexagonal lattice (60 draws of 576 pins, sigma
#: 0.005 pitch). The mean's factor is 6 standard errors below 0.83 / sqrt(7): neighbours' noise cancels.
CELL_NOISE = 0.83
MEAN_NOISE = 0.33
#: 331 pins at 240 frames/s: one false touch in some 20 hours of Gaussian noise at 6 sigma.
ON, OFF = 6.0, 5.0
#: Learnt noise may leave the predicted one by this factor up and down.
TRUST = 3.0
#: Weight of one untouched frame in the learnt noise: 64 frames, a quarter of a second at 240 frames/s.
RATE = 1.0 / 64.0


class Gate:
    """Touched or not, frame by frame."""

    def __init__(self, rest: Rest) -> None:
        near = Neighbourhood(rest)
        self._ring = near.ring
        self._slope = near.slope.reshape(*near.ring.shape, 2)
        self._rest_img = rest.xy_img
        self._width = self._ring.shape[1]
        self._pitch_px = rest.pattern.pitch_px
        self._rest_var = float(np.median(rest.pins.sigma_px)) ** 2
        self._learnt = 1.0  # measured over predicted noise
        self._touched = False

    def sigma_px(self, tracks: Tracks) -> float:
        """Noise of one coordinate of a pin's motion since rest."""
        sigma = tracks.sigma_px if tracks.n_seen == len(tracks.seen) else tracks.sigma_px[tracks.seen]
        now = float(sigma.mean()) if len(sigma) else 0.0
        return float(np.sqrt(now * now + self._rest_var))

    def cell_noise(self, sigma_px: float) -> float:
        """One-sigma noise of a single cell's relative area change."""
        return CELL_NOISE / self._pitch_px * sigma_px * self._learnt

    def touched_by_area(self, change: Array, xy_img: Array, sigma_px: float) -> bool:
        """Decide on one frame's area changes, and learn from it if nothing touches.

        change    (n,) relative area change; NaN where lost
        xy_img    (n, 2) px, where the pins are; finite
        sigma_px  of `sigma_px`
        """
        mean, weight = self._means(change)
        if weight is not None and not weight.any():
            return self._touched  # a dark frame says nothing
        predicted = sigma_px / self._pitch_px
        limit = (OFF if self._touched else ON) * MEAN_NOISE * predicted * self._learnt
        self._touched = self._highest(mean, weight) > limit
        if self._touched:
            middle = np.median((xy_img - self._rest_img)[self._ring], axis=1)
            slope = np.einsum("nkd,nkc->ncd", self._slope, middle[self._ring])
            grown = np.linalg.det(np.eye(2) + slope) - 1.0
            first = self._ring[int(np.argmax(self._scores(mean, weight)))]
            self._touched = bool(grown[first].max() > COHERENT * limit or grown.max() > ANYWHERE * limit)
        if not self._touched:
            # 1.4826 MAD = sigma; the median of |x| rather than about the median: a drift is noise too.
            size = np.abs(change)
            typical = float(np.median(size if weight is None else size[np.isfinite(size)]))
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
        u = (motion_px - np.median(motion_px[seen], axis=0))[self._ring]
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # rings without any seen pin
            middle = np.nanmedian(u, axis=1)
        size = np.nan_to_num(np.hypot(*middle.T))
        limit = (OFF if self._touched else ON) * MEDIAN_NOISE * sigma_px / math.sqrt(self._width)
        self._touched = self._highest(size, seen[self._ring].sum(axis=1, dtype=np.int32)) > limit
        return self._touched

    def _means(self, value: Array) -> tuple[Array, Index | None]:
        """Mean over each pin and its neighbours, and of how many; None: of all of them."""
        mean: Array = value[self._ring].sum(axis=1) / self._width
        if math.isfinite(float(mean.sum())):
            return mean, None
        seen = np.isfinite(value)
        weight = seen[self._ring].sum(axis=1, dtype=np.int32)
        return np.where(seen, value, 0.0)[self._ring].sum(axis=1) / np.maximum(weight, 1), weight

    def _highest(self, mean: Array, weight: Index | None) -> float:
        return float(self._scores(mean, weight).max())

    def _scores(self, mean: Array, weight: Index | None) -> Array:
        """Means as they count; fewer cells average less noise away, fewer than four are not listened to."""
        if weight is None:
            return mean
        score = mean * np.sqrt(weight / self._width)
        return np.where(weight >= min(4, self._width), score, 0.0)
