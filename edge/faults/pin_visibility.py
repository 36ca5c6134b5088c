"""Are enough pins seen, and are their places plausible?

- With too few pins, or a hole in the pattern, no values are sent: in a hole the polynomial of the motion is
  undetermined, and a contact there is hidden.
- Nor when many pins vanish at once, until they are back. The baseline is forgotten slowly, so that a tip that
  has lost pins for good becomes usable again.
- Nor in an image that is corrupt in one place: pins that vanish are next to each other, and those around them
  stand still. Pins that vanish one by one are next to each other too, as often as chance has it: both
  explanations are compared by their likelihoods.
"""

from math import log, sqrt

import numpy as np

from edge.faults.frame_counts import PinCounts
from edge.faults.image_quality import HALF_REL
from edge.features.params import PARAMS as FEATURES
from edge.geometry.lattice import N_RING
from edge.geometry.neighbours import nearest_of
from edge.params import ASTRAY_REL
from edge.params import PARAMS as RUNTIME
from edge.types import Index, Mask, Rest, Tracks

SEEN_REL = 0.8  # smallest share of the rest frame's pins
HOLE_REL = 0.01  # largest share of them that are lost with all their neighbours
#: Good frames in a row until values are sent again: those that slip is taken over are good then.
SETTLED_N = FEATURES.slip_span_frames
BASELINE_N = FEATURES.noise_frames_n  # frames over which the baseline is learnt
DROP_REL = RUNTIME.most_rel  # of the baseline share; with fewer, too many vanished at once
BACK_REL = DROP_REL + RUNTIME.hysteresis_rel * DROP_REL  # until so many are back


class PinVisibility:
    """Checks the pins of each frame against the rest frame.

    counts      what is counted of each frame
    impossible  the pins moved further than skin can: the pattern was matched to itself rotated
    """

    def __init__(self, rest: Rest) -> None:
        self._reason = ""
        self._good_n = SETTLED_N
        self._baseline_share = 1.0
        self._baseline_px = float(np.nanmean(rest.pins.sigma_px))
        self._near = nearest_of(rest.xy_img, rest.xy_img, N_RING + 1)[1]
        self.counts = PinCounts(rest.xy_img, self._near)
        self._before = rest.xy_img
        self._pitch_px = rest.pattern.pitch_px
        # Skin cannot move further: twice as far as where a pin counts as overloaded.
        self._far_px = 2.0 * RUNTIME.load_pitches * self._pitch_px
        self._n = len(rest)
        self._seen_n = 0
        self._noise_px = 0.0
        self.impossible = False

    def problem(self, tracks: Tracks) -> str:
        """Count a frame's pins. Why they allow no values for it; empty: they do."""
        n = self._n
        seen_n, _, new_n, hole_n, far_n, self._noise_px = self.counts.seen(
            tracks.xy_img, tracks.sigma_px, FEATURES.noise_ratio_max * self._baseline_px, self._far_px
        )
        self._seen_n = seen_n
        self.impossible = far_n > ASTRAY_REL * n
        identified = tracks.confidence >= Tracks.LOW_CONFIDENCE and not self.impossible
        share = seen_n / n
        why = ""
        if share < SEEN_REL:
            why = "only {counted}"
        elif hole_n > HOLE_REL * n:
            why = "{counted}; around {hole_n} of the others no pin is seen either"
        elif new_n > 1 and self._image_corrupt(tracks):
            why = "{counted}; pins vanished side by side while their neighbours stood still"
        elif share < (BACK_REL if self._reason else DROP_REL) * self._baseline_share:
            why = "{counted}, {usual:.0%} usually: too many vanished at once"
        self._before = tracks.xy_img
        self._baseline_share += (ASTRAY_REL if why else 1.0) * (share - self._baseline_share) / BASELINE_N
        if not why and not identified:
            why = "the pins could not be identified; waiting for several good frames"
        self._good_n = 0 if why else self._good_n + 1
        if why:
            counted = f"{seen_n} of {n} pins are seen"
            self._reason = why.format(counted=counted, hole_n=hole_n, usual=self._baseline_share)
        elif self._good_n >= SETTLED_N:
            self._reason = ""
        return self._reason

    def _image_corrupt(self, tracks: Tracks) -> bool:
        """Whether pins vanished side by side since the last frame while those around them did not move."""
        before = self._before
        gone, bad = self.counts.new.view(np.bool_), self.counts.bad.view(np.bool_)
        if _evidence_of_place(gone, self._near) <= log(Tracks.LOW_CONFIDENCE / (1.0 - Tracks.LOW_CONFIDENCE)):
            return False
        around = self._near[gone, 1:]
        rest = np.unique(around[~bad[around]])
        step = tracks.xy_img[rest] - before[rest]
        length_px = np.hypot(step[:, 0], step[:, 1])
        length_px = length_px[np.isfinite(length_px)]
        return not length_px.size or float(np.median(length_px)) < RUNTIME.still_pitches * self._pitch_px

    def needs_focus_check(self) -> bool:
        """Whether pins are missing, or seen with more noise than the baseline."""
        if self._seen_n < (1.0 - ASTRAY_REL) * self._n:
            return True
        # A centroid's sigma is as the root of the gradient's energy.
        noisy = self._noise_px * sqrt(HALF_REL) > self._baseline_px
        self._baseline_px += (self._noise_px - self._baseline_px) / BASELINE_N
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
