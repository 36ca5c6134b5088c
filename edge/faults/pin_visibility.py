"""Are enough pins seen, and are their places plausible?

- With too few pins, or a hole in the pattern, no values are sent: in a hole the polynomial of the motion is
  undetermined, and a contact there is hidden.
- Nor when many pins vanish at once, until they are back. The baseline is forgotten slowly, so that a tip that
  has lost pins for good becomes usable again.
- Nor in an image that is corrupt in one place: pins that vanish are next to each other, and those around them
  stand still. Pins that vanish one by one are next to each other too, as often as chance has it: both
  explanations are compared by their likelihoods.
"""

from dataclasses import dataclass
from math import log, sqrt

import numpy as np

from edge.faults.frame_counts import PinCounts
from edge.faults.image_quality import PARAMS as IMAGE
from edge.features.params import PARAMS as FEATURES
from edge.geometry.lattice import N_RING
from edge.geometry.neighbours import nearest_of
from edge.params import PARAMS as RUNTIME
from edge.types import Index, Mask, Rest, Tracks


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
    """Checks the pins of each frame against the rest frame.

    counts      what is counted of each frame
    impossible  the pins moved further than skin can: the pattern was matched to itself rotated
    """

    def __init__(self, rest: Rest, params: PinVisibilityParams = PARAMS) -> None:
        self._params = params
        self._reason = ""
        self._good_n = params.settled_frames_n
        self._baseline_share = 1.0
        self._baseline_px = float(np.nanmean(rest.pins.sigma_px))
        self._near = nearest_of(rest.xy_img, rest.xy_img, N_RING + 1)[1]
        self.counts = PinCounts(rest.xy_img, self._near)
        self._before = rest.xy_img
        self._pitch_px = rest.pattern.pitch_px
        self._far_px = params.far_pitches * self._pitch_px
        self._n = len(rest)
        self._seen_n = 0
        self._noise_px = 0.0
        self.impossible = False

    def problem(self, tracks: Tracks) -> str:
        """Count a frame's pins. Why they allow no values for it; empty: they do."""
        p, n = self._params, self._n
        seen_n, _, new_n, hole_n, far_n, self._noise_px = self.counts.seen(
            tracks.xy_img, tracks.sigma_px, p.noisy_ratio * self._baseline_px, self._far_px
        )
        self._seen_n = seen_n
        self.impossible = far_n > p.far_rel * n
        identified = tracks.confidence >= Tracks.LOW_CONFIDENCE and not self.impossible
        share = seen_n / n
        corrupt = new_n > 1 and self._image_corrupt(tracks)
        self._before = tracks.xy_img
        few = share < p.seen_rel or hole_n > p.hole_rel * n or corrupt
        least = p.drop_rel * (1.0 + p.back_rel) if self._reason else p.drop_rel
        suddenly = share < least * self._baseline_share
        weight = p.forget_rel if few or suddenly else 1.0
        self._baseline_share += weight * (share - self._baseline_share) / p.baseline_frames_n
        if few or suddenly or not identified:
            self._good_n = 0
            counted = f"{seen_n} of {n} pins are seen"
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

    def _image_corrupt(self, tracks: Tracks) -> bool:
        """Whether pins vanished side by side since the last frame while those around them did not move."""
        p, before = self._params, self._before
        gone, bad = self.counts.new.view(np.bool_), self.counts.bad.view(np.bool_)
        if _evidence_of_place(gone, self._near) <= log(p.corrupt_confidence / (1.0 - p.corrupt_confidence)):
            return False
        around = self._near[gone, 1:]
        rest = np.unique(around[~bad[around]])
        step = tracks.xy_img[rest] - before[rest]
        length_px = np.hypot(step[:, 0], step[:, 1])
        length_px = length_px[np.isfinite(length_px)]
        return not length_px.size or float(np.median(length_px)) < p.still_pitches * self._pitch_px

    def needs_focus_check(self) -> bool:
        """Whether pins are missing, or seen with more noise than the baseline."""
        p = self._params
        if self._seen_n < (1.0 - RUNTIME.astray_rel) * self._n:
            return True
        # A centroid's sigma is as the root of the gradient's energy.
        noisy = self._noise_px * sqrt(p.blurred_rel) > self._baseline_px
        self._baseline_px += (self._noise_px - self._baseline_px) / p.baseline_frames_n
        return noisy


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
