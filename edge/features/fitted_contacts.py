"""What fits of contacts decide in a frame: one long contact or two, the direction of a long one, and what
each of several contacts does alone.

    regions --one, long--> line or two points? --two--> two points or a line? --several--> points together

Rules
- Only frames that may hold more than one contact, or a long one, are fitted; a round contact alone is not,
  unless somebody asks.
- Shapes are compared on the same pins by the likelihood of their motion, its noise unknown: the logarithm
  of two likelihoods' ratio is n log of the ratio of squared errors, of n pins with two coordinates each.
- What the regions say is overruled by much evidence only: the model's errors are alike among neighbours.
- Two points are two contacts only if both press.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum, auto

import numpy as np

from edge.features.contact_fit import FITS_MAX, ContactFit
from edge.features.params import PARAMS, FeatureParams
from edge.features.regions import CONTACTS_MAX, Regions
from edge.features.surface import Surface
from edge.types import Array, FittedContact, Mask

__all__ = ["Fits", "FittedContacts"]

#: Two points as far from a region's middle, in its semi-axes, have its variance: a semi-axis is two sigmas.
_HALF = 0.5
#: Pins that a fit needs: as many as two contacts with the affine motion have parameters, two numbers each.
_PINS_MIN = 22


class Fits(IntEnum):
    """Which contacts are wanted as fitted: those of a frame with so many."""

    ALL = auto()
    SEVERAL = auto()
    NONE = CONTACTS_MAX  # more than a fit takes


@dataclass(frozen=True, slots=True)
class _Line:
    """One long contact fitted.

    error      squared, in squared pitches
    direction  rad
    """

    error: float
    direction: float


@dataclass(frozen=True, slots=True)
class _Pair:
    """Two points fitted.

    error     squared, in squared pitches
    place     (2, 2) px, at rest
    heights   of the potentials, squared pitches
    """

    error: float
    place: Array
    heights: tuple[float, float]


class FittedContacts:
    """Fits contacts of one tip's regions."""

    def __init__(self, surface: Surface, regions: Regions, params: FeatureParams = PARAMS) -> None:
        self._fit = ContactFit(surface.rest_img, surface.pitch_px, params)
        self._regions, self._params, self._pitch_px = regions, params, surface.pitch_px
        self._middle, self._semi_axis = np.asarray(regions.middle), np.asarray(regions.semi_axis)
        self._direction = np.asarray(regions.direction)
        fit = self._fit
        self._fitted = [np.asarray(a) for a in (fit.place, fit.width, fit.total, fit.shear, fit.dipole)]
        self._pair_is_fitted = False  # the last fit is that of the two regions

    def forget(self) -> None:
        """The next frame does not follow the last one."""
        self._fit.forget()

    def begin(self) -> None:
        """Another frame begins, which follows the last one."""
        self._fit.begin()
        self._pair_is_fitted = False

    def fit(self, xy: Array, seen: Mask) -> list[FittedContact]:
        """All contacts of the regions, in their order; none: there are too many, or too few pins are seen.

        xy       (n, 2) float64 px, where the pins are; finite
        seen     (n,) bool
        """
        n = self._regions.n_contacts
        if not 0 < n <= FITS_MAX:
            return []
        if not (self._pair_is_fitted and n == 2):
            starts = self._middle[:n]
            if not self._choose_pins(xy, seen, starts):
                return []
            self._fit.fit_points(starts, n)
        columns = (array[:n].copy() for array in self._fitted)
        return [
            FittedContact(place, width, potential, shear, dipole)
            for place, width, potential, shear, dipole in zip(*columns, strict=True)
        ]

    def split(self, xy: Array, seen: Mask) -> float:
        """Split a single long region that is two contacts.

        xy, seen  as of `fit`
        Returns   direction of the contact, rad; NaN: there are two, it is round, or too few pins are seen
        """
        half = self._semi_axis[0] * np.array([math.cos(self._direction[0]), math.sin(self._direction[0])])
        middle = self._middle[0]
        starts = np.array([middle - _HALF * half, middle + _HALF * half])
        if not self._choose_pins(xy, seen, starts):
            return math.nan
        line = self._line(middle, half)
        if self._semi_axis[0] >= self._params.close_pitch * self._pitch_px:
            return line.direction  # two so far apart would be two regions
        pair = self._pair(starts)
        if not (self._is_better(pair.error, line.error) and self._are_two(pair)):
            return line.direction
        if not self._is_better(pair.error, self._fit.fit_points(middle[None], 1)):
            return math.nan
        first, second = (self._regions.nearest_point(x, y) for x, y in pair.place.tolist())
        if first == second:
            return line.direction
        self._regions.split(0, first, second)
        self._regions.sort()
        return math.nan

    def join(self, xy: Array, seen: Mask) -> float:
        """Join two regions that are one long contact.

        xy, seen  as of `fit`
        Returns   direction of the contact, rad; NaN: there are two, or too few pins are seen
        """
        starts = self._middle[:2].copy()
        if not self._choose_pins(xy, seen, starts):
            return math.nan
        # A round contact is no third: two points explain the motion as well as one does.
        line = self._line(starts.mean(axis=0), starts[1] - starts[0])
        if not self._is_better(line.error, self._pair(starts).error):
            self._pair_is_fitted = True
            return math.nan
        self._regions.join(0, 1)
        return line.direction

    def _choose_pins(self, xy: Array, seen: Mask, places: Array) -> bool:
        """The pins near these places are those to be explained; whether they are enough."""
        fit = self._fit
        fit.set_motion(xy, seen)
        fit.keep_near(places)
        return bool(fit.n_pins >= _PINS_MIN)

    def _line(self, middle: Array, half: Array) -> _Line:
        """A line on those pins."""
        fit = self._fit
        error = fit.fit_line(middle[0], middle[1], half[0], half[1])
        x, y = fit.dipole[0]
        angle = math.atan2(y, x)
        return _Line(error, angle - math.pi * round(angle / math.pi))

    def _pair(self, starts: Array) -> _Pair:
        """Two points on those pins."""
        fit = self._fit
        error = fit.fit_points(starts, 2)
        return _Pair(error, np.array(fit.place[:2]), (fit.height[0], fit.height[1]))

    def _is_better(self, error: float, other: float) -> bool:
        """Whether a shape explains the motion better than another by as much evidence as is needed."""
        return error < other * math.exp(-self._params.shape_evidence / self._fit.n_pins)

    def _are_two(self, pair: _Pair) -> bool:
        """Whether both press."""
        return min(pair.heights) > 0.0
