"""Features of one frame: the demand decides what is computed.

    tracks, cells --> motion, area change --> contact detector --no contact--> zeros
                                                               \\--in contact--> what `NEEDS` lists for the
                                                               demand

Rules
- The demand is data: `NEEDS` maps each feature to the quantities it depends on; a quantity that is not needed
  is None in the result. Only motion, area change and the detector's bit are always computed.
- No contact: no surface, no peaks. Volume, torsion and slip are zero, contacts none; shear is computed all
  the same, and so are modes, unless the caller knows what an untouched tip reads, as a calibration does.
- Without cells everything that depends on areas stays None, area change all NaN.
- Who needs no areas needs no cells as long as the pins' motion alone shows that the contact goes on
  (`contact_holds`). Where and when one begins and ends is for the areas to decide.
- State: the detector's bit and learnt noise, the last frames' motion for slip and vibration, and
  where the last frame's fits of contacts ended, from which the next ones begin. Nothing else depends on the
  frame before.
- A lost pin is put where the seen ones predict it (`Cells.xy_img`), and its cell likewise, for the modes and
  the mean motion too: a polynomial fitted to the seen pins alone is different, and in a model of many terms
  the difference is 0.25 mm of depth (331 simulated pins, 30 % dark; 0.06 mm with predicted pins).
- Lengths in px of the image, areas as a share of the cell at rest: `calibration` knows millimetres.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np

from edge.features.area_change import AreaChange
from edge.features.contact_detector import ContactDetector
from edge.features.contacts import ContactFinder
from edge.features.modes import Modes
from edge.features.params import PARAMS, FeatureParams, largest_noise
from edge.features.pin_motion import PinMotion
from edge.features.several import Fits
from edge.features.slip import Slip
from edge.features.surface import Surface
from edge.features.vibration import Rms, Vibration
from edge.types import Array, Cells, ContactRegion, Feature, Features, Mask, Rest, Tracks, per_frame

__all__ = ["NEEDS", "FeatureExtractor", "FeaturePlan", "Quantity"]


class Quantity(StrEnum):
    """What can be computed, as opposed to what can be demanded."""

    SHEAR = "shear"
    MODES = "modes"
    VOLUME = "volume"
    SURFACE = "surface"
    CONTACTS = "contacts"
    TORSION = "torsion"
    SLIP = "slip"
    VIBRATION = "vibration"


NEEDS: dict[Feature, frozenset[Quantity]] = {
    feature: frozenset(map(Quantity, feature.needs)) for feature in Feature
}


#: Fields of `Features` that follow from areas: volume, surface, grid, contacts; and from the pins in the
#: contact: torsion, slip and its probability, vibration and the end of its band.
_OfAreas = tuple[float | None, Array | None, tuple[Array, Array] | None, tuple[ContactRegion, ...] | None]
_OfPins = tuple[float | None, float | None, float | None, float | None, float | None]
_NO_AREAS: _OfAreas = (None, None, None, None)
_NO_PINS: _OfPins = (None, None, None, None, None)


class FeaturePlan:
    """What is computed of a frame for a demand: `NEEDS`, resolved once. And what a frame without contact has.

    moments        False: the contacts' moments are not wanted; they are NaN
    fits           the contacts that are wanted as fitted to the pins' motion
    modes_at_rest  False: modes are not wanted of an untouched tip
    """

    def __init__(
        self,
        demand: frozenset[Feature],
        *,
        moments: bool = True,
        fits: Fits = Fits.ALL,
        modes_at_rest: bool = True,
    ) -> None:
        need: frozenset[Quantity] = frozenset().union(*(NEEDS[feature] for feature in demand))
        self.moments, self.fits, self.modes_at_rest = moments, fits, modes_at_rest
        self.shear = Quantity.SHEAR in need
        self.modes = Quantity.MODES in need
        self.volume = Quantity.VOLUME in need
        self.surface = Quantity.SURFACE in need
        self.contacts = Quantity.CONTACTS in need
        self.torsion = Quantity.TORSION in need
        self.slip = Quantity.SLIP in need
        self.areas = self.volume or self.surface or self.contacts
        self.vibration = Quantity.VIBRATION in need
        self.contact_pins = self.torsion or self.slip or self.vibration
        slip = 0.0 if self.slip else None
        self.untouched_areas: _OfAreas = (
            0.0 if self.volume else None,
            None,
            None,
            () if self.contacts else None,
        )
        self.untouched_pins: _OfPins = (
            0.0 if self.torsion else None,
            slip,
            slip,
            0.0 if self.vibration else None,
            None,
        )


@per_frame
class _Motion:
    """Where the pins are, and how far they have moved.

    px        (n, 2) since rest; NaN where lost; good until the next frame
    whole_px  the same, with lost pins predicted if enough are seen; `known` (n,) where
              finite; None: everywhere
    mean_px   (2,) mean of `whole_px`; good until the next frame
    sigma_px  noise of one coordinate of one pin's motion
    now_px    the part of it that is this frame's
    filled    whether lost pins were predicted
    """

    px: Array
    whole_px: Array
    known: Mask | None
    mean_px: Array
    sigma_px: float
    now_px: float
    filled: bool


class FeatureExtractor:
    """Features of the frames of one tip.

    rest_area_px2  (n,) float64 px2, area of each pin's cell at rest, by the current cells' own rule
    grid           points along the surface's side; None: chosen from the pitch
    """

    def __init__(
        self,
        rest: Rest,
        rest_area_px2: Array,
        *,
        grid: int | None = None,
        params: FeatureParams = PARAMS,
    ) -> None:
        self._rest, self._grid, self._params = rest, grid, params
        self._xy_rest = np.ascontiguousarray(rest.xy_img)
        self._area_change = AreaChange(rest.xy_img, rest.pattern.pitch_px, rest_area_px2)
        # Kernels need not look at arrays again that stay the same objects: these are written in each frame.
        self._changes = np.asarray(self._area_change.values)  # the kernel's array
        self._px, self._whole_px = np.empty_like(self._xy_rest), np.empty_like(self._xy_rest)
        self._change, self._whole_change = np.empty(len(rest)), np.empty(len(rest))
        self._detector = ContactDetector(rest, params)
        self._largest_noise = largest_noise(len(rest))
        self._rest_variance = float(np.median(rest.pins.sigma_px)) ** 2
        self._motion = PinMotion(rest)
        self._xy = self._motion.xy
        self._modes = Modes(rest)
        self._slip = Slip(rest, self._motion, params)
        self._vibration = Vibration(self._px, params)
        self._surface: Surface | None = None  # made for the first contact
        self._finder: ContactFinder | None = None
        self._plan = FeaturePlan(frozenset())

    @property
    def surface(self) -> Surface:
        """The grid and its operators."""
        if self._surface is None:
            self._surface = Surface(self._rest, self._grid, self._params)
        return self._surface

    @property
    def finder(self) -> ContactFinder:
        """Finds contacts on that grid."""
        if self._finder is None:
            self._finder = ContactFinder(self.surface, self._params)
        return self._finder

    def prepare(self, plan: FeaturePlan) -> None:
        """Make now what otherwise the first contact would wait for (70 ms)."""
        if plan.contacts:
            self.finder  # noqa: B018

    def forget_contacts(self) -> None:
        """The next frame's contacts do not follow from the last one's."""
        if self._finder is not None:
            self._finder.forget()

    def contact_holds(self, tracks: Tracks) -> bool:
        """Whether the last frame's contact goes on, by the motion of its pins; False: not known."""
        return self._detector.holds(tracks.xy_img)

    def extract(
        self,
        tracks: Tracks,
        cells: Cells | None,
        plan: FeaturePlan,
        *,
        contact_holds: bool = False,
        capture_ns: int = 0,
    ) -> Features:
        """The features of one frame.

        cells          of the same frame; None when nobody asked for what needs areas
        contact_holds  of this frame, as `contact_holds` says; no cells are needed then
        capture_ns     when the frame was taken; 0: not known, and vibration neither
        Returns        Features; fields outside of the plan are None
        """
        if plan is not self._plan:
            self._plan = plan
            self.forget_contacts()
        motion = self._motion_of(tracks, cells)
        area_change, whole_change = self._area_changes(cells, motion.filled)
        if contact_holds:
            in_contact = True
        elif cells is None:
            in_contact = self._detector.by_motion(tracks.xy_img, motion.sigma_px)
        else:
            in_contact = self._detector.by_area(whole_change, self._xy, motion.sigma_px)
        noise = self._detector.cell_noise(motion.sigma_px) if in_contact else 0.0
        shear_px = motion.mean_px.copy() if plan.shear else None
        modes_px = None
        if plan.modes and (in_contact or plan.modes_at_rest):
            modes_px = self._modes.fit(motion.whole_px, motion.known)
        kept = motion.px.copy(), area_change.copy()
        of_areas, of_pins = _NO_AREAS, _NO_PINS
        if in_contact:
            if cells is not None and plan.areas:
                of_areas = self._of_areas(whole_change, tracks.seen, motion.sigma_px, noise)
            if plan.contact_pins:
                of_pins = self._of_contact_pins(motion, area_change, noise, kept, capture_ns)
        else:
            self._slip.forget()
            self._vibration.forget()
            self.forget_contacts()
            of_areas, of_pins = plan.untouched_areas if cells is not None else _NO_AREAS, plan.untouched_pins
        if cells is not None:
            gap, gap_img = cells.gap, cells.gap_img
        else:
            gap, gap_img = 0.0 if motion.known is None else math.nan, None
        # By place: names cost 3,000 instructions.
        return Features(kept[1], kept[0], in_contact, shear_px, modes_px, *of_areas, *of_pins, gap, gap_img)

    def _motion_of(self, tracks: Tracks, cells: Cells | None) -> _Motion:
        seen, px = tracks.seen, self._px
        now_px, n_seen = self._motion.since_rest(tracks.xy_img, tracks.sigma_px, px)
        sigma_px, mean_px = math.sqrt(now_px * now_px + self._rest_variance), self._motion.mean
        if n_seen == len(seen):
            return _Motion(px, px, None, mean_px, sigma_px, now_px, False)
        if cells is not None:
            self._xy[:] = cells.xy_img
        if cells is None or 2 * n_seen < max(len(seen), 2):  # most are a guess
            return _Motion(px, px, seen, mean_px, sigma_px, now_px, False)
        whole = np.subtract(cells.xy_img, self._xy_rest, out=self._whole_px)
        return _Motion(px, whole, None, whole.mean(axis=0), sigma_px, now_px, True)

    def _area_changes(self, cells: Cells | None, filled: bool) -> tuple[Array, Array]:
        """Relative area changes, (n,), NaN where lost; and the same with lost pins' cells, if these are
        predicted. Good until the next frame.
        """
        if cells is None:
            self._change.fill(np.nan)
            return self._change, self._change
        self._area_change.since_rest(cells.area_px2, self._change)
        if filled and cells.whole_px2 is not None:
            self._area_change.since_rest(cells.whole_px2, self._whole_change)
            return self._change, self._whole_change
        return self._change, self._change

    def _of_areas(self, area_change: Array, seen: Mask, sigma_px: float, noise: float) -> _OfAreas:
        """Those of a frame in contact."""
        plan, changes, xy_img = self._plan, self._area_change, self._xy
        volume = picture = grid = contacts = None
        changes.fill(area_change, xy_img)
        if plan.volume:
            volume = changes.volume(self._largest_noise * noise)
        if plan.surface or plan.contacts:
            surface = self.surface
            surface.field.set_area_change(self._changes)
            if plan.surface:
                picture, grid = surface.picture(), surface.grid_img
            if plan.contacts:
                surface.field.find(xy_img)
                contacts = self.finder.find(xy_img, seen, sigma_px, moments=plan.moments, fits=plan.fits)
        return volume, picture, grid, contacts

    def _of_contact_pins(
        self,
        motion: _Motion,
        area_change: Array,
        noise: float,
        kept: tuple[Array, Array],
        capture_ns: int,
    ) -> _OfPins:
        """Those of a frame in contact; noise: one sigma of a cell's area change."""
        plan, params = self._plan, self._params
        torsion = slip = probability = None
        vibration: Rms = (None, None)
        least = max(params.contact_sigma * noise, params.min_area_change)
        pins = self._motion.in_contact(area_change, least)
        if plan.torsion:
            torsion = self._motion.torsion(motion.px, pins)
        if plan.slip:
            state = self._slip.update(motion.px, area_change, pins, motion.sigma_px, kept)
            slip, probability = state.slip_px, state.probability
        if plan.vibration:
            vibration = self._vibration.update(pins, motion.now_px, capture_ns)
        return torsion, slip, probability, *vibration
