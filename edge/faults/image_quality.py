"""Does the image show pins as the rest frame did? Dark, overexposed, out of focus; and has the camera moved?

Focus is measured in windows as wide as the pitch: wherever the pins have moved, about one pin lies in each,
so this needs no tracking. The measure is the energy of the gradient over the square of the contrast, which
does not depend on brightness. It is not reported if the image is dark or overexposed: that explains it.
"""

from dataclasses import dataclass
from math import isqrt, nan

import numpy as np

from edge.faults.frame_counts import FocusWindows, sample_levels
from edge.faults.judge import Check, Facts
from edge.params import PARAMS as RUNTIME
from edge.pins.lens import rest_as_seen
from edge.pins.params import PARAMS as PINS
from edge.types import Array, Frame, Image, Rest
from hostlink.wire import FaultCode as F


@dataclass(frozen=True, slots=True)
class ImageParams:
    """Parameters by name; evidence in docs/tuning.md. `_rel`: a share of the rest frame's."""

    least_rel: float = PINS.pin_share_min  # level, or contrast over level, below which nothing is shown
    half_rel: float = 0.5  # sharpness, or pixels that are not saturated, below which the image is spoilt; of
    # the common step by which pins differ from it, when the camera moved
    focus_period_s: float = RUNTIME.check_s  # between measurements of the focus
    alike_share: float = RUNTIME.most_rel  # of the pins that make a common step


PARAMS = ImageParams()
#: One grey level of 8 bits, of full scale: an image with a lower mean is black.
ONE_LEVEL = 1 / 255
_SAMPLE_N = RUNTIME.sample_n


def level_of(image: Image, bits: int) -> tuple[float, float]:
    """Mean level and share of saturated pixels, of full scale."""
    top = (1 << bits) - 1
    step = max(1, isqrt(image.size) // _SAMPLE_N)
    total, full, n = sample_levels(image, step, top)
    return (total / (n * top), full / n) if n else (0.0, 0.0)


class ImageQuality:
    """Measures images against the rest frame, once there is one; `image_checks` says what is a fault."""

    def __init__(self, params: ImageParams = PARAMS) -> None:
        self._params = params
        self._focus: FocusWindows | None = None
        self._seen = np.empty((0, 2))
        self._rest = (0.0, 0.0, 0.0)
        self._noise_energy = 0.0
        self._level = self._saturated = 0.0
        self._period_ns = round(params.focus_period_s * 1e9)
        self._due_ns = -1  # at once

    def learn(self, rest: Rest, frame: Frame) -> None:
        """Take this image of the untouched tip as the reference."""
        height, width = frame.image.shape
        rest = rest_as_seen(rest)
        half, n = max(3, round(rest.pattern.pitch_px / 2)), _SAMPLE_N
        xy = np.rint(rest.xy_img).astype(np.int32)
        inside = np.all((xy >= half) & (xy < [width - half, height - half]), axis=1)
        chosen = xy[inside][:: max(1, np.count_nonzero(inside) // n)]
        self._focus = FocusWindows(chosen - half, 2 * half + 1, n) if len(chosen) else None
        self._seen = np.empty((len(chosen), 2))
        self._noise_energy = 4.0 * rest.pattern.noise**2  # of two differences of two pixels each
        self._level, self._saturated = level_of(frame.image, frame.bits)
        self._rest = self._windows(self._focus, frame.image) if self._focus else (0.0, 0.0, 0.0)
        self._due_ns = -1  # at once

    def brightness(self, frame: Frame, facts: Facts) -> None:
        """Write what `image_checks` names of the brightness. Changes no state of its own; for any thread."""
        facts.level, facts.saturated = level_of(frame.image, frame.bits)
        below = 1.0 - self._saturated  # bright skin round dark pins may be saturated
        facts.rest_level = self._level
        facts.level_rel = facts.level / self._level if self._level else nan
        facts.newly_saturated = (facts.saturated - self._saturated) / below if below else nan

    def focus_due(self, frame: Frame) -> bool:
        """Whether the sharpness was not measured for a while."""
        return self._focus is not None and not 0 <= self._due_ns - frame.capture_ns <= self._period_ns

    def measure_focus(self, frame: Frame, facts: Facts) -> None:
        if self._focus is None:
            return
        self._due_ns = frame.capture_ns + self._period_ns
        energy, contrast, level = self._windows(self._focus, frame.image)
        rest_energy, rest_contrast, rest_level = self._rest
        flat = contrast / max(level, 1.0) < self._params.least_rel * rest_contrast / max(rest_level, 1.0)
        facts.sharpness = 0.0 if flat else energy / rest_energy if rest_energy > 0.0 else 1.0

    def _windows(self, windows: FocusWindows, image: Image) -> tuple[float, float, float]:
        """Energy of the gradient over the contrast squared; contrast; level: medians over the windows."""
        level = windows.measure(image, self._seen)
        contrast = np.maximum(self._seen[:, 1], 1.0)
        energy = (self._seen[:, 0] - self._noise_energy) / contrast**2
        return float(np.median(energy)), float(np.median(contrast)), level


def image_checks(p: ImageParams = PARAMS) -> tuple[Check, ...]:
    """Brightness, the camera's own "black", and focus."""
    dark = "mean level {level:.1%} of full scale, {rest_level:.1%} at rest"
    return (
        Check(F.IMAGE_DARK, "level", dark, ONE_LEVEL, "full scale", below=True),
        Check(F.IMAGE_DARK, "level_rel", dark, p.least_rel, "rest level", below=True),
        Check(F.IMAGE_DARK, "black", "black"),
        Check(
            F.IMAGE_BRIGHT, "newly_saturated", "{saturated:.0%} of the image is at full scale",
            1.0 - p.half_rel, "of the others",
        ),
        Check(
            F.IMAGE_BLURRED, "sharpness", "sharpness {sharpness:.0%} of that at rest",
            p.half_rel, "that at rest", below=True,
        ),
    )  # fmt: skip


def common_step_px(step_px: Array, params: ImageParams = PARAMS) -> Array | None:
    """The common step of all pins, as when the camera is knocked; None: they did not move alike.

    step_px   (n, 2) from one frame to the next; NaN where lost in either
    """
    common: Array = np.nanmedian(step_px, axis=0)
    off_px = np.hypot(*(step_px - common).T)
    alike = np.nanquantile(off_px, params.alike_share) < params.half_rel * np.hypot(*common)
    return common if alike else None
