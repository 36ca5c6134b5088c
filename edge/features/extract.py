"""Features of one frame: the demand decides what is computed.

    tracks, cells --> motion, area change --> gate --untouched--> zeros
                                               \\--touched--> what `NEEDS` lists for the demand

Rules
- The demand is data: `NEEDS` maps each feature to the quantities behind it, and a quantity that no one
  needs is None in the result. Only motion, area change and the gate's bit are always there.
- No contact: no surface, no maxima. Volume, torsion and slip are zero, contacts none; shear and modes are
  given all the same (a calibration decides what an untouched tip reads).
- Without cells nothing that comes from areas can be given: it stays None, area change all NaN.
- State: the gate's bit and learnt noise, and the last frame's motion for slip. Nothing else depends on
  the frame before.
- A lost pin counts as where the seen ones say it is (`Cells.xy_img`), and its cell as it is there. In the
  modes and in the mean motion too: a polynomial through the seen pins alone is another one, and a model of
  many terms makes 0.25 mm of depth of the difference (331 simulated pins, 30 % dark; 0.06 mm so).
- Lengths in px of the image, areas as a share of the cell at rest: `calibration` knows millimetres.
"""

from __future__ import annotations

from enum import Enum, auto

import numpy as np

from edge import _features
from edge.features.contacts import ContactFinder, blend
from edge.features.gate import Gate
from edge.features.local import Neighbourhood
from edge.features.modes import Modes
from edge.features.motion import ContactPins, Slip, torsion
from edge.features.surface import Surface
from edge.types import Array, Cells, ContactRegion, Feature, Features, Rest, Tracks

__all__ = ["NEEDS", "FeatureExtractor", "Quantity"]


class Quantity(Enum):
    """What can be computed, as opposed to what can be asked for."""

    SHEAR = auto()
    MODES = auto()
    VOLUME = auto()
    SURFACE = auto()
    CONTACTS = auto()
    TORSION = auto()
    SLIP = auto()


#: The calibrated outputs are polynomials in modes and volume (`edge.calibration`).
_LOAD = frozenset({Quantity.MODES, Quantity.VOLUME})
NEEDS: dict[Feature, frozenset[Quantity]] = {
    Feature.DISPLACEMENT: _LOAD,
    Feature.FORCE: _LOAD,
    Feature.PRESSURE: _LOAD | {Quantity.CONTACTS},
    Feature.CONTACT_AREA: _LOAD | {Quantity.CONTACTS},
    Feature.CONTACTS: frozenset({Quantity.CONTACTS}),
    Feature.SHEAR: frozenset({Quantity.SHEAR, Quantity.MODES}),
    Feature.TORSION: frozenset({Quantity.TORSION, Quantity.MODES}),
    Feature.TILT: frozenset({Quantity.MODES}),
    Feature.SLIP: frozenset({Quantity.SLIP}),
    Feature.ORIENTATION: frozenset({Quantity.CONTACTS}),
    Feature.SURFACE: frozenset({Quantity.SURFACE}),
}
#: Contact threshold in sigmas of the noise there: 800 grid points, one false maximum in 4000 frames.
THRESHOLD = 5.0
#: Threshold of the volume: rectified noise below it would add up. At 3 sigmas 0.04 % of it is left.
VOLUME_THRESHOLD = 3.0
#: and never below this area change: drift of light and focus between tare and now, not noise.
THRESHOLD_MIN = 0.01


#: Share of the pins that must be seen for the others to be filled in: with fewer it is no interpolation.
FILL_LEAST = 0.5


class _Plan:
    """A demand, looked up once: an enum's hash is Python code, and 50 of them a frame cost 20 us."""

    def __init__(self, demand: frozenset[Feature]) -> None:
        need: frozenset[Quantity] = frozenset().union(*(NEEDS[feature] for feature in demand))
        self.demand = demand
        self.shear = Quantity.SHEAR in need
        self.modes = Quantity.MODES in need
        self.volume = Quantity.VOLUME in need
        self.surface = Quantity.SURFACE in need
        self.contacts = Quantity.CONTACTS in need
        self.torsion = Quantity.TORSION in need
        self.slip = Quantity.SLIP in need


class FeatureExtractor:
    """Features of the frames of one tip.

    rest_area_px2  (n,) float64 px2, area of each pin's cell at rest, by the current cells' own rule
    grid           points along the surface's side; None: chosen from the pitch
    """

    def __init__(self, rest: Rest, rest_area_px2: Array, *, grid: int | None = None) -> None:
        self._xy_rest = np.ascontiguousarray(rest.xy_img)
        self._rest_area_px2 = rest_area_px2
        self._inverse_area = 1.0 / rest_area_px2
        self._near = Neighbourhood(rest)
        self._gate = Gate(rest, self._near)
        self._modes = Modes(rest)
        self._everyone = np.ones(len(rest), dtype=np.bool_)
        self._pins = ContactPins(rest)
        self._slip = Slip(rest)
        self._finder: ContactFinder | None = None
        self._surface: Surface | None = None  # 10 ms to make: only when a contact is first asked about
        self._rest, self._grid = rest, grid
        self._plan = _Plan(frozenset())

    @property
    def surface(self) -> Surface:
        """The grid and its operator."""
        if self._surface is None:
            self._surface = Surface(self._rest, self._grid, self._near)
        return self._surface

    @property
    def finder(self) -> ContactFinder:
        """What looks for contacts on that grid."""
        if self._finder is None:
            self._finder = ContactFinder(self.surface)
        return self._finder

    def extract(self, tracks: Tracks, cells: Cells | None, demand: frozenset[Feature]) -> Features:
        """What the geometry of one frame says.

        cells    of the same frame; None when nobody asked for what needs areas
        Returns  Features; fields outside of the demand are None
        """
        if demand is not self._plan.demand:
            self._plan = _Plan(demand)
        plan = self._plan
        seen = tracks.seen
        motion = np.empty_like(self._xy_rest)  # new: it is handed on, and remembered for slip
        mean_x, mean_y, now_px, seen_n = _features.motion(
            np.ascontiguousarray(tracks.xy_img),
            self._xy_rest,
            np.ascontiguousarray(tracks.sigma_px),
            seen,
            motion,
        )
        sigma = self._gate.sigma_px(now_px)
        filled = cells is not None and max(FILL_LEAST * len(seen), 1) <= seen_n < len(seen)
        if cells is None:
            change = np.full(len(motion), np.nan)
            touched = self._gate.touched_by_motion(motion, seen, sigma)
        else:
            change = cells.area_px2 * self._inverse_area - 1.0
            grown = (
                cells.whole_px2 * self._inverse_area - 1.0
                if filled and cells.whole_px2 is not None
                else change
            )
            xy = np.ascontiguousarray(cells.xy_img)
            touched = self._gate.touched_by_area(grown, xy, sigma)
        whole, known = motion, seen
        if cells is not None and filled:
            whole, known = cells.xy_img - self._xy_rest, self._everyone
            mean_x, mean_y = whole.mean(axis=0).tolist()
        shear = np.array([mean_x, mean_y]) if plan.shear else None
        modes = self._modes.fit(whole, known) if plan.modes else None
        if not touched:
            self._slip.forget()
            areas = cells is not None
            return Features(
                area_change=change,
                displacement_px=motion,
                touched=False,
                shear_px=shear,
                modes_px=modes,
                volume_px2=0.0 if plan.volume and areas else None,
                contacts=() if plan.contacts and areas else None,
                torsion_rad=0.0 if plan.torsion else None,
                slip_px=0.0 if plan.slip else None,
                slip_probability=0.0 if plan.slip else None,
            )
        volume: float | None = None
        picture: Array | None = None
        contacts: tuple[ContactRegion, ...] | None = None
        noise = self._gate.cell_noise(sigma)
        if cells is not None and (plan.volume or plan.surface or plan.contacts):
            surface = self.surface
            growth, heights, pressed = surface.rise(grown, xy, VOLUME_THRESHOLD * noise)
            if plan.volume:
                volume = pressed
            if plan.surface:
                picture = surface.spread(heights, np.nan).astype(np.float64)
            if plan.contacts:
                relief = blend(surface.stretch(xy), heights)
                least = surface.stretch_noise * np.float32(THRESHOLD * sigma)
                np.maximum(least, np.float32(THRESHOLD_MIN), out=least)
                contacts = self.finder.find(relief, least, growth, xy, seen)
        turn = slip = probability = None
        if plan.torsion or plan.slip:
            least_change = max(THRESHOLD * noise, THRESHOLD_MIN)
            pins = self._pins.select(change, least_change)
            if plan.torsion:
                turn = torsion(self._xy_rest, motion, pins)
            if plan.slip:
                state = self._slip.update(motion, change, pins, sigma)
                slip, probability = state.slip_px, state.probability
        return Features(
            area_change=change,
            displacement_px=motion,
            touched=True,
            shear_px=shear,
            modes_px=modes,
            volume_px2=volume,
            surface=picture,
            grid_img=(self.surface.x_img, self.surface.y_img) if picture is not None else None,
            contacts=contacts,
            torsion_rad=turn,
            slip_px=slip,
            slip_probability=probability,
        )
