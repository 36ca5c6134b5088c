"""Where each known pin is now, from its neighbourhood alone: the tip's constants for `centroids`."""

from __future__ import annotations

import numpy as np

from edge.geometry.lens import corrected, magnification, seen
from edge.pins.centroids import CentroidKernel
from edge.pins.lens import rest_as_seen
from edge.pins.params import PARAMS, PinParams
from edge.pins.templates import STEP_MAX, templates_of
from edge.types import Array, Image, Pins, Rest


class CentroidRefiner:
    """Reads the pins of `rest` in image after image, each near where it is predicted."""

    def __init__(self, rest: Rest, params: PinParams = PARAMS) -> None:
        self._lens = rest.pattern.lens
        rest = rest_as_seen(rest)
        pattern = rest.pattern
        if self._lens is not None:
            self._magnification = magnification(self._lens, rest.xy_img)
        radius = np.asarray(rest.pins.radius_px, np.float64)
        kinds, kind_of = np.unique(
            np.rint(np.log(radius) / np.log(params.radius_kind_step)), return_inverse=True
        )
        self._kernel = CentroidKernel(
            templates_of(tuple(params.radius_kind_step**kinds), pattern.edge_px, pattern.pitch_px),
            kind_of.astype(np.int32),
            rest.pins.brightness,
            {
                "steps_max": params.steps_max,
                "near_phases": params.near_phases,
                "share_min": params.pin_share_min,
                "reach_px": params.own_pitches * pattern.pitch_px,
                "clash_px": radius.min(),  # nearer, one's middle lies on the other's disc
                "noise": pattern.noise,
                # So few that one bit is left above the pins' brightness: the light may double.
                "spare_bits": max(0.0, np.ceil(np.log2(pattern.brightness / STEP_MAX)) + 1.0),
            },
            pattern.dark,
        )
        kernel = self._kernel
        self._pins = Pins(kernel.xy, kernel.sigma, radius, kernel.amplitude)  # the kernel's memory

    def refine(self, image: Image, xy_img_predicted: Array) -> Pins:
        """Centroid of each pin near its prediction; row i is pin i, NaN where there is none.

        image             (h, w) uint8 or uint16
        xy_img_predicted  (n, 2) float64, px; within half a pitch of the truth; NaN gives NaN
        Raises            ValueError: another image or another number of predictions
        """
        pins = self.read(image, xy_img_predicted)
        return Pins(pins.xy_img.copy(), pins.sigma_px.copy(), pins.radius_px, pins.brightness.copy())

    def read(self, image: Image, xy_img_predicted: Array) -> Pins:
        """As `refine`, but the arrays are good until the next image: for a frame's hot path."""
        predicted = xy_img_predicted if self._lens is None else seen(self._lens, xy_img_predicted)
        self._kernel.read(image, np.ascontiguousarray(predicted, np.float64))
        pins = self._pins
        if self._lens is None:
            return pins
        xy, sigma = corrected(self._lens, pins.xy_img), pins.sigma_px * self._magnification
        return Pins(xy, sigma, pins.radius_px, pins.brightness)

    @property
    def fit(self) -> Array:
        """(n,) share of the window's variation that the disc explained in the last image."""
        fit: Array = self._kernel.fit.copy()
        return fit
