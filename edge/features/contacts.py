"""Contacts of a frame, from the contact field to their places.

    contact field --peaks--> above the noise --prominence--> contacts, each a region
    --seen pins--> no guesses --fits--> close pairs separated, bars joined --pins round it--> place

A probe makes one peak, a long edge a chain of them, a flat surface a ring or a rough plateau. Peaks with no
real valley between them are one contact.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from edge.features.contact_place import ContactPlace
from edge.features.params import PARAMS, FeatureParams
from edge.features.peaks import PeakFinder
from edge.features.pin_motion import PinNoise
from edge.features.regions import Regions
from edge.features.several import Fits, FittedContacts
from edge.features.surface import Surface
from edge.types import Array, ContactRegion, FittedContact, Heights, Mask

__all__ = ["ContactFinder", "maxima"]

_UNKNOWN = np.full(2, np.nan)


def maxima(grid: Heights) -> Mask:
    """Regional maxima, plateaus included.

    grid     (h, w) float32; -inf where there is no value
    Returns  (h, w) bool, equal to skimage.morphology.local_maxima(grid): none where all is of one height
    """
    peaks = PeakFinder(np.ones(grid.shape, dtype=np.bool_))
    peaks.set_field(grid.ravel())
    top: Mask = peaks.mark_maxima().reshape(grid.shape)
    return np.zeros_like(top) if top.all() else top


class ContactFinder:
    """Finds the contacts on the grid of one tip's surface."""

    def __init__(self, surface: Surface, params: FeatureParams = PARAMS) -> None:
        self._surface, self._params = surface, params
        self._peaks = PeakFinder(surface.inside)
        x0, y0, step_px = float(surface.x_img[0]), float(surface.y_img[0]), surface.step_px
        self._regions = Regions(self._peaks, x0, y0, step_px, params)
        self._place = ContactPlace(surface.rest_img, surface.pitch_px, surface.field, self._regions, params)
        self._fitted = FittedContacts(surface, self._regions, params)
        self._pin_noise = PinNoise(surface.rest_img, surface.pitch_px)
        # The kernels' arrays.
        self._blend, self._active = np.asarray(surface.field.blend), np.asarray(surface.field.active)
        # In their `data` numbers are read in a fifth of the time.
        self._elongation: Any = np.asarray(self._regions.elongation).data
        self._direction: Any = np.asarray(self._regions.direction).data
        self._placed, self._middle = np.asarray(self._place.place), np.asarray(self._regions.middle)
        self._divergence_moment = np.asarray(self._place.divergence_moment)
        self._curl_moment = np.asarray(self._place.curl_moment)

    def forget(self) -> None:
        """The next frame does not follow the last one."""
        self._fitted.forget()

    def find(
        self, xy_img: Array, seen: Mask, sigma_px: float, *, moments: bool = True, fits: Fits = Fits.ALL
    ) -> tuple[ContactRegion, ...]:
        """Contacts of the frame that the surface's fields were last computed for, strongest first.

        xy_img    (n, 2) px, where each pin is now; finite
        seen      (n,) bool
        sigma_px  noise of one coordinate of a pin's motion since rest
        moments   False: they are not wanted, and NaN
        fits      the contacts that are wanted as fitted to the pins' motion
        Source    paper, "Contact Location and Multi-Contact Detection"
        """
        params, regions, peaks = self._params, self._regions, self._peaks
        field_noise = self._surface.divergence_noise
        peaks.set_field(self._blend, self._active, self._surface.field.n_active)
        if not peaks.find(field_noise, params.contact_sigma * sigma_px, params.min_area_change):
            self.forget()
            return ()
        if regions.merge(field_noise, 0.0) > 1:  # noise joins contacts, it parts none
            regions.merge(field_noise, self._pin_noise_px(xy_img, seen, sigma_px))
        if regions.n_contacts > 1:
            self._place.drop_guesses(seen)
        self._fitted.begin()
        n, direction = regions.n_contacts, math.nan
        if n == 2:
            direction = self._fitted.join(xy_img, seen, wanted=fits <= n)
        elif n == 1 and self._elongation[0] >= params.min_oriented_elongation:
            direction = self._fitted.split(xy_img, seen)
        elif n == 1 and peaks.n_peaks > 1:
            self._fitted.split_round(xy_img, seen, regions.ridge(0))
        self._place.find_places(xy_img)
        if moments:
            self._place.find_moments()
        fitted = self._fitted.fit(xy_img, seen) if regions.n_contacts >= fits else []
        contacts = [self._describe(0, direction, moments, fitted)]
        for i in range(1, regions.n_contacts):
            contacts.append(self._describe(i, math.nan, moments, fitted))
        return tuple(contacts)

    def _pin_noise_px(self, xy_img: Array, seen: Mask, sigma_px: float) -> float:
        """Noise of a pin, from its neighbours in this frame and from rest."""
        return math.hypot(self._pin_noise.sigma_px(xy_img, seen), sigma_px)

    def _describe(
        self, i: int, direction: float, moments: bool, fitted: list[FittedContact]
    ) -> ContactRegion:
        """Contact i, whose direction is known from a fit, or NaN."""
        elongation = self._elongation[i]
        if math.isnan(direction) and elongation >= self._params.min_oriented_elongation:
            direction = self._direction[i]
        return ContactRegion(
            xy_img=self._placed[i].copy(),
            peak=self._regions.peak_height(i),
            area_px2=self._regions.area_px2(i),
            orientation_rad=direction,
            elongation=elongation,
            ridge_img=self._regions.ridge(i),
            middle_img=self._middle[i].copy(),
            divergence_moment_px=self._divergence_moment[i].copy() if moments else _UNKNOWN,
            curl_moment_px=self._curl_moment[i].copy() if moments else _UNKNOWN,
            fitted=fitted[i] if fitted else None,
        )
