"""Features of a skin that the image shows in several parts: each part has its contacts, found by itself.

Rules
- Contacts of all parts are in one list, the strongest first, each at its place in the image. One touch that
  two mirrors show is two contacts.
- Volume is the sum. Mean motion and modes are those of all pins together.
- Torsion, slip and vibration are of the part in contact whose pins have moved the most.
"""

from dataclasses import replace

import cv2
import numpy as np

from edge.features.extract import FeatureExtractor, FeaturePlan
from edge.features.modes import Modes
from edge.features.params import CONTACTS_MAX
from edge.features.surface import grid_line
from edge.geometry.neighbours import nearest_of
from edge.geometry.parts import joined, parts_of, tracks_of
from edge.types import Array, Cells, Features, Index, Rest, Tracks


class RegionExtractor:
    """A `FeatureExtractor` of each part, with the same calls; part (n,): which part each pin belongs to."""

    def __init__(self, rest: Rest, part: Index, rest_area_px2: Array) -> None:
        self._rest, self._part, self._modes = rest, part, Modes(rest)
        self._parts = [(rows, FeatureExtractor(own, rest_area_px2[rows])) for rows, own in parts_of(rest)]

    def prepare(self, plan: FeaturePlan) -> None:
        """Make now what otherwise the first contact would wait for."""
        for _, extractor in self._parts:
            extractor.prepare(plan)

    def forget_contacts(self) -> None:
        """The next frame's contacts do not follow from the last one's."""
        for _, extractor in self._parts:
            extractor.forget_contacts()

    def contact_holds(self, tracks: Tracks) -> bool:
        """Whether the last frame's contacts go on in all parts; False: not known."""
        return all(extractor.contact_holds(tracks_of(tracks, rows)) for rows, extractor in self._parts)

    def extract(
        self, tracks: Tracks, cells: Cells | None, plan: FeaturePlan, holds: bool = False, capture_ns: int = 0
    ) -> Features:
        """The features of one frame; arguments as of `FeatureExtractor`."""
        of_parts: list[Features] = []
        for rows, extractor in self._parts:
            own = None if cells is None else _areas_of(cells, rows)
            of_parts.append(extractor.extract(tracks_of(tracks, rows), own, plan, holds, capture_ns))
        of_rows = [rows for rows, _ in self._parts]
        most = max(of_parts, key=lambda f: (f.in_contact, np.nansum(f.displacement_px**2)))
        shear = [len(f.area_change) * f.shear_px for f in of_parts if f.shear_px is not None]
        contacts = sorted((c for f in of_parts for c in f.contacts or ()), key=lambda c: -c.peak)
        moved, seen = tracks.xy_img, tracks.seen
        if cells is not None:  # lost pins are where they are predicted
            moved, seen = cells.xy_img, np.ones_like(seen)
        surface, grid = self._surface(of_parts)
        return replace(
            most,
            area_change=joined(of_rows, [f.area_change for f in of_parts]),
            displacement_px=joined(of_rows, [f.displacement_px for f in of_parts]),
            shear_px=np.sum(shear, axis=0) / len(seen) if shear else None,
            modes_px=None if most.modes_px is None else self._modes.fit(moved - self._rest.xy_img, seen),
            volume_px2=None if most.volume_px2 is None else sum(f.volume_px2 or 0.0 for f in of_parts),
            surface=surface,
            grid_img=grid,
            contacts=None if most.contacts is None else tuple(contacts[:CONTACTS_MAX]),
            gap=sum(f.gap for f in of_parts) if cells is None else cells.gap,
            gap_img=None if cells is None else cells.gap_img,
            longest_px=max(f.longest_px for f in of_parts),
            step_px=max(f.step_px for f in of_parts),
            sigma_px=float(np.nanmean(tracks.sigma_px)),
            sigma_max_px=max(f.sigma_max_px for f in of_parts),
        )

    def _surface(self, of_parts: list[Features]) -> tuple[Array | None, tuple[Array, Array] | None]:
        """The surfaces of the parts in contact on one grid, each at the points nearest to its pins."""
        if all(f.surface is None for f in of_parts):
            return None, None
        (x0, y0), radius_px = self._rest.pattern.centre_img, self._rest.pattern.tip_radius_px
        line = grid_line(self._rest.pattern)
        x, y = np.meshgrid(line, line)
        surface = np.where(np.hypot(x, y) <= radius_px, 0.0, np.nan)
        places = np.stack([x + x0, y + y0], axis=-1)
        part = self._part[nearest_of(self._rest.xy_img, places.reshape(-1, 2))[1]].reshape(x.shape)
        for (rows, _), features in zip(self._parts, of_parts, strict=True):
            if features.surface is not None and features.grid_img is not None:
                own_x, own_y = features.grid_img
                at = ((places - [own_x[0], own_y[0]]) / (own_x[1] - own_x[0])).astype(np.float32)
                x, y = np.moveaxis(at, -1, 0)
                own = cv2.remap(features.surface, x, y, cv2.INTER_LINEAR, borderValue=np.nan)
                surface = np.where(part == self._part[rows[0]], surface + own, surface)
        return surface, (line + x0, line + y0)


def _areas_of(cells: Cells, rows: Index) -> Cells:
    """Areas and places of these pins alone."""
    whole = None if cells.whole_px2 is None else cells.whole_px2[rows]
    return replace(cells, area_px2=cells.area_px2[rows], xy_img=cells.xy_img[rows], whole_px2=whole)


def extractor_of(rest: Rest, rest_area_px2: Array, dots: bool) -> FeatureExtractor | RegionExtractor:
    """What makes the features of a skin in one part or in several; dots: on the surface of one part."""
    if rest.part is None:
        return FeatureExtractor(rest, rest_area_px2, dots)
    return RegionExtractor(rest, rest.part, rest_area_px2)
