"""What several views of one skin show, as one: each is read as a tip of its own.

Rules
- A view whose pins are not identified, span no plane, or are too few by the rules for one view, is lost: it
  has no pins and no contacts, and the others' values go on. Where none is left, nothing is trusted.
- Contacts of all views are in one list, the strongest first, each at its place in the image. One touch that
  two mirrors show is two contacts.
- Volume is the sum. Mean motion is that of all pins, and so are modes, unless a view is lost.
- Torsion, slip and vibration are of the view in contact whose pins have moved the most.
- A calibrated value is the mean of those of the views in contact, weighted by their variances. The views'
  errors may have one cause, so it is taken to be no more certain than they are on average.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

import cv2
import numpy as np

from edge.calibration import uncalibrated
from edge.faults.pin_visibility import PinVisibility
from edge.features import Modes
from edge.features.params import CONTACTS_MAX
from edge.features.surface import grid_line
from edge.geometry.neighbours import nearest_of
from edge.geometry.parts import joined, parts_of, tracks_joined
from edge.types import Array, Cells, ContactRegion, Features, Frame, Reading, Rest, Result, Tracks

T = TypeVar("T")


class JoinedViews:
    """Joins the results of the views of one rest frame; rest_areas_px2: of each view's cells, (its pins,)."""

    def __init__(self, rest: Rest, rest_areas_px2: Sequence[Array]) -> None:
        self._rest, self._modes = rest, Modes(rest)
        parts = parts_of(rest)
        self._rows = [rows for rows, _ in parts]
        self._visibility = [PinVisibility(own) for _, own in parts]
        self._lost = [_nothing_of(own, area) for (_, own), area in zip(parts, rest_areas_px2, strict=True)]

    def result(self, frame: Frame, of_views: Sequence[Result]) -> Result:
        spoilt = [
            bool(pins.problem(one.tracks, one.features)) and not pins.explained
            for pins, one in zip(self._visibility, of_views, strict=True)
        ]
        found = [one.features is not None for one in of_views]
        known = [is_found and not bad for is_found, bad in zip(found, spoilt, strict=True)]
        known = known if any(known) else found
        if not any(known):
            tracks = tracks_joined(self._rows, [one.tracks for one in of_views])
            return Result(frame, tracks, None, None, uncalibrated(), searched=True)
        kept = [
            one if is_known else Result(frame, *lost, uncalibrated(), searched=False)
            for one, is_known, lost in zip(of_views, known, self._lost, strict=True)
        ]
        features = self.features([one.features for one in kept])
        cells = [one.cells for one in kept if one.cells is not None]
        whole = self._cells(cells) if len(cells) == len(kept) else None
        tracks = tracks_joined(self._rows, [one.tracks for one in kept])
        return Result(frame, tracks, whole, features, _reading(kept), any(one.searched for one in kept))

    def _cells(self, of_views: Sequence[Cells]) -> Cells:
        """The cells of all views; their boundary points, one after the other, follow all pins."""
        rows, triangles, end = self._rows, [], len(self._rest)
        for cells, own in zip(of_views, rows, strict=True):
            start, end = end, end + len(cells.boundary_img)
            if cells.triangles is not None:
                triangles.append(np.append(own, np.arange(start, end, dtype=np.int32))[cells.triangles])
        whole = None
        if any(cells.whole_px2 is not None for cells in of_views):
            areas = [cells.area_px2 if cells.whole_px2 is None else cells.whole_px2 for cells in of_views]
            whole = joined(rows, areas)
        return Cells(
            joined(rows, [cells.area_px2 for cells in of_views]),
            joined(rows, [cells.rest_area_px2 for cells in of_views]),
            joined(rows, [cells.xy_img for cells in of_views]),
            np.concatenate(triangles) if len(triangles) == len(rows) else None,
            np.concatenate([cells.boundary_img for cells in of_views]),
            whole,
            *self._gap(of_views),
        )

    def _gap(self, of_views: Sequence[Cells | Features]) -> tuple[float, Array | None]:
        """`Cells.gap` and its place, of all pins; of a lost view infinite."""
        gaps = np.array([one.gap * len(rows) for one, rows in zip(of_views, self._rows, strict=True)])
        gap = float(gaps.sum()) / len(self._rest)
        if not gap > 0.0:
            return gap, None
        places = [np.zeros(2) if one.gap_img is None else one.gap_img for one in of_views]
        return gap, np.average(places, axis=0, weights=np.isinf(gaps) if math.isinf(gap) else gaps)

    def features(self, of_views: Sequence[Features | None]) -> Features:
        """The features of all views, of which one at least is known; None: a view is lost."""
        every = [one or lost for one, (*_, lost) in zip(of_views, self._lost, strict=True)]
        known = [one for one in every if not math.isinf(one.gap)]
        most = max(known, key=_moved)
        displacement_px = joined(self._rows, [one.displacement_px for one in every])
        seen = np.isfinite(displacement_px[:, 0])
        modes_known = all(one.modes_px is not None for one in every)
        shear = [len(one.area_change) * one.shear_px for one in known if one.shear_px is not None]
        surface, grid = self._surface(every)
        gap, gap_img = self._gap(every)
        contacts = _strongest((contact, None) for one in known for contact in one.contacts or ())
        return replace(
            most,
            area_change=joined(self._rows, [one.area_change for one in every]),
            displacement_px=displacement_px,
            shear_px=np.sum(shear, axis=0) / sum(len(one.area_change) for one in known) if shear else None,
            modes_px=self._modes.fit(displacement_px, seen) if modes_known else None,
            volume_px2=None if most.volume_px2 is None else sum(one.volume_px2 or 0.0 for one in known),
            surface=surface,
            grid_img=grid,
            contacts=None if most.contacts is None else tuple(contact for contact, _ in contacts),
            gap=gap,
            gap_img=gap_img,
            longest_px=max(one.longest_px for one in known),
            step_px=max(one.step_px for one in known),
            sigma_px=float(np.mean([one.sigma_px for one in known])),
            sigma_max_px=max(one.sigma_max_px for one in known),
        )

    def _surface(self, of_views: Sequence[Features]) -> tuple[Array | None, tuple[Array, Array] | None]:
        """The surfaces of the views in contact on one grid, each at the points nearest to its pins."""
        if all(one.surface is None for one in of_views):
            return None, None
        (x0, y0), radius_px = self._rest.pattern.centre_img, self._rest.pattern.tip_radius_px
        line = grid_line(self._rest.pattern)
        x, y = np.meshgrid(line, line)
        surface = np.where(np.hypot(x, y) <= radius_px, 0.0, np.nan)
        places = np.stack([x + x0, y + y0], axis=-1)
        view_of = np.concatenate([np.full(len(rows), k) for k, rows in enumerate(self._rows)])
        nearest = nearest_of(self._rest.xy_img[np.concatenate(self._rows)], places.reshape(-1, 2))[1]
        view = view_of[nearest].reshape(x.shape)
        for k, one in enumerate(of_views):
            if one.surface is not None and one.grid_img is not None:
                own_x, own_y = one.grid_img
                at = ((places - [own_x[0], own_y[0]]) / (own_x[1] - own_x[0])).astype(np.float32)
                x, y = np.moveaxis(at, -1, 0)
                own = cv2.remap(one.surface, x, y, cv2.INTER_LINEAR, borderValue=np.nan)
                surface = np.where(view == k, surface + own, surface)
        return surface, (line + x0, line + y0)


def _nothing_of(rest: Rest, rest_area_px2: Array) -> tuple[Tracks, Cells, Features]:
    """What is known of a view that is lost."""
    nowhere, middle_img = np.full_like(rest.xy_img, np.nan), rest.xy_img.mean(axis=0)
    none, triangles, boundary = nowhere[:, 0], np.empty((0, 3), np.int32), np.empty((0, 2))
    cells = Cells(none, rest_area_px2, nowhere, triangles, boundary, none, math.inf, middle_img)
    tracks = Tracks.of(nowhere, none, np.zeros(len(rest), np.bool_))
    return tracks, cells, Features(none, nowhere, in_contact=False, gap=math.inf, gap_img=middle_img)


def _moved(features: Features) -> tuple[bool, float]:
    return features.in_contact, float(np.nansum(features.displacement_px**2))


def _strongest(contacts: Iterable[tuple[ContactRegion, T]]) -> list[tuple[ContactRegion, T]]:
    """The contacts that are passed on, each with what belongs to it."""
    return sorted(contacts, key=lambda pair: -pair[0].peak)[:CONTACTS_MAX]


def _reading(of_views: Sequence[Result]) -> Reading:
    found = [(one.features, one.reading) for one in of_views if one.features is not None]
    places = [pair for f, reading in found for pair in zip(f.contacts or (), reading.contacts, strict=True)]
    contacts = np.reshape([place for _, place in _strongest(places)], (-1, 3))
    found.sort(key=lambda pair: _moved(pair[0]), reverse=True)
    in_contact = found[0][0].in_contact
    used = [reading for f, reading in found if f.in_contact == in_contact and reading.calibrated]
    values: dict[str, float] = {}
    sigmas: dict[str, float] = {}
    for name in dict.fromkeys(name for reading in used for name in reading.values):
        read = [(one.values[name], one.sigmas.get(name, math.nan)) for one in used if name in one.values]
        values[name], sigma = _mean([pair for pair in read if math.isfinite(pair[0])])
        if not math.isnan(sigma):
            sigmas[name] = sigma
    saturated = frozenset[str]().union(*(reading.saturated for reading in used))
    return Reading(values, sigmas, contacts, saturated, bool(used))


def _mean(read: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Of values and their sigmas; without sigmas the first. NaN: there is none."""
    if not read or not all(0.0 < sigma < math.inf for _, sigma in read):
        return read[0] if read else (math.nan, math.nan)
    weights = [sigma**-2 for _, sigma in read]
    value = sum(weight * value for weight, (value, _) in zip(weights, read, strict=True)) / sum(weights)
    return value, math.sqrt(len(read) / sum(weights))
