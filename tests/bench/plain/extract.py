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
- Lengths in px of the image, areas as a share of the cell at rest: `calibration` knows millimetres.
"""

from __future__ import annotations

from enum import Enum, auto

import numpy as np

from edge.features.extract import FILL_LEAST
from edge.features.local import Neighbourhood
from edge.types import Array, Cells, ContactRegion, Feature, Features, Mask, Rest, Tracks
from tests.bench.plain.contacts import FineField, blend, find_contacts
from tests.bench.plain.gate import Gate
from tests.bench.plain.modes import Modes
from tests.bench.plain.motion import ContactPins, Slip, mean_motion, torsion
from tests.bench.plain.surface import Surface

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
        self._xy_rest = rest.xy_img
        self._inverse_area = 1.0 / rest_area_px2
        self._gate = Gate(rest)
        self._modes = Modes(rest)
        self._pins = ContactPins(rest)
        self._slip = Slip(rest)
        self._near = Neighbourhood(rest)
        self._fine: FineField | None = None
        self._surface: Surface | None = None  # 10 ms to make: only when a contact is first asked about
        self._rest, self._grid = rest, grid
        self._plan = _Plan(frozenset())

    @property
    def surface(self) -> Surface:
        """The grid and its operator."""
        if self._surface is None:
            self._surface = Surface(self._rest, self._grid)
        return self._surface

    @property
    def fine(self) -> FineField:
        """The sharper field."""
        if self._fine is None:
            self._fine = FineField(self.surface)
        return self._fine

    def _noise_px(self, motion_px: Array, seen: Mask) -> float:
        """Noise of a pin, as its neighbours show it."""
        near = self._near
        off = np.einsum("nk,nkc->nc", near.residual, motion_px[near.near])[seen]
        return 1.4826 * float(np.median(np.abs(off))) if len(off) else 0.0

    def extract(self, tracks: Tracks, cells: Cells | None, demand: frozenset[Feature]) -> Features:
        """What the geometry of one frame says.

        cells    of the same frame; None when nobody asked for what needs areas
        Returns  Features; fields outside of the demand are None
        """
        if demand is not self._plan.demand:
            self._plan = _Plan(demand)
        plan = self._plan
        motion = tracks.xy_img - self._xy_rest
        seen = tracks.seen
        all_seen = tracks.n_seen == len(seen)
        sigma = self._gate.sigma_px(tracks)
        if cells is None:
            change = np.full(len(motion), np.nan)
            touched = self._gate.touched_by_motion(motion, seen, sigma)
        else:
            change = cells.area_px2 * self._inverse_area - 1.0
            grown = change
            if cells.whole_px2 is not None and tracks.n_seen >= FILL_LEAST * len(seen):
                grown = cells.whole_px2 * self._inverse_area - 1.0
            touched = self._gate.touched_by_area(grown, cells.xy_img, sigma)
        whole = motion if cells is None else cells.xy_img - self._xy_rest
        filled = cells is not None and tracks.n_seen >= FILL_LEAST * len(seen)
        known = np.ones_like(seen) if filled else seen
        given = whole if filled else motion
        shear = mean_motion(given, None if known.all() else known) if plan.shear else None
        modes = self._modes.fit(given, known) if plan.modes else None
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
            growth = surface.fill(grown, whole)
            heights = surface.heights(growth)
            if plan.volume:
                volume = surface.volume_px2(heights, VOLUME_THRESHOLD * noise)
            if plan.surface:
                picture = surface.spread(heights, np.nan).astype(np.float64)
            if plan.contacts:
                relief = blend(surface.stretch((cells.xy_img - self._xy_rest).astype(np.float32)), heights)
                least = surface.stretch_noise * np.float32(THRESHOLD * sigma)
                np.maximum(least, np.float32(THRESHOLD_MIN), out=least)
                contacts = find_contacts(
                    relief, surface, least, growth, cells.xy_img, self._noise_px(whole, seen), self.fine, seen
                )
        turn = slip = probability = None
        if plan.torsion or plan.slip:
            least_change = max(THRESHOLD * noise, THRESHOLD_MIN)
            pins = self._pins.select(np.where(change > least_change, change, 0.0))
            if plan.torsion:
                held = pins if all_seen else pins[seen[pins]]
                turn = torsion(self._xy_rest[held], motion[held])
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
