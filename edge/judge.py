"""Does the image show pins as the rest frame did? Dark, overexposed, out of focus; and has the camera moved?

Rules
- Dark and overexposed are judged on every image, against the full scale and against the rest frame.
- Focus is judged in windows as wide as the pitch: wherever the pins have moved, about one pin lies in each,
  so the judgement needs no tracking. Its measure is the energy of the gradient over the square of the
  contrast, which light does not change, in relation to the rest frame's.
- Nothing is said about focus where there is no contrast to judge it by, and light explains that.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from edge import _judge
from edge.types import Array, Frame, Image, Index, Mask, Rest, Tracks

__all__ = ["ImageJudge", "PinsJudge", "common_step_px", "level_of", "moved_px"]

_SAMPLE_STEP = 16  # brightness is read on every 16th row and column: 1200 pixels of 640x480
#: Share of the full scale below which the mean level of an image shows nothing; share of samples at the top
#: of the scale above which it shows too little.
DARK, FULL = 0.004, 0.5
#: Against the rest frame: below the first share a fault is present, above the second it is gone. Contacts on
#: six real tips (two sets of stills, four videos) leave level within 0.82..1.12, sharpness within 0.64..1.14;
#: a Gaussian blur of 3 px brings the sharpness to 0.09..0.53, one of 5 px to 0.3 and less.
DIM, DIM_GONE = 0.25, 0.3
BLURRED, BLURRED_GONE = 0.5, 0.56
FLAT = 0.25  # contrast over level: a lens this far out of focus leaves no edges at all
WINDOWS = 32
#: Pins: below this share of them, or with more than this share of them in holes (lost, and all their
#: neighbours too), values are not to be trusted: in a hole the polynomial of the motion has nothing to go by.
#: Noise over an eighth of the image: shear wrong by up to 0.12 mm at 0.02, 0.8 mm at 0.05, 2.8 mm at 0.2; and
#: a hole over a contact hides it. Good stills of the 331-pin tip show 0.99 of the pins and no hole.
SEEN_SHARE, HOLE_SHARE = 0.8, 0.01
NEIGHBOURS = 6
#: A pin with this many times the usual sigma is as good as lost. Where at least so many pins go from one
#: frame to the next, side by side, and those around them hardly move, no touch took them: a piece of the
#: image broke, and what holds there is known a few frames later. Share of such a pin's neighbours that go
#: with it: noise over an eighth of the image 0.28..0.8; four real videos at full rate below 0.25 in
#: 98..99.5 % of the frames; pins that go one by one as many as go at all, hence the factor. Motion in
#: pitches a frame.
NOISY, TORN_PINS, TORN_SHARE, TORN_OVER_CHANCE, STILL = 5.0, 4, 0.25, 2.0, 0.1
#: Motion of 5 % of the pins, in pitches, that no skin stands: identities are wrong. The published range of
#: the 331-pin tip ends at 1.3; a pattern taken for itself, turned by one step of its symmetry, begins at 6.
FAR_PITCHES, FAR_SHARE = 3.0, 0.05
#: Pins seen with this much more noise than usual, or fewer than this share of them: look at the focus now.
NOISIER, FEWER = 1.3, 0.95
#: Against the share of pins usually seen: fewer than this all at once, and until this many are back, values
#: are not to be trusted. What was usual is forgotten slowly while too few are seen: a pattern that has
#: lost pins for good is used again.
DROP_SHARE, BACK_SHARE = 0.9, 0.98
SETTLED_FRAMES = 4  # good ones in a row, until the identities of the last pins that came back are sure
USUAL_FRAMES, SETTLING_FRAMES = 64, 1024
#: A step that all pins make from one frame to the next is the camera's, where nine of ten are off the common
#: step by less than this share of it. Skin is held at its rim: in four real videos, at full, half and quarter
#: rate, steps of 0.08 pitches and more have 0.64 and more; a camera knocked during a simulated touch, 0.22.
ALIKE, ALIKE_SHARE = 0.35, 0.9
PERIOD_NS = 40_000_000  # of the judgement of focus, which costs 0.1 ms: a quarter of a percent of one core


def level_of(image: Image, bits: int) -> tuple[float, float]:
    """Mean level and share of saturated pixels, of full scale."""
    top = (1 << bits) - 1
    total, full, n = _judge.levels(image, _SAMPLE_STEP, top)
    return (total / (n * top), full / n) if n else (0.0, 0.0)


class ImageJudge:
    """Judges images against the rest frame, once there is one.

    dark, bright, blurred  words; "" where all is well
    """

    def __init__(self) -> None:
        self.dark = self.bright = self.blurred = ""
        self.sharpness = 1.0  # in relation to the rest frame's
        self._corners: Index = np.empty((0, 2), np.int32)
        self._side = 0
        self._seen = np.empty((0, 2))
        self._rest = (0.0, 0.0, 0.0)
        self._noise_energy = 0.0
        self._level = 0.0
        self._due_ns: int | None = None

    def learn(self, rest: Rest, frame: Frame) -> None:
        """Take this image of the untouched tip as what is right."""
        height, width = frame.image.shape
        half = max(3, round(rest.pattern.pitch_px / 2))
        xy = np.rint(rest.xy_img).astype(np.int32)
        inside = np.all((xy >= half) & (xy < [width - half, height - half]), axis=1)
        chosen = xy[inside][:: max(1, np.count_nonzero(inside) // WINDOWS)]
        self._corners = np.ascontiguousarray(chosen - half, np.int32)
        self._side = 2 * half + 1
        self._seen = np.empty((len(chosen), 2))
        self._noise_energy = 4.0 * rest.pattern.noise**2  # of two differences of two pixels each
        self._level, _ = level_of(frame.image, frame.bits)
        self._rest = self._windows(frame.image) if len(chosen) else (0.0, 0.0, 0.0)
        self._due_ns = None

    def look(self, frame: Frame) -> None:
        """Judge one image."""
        self.dark, self.bright = self.light(frame)
        due = self._due_ns is None or not 0 <= self._due_ns - frame.capture_ns <= PERIOD_NS
        if due and len(self._corners):
            self._due_ns = frame.capture_ns + PERIOD_NS
            self._judge_focus(frame.image)

    def light(self, frame: Frame) -> tuple[str, str]:
        """Words for too dark and overexposed, "" where it is not; remembers nothing."""
        level, full = level_of(frame.image, frame.bits)
        least = max(DARK, (DIM_GONE if self.dark else DIM) * self._level)
        dark = f"mean level {level:.1%} of full scale, {self._level:.1%} at rest" if level < least else ""
        return dark, f"{full:.0%} of the image is at full scale" if full > FULL else ""

    def look_closer(self, frame: Frame) -> None:
        """Judge the focus now: pins went missing in this image."""
        if len(self._corners):
            self._judge_focus(frame.image)

    def _judge_focus(self, image: Image) -> None:
        if self.dark or self.bright:
            return  # light explains it
        energy, contrast, level = self._windows(image)
        rest_energy, rest_contrast, rest_level = self._rest
        flat = contrast / max(level, 1.0) < FLAT * rest_contrast / max(rest_level, 1.0)
        self.sharpness = 0.0 if flat else energy / rest_energy if rest_energy > 0.0 else 1.0
        limit = BLURRED_GONE if self.blurred else BLURRED
        self.blurred = f"sharpness {self.sharpness:.0%} of that at rest" if self.sharpness < limit else ""

    def _windows(self, image: Image) -> tuple[float, float, float]:
        """Energy of the gradient over the contrast squared; contrast; level: medians over the windows."""
        level = _judge.windows(image, self._corners, self._side, self._seen)
        contrast = np.maximum(self._seen[:, 1], 1.0)
        energy = (self._seen[:, 0] - self._noise_energy) / contrast**2
        return float(np.median(energy)), float(np.median(contrast)), level


class PinsJudge:
    """Judges whether the pins that are seen are enough, and where they can be."""

    def __init__(self, rest: Rest) -> None:
        k = min(NEIGHBOURS + 1, len(rest))
        self._rest_img = np.ascontiguousarray(rest.xy_img)
        self._missing = False
        self._good_n = SETTLED_FRAMES
        self._usual_share = 1.0
        self._usual_px = float(np.nanmean(rest.pins.sigma_px))
        self._near = cKDTree(rest.xy_img).query(rest.xy_img, k=k)[1]
        self._bad, self._before = np.zeros(len(rest), dtype=np.bool_), rest.xy_img
        self._still_px = STILL * rest.pattern.pitch_px
        self._far_px = FAR_PITCHES * rest.pattern.pitch_px

    def missing(self, tracks: Tracks) -> str:
        """Empty, or what is missing: too much at all, or suddenly, or not all of it back yet."""
        n = len(tracks.seen)
        share = tracks.n_seen / n
        bad = ~(tracks.sigma_px <= NOISY * self._usual_px)  # a lost pin's is NaN
        hole_n = int(np.count_nonzero(bad[self._near].all(axis=1))) if bad.any() else 0
        little = share < SEEN_SHARE or hole_n > HOLE_SHARE * n or self._torn(tracks, bad)
        suddenly = share < (BACK_SHARE if self._missing else DROP_SHARE) * self._usual_share
        frames = SETTLING_FRAMES if little or suddenly else USUAL_FRAMES
        self._usual_share += (share - self._usual_share) / frames
        doubtful = little or suddenly or tracks.confidence < Tracks.LOW_CONFIDENCE
        self._good_n = 0 if doubtful else self._good_n + 1
        self._missing = self._good_n < SETTLED_FRAMES
        return f"{tracks.n_seen} of {n} pins are seen, {hole_n} within holes" if self._missing else ""

    def _torn(self, tracks: Tracks, bad: Mask) -> bool:
        """Whether pins went since the last frame, together, and nothing moved that could have taken them."""
        gone, before = bad & ~self._bad, self._before
        self._bad, self._before = bad, tracks.xy_img
        if np.count_nonzero(gone) < TORN_PINS:
            return False
        around = self._near[gone, 1:]
        beside = gone[around]
        if beside.mean() <= max(TORN_SHARE, TORN_OVER_CHANCE * gone.mean()):
            return False
        left = np.unique(around[~bad[around]])
        step = tracks.xy_img[left] - before[left]
        moved_px = np.hypot(step[:, 0], step[:, 1])
        moved_px = moved_px[np.isfinite(moved_px)]
        return not moved_px.size or float(np.median(moved_px)) < self._still_px

    def odd(self, tracks: Tracks) -> bool:
        """Whether the image deserves a closer look: pins missing, or seen with more noise than usual."""
        if tracks.n_seen < FEWER * len(tracks.seen):
            return True
        noise_px = float(tracks.sigma_px[tracks.seen].mean())
        odd = noise_px > NOISIER * self._usual_px
        self._usual_px += (noise_px - self._usual_px) / USUAL_FRAMES
        return odd

    def impossible(self, tracks: Tracks) -> bool:
        """Whether pins would have moved further than any skin does."""
        far_n = _judge.far(np.ascontiguousarray(tracks.xy_img), self._rest_img, self._far_px)
        return far_n > FAR_SHARE * len(self._rest_img)


def moved_px(motion_px: Array) -> float:
    """By how much the pins stand elsewhere as a whole: median length of their motion.

    motion_px  (n, 2) since rest, of an untouched tip; NaN where lost
    """
    return _judge.middle_length(np.ascontiguousarray(motion_px), np.empty(len(motion_px)))


def common_step_px(step_px: Array, least_px: float) -> Array | None:
    """The step that all pins made alike, as they do when the camera is knocked; None: there was none.

    step_px   (n, 2) from one frame to the next; NaN where lost in either
    least_px  smaller ones are none
    """
    if moved_px(step_px) < least_px:
        return None
    common: Array = np.nanmedian(step_px, axis=0)
    off_px = np.hypot(*(step_px - common).T)
    alike = np.nanquantile(off_px, ALIKE_SHARE) < ALIKE * np.hypot(*common)
    return common if alike else None
