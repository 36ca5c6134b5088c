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

from edge.features.contacts import find_contacts
from edge.features.gate import Gate
from edge.features.modes import Modes
from edge.features.motion import Slip, contact_pins, mean_motion, torsion
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
_FROM_AREAS = frozenset({Quantity.VOLUME, Quantity.SURFACE, Quantity.CONTACTS})
_FROM_GRID = frozenset({Quantity.VOLUME, Quantity.SURFACE, Quantity.CONTACTS})

#: Contact threshold and the volume's threshold, in sigmas of one cell's noise.
THRESHOLD = 5.0
#: and never below this area change: drift of light and focus between tare and now, not noise.
THRESHOLD_MIN = 0.01


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
        self._slip = Slip(rest)
        self._surface: Surface | None = None  # 10 ms to make: only when a contact is first asked about
        self._rest, self._grid = rest, grid

    @property
    def surface(self) -> Surface:
        """The grid and its operator."""
        if self._surface is None:
            self._surface = Surface(self._rest, self._grid)
        return self._surface

    def extract(self, tracks: Tracks, cells: Cells | None, demand: frozenset[Feature]) -> Features:
        """What the geometry of one frame says.

        cells    of the same frame; None when nobody asked for what needs areas
        Returns  Features; fields outside of the demand are None
        """
        need: frozenset[Quantity] = frozenset().union(*(NEEDS[feature] for feature in demand))
        motion = tracks.xy_img - self._xy_rest
        seen = tracks.seen
        if cells is None:
            need -= _FROM_AREAS
            change = np.full(len(motion), np.nan)
            touched = self._gate.touched_by_motion(motion, tracks)
        else:
            change = cells.area_px2 * self._inverse_area - 1.0
            touched = self._gate.touched_by_area(change, tracks)
        shear = mean_motion(motion, seen) if Quantity.SHEAR in need else None
        modes = self._modes.fit(motion, seen) if Quantity.MODES in need else None
        if not touched:
            self._slip.forget()
            return Features(
                area_change=change,
                displacement_px=motion,
                touched=False,
                shear_px=shear,
                modes_px=modes,
                volume_px2=0.0 if Quantity.VOLUME in need else None,
                contacts=() if Quantity.CONTACTS in need else None,
                torsion_rad=0.0 if Quantity.TORSION in need else None,
                slip_px=0.0 if Quantity.SLIP in need else None,
                slip_probability=0.0 if Quantity.SLIP in need else None,
            )
        threshold = max(THRESHOLD * self._gate.noise(tracks), THRESHOLD_MIN)
        volume: float | None = None
        picture: Array | None = None
        contacts: tuple[ContactRegion, ...] | None = None
        if need & _FROM_GRID:
            assert cells is not None
            surface = self.surface
            growth = surface.fill(change)
            if Quantity.VOLUME in need or Quantity.SURFACE in need:
                heights = surface.heights(growth)
                if Quantity.VOLUME in need:
                    volume = surface.volume_px2(heights, threshold)
                if Quantity.SURFACE in need:
                    picture = surface.spread(heights, np.nan).astype(np.float64)
            if Quantity.CONTACTS in need:
                moved = (cells.xy_img - self._xy_rest).astype(np.float32)
                least = np.maximum(
                    surface.stretch_noise * np.float32(THRESHOLD * self._gate.sigma_px(tracks)),
                    np.float32(THRESHOLD_MIN),
                )
                contacts = find_contacts(surface.stretch(moved), surface, least, growth, cells.xy_img)
        turn = slip = probability = None
        if Quantity.TORSION in need or Quantity.SLIP in need:
            compression = np.where(change > threshold, change, 0.0)
            weight = contact_pins(self._xy_rest, compression) * seen
            if Quantity.TORSION in need:
                turn = torsion(self._xy_rest, np.where(seen[:, None], motion, 0.0), weight)
            if Quantity.SLIP in need:
                sigma = float(np.median(tracks.sigma_px[seen])) if seen.any() else 0.0
                state = self._slip.update(motion, weight, sigma)
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
