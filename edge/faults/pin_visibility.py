"""Are enough pins seen, and are their places plausible?

- With too few pins, or a hole in the pattern, no values are sent: in a hole the polynomial of the motion is
  undetermined, and a contact there is hidden.
- Nor when many pins vanish at once, until they are back. The baseline is forgotten slowly, so that a tip that
  has lost pins for good becomes usable again.
- Nor in an image that is corrupt in one place: pins that vanish are next to each other, and those around them
  stand still. Pins that vanish one by one are next to each other too, as often as chance has it: both
  explanations are compared by their likelihoods.
- Pins that a contact hides are its own evidence: those around them have moved apart. Values come from the
  others, with the variance that the lost ones leave; the fault says that they are partly seen.
- A view of which no pin is seen, as of a mirror that is covered, is none of the others': theirs go on.
- Each image is judged by itself: values are back as soon as the pins are.
"""

from math import log, pi, sqrt

import numpy as np

from edge.features.params import PARAMS as FEATURES
from edge.geometry.lattice import N_RING
from edge.geometry.neighbours import nearest_of
from edge.geometry.parts import joined, parts_of
from edge.params import ASTRAY_REL
from edge.params import PARAMS as RUNTIME
from edge.types import Array, ContactRegion, Features, Index, Mask, Rest, Tracks

SEEN_REL = 0.8  # smallest share of the rest frame's pins
HOLE_REL = 0.01  # largest share of them that are lost with all their neighbours
BASELINE_N = FEATURES.noise_frames_n  # frames over which the baseline is learnt
DROP_REL = RUNTIME.most_rel  # of the baseline share; with fewer, too many vanished at once
BY_CONTACT = "a contact hides them"


class PinVisibility:
    """Checks the pins of each frame against the rest frame.

    impossible  the pins moved further than skin can: the pattern was matched to itself rotated
    baseline_px  with what mean sigma pins are usually seen; learnt by the caller
    explained   by what the last frame's problem is, so that it has values all the same; empty: by nothing
    """

    def __init__(self, rest: Rest) -> None:
        self._baseline_share = 1.0
        self.baseline_px = float(np.nanmean(rest.pins.sigma_px))
        self._rest_img = rest.xy_img
        parts = parts_of(rest)
        near = [rows[nearest_of(own.xy_img, own.xy_img, N_RING + 1)[1]] for rows, own in parts]
        self._views = [rows for rows, _ in parts]
        self._near = joined(self._views, near)
        self._bad = self._none_bad = np.zeros(len(rest), np.bool_)  # in the last frame; not written to
        self._before = rest.xy_img
        self._pitch_px = rest.pattern.pitch_px
        # Skin cannot move further: twice as far as where a pin counts as overloaded.
        self._far_px = 2.0 * RUNTIME.load_pitches * self._pitch_px
        self._n = len(rest)
        self._seen_n = 0
        self.impossible = False
        self.explained = ""

    def note_calm(self, xy_img: Array, frames_n: int) -> None:
        """Note frames that gave no cause to look at their pins, all of them seen; in the last one here."""
        self._bad, self._before = self._none_bad, xy_img
        self._baseline_share = 1.0 - (1.0 - self._baseline_share) * (1.0 - 1.0 / BASELINE_N) ** frames_n

    def problem(self, tracks: Tracks, features: Features | None = None) -> str:
        """Count a frame's pins, which gave these features, if any; what is wrong with them, or empty."""
        n = self._n
        self._seen_n = tracks.n_seen
        self.impossible, self.explained = False, ""
        # Drift moves no pin by half as much.
        if features is None or features.longest_px > 0.5 * self._far_px:
            far = np.hypot(*(tracks.xy_img - self._rest_img).T) > self._far_px
            self.impossible = int(np.count_nonzero(far)) > ASTRAY_REL * n
        why, noisy_px = "", FEATURES.noise_ratio_max * self.baseline_px
        if features is None or self._seen_n < n or features.sigma_max_px > noisy_px:
            before, self._bad = self._bad, ~(tracks.sigma_px <= noisy_px)
            why = self._judge(tracks, features, self._bad & ~before)
        else:
            self._bad = self._none_bad
        self._before = tracks.xy_img
        known = ASTRAY_REL**2 if why and self.explained != BY_CONTACT else 1.0
        self._baseline_share += known * (self._seen_n / n - self._baseline_share) / BASELINE_N
        return f"{why}; {self.explained}" if self.explained else why

    def _judge(self, tracks: Tracks, features: Features | None, new: Mask) -> str:
        """The fault of a frame with bad pins, these newly so; and what explains it."""
        if self._seen_n == self._n and not new.any():
            return ""
        bad, why = self._bad, self._why(tracks, self._seen_n, self._bad, new)
        if why and features is not None:
            hidden = self._within(features.contacts or ())
            lost = [rows for rows in self._views if not tracks.seen[rows].any()]
            for rows in lost:
                hidden[rows] = True
            seen_n = int(np.count_nonzero(tracks.seen | hidden))
            if not self._why(tracks, seen_n, bad & ~hidden, new & ~hidden):
                self.explained = f"{len(lost)} of {len(self._views)} views lost" if lost else BY_CONTACT
        return why

    def _why(self, tracks: Tracks, seen_n: int, bad: Mask, new: Mask) -> str:
        """Why these pins allow no values; empty: they do."""
        n, share = self._n, seen_n / self._n
        counted = f"{self._seen_n} of {n} pins are seen"
        if share < SEEN_REL:
            return f"only {counted}"
        hole_n = np.count_nonzero(bad[self._near].all(axis=1))
        if hole_n > HOLE_REL * n:
            return f"{counted}; around {hole_n} of the others no pin is seen either"
        if self._image_corrupt(tracks, bad, new):
            return f"{counted}; pins vanished side by side while their neighbours stood still"
        if share < DROP_REL * self._baseline_share:
            return f"{counted}, {self._baseline_share:.0%} usually: too many vanished at once"
        return ""

    def _within(self, contacts: tuple[ContactRegion, ...]) -> Mask:
        """(n,) bool, the pins that lie at rest within a contact's region, or a pitch around it."""
        within = np.zeros(self._n, np.bool_)
        for contact in contacts:
            reach_px = sqrt(contact.area_px2 * contact.elongation / pi) + self._pitch_px
            within |= np.hypot(*(self._rest_img - contact.middle_img).T) < reach_px
        return within

    def _image_corrupt(self, tracks: Tracks, bad: Mask, gone: Mask) -> bool:
        """Whether pins vanished side by side since the last frame while those around them did not move."""
        before = self._before
        if _evidence_of_place(gone, self._near) <= log(Tracks.LOW_CONFIDENCE / (1.0 - Tracks.LOW_CONFIDENCE)):
            return False
        around = self._near[gone, 1:]
        rest = np.unique(around[~bad[around]])
        step = tracks.xy_img[rest] - before[rest]
        length_px = np.hypot(step[:, 0], step[:, 1])
        length_px = length_px[np.isfinite(length_px)]
        return not length_px.size or float(np.median(length_px)) < RUNTIME.still_pitches * self._pitch_px


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
