"""Are enough pins seen, and are their places plausible?

Rules
- With too few pins, or a hole in the pattern, no values are sent: in a hole the polynomial of the motion is
  undetermined, and a contact there is hidden.
- Nor when many pins vanish at once, until they are back: the baseline is learnt in normal operation and
  forgotten slowly, so that a tip that has lost pins for good becomes usable again.
- Nor in an image that is corrupt in one place: pins that vanish are next to each other, and those around them
  stand still. Pins that vanish one by one are next to each other too, as often as chance has it. Both
  explanations are compared by their likelihoods; as much evidence decides as for the pins' identities.
- Values return after a few good frames in a row: then the identities of the pins that came back are certain.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, sqrt

import numpy as np

from edge.faults.frame_counts import count_apart
from edge.faults.image_quality import PARAMS as IMAGE
from edge.features.params import PARAMS as FEATURES
from edge.geometry.lattice import N_RING
from edge.geometry.neighbours import nearest_of
from edge.params import PARAMS as RUNTIME
from edge.types import Index, Mask, Rest, Tracks

__all__ = ["PinVisibility", "PinVisibilityParams"]


@dataclass(frozen=True, slots=True)
class PinVisibilityParams:
    """Thresholds; evidence in docs/tuning.md. `_rel`: a share; pins are counted over the rest frame's."""

    seen_rel: float = 0.8  # smallest share of the pins
    hole_rel: float = 0.01  # largest share of them that are lost with all their neighbours
    noisy_ratio: float = FEATURES.noise_ratio_max  # a pin with so many times the usual sigma counts as lost
    drop_rel: float = RUNTIME.most_rel  # of the baseline share; with fewer, too many vanished at once
    back_rel: float = RUNTIME.hysteresis_rel  # of the same, above it: until so many are back
    # good frames in a row until values are sent again: those that slip is taken over are good then
    settled_frames_n: int = FEATURES.slip_span_frames
    baseline_frames_n: int = FEATURES.noise_frames_n  # over which the baseline is learnt
    forget_rel: float = RUNTIME.astray_rel  # weight of a frame in it while too few are seen, of a good one's
    corrupt_confidence: float = Tracks.LOW_CONFIDENCE  # that pins vanished side by side not by chance
    still_pitches: float = RUNTIME.still_pitches  # largest motion in a frame that counts as static
    far_rel: float = RUNTIME.astray_rel  # share of the pins so far away: identities are wrong
    blurred_rel: float = IMAGE.half_rel  # sharpness of a blurred image, which may show in its pins' noise

    @property
    def far_pitches(self) -> float:
        """Skin cannot move further: twice as far as where a pin counts as overloaded."""
        return 2.0 * RUNTIME.load_pitches


PARAMS = PinVisibilityParams()


class PinVisibility:
    """Checks the pins of each frame against the rest frame."""

    def __init__(self, rest: Rest, params: PinVisibilityParams = PARAMS) -> None:
        self._params = params
        self._rest_img = np.ascontiguousarray(rest.xy_img)
        self._reason = ""
        self._good_n = params.settled_frames_n
        self._baseline_share = 1.0
        self._baseline_px = float(np.nanmean(rest.pins.sigma_px))
        self._near = nearest_of(rest.xy_img, rest.xy_img, N_RING + 1)[1]
        self._bad, self._before = np.zeros(len(rest), dtype=np.bool_), rest.xy_img
        self._pitch_px = rest.pattern.pitch_px

    def problem(self, tracks: Tracks) -> str:
        """Why the pins allow no values for this frame; empty: they do."""
        p, n = self._params, len(tracks.seen)
        share = tracks.n_seen / n
        bad = ~(tracks.sigma_px <= p.noisy_ratio * self._baseline_px)  # NaN for a lost pin
        hole_n = int(np.count_nonzero(bad[self._near].all(axis=1))) if bad.any() else 0
        corrupt = self._image_corrupt(tracks, bad)
        few = share < p.seen_rel or hole_n > p.hole_rel * n or corrupt
        least = p.drop_rel * (1.0 + p.back_rel) if self._reason else p.drop_rel
        suddenly = share < least * self._baseline_share
        weight = p.forget_rel if few or suddenly else 1.0
        self._baseline_share += weight * (share - self._baseline_share) / p.baseline_frames_n
        unidentified = tracks.confidence < Tracks.LOW_CONFIDENCE
        if few or suddenly or unidentified:
            self._good_n = 0
            counted = f"{tracks.n_seen} of {n} pins are seen"
            if share < p.seen_rel:
                self._reason = f"only {counted}"
            elif hole_n > p.hole_rel * n:
                self._reason = f"{counted}; around {hole_n} of the others no pin is seen either"
            elif corrupt:
                self._reason = f"{counted}; pins vanished side by side while their neighbours stood still"
            elif suddenly:
                self._reason = f"{counted}, {self._baseline_share:.0%} usually: too many vanished at once"
            else:
                self._reason = "the pins could not be identified; waiting for several good frames"
        else:
            self._good_n += 1
            if self._good_n >= p.settled_frames_n:
                self._reason = ""
        return self._reason

    def _image_corrupt(self, tracks: Tracks, bad: Mask) -> bool:
        """Whether pins vanished side by side since the last frame while those around them did not move."""
        p = self._params
        gone, before = bad & ~self._bad, self._before
        self._bad, self._before = bad, tracks.xy_img
        if _evidence_of_place(gone, self._near) <= log(p.corrupt_confidence / (1.0 - p.corrupt_confidence)):
            return False
        around = self._near[gone, 1:]
        rest = np.unique(around[~bad[around]])
        step = tracks.xy_img[rest] - before[rest]
        length_px = np.hypot(step[:, 0], step[:, 1])
        length_px = length_px[np.isfinite(length_px)]
        return not length_px.size or float(np.median(length_px)) < p.still_pitches * self._pitch_px

    def needs_focus_check(self, tracks: Tracks) -> bool:
        """Whether pins are missing, or seen with more noise than the baseline."""
        p = self._params
        if tracks.n_seen < (1.0 - RUNTIME.astray_rel) * len(tracks.seen):
            return True
        noise_px = float(tracks.sigma_px[tracks.seen].mean())
        # A centroid's sigma is as the root of the gradient's energy.
        noisy = noise_px * sqrt(p.blurred_rel) > self._baseline_px
        self._baseline_px += (noise_px - self._baseline_px) / p.baseline_frames_n
        return noisy

    def impossible(self, tracks: Tracks) -> bool:
        """Whether pins moved further than skin can."""
        p = self._params
        far_n = count_apart(tracks.xy_img, self._rest_img, p.far_pitches * self._pitch_px)
        return far_n > p.far_rel * len(self._rest_img)


def _evidence_of_place(gone: Mask, near: Index) -> float:
    """Logarithm of two likelihoods' ratio: that pins next to a lost one are lost as often as is seen, and as
    often as any pin. 0 where they are not lost more often.

    near  (n, k) int, of each pin itself and its neighbours
    """
    n, lost_n = len(gone), int(np.count_nonzero(gone))
    if not 1 < lost_n < n:
        return 0.0
    beside = gone[near[gone, 1:]]
    share, chance = float(beside.mean()), (lost_n - 1) / (n - 1)
    if share <= chance:
        return 0.0
    evidence = share * log(share / chance)
    if share < 1.0:
        evidence += (1.0 - share) * log((1.0 - share) / (1.0 - chance))
    return 0.5 * beside.size * evidence  # two pins that are next to each other are counted from both sides
