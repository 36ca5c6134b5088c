"""Where each known pin is now, from its neighbourhood alone: the tip's constants for `centroids`."""

from collections.abc import Callable

import numpy as np

from edge.pins.centroids import CentroidKernel
from edge.pins.lens import corrected, magnification, rest_as_seen, seen
from edge.pins.params import PARAMS
from edge.pins.templates import SIDE, STEP_MAX, templates_of
from edge.types import Array, Image, Pins, Rest


class CentroidRefiner:
    """Reads the pins of `rest` in image after image, each near where it is predicted.

    predicted  (n, 2) px, where pins are to be searched for; to be written before `read`
    found      what `read` found there; row i is pin i, NaN where there is none
    Both are the same arrays in all frames.
    """

    def __init__(self, rest: Rest) -> None:
        self._lens = rest.pattern.lens
        rest = rest_as_seen(rest)
        pattern = rest.pattern
        if self._lens is not None:
            self._magnification = magnification(self._lens, rest.xy_img)
        radius = np.asarray(rest.pins.radius_px, np.float64)
        # Where kinds are a pixel apart, pins are read by blocks, which hide less of a radius that is off.
        side = SIDE if (PARAMS.radius_kind_step - 1.0) * pattern.pin_radius_px >= 1.0 else 1
        step = PARAMS.radius_kind_step ** (1.0 / side)
        kinds, kind_of = np.unique(np.rint(np.log(radius) / np.log(step)), return_inverse=True)
        levels, most = (side * side * level for level in (pattern.brightness, np.iinfo(np.uint8).max))
        self._kernel = CentroidKernel(
            templates_of(tuple(step**kinds), pattern.edge_px, pattern.pitch_px, side),
            kind_of.astype(np.int32),
            rest.pins.brightness,
            {
                "steps_max": PARAMS.steps_max,
                "near_phases": PARAMS.near_phases,
                "share_min": PARAMS.pin_share_min,
                "reach_px": PARAMS.own_pitches * pattern.pitch_px,
                "noise": pattern.noise,
                # One bit is left above the pins' brightness, since the light may double.
                "spare_bits": max(0.0, np.ceil(np.log2(levels / STEP_MAX)) + 1.0) if levels > most else 0.0,
            },
            pattern.dark,
        )
        k = self._kernel
        predicted, xy, sigma, amplitude = map(np.asarray, (k.predicted, k.xy, k.sigma, k.amplitude))
        self.predicted: Array = predicted
        self.found = Pins(xy, sigma, radius, amplitude)
        self.read: Callable[[Image], None] = k.read
        if self._lens is not None:  # the kernel's are as the camera sees them
            self._as_seen = predicted, xy, sigma
            self.predicted = predicted.copy()
            self.found = Pins(xy.copy(), sigma.copy(), radius, amplitude)
            self.read = self._read_through_lens

    def refine(self, image: Image, xy_img_predicted: Array) -> Pins:
        """Centroid of each pin near its prediction, in arrays of its own.

        image             (h, w) uint8 or uint16
        xy_img_predicted  (n, 2) float64, px; within half a pitch of the truth; NaN gives NaN
        Raises            ValueError: another image or another number of predictions
        """
        if xy_img_predicted.shape != self.predicted.shape:
            raise ValueError(f"predictions {self.predicted.shape} are wanted, not {xy_img_predicted.shape}")
        self.predicted[:] = xy_img_predicted
        self.read(image)
        pins = self.found
        return Pins(pins.xy_img.copy(), pins.sigma_px.copy(), pins.radius_px, pins.brightness.copy())

    def _read_through_lens(self, image: Image) -> None:
        (predicted, xy, sigma), lens = self._as_seen, self._lens
        assert lens is not None
        predicted[:] = seen(lens, self.predicted)
        self._kernel.read(image)
        self.found.xy_img[:] = corrected(lens, xy)
        self.found.sigma_px[:] = sigma * self._magnification

    @property
    def fit(self) -> Array:
        """(n,) share of the window's variation that the disc explained in the last image."""
        return np.array(self._kernel.fit)
