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

import numpy as np

from edge.types import Array, Index, Rest, Tracks

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


def neighbours(xy: Array, k: int = 6) -> Index:
    """The pin itself and its k nearest ones.

    xy       (n, 2) any unit
    Returns  (n, k + 1) int32, nearest first; fewer columns where there are fewer pins
    """
    d2 = ((xy[:, None, :] - xy[None, :, :]) ** 2).sum(axis=2)
    np.fill_diagonal(d2, -1.0)
    return np.argsort(d2, axis=1, kind="stable")[:, : k + 1].astype(np.int32)


class Gate:
    """Touched or not, frame by frame."""

    def __init__(self, rest: Rest) -> None:
        self._ring = neighbours(rest.xy_img)
        self._pitch_px = rest.pattern.pitch_px
        self._rest_var = float(np.median(rest.pins.sigma_px)) ** 2
        self._learnt = 1.0  # measured over predicted noise
        self._touched = False

    def noise(self, tracks: Tracks) -> float:
        """One-sigma noise of a single cell's relative area change in this frame."""
        return CELL_NOISE / self._pitch_px * self.sigma_px(tracks) * self._learnt

    def touched_by_area(self, change: Array, tracks: Tracks) -> bool:
        """Decide on one frame's area changes, and learn from it if nothing touches.

        change  (n,) relative area change; NaN where lost
        """
        seen = np.isfinite(change)
        value = np.where(seen, change, 0.0)
        if not seen.any():
            return self._touched
        weight = seen[self._ring].sum(axis=1)
        mean = value[self._ring].sum(axis=1) / np.maximum(weight, 1)
        # Fewer cells average less noise away; a mean of fewer than four is not listened to.
        score = mean * np.sqrt(weight / self._ring.shape[1])
        score[weight < min(4, self._ring.shape[1])] = 0.0
        predicted = self.sigma_px(tracks) / self._pitch_px
        level = float(score.max()) / (MEAN_NOISE * predicted * self._learnt)
        self._touched = level > (OFF if self._touched else ON)
        if not self._touched:
            # 1.4826 MAD = sigma; the median of |x| rather than about the median: a drift is noise too.
            spread = 1.4826 * float(np.median(np.abs(change[seen]))) / (CELL_NOISE * predicted)
            self._learnt += RATE * (min(max(spread, 1.0 / TRUST), TRUST) - self._learnt)
        return self._touched

    def touched_by_motion(self, motion_px: Array, tracks: Tracks) -> bool:
        """Decide without areas: do pins move against each other beyond their noise?

        motion_px  (n, 2) since rest; NaN where lost
        """
        seen = tracks.seen
        if np.count_nonzero(seen) < 4:
            return self._touched
        u = np.where(seen[:, None], motion_px, 0.0)
        u -= np.median(u[seen], axis=0)
        u[~seen] = 0.0
        weight = seen[self._ring].sum(axis=1)
        mean = u[self._ring].sum(axis=1) / np.maximum(weight, 1)[:, None]
        level = float(np.sqrt((mean * mean).sum(axis=1) * weight).max()) / self.sigma_px(tracks)
        self._touched = level > (OFF if self._touched else ON)
        return self._touched

    def sigma_px(self, tracks: Tracks) -> float:
        """Noise of one coordinate of a pin's motion since rest."""
        seen = tracks.seen
        now = float(np.median(tracks.sigma_px[seen])) if seen.any() else 0.0
        return float(np.sqrt(now * now + self._rest_var))
