"""Does the image show pins as the rest frame did? Dark, overexposed, out of focus; and has the camera moved?

Rules
- Dark and overexposed are checked in every image, against the full scale and against the rest frame.
- Focus is measured in windows as wide as the pitch: wherever the pins have moved, about one pin lies in each,
  so this needs no tracking. The measure is the energy of the gradient over the square of the contrast, which
  does not depend on brightness, relative to that of the rest frame.
- Without contrast focus is not reported if the image is dark or overexposed: that explains it.
"""

from __future__ import annotations

import numpy as np

from edge.runtime.measures import FocusWindows, median_length, sample_levels
from edge.types import Array, Frame, Image, Rest

__all__ = ["ImageQuality", "common_step_px", "level_of", "median_offset_px"]

_SAMPLE_STEP = 16  # brightness is read on every 16th row and column: 1200 pixels of 640x480
#: Share of the full scale below which the mean level counts as black; share of samples at full scale above
#: which the image counts as overexposed: of those that are below it in the rest frame.
DARK, FULL = 0.004, 0.5
#: Against the rest frame: below the first share a fault is present, above the second it is gone. Contacts on
#: six real tips (two sets of stills, four videos) keep the level within 0.82..1.12, sharpness within
#: 0.64..1.14;
#: a Gaussian blur of 3 px brings the sharpness to 0.09..0.53, one of 5 px to 0.3 and less.
DIM, DIM_GONE = 0.25, 0.3
BLURRED, BLURRED_GONE = 0.5, 0.56
FLAT = 0.25  # contrast over level: a lens this far out of focus shows no edges at all
WINDOWS = 32
#: A step of all pins from one frame to the next is the camera's if nine of ten differ from the common step by
#: less than this share of it. Skin is held at its rim: in four real videos, at full, half and quarter
#: rate, steps of 0.08 pitches and more have 0.64 and more; a camera knocked during a simulated touch, 0.22.
ALIKE, ALIKE_SHARE = 0.35, 0.9
PERIOD_NS = 40_000_000  # of focus checks, each 0.1 ms: a quarter of a percent of one core


def level_of(image: Image, bits: int) -> tuple[float, float]:
    """Mean level and share of saturated pixels, of full scale."""
    top = (1 << bits) - 1
    total, full, n = sample_levels(image, _SAMPLE_STEP, top)
    return (total / (n * top), full / n) if n else (0.0, 0.0)


class ImageQuality:
    """Compares images with the rest frame, once there is one.

    dark, bright, blurred  the problem; "" if there is none
    """

    def __init__(self) -> None:
        self.dark = self.bright = self.blurred = ""
        self.sharpness = 1.0  # relative to the rest frame's
        self._focus: FocusWindows | None = None
        self._seen = np.empty((0, 2))
        self._rest = (0.0, 0.0, 0.0)
        self._noise_energy = 0.0
        self._level = self._full = 0.0
        self._due_ns: int | None = None

    def learn(self, rest: Rest, frame: Frame) -> None:
        """Take this image of the untouched tip as the reference."""
        height, width = frame.image.shape
        half = max(3, round(rest.pattern.pitch_px / 2))
        xy = np.rint(rest.xy_img).astype(np.int32)
        inside = np.all((xy >= half) & (xy < [width - half, height - half]), axis=1)
        chosen = xy[inside][:: max(1, np.count_nonzero(inside) // WINDOWS)]
        self._focus = FocusWindows(chosen - half, 2 * half + 1) if len(chosen) else None
        self._seen = np.empty((len(chosen), 2))
        self._noise_energy = 4.0 * rest.pattern.noise**2  # of two differences of two pixels each
        self._level, self._full = level_of(frame.image, frame.bits)
        self._rest = self._windows(self._focus, frame.image) if self._focus else (0.0, 0.0, 0.0)
        self._due_ns = None

    def check(self, frame: Frame) -> None:
        """Check one image."""
        self.dark, self.bright = self.brightness_problems(frame)
        due = self._due_ns is None or not 0 <= self._due_ns - frame.capture_ns <= PERIOD_NS
        if due and self._focus:
            self._due_ns = frame.capture_ns + PERIOD_NS
            self._measure_focus(self._focus, frame.image)

    def brightness_problems(self, frame: Frame) -> tuple[str, str]:
        """Why the image is too dark, and overexposed; "" if it is not. Changes no state."""
        level, full = level_of(frame.image, frame.bits)
        least = max(DARK, (DIM_GONE if self.dark else DIM) * self._level)
        dark = f"mean level {level:.1%} of full scale, {self._level:.1%} at rest" if level < least else ""
        most = self._full + FULL * (1.0 - self._full)  # bright skin round dark pins may be there at rest
        return dark, f"{full:.0%} of the image is at full scale" if full > most else ""

    def check_focus(self, frame: Frame) -> None:
        """Check the focus now: pins are missing in this image."""
        if self._focus:
            self._measure_focus(self._focus, frame.image)

    def _measure_focus(self, windows: FocusWindows, image: Image) -> None:
        if self.dark or self.bright:
            return  # brightness explains it
        energy, contrast, level = self._windows(windows, image)
        rest_energy, rest_contrast, rest_level = self._rest
        flat = contrast / max(level, 1.0) < FLAT * rest_contrast / max(rest_level, 1.0)
        self.sharpness = 0.0 if flat else energy / rest_energy if rest_energy > 0.0 else 1.0
        limit = BLURRED_GONE if self.blurred else BLURRED
        self.blurred = f"sharpness {self.sharpness:.0%} of that at rest" if self.sharpness < limit else ""

    def _windows(self, windows: FocusWindows, image: Image) -> tuple[float, float, float]:
        """Energy of the gradient over the contrast squared; contrast; level: medians over the windows."""
        level = windows.measure(image, self._seen)
        contrast = np.maximum(self._seen[:, 1], 1.0)
        energy = (self._seen[:, 0] - self._noise_energy) / contrast**2
        return float(np.median(energy)), float(np.median(contrast)), level


def median_offset_px(motion_px: Array) -> float:
    """Offset of the pins as a whole: median length of their motion.

    motion_px  (n, 2) since rest, of an untouched tip; NaN where lost
    """
    return median_length(motion_px)


def common_step_px(step_px: Array, least_px: float) -> Array | None:
    """The common step of all pins, as when the camera is knocked; None: there was none.

    step_px   (n, 2) from one frame to the next; NaN where lost in either
    least_px  smaller steps do not count
    """
    if median_offset_px(step_px) < least_px:
        return None
    common: Array = np.nanmedian(step_px, axis=0)
    off_px = np.hypot(*(step_px - common).T)
    alike = np.nanquantile(off_px, ALIKE_SHARE) < ALIKE * np.hypot(*common)
    return common if alike else None
