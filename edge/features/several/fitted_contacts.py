"""Fits of contacts decide in a frame: one long contact or two, the direction of a long one, and the share
that each of several contacts has in the motion.

    regions --one, long, or of two peaks--> line or two points? --two--> two points or a line?
            --several--> points together

Rules
- Only frames that may hold more than one contact, or a long one, are fitted; a round contact of one peak
  is not, unless somebody asks.
- Shapes are compared on the same pins by the likelihood of their motion, its noise unknown: the logarithm
  of two likelihoods' ratio is n log of the ratio of squared errors, of n pins with two coordinates each.
- The model's errors are alike among neighbours: a pin and its ring count as one. What the regions say is
  overruled by as much evidence as pins are identified with. Where one region is split, a pin and its two
  rings count as one: no contact presses just as a line does, and its error is alike over its whole region.
- A contact has a direction if the line fitted to it is long. A region is blurred, and as long for a ball at
  the rim of the tip as for a bar on a dome.
- Two points are two contacts only if both press, and neither lies within the other's width: a pin that is
  seen in the wrong place within a broad contact looks like a narrow one.
- What was decided is decided again where it may have changed. By the triangle inequality the root of a
  shape's squared error changes by no more than the root of the squared distance between two frames' motions:
  as long as that leaves the other shapes too large an error, only a shape whose result is wanted is fitted.
"""

import math
from dataclasses import dataclass
from enum import IntEnum, auto
from typing import Any, Protocol

import numpy as np

from edge.features.params import CONTACTS_MAX, PARAMS
from edge.features.several.contact_fit import FITS_MAX, ContactFit
from edge.features.surface import Surface
from edge.geometry.lattice import N_RING, N_TWO_RINGS
from edge.types import Array, FittedContact, Mask, Tracks

#: Two points as far from a region's middle, in its semi-axes, have its variance: a semi-axis is two sigmas.
_HALF = 0.5
#: Pins that a fit needs: as many as two contacts with the affine motion have parameters, two numbers each.
PINS_MIN = 22


def _evidence(alike: int) -> float:
    """As much as a pin is identified with, if the errors of a pin and so many neighbours are alike."""
    return (alike + 1) * math.log(Tracks.LOW_CONFIDENCE / (1.0 - Tracks.LOW_CONFIDENCE))


#: The first evidence of all pins overrules the regions, or makes a contact; the second splits a region.
EVIDENCE, SPLITS = _evidence(N_RING), _evidence(N_TWO_RINGS)


class Fits(IntEnum):
    """Which contacts are wanted as fitted: those of a frame with so many."""

    ALL = auto()
    SEVERAL = auto()
    NONE = CONTACTS_MAX  # more than a fit takes


class FrameRegions(Protocol):
    """The part of `edge.features.contacts.Regions` that a fit reads and changes."""

    n_contacts: int
    middle: Array
    semi_axis: Array
    direction: Array

    def split(self, x0: float, y0: float, x1: float, y1: float) -> bool: ...

    def join(self, i: int, j: int) -> None: ...


@dataclass(frozen=True, slots=True)
class _Decision:
    """The decision on the motion that the fit has marked.

    overruled    the regions were
    alternative  pitches, the least root of the squared errors of the shapes that were decided against
    """

    overruled: bool
    alternative: float


class FittedContacts:
    """Fits contacts of one tip's regions."""

    def __init__(self, surface: Surface, regions: FrameRegions) -> None:
        self._fit = ContactFit(surface.rest_img, surface.pitch_px)
        self._regions = regions
        self._pitch_px = surface.pitch_px
        self._close_px = PARAMS.close_pitch * surface.pitch_px
        self._min_oriented_elongation = PARAMS.min_oriented_elongation
        self._middle, self._starts = np.asarray(regions.middle), np.zeros((2, 2))
        fit = self._fit
        self._fitted = [np.asarray(a) for a in (fit.place, fit.width, fit.total, fit.shear, fit.dipole)]
        # Numbers are read and set in their `data` in a fifth of the time.
        self._middle_cell: Any = self._middle.data
        self._start: Any = self._starts.data
        self._semi_axis: Any = np.asarray(regions.semi_axis).data
        self._direction: Any = np.asarray(regions.direction).data
        self._height: Any = np.asarray(fit.height).data
        self._width: Any = self._fitted[1].data
        self._dipole: Any = self._fitted[-1].data
        self._decision: _Decision | None = None
        self._moved = 0.0  # pitches, root of the squared distance from the motion that it is about
        self._pair: list[Array] | None = None  # of this frame's two regions

    def forget(self) -> None:
        """The next frame does not follow the last one."""
        self._fit.forget()
        self._decision = self._pair = None

    def fit(self, xy: Array, seen: Mask) -> list[FittedContact]:
        """All contacts of the regions, in their order; none: there are too many, or too few pins are seen.

        xy       (n, 2) float64 px, where the pins are; finite
        seen     (n,) bool
        """
        n = self._regions.n_contacts
        if not 0 < n <= FITS_MAX:
            return []
        columns = self._pair if n == 2 else None
        if columns is None:
            if not self._choose_pins(xy, seen, self._middle[:n]):
                return []
            self._fit.fit_points(self._middle, n)
            columns = self._columns(n)
        return [
            FittedContact(place, width, potential, shear, dipole)
            for place, width, potential, shear, dipole in zip(*columns, strict=True)
        ]

    def split(self, xy: Array, seen: Mask, ridge: Array, *, is_long: bool, wanted: bool) -> float:
        """Split a single region that is two contacts: a long one, or a round one of two peaks.

        xy, seen  as of `fit`
        ridge     (m, 2) px, its peaks
        is_long   it is
        wanted    the direction is, of a round one
        Returns   direction of the contact, rad; NaN: there are two, it is round, or too few pins are seen
        """
        (x, y), apart_px, angle = self._place_of(0), self._semi_axis[0], self._direction[0]
        half_x, half_y = apart_px * math.cos(angle), apart_px * math.sin(angle)
        off_x, off_y = _HALF * half_x, _HALF * half_y
        self._start_at(x - off_x, y - off_y, x + off_x, y + off_y)
        if len(ridge) == 2 and not is_long:
            (x0, y0), (x1, y1) = ridge.tolist()
            self._start_at(x0, y0, x1, y1)
            x, y, half_x, half_y = 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0)
            apart_px = math.hypot(x1 - x0, y1 - y0)
        # Two contacts farther apart than that would be two regions.
        is_one = apart_px >= self._close_px or not (is_long or len(ridge) == 2)
        if is_one and not wanted:
            return math.nan
        direction = self._divide(xy, seen, (x, y, half_x, half_y), is_line=is_one, wanted=wanted)
        return direction if wanted else math.nan

    def _divide(
        self,
        xy: Array,
        seen: Mask,
        line_at: tuple[float, float, float, float],
        *,
        is_line: bool,
        wanted: bool,
    ) -> float:
        """Split the single region if it is two contacts that begin at `_starts`.

        line_at  where a line begins, as of `fit_line`
        is_line  it is one contact in any case
        wanted   its direction is
        Returns  as of `split`
        """
        fit, starts = self._fit, self._starts
        if not self._take_pins(xy, seen, starts):
            return math.nan
        split, stays = self._last(True), self._last(False)
        if split is not None:
            stands = self._stands(split, fit.fit_points(starts, 2), SPLITS)
            if stands and self._make_two(self._pair_places()):
                return math.nan
        if stays is not None and not wanted and self._stands(stays, fit.last_error(0)):
            return math.nan
        line, line_least = fit.fit_line(*line_at), fit.least
        direction = self._line_direction()
        if is_line or (stays is not None and self._stands(stays, line)):
            return direction
        pair, pair_least = fit.fit_points(starts, 2, self._limit(line)), fit.least
        if pair >= self._limit(line):
            self._decide(False, pair_least)
            return direction
        places = self._pair_places()
        if not places:
            return direction
        point, point_least = fit.fit_points(self._middle, 1), fit.least
        if pair >= self._limit(point):
            return math.nan
        # A line may have to be looked for elsewhere than in the region's middle: a sheared ball's.
        (x, y), (_, _, half_x, half_y) = self._fitted[0][0].tolist(), line_at
        if pair >= self._limit(fit.fit_line(x, y, half_x, half_y, math.inf, True), SPLITS):
            return self._line_direction()
        if not self._make_two(places):
            return direction
        self._decide(True, min(line_least, point_least, fit.least))
        return math.nan

    def join(self, xy: Array, seen: Mask, *, wanted: bool) -> float:
        """Join two regions that are one long contact.

        xy, seen  as of `fit`
        wanted    whether `fit` will be asked for the two, if they are two
        Returns   direction of the contact, rad; NaN: there are two, or too few pins are seen
        """
        self._pair = None
        fit, starts, (x0, y0), (x1, y1) = self._fit, self._starts, self._place_of(0), self._place_of(1)
        self._start_at(x0, y0, x1, y1)
        line_at = 0.5 * (x0 + x1), 0.5 * (y0 + y1), x1 - x0, y1 - y0
        if not self._take_pins(xy, seen, starts):
            return math.nan
        joined, stays = self._last(True), self._last(False)
        if joined is not None and self._stands(joined, fit.fit_line(*line_at)):
            self._regions.join(0, 1)
            return self._line_direction()
        if stays is not None and not wanted and self._stands(stays, fit.last_error(2)):
            return math.nan
        # A round contact is no third: two points explain the motion as well as one does.
        pair, pair_least = fit.fit_points(starts, 2), fit.least
        self._pair = self._columns(2) if wanted else None
        if stays is not None and self._stands(stays, pair):
            return math.nan
        limit = self._limit(pair)
        line, line_least = fit.fit_line(*line_at, limit), fit.least
        if line >= limit and fit.fit_line(*line_at, limit, True) >= limit:
            self._decide(False, min(line_least, fit.least))
            return math.nan
        self._decide(True, pair_least)
        self._regions.join(0, 1)
        return self._line_direction()

    def _take_pins(self, xy: Array, seen: Mask, places: Array) -> bool:
        """Take the motion of the pins that were chosen last, or of others if the contacts have moved.

        Returns whether they are enough.
        """
        self._moved = self._fit.again(xy, seen, places)
        if math.isfinite(self._moved):
            return bool(self._fit.n_pins >= PINS_MIN)
        return self._choose_pins(xy, seen, places)

    def _last(self, overruled: bool) -> _Decision | None:
        """The last decision, if it was such a one."""
        last = self._decision
        return last if last is not None and last.overruled == overruled else None

    def _stands(self, last: _Decision, error: float, evidence: float = EVIDENCE) -> bool:
        """Whether it would be decided again, by its shape's error, whatever the others' errors are now."""
        alternative = max(last.alternative - self._moved, 0.0) ** 2
        if last.overruled:
            return error < self._limit(alternative, evidence)
        return alternative >= self._limit(error)

    def _decide(self, overruled: bool, least: float) -> None:
        """Keep what was decided, and the least squared error of the shapes that were decided against."""
        self._fit.mark()
        self._decision = _Decision(overruled, math.sqrt(least))

    def _choose_pins(self, xy: Array, seen: Mask, places: Array) -> bool:
        """The pins near these places are those to be explained; whether they are enough."""
        self._decision, self._moved = None, 0.0
        self._fit.choose(xy, seen, places)
        return bool(self._fit.n_pins >= PINS_MIN)

    def _start_at(self, x0: float, y0: float, x1: float, y1: float) -> None:
        """Where two points begin."""
        cell = self._start
        cell[0, 0], cell[0, 1], cell[1, 0], cell[1, 1] = x0, y0, x1, y1

    def _place_of(self, i: int) -> tuple[float, float]:
        """px, middle of a region."""
        return self._middle_cell[i, 0], self._middle_cell[i, 1]

    def _pair_places(self) -> list[list[float]]:
        """px, of the two points fitted last; none: one does not press, or lies within the other's width."""
        places: list[list[float]] = self._fitted[0][:2].tolist()
        (x0, y0), (x1, y1) = places
        apart = math.hypot(x1 - x0, y1 - y0) > self._pitch_px * max(self._width[0], self._width[1])
        return places if apart and min(self._height[0], self._height[1]) > 0.0 else []

    def _make_two(self, places: list[list[float]]) -> bool:
        """Make two regions of the one; False: there are no two places."""
        return bool(places) and self._regions.split(*places[0], *places[1])

    def _line_direction(self) -> float:
        """rad, of the line fitted last; NaN: by its second moments it is nearly round."""
        x, y = self._dipole[0, 0], self._dipole[0, 1]
        long, wide = math.hypot(x, y) / math.sqrt(3.0), self._width[0]
        if math.hypot(long, wide) < self._min_oriented_elongation * wide:
            return math.nan
        angle = math.atan2(y, x)
        return angle - math.pi * round(angle / math.pi)

    def _columns(self, n: int) -> list[Array]:
        """The fields of `FittedContact`, of the n points fitted last."""
        return [column[:n].copy() for column in self._fitted]

    def _limit(self, error: float, evidence: float = EVIDENCE) -> float:
        """The error below which another shape has as much evidence as overrules one with this error."""
        return error * math.exp(-evidence / self._fit.n_pins)
