"""Image in, features out, without a bus: what `from edge import Fingertip` gives."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from edge.calibration import Calibration
from edge.examples import example_calibration
from edge.frame import ALL, Pipeline
from edge.rest.tare import PARAMS as TARE
from edge.rest.tare import take_rest_frame
from edge.sources.region import region_named
from edge.types import Feature, Frame, Image, Result


class Fingertip:
    """One fingertip, read from its camera's images, which follow each other: for stills make one for each.

    untouched    images of the untouched tip, 8 as a rule: (h, w) uint8, grey; or uint16
    calibration  of this tip, a file or example:NAME; None: values in px alone
    bits         significant in each pixel
    region       where the images show the skin, as in a source's address: "roi=40,30,560,420",
                 "mask=skin.png"; parts that do not touch each other, as mirrors give them, are views of it
    Raises       EdgeError: no pins, a touch, another tip, no such region, or a file cannot be read
    """

    def __init__(
        self,
        untouched: Sequence[Image],
        calibration: str | Path | None = None,
        bits: int = 8,
        region: str = "",
    ) -> None:
        file = calibration and (example_calibration(str(calibration)) or calibration)
        loaded = Calibration.load(file) if file else None
        width, height = _grey(untouched[0]).shape[::-1] if len(untouched) else (0, 0)
        self._region = region_named("Fingertip", (width, height), region)
        images = [Frame(_grey(image), 0, 0).within(self._region).image for image in untouched]
        self.rest = take_rest_frame(images, replace(TARE, region=self._region), loaded).rest
        self._pipeline = Pipeline(self.rest, loaded, ALL - {Feature.SURFACE})
        self._bits, self._sequence = bits, 0

    def read(self, image: Image, time_s: float) -> Result:
        """The features of the next image, and its calibrated values.

        image    as those of the untouched tip
        time_s   when it was taken, on any clock: slip and vibration are rates
        Returns  `reading.values` by name, in mm, N and deg, NaN where not valid; `features` in px, None where
                 the pins could not be identified; `tracks`, where each pin is
        Raises   ValueError: no grey image of the same size, no time
        """
        width, height = self.rest.pattern.size_px
        if _grey(image).shape != (height, width):
            raise ValueError(f"image of {image.shape[1]}x{image.shape[0]} px; give {width}x{height}")
        if not math.isfinite(time_s):
            raise ValueError(f"time_s {time_s}; give seconds")
        self._sequence += 1
        frame = Frame(image, round(time_s * 1e9), self._sequence, bits=self._bits)
        return self._pipeline.process(frame.within(self._region))


def _grey(image: Image) -> Image:
    """Raises ValueError: it is no grey image."""
    if image.ndim != 2 or image.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"image of shape {image.shape}, {image.dtype}; give a grey one, uint8 or uint16")
    return image
