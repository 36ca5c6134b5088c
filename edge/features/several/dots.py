"""Contacts of a skin whose dots lie on its surface: one after the other, each where it explains most.

    motion --affine part away--> where would one contact explain most? --fit of all so far--> what is left --.
                                             ^---------------------------------------------------------------'

Idea: a gel that is bonded to its carrier bulges round a tool, over a distance of about its thickness. A dot
goes outwards far beyond the contact, and the few dots under the tool follow it. Two contacts three pitches
apart thus make one hill of grown cells. But their motions add up, and what one leaves is the other's.

Rules
- A contact more is taken as long as the likelihood of the motion grows by as much evidence as pins are
  identified with, a dot and its ring counting as one (`fitted_contacts` has the measure). Of several alike
  none may have it alone: the first ones are taken together.
- Each contact must press, and its core must lie apart from the others': the error of one that is sheared
  looks like a second one within it, which pulls.
- One line is preferred to several points unless they have as much evidence against it, and as much as splits
  a region if there is no real valley between two of their cores. A single point is no line: a sheared one
  looks like it, too.
- Dots that are lost count in nothing but the search.
"""

import math

import numpy as np

from edge.features.params import PARAMS
from edge.features.several.contact_fit import FITS_MAX, ContactFit
from edge.features.several.fitted_contacts import EVIDENCE, PINS_MIN, SPLITS
from edge.features.surface import Surface
from edge.geometry.layout import affine_terms
from edge.types import Array, ContactRegion, FittedContact, Mask

#: The model errs by this share of the motion: no more than is left out of the weakest contact beside
#: another.
_MODEL_REL = PARAMS.shallow_rel * PARAMS.shallow_rel


class DotContacts:
    """Finds contacts among the dots of one tip."""

    def __init__(self, surface: Surface) -> None:
        self._pitch_px, self._rest = surface.pitch_px, surface.rest_img
        self._fit = ContactFit(surface.rest_img, surface.pitch_px, dots=True)
        self._middle = surface.rest_img.mean(axis=0, keepdims=True)
        self._places = surface.points_img
        self._floor = 0.0  # squared pitches, of the error: what the model leaves in any case
        x = surface.rest_img / self._pitch_px
        affine = np.kron(affine_terms(x, x.mean(axis=0), 1.0), np.eye(2))
        self._affine = np.linalg.qr(affine)[0]
        self._search = np.stack([self._explained(place) for place in self._places / self._pitch_px])

    def _explained(self, place: Array) -> Array:
        """(3, 2 n) orthonormal: motions by a contact of usual widths there, less their affine part."""
        d = self._rest / self._pitch_px - place
        r2 = (d * d).sum(axis=1)
        core = np.exp(-0.5 * r2 * PARAMS.grid_steps_per_pitch**2)
        press = d / (1.0 + 0.5 * r2 / PARAMS.place_radius_pitch**2)[:, None] ** 2
        columns = np.column_stack([press.ravel(), np.kron(core[:, None], np.eye(2))])
        columns -= self._affine @ (self._affine.T @ columns)
        return np.asarray(np.linalg.qr(columns)[0].T, np.float32)

    def find(self, xy: Array, seen: Mask) -> tuple[ContactRegion, ...]:
        """Contacts of a frame, strongest first.

        xy       (n, 2) float64 px, where the dots are; finite
        seen     (n,) bool
        """
        fit = self._fit
        fit.choose(xy, seen, self._middle)
        if fit.n_pins < PINS_MIN:
            return ()
        motion = ((xy - self._rest) / self._pitch_px).ravel()
        left = (motion - self._affine @ (self._affine.T @ motion)).reshape(-1, 2)
        left[~seen] = 0.0
        least = float((left * left).sum())
        self._floor = _MODEL_REL**2 * least
        places = tried = np.empty((0, 2))
        while len(tried) < FITS_MAX:
            tried, error = self._fit_points(np.vstack([tried, self._most_explained(left)]))
            if self._is_better(error, least, (len(tried) - len(places)) * EVIDENCE):
                places, least = tried, error
            elif len(places):
                break
            left = fit.left_over()
        if not len(places):
            return ()
        places, least = self._without_needless(places, least)
        self._fit_points(places)
        found = [self._region(i) for i in range(len(places))]
        line = self._line(places, least) if len(places) > 1 else None
        return tuple(sorted(found, key=lambda contact: -contact.peak)) if line is None else (line,)

    def _fit_points(self, starts: Array) -> tuple[Array, float]:
        """Places, px, of points that were begun there, and the squared error."""
        self._fit.forget()  # a fit begins at the given places, not where another ended
        error = self._fit.fit_points(starts, len(starts))
        return np.asarray(self._fit.place)[: len(starts)].copy(), error

    def _is_better(self, error: float, other: float, evidence: float = EVIDENCE) -> bool:
        """Whether a shape has the evidence against another, by their errors."""
        ratio = math.exp(-evidence / self._fit.n_pins)
        return error + self._floor < (other + self._floor) * ratio

    def _without_needless(self, places: Array, least: float) -> tuple[Array, float]:
        """The points without those that the others explain as well, until all that are left may be contacts.

        Places that were added one by one may have been too many, or in the wrong place.
        """
        while len(places) > 1:
            fits = [self._fit_points(np.delete(places, i, axis=0)) for i in range(len(places))]
            fewer, error = min(fits, key=lambda one: one[1])
            again, least = self._fit_points(places)
            if self._is_better(least, error) and self._stands(len(places)):
                return again, least
            places, least = fewer, error
        return places, least

    def _line(self, starts: Array, least: float) -> ContactRegion | None:
        """One long contact instead of several with that squared error; None: they stand."""
        far, core = np.hypot(*(starts[:, None] - starts).transpose(2, 0, 1)), np.asarray(self._fit.core)
        a, b = np.unravel_index(int(far.argmax()), far.shape)
        # k points that share a line evenly leave half of one's part beyond the first and the last.
        reach = 0.5 * len(starts) / (len(starts) - 1)
        (x, y), (half_x, half_y) = 0.5 * (starts[a] + starts[b]), reach * (starts[b] - starts[a])
        i, j = np.triu_indices(len(starts), 1)
        apart2 = (far[i, j] / self._pitch_px) ** 2 / (core[i] ** 2 + core[j] ** 2)
        is_parted = bool((2.0 * np.exp(-0.25 * apart2) < 1.0 - PARAMS.shallow_rel).all())
        errors = [self._fit.fit_line(x, y, half_x, half_y, math.inf, even) for even in (True, False)]
        if errors[0] < errors[1]:
            self._fit.fit_line(x, y, half_x, half_y, math.inf, True)
        # What splits a region allows for the errors of both shapes, which are alike there.
        evidence, floor = (EVIDENCE, self._floor) if is_parted else (SPLITS, 0.0)
        stays = self._is_better(least + floor, min(errors) + floor, (len(starts) - 1) * evidence)
        return None if stays else self._region(0, is_line=True)

    def _most_explained(self, left: Array) -> Array:
        """(2,) px, where one contact more would explain most of the motion that is left."""
        gain = ((self._search @ left.ravel().astype(np.float32)) ** 2).sum(axis=1)
        place: Array = self._places[int(gain.argmax())]
        return place

    def _stands(self, n: int) -> bool:
        """Whether all of the n points fitted last press, more than the model errs, with their cores apart."""
        fit = self._fit
        core, place = np.asarray(fit.core)[:n], np.asarray(fit.place)[:n] / self._pitch_px
        height = np.asarray(fit.height)[:n]
        height = height * np.sign(height[np.abs(height).argmax()])
        far = np.hypot(*(place[:, None] - place).transpose(2, 0, 1))
        far[np.diag_indices(n)] = np.inf
        return bool((height > _MODEL_REL * height.max()).all() and (far > core[:, None] + core).all())

    def _region(self, i: int, is_line: bool = False) -> ContactRegion:
        """Contact i of those fitted last."""
        fit, pitch_px = self._fit, self._pitch_px
        place, shear = np.asarray(fit.place)[i].copy(), np.asarray(fit.shear)[i].copy()
        width, core, half = fit.width[i], fit.core[i], np.asarray(fit.dipole)[i].copy()
        height = abs(fit.height[i])
        length = float(np.hypot(*half)) if is_line else 0.0
        return ContactRegion(
            xy_img=place + pitch_px * shear,
            weighted_img=place + pitch_px * shear,
            peak=2.0 * height / width**2,
            area_px2=2.0 * math.pi * height * pitch_px**2,  # as the load and the contact grow
            orientation_rad=_angle(half) if is_line else math.nan,
            elongation=1.0 + length / core,
            ridge_img=place[None],
            middle_img=place,
            divergence_moment_px=pitch_px * shear,
            curl_moment_px=pitch_px * shear,
            # A bonded layer's dent is its own: others' potentials reach far beyond theirs.
            fitted=FittedContact(place, core, height**0.5, shear, np.zeros(2)),
        )


def _angle(along: Array) -> float:
    """rad, of a line, in (-pi/2, pi/2]."""
    angle = math.atan2(along[1], along[0])
    return angle - math.pi * round(angle / math.pi)
