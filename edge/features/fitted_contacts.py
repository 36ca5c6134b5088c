"""What fits of contacts decide in a frame: one long contact or two, the direction of a long one, and what
each of several contacts does alone.

    regions --one, long, or of two peaks--> line or two points? --two--> two points or a line?
            --several--> points together

Rules
- Only frames that may hold more than one contact, or a long one, are fitted; a round contact of one peak
  is not, unless somebody asks.
- Shapes are compared on the same pins by the likelihood of their motion, its noise unknown: the logarithm
  of two likelihoods' ratio is n log of the ratio of squared errors, of n pins with two coordinates each.
- The model's errors are alike among neighbours: a pin and its ring count as one. What the regions say is
  overruled by as much evidence as pins are identified with.
- Two points are two contacts only if both press, and neither lies within the other's width: a pin that is
  seen in the wrong place within a broad contact looks like a narrow one.
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
from edge.geometry.lattice import N_RING
from edge.types import Array, FittedContact, Mask, Tracks

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

    error    squared, in squared pitches
    heights  of the potentials, squared pitches
    columns  what `FittedContact` has, of both
    """

    error: float
    heights: tuple[float, float]
    columns: list[Array]


class FittedContacts:
    """Fits contacts of one tip's regions."""

    def __init__(self, surface: Surface, regions: Regions, params: FeatureParams = PARAMS) -> None:
        self._fit = ContactFit(surface.rest_img, surface.pitch_px, params)
        self._regions, self._params, self._pitch_px = regions, params, surface.pitch_px
        odds = Tracks.LOW_CONFIDENCE / (1.0 - Tracks.LOW_CONFIDENCE)
        self._evidence = (N_RING + 1) * math.log(odds)  # of all pins, that overrules the regions
        self._middle, self._semi_axis = np.asarray(regions.middle), np.asarray(regions.semi_axis)
        self._direction = np.asarray(regions.direction)
        fit = self._fit
        self._fitted = [np.asarray(a) for a in (fit.place, fit.width, fit.total, fit.shear, fit.dipole)]
        self._pair: _Pair | None = None  # the two regions, fitted in this frame
        self._n = 0  # regions of this frame, before any was split or joined

    def forget(self) -> None:
        """The next frame does not follow the last one."""
        self._fit.forget()

    def begin(self) -> None:
        """Another frame begins, which follows the last one; with other regions it is another scene."""
        n = self._regions.n_contacts
        if n != self._n:
            self.forget()
        self._fit.begin()
        self._pair, self._n = None, n

    def fit(self, xy: Array, seen: Mask) -> list[FittedContact]:
        """All contacts of the regions, in their order; none: there are too many, or too few pins are seen.

        xy       (n, 2) float64 px, where the pins are; finite
        seen     (n,) bool
        """
        n = self._regions.n_contacts
        if not 0 < n <= FITS_MAX:
            return []
        if self._pair is not None and n == 2:
            columns = self._pair.columns
        else:
            starts = self._middle[:n]
            if not self._choose_pins(xy, seen, starts):
                return []
            self._fit.fit_points(starts, n)
            columns = self._columns(n)
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
        line = self._fit_line(middle, half)
        if self._semi_axis[0] >= self._params.close_pitch * self._pitch_px:
            return line.direction  # two so far apart would be two regions
        return self._divide(starts, line)

    def split_at(self, xy: Array, seen: Mask, ridge: Array) -> None:
        """Split a single round region that is two contacts.

        xy, seen  as of `fit`
        ridge     (m, 2) px, its peaks: two may be two contacts, one none, many a flat one
        """
        if len(ridge) != 2:
            return
        half = 0.5 * (ridge[1] - ridge[0])
        if 2.0 * math.hypot(*half) >= self._params.close_pitch * self._pitch_px:
            return  # two so far apart would be two regions
        if self._choose_pins(xy, seen, ridge):
            self._divide(ridge, self._fit_line(ridge.mean(axis=0), half))

    def join(self, xy: Array, seen: Mask) -> float:
        """Join two regions that are one long contact.

        xy, seen  as of `fit`
        Returns   direction of the contact, rad; NaN: there are two, or too few pins are seen
        """
        starts = self._middle[:2].copy()
        if not self._choose_pins(xy, seen, starts):
            return math.nan
        # A round contact is no third: two points explain the motion as well as one does.
        pair = self._fit_pair(starts)
        limit = self._limit(pair.error)
        line = self._fit_line(starts.mean(axis=0), starts[1] - starts[0], limit)
        if line.error >= limit:
            self._pair = pair
            return math.nan
        self._regions.join(0, 1)
        return line.direction

    def _divide(self, starts: Array, line: _Line) -> float:
        """Split the single region if it is two contacts, rather than a line or a round one; as `split`."""
        limit = self._limit(line.error)
        pair = self._fit_pair(starts, limit)
        if pair.error >= limit or not self._are_apart(pair):
            return line.direction
        if pair.error >= self._limit(self._fit.fit_points(self._middle[:1], 1)):
            return math.nan
        first, second = (self._regions.nearest_point(x, y) for x, y in pair.columns[0].tolist())
        if first == second:
            return line.direction
        self._regions.split(0, first, second)
        self._regions.sort()
        return math.nan

    def _are_apart(self, pair: _Pair) -> bool:
        """Whether both press, and neither lies within the other's width."""
        (place, other), width = pair.columns[0], pair.columns[1]
        return min(pair.heights) > 0.0 and math.hypot(*(place - other)) > max(width) * self._pitch_px

    def _choose_pins(self, xy: Array, seen: Mask, places: Array) -> bool:
        """The pins near these places are those to be explained; whether they are enough."""
        fit = self._fit
        fit.set_motion(xy, seen)
        fit.keep_near(places)
        return bool(fit.n_pins >= _PINS_MIN)

    def _fit_line(self, middle: Array, half: Array, limit: float = math.inf) -> _Line:
        """A line on those pins; with an error above a limit it is of no use."""
        fit = self._fit
        error = fit.fit_line(middle[0], middle[1], half[0], half[1], limit)
        x, y = fit.dipole[0]
        angle = math.atan2(y, x)
        return _Line(error, angle - math.pi * round(angle / math.pi))

    def _fit_pair(self, starts: Array, limit: float = math.inf) -> _Pair:
        """Two points on those pins; likewise."""
        fit = self._fit
        return _Pair(fit.fit_points(starts, 2, limit), (fit.height[0], fit.height[1]), self._columns(2))

    def _columns(self, n: int) -> list[Array]:
        """What `FittedContact` has, of the n points fitted last."""
        return [column[:n].copy() for column in self._fitted]

    def _limit(self, error: float) -> float:
        """The error below which another shape has as much evidence as overrules one with this error."""
        return error * math.exp(-self._evidence / self._fit.n_pins)
