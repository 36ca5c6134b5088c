"""How bright and how sharp an image is, against that of the rest frame; what is a fault: `fault_checks`.

Focus is measured in windows as wide as the pitch: wherever the pins have moved, about one pin lies in each,
so this needs no tracking. The measure is the energy of the gradient over the square of the contrast, which
does not depend on brightness. It is not reported if the image is dark or overexposed: that explains it.
"""

from math import nan

import numpy as np

from edge.faults.frame_counts import FocusWindows, level_of
from edge.faults.judge import Facts
from edge.params import PARAMS as RUNTIME
from edge.pins.lens import rest_as_seen
from edge.pins.params import PARAMS as PINS
from edge.types import Array, Frame, Image, Rest

HALF_REL = 0.5  # sharpness, or pixels that are not saturated, of the rest frame's, below which it is spoilt
#: One grey level of 8 bits, of full scale: an image with a lower mean is black.
ONE_LEVEL = 1 / 255
_SAMPLE_N = RUNTIME.sample_n


class ImageQuality:
    """Measures images against the rest frame, once there is one."""

    def __init__(self) -> None:
        self._focus: FocusWindows | None = None
        self._seen = np.empty((0, 2))
        self._rest = (0.0, 0.0, 0.0)
        self._noise_energy = 0.0
        self._level = self._saturated = 0.0
        self._period_ns = round(RUNTIME.check_s * 1e9)
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
        """Write what `fault_checks` names of the brightness. Changes no state of its own; for any thread."""
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
        flat = contrast / max(level, 1.0) < PINS.pin_share_min * rest_contrast / max(rest_level, 1.0)
        facts.sharpness = 0.0 if flat else energy / rest_energy if rest_energy > 0.0 else 1.0

    def _windows(self, windows: FocusWindows, image: Image) -> tuple[float, float, float]:
        """Energy of the gradient over the contrast squared; contrast; level: medians over the windows."""
        level = windows.measure(image, self._seen)
        contrast = np.maximum(self._seen[:, 1], 1.0)
        energy = (self._seen[:, 0] - self._noise_energy) / contrast**2
        return _median(energy), _median(contrast), level


def _median(values: Array) -> float:
    """The same as np.median, which takes ten times as long for a few values."""
    ordered, half = sorted(values.tolist()), len(values) // 2
    return 0.5 * float(ordered[half] + ordered[~half])
