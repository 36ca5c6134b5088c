"""How sharp an image is, against that of the rest frame; what is a fault: `fault_checks`.

Focus is measured in windows as wide as the pitch: wherever the pins have moved, about one pin lies in each,
so this needs no tracking. The measure is the energy of the gradient over the square of the contrast, which
does not depend on brightness. It is not reported if the image is dark or overexposed: that explains it.
"""

from math import nan

import numpy as np

from edge.faults.frame_counts import FocusWindows
from edge.params import PARAMS as RUNTIME
from edge.pins.lens import rest_as_seen
from edge.pins.params import PARAMS as PINS
from edge.types import Frame, Image, Rest

HALF_REL = 0.5  # sharpness, or pixels that are not saturated, of the rest frame's, below which it is spoilt
ONE_LEVEL = 1 / 255  # of full scale: an image with a lower mean is black


class ImageQuality:
    """Measures images against the rest frame, once there is one."""

    def __init__(self) -> None:
        self._focus: FocusWindows | None = None
        self._rest, self._noise_energy = (0.0, 0.0), 0.0

    def learn(self, rest: Rest, frame: Frame) -> None:
        """Take this image of the untouched tip as the reference."""
        height, width = frame.image.shape
        rest = rest_as_seen(rest)
        half, n = max(3, round(rest.pattern.pitch_px / 2)), RUNTIME.sample_n
        xy = np.rint(rest.xy_img).astype(np.int32)
        inside = np.all((xy >= half) & (xy < [width - half, height - half]), axis=1)
        chosen = xy[inside][:: max(1, np.count_nonzero(inside) // n)]
        self._focus = FocusWindows(chosen - half, 2 * half + 1, n) if len(chosen) else None
        self._noise_energy = 4.0 * rest.pattern.noise**2  # of two differences of two pixels each
        self._rest = self._focus.measure(frame.image, self._noise_energy) if self._focus else (0.0, 0.0)

    def sharpness(self, image: Image, level_rel: float) -> float:
        """Of the rest frame's, and so is `level_rel`; NaN: there is none, or it shows no whole pin."""
        if self._focus is None:
            return nan
        energy, contrast = self._focus.measure(image, self._noise_energy)
        rest_energy, rest_contrast = self._rest
        flat = contrast < PINS.pin_share_min * rest_contrast * level_rel
        return 0.0 if flat else energy / rest_energy if rest_energy > 0.0 else 1.0
