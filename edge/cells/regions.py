"""Cells of a skin that the image shows in several parts: none reaches from one part into the next."""

import numpy as np

from edge.cells.tessellator import Tessellator
from edge.errors import DegenerateLayout
from edge.geometry.parts import joined, parts_of, tracks_of
from edge.types import Cells, Index, Rest, Tracks


class RegionTessellator:
    """A `Tessellator` of each part, with the same calls. A part whose pins span no plane has no cells."""

    def __init__(self, rest: Rest) -> None:
        self._parts = [(rows, Tessellator(own)) for rows, own in parts_of(rest)]
        self._rows = [rows for rows, _ in self._parts]
        self._middles = [rest.xy_img[rows].mean(axis=0) for rows in self._rows]
        self._n = len(rest)
        self.rest_area_px2 = joined(self._rows, [part.rest_area_px2 for _, part in self._parts])

    def prepare(self) -> None:
        """Make now what otherwise the first lost pin would wait for."""
        for _, tessellator in self._parts:
            tessellator.prepare()

    def cells(self, tracks: Tracks) -> Cells:
        """Area of each pin's bounded cell in this frame. Raises DegenerateLayout, of all parts."""
        of_parts = [self._of_part(k, tracks_of(tracks, rows)) for k, rows in enumerate(self._rows)]
        if all(np.isnan(cells.xy_img).all() for cells in of_parts):
            raise DegenerateLayout(f"{tracks.n_seen} seen pins: those of no part span a plane")
        whole = gap_img = None
        gaps = np.array([cells.gap * len(cells.area_px2) / self._n for cells in of_parts])
        if tracks.n_seen < self._n:
            of_all = [cells.area_px2 if cells.whole_px2 is None else cells.whole_px2 for cells in of_parts]
            whole = joined(self._rows, of_all)
            places = [np.zeros(2) if cells.gap_img is None else cells.gap_img for cells in of_parts]
            gap_img = np.average(places, axis=0, weights=np.isinf(gaps) if np.isinf(gaps).any() else gaps)
        return Cells(
            joined(self._rows, [cells.area_px2 for cells in of_parts]),
            self.rest_area_px2,
            joined(self._rows, [cells.xy_img for cells in of_parts]),
            self._triangles(of_parts),
            np.concatenate([cells.boundary_img for cells in of_parts]),
            whole,
            float(gaps.sum()),
            gap_img,
        )

    def _of_part(self, k: int, tracks: Tracks) -> Cells:
        """The cells of a part, of its tracks; where its pins are lost, nothing is known of them."""
        _, tessellator = self._parts[k]
        try:
            return tessellator.cells(tracks)
        except DegenerateLayout:
            tessellator.forget()
        nowhere = np.full_like(tracks.xy_img, np.nan)
        area, triangles, boundary = nowhere[:, 0], np.empty((0, 3), np.int32), np.empty((0, 2))
        rest_px2, middle_img = tessellator.rest_area_px2, self._middles[k]
        return Cells(area, rest_px2, nowhere, triangles, boundary, area, np.inf, middle_img)

    def _triangles(self, of_parts: list[Cells]) -> Index:
        """Those of all parts; the boundary points of the parts, one after the other, follow all pins."""
        triangles: list[Index] = []
        end = self._n
        for cells, rows in zip(of_parts, self._rows, strict=True):
            start, end = end, end + len(cells.boundary_img)
            triangles.append(np.append(rows, np.arange(start, end, dtype=np.int32))[cells.triangles])
        return np.concatenate(triangles)

    def keep(self, tracks: Tracks) -> None:
        """Make a frame whose cells nobody needs the last one; all of its pins are seen."""
        for rows, tessellator in self._parts:
            tessellator.keep(tracks_of(tracks, rows))

    def forget(self) -> None:
        """Let the next frame's areas depend on that frame alone, to the last bit."""
        for _, tessellator in self._parts:
            tessellator.forget()


def tessellator_of(rest: Rest) -> Tessellator | RegionTessellator:
    """What makes the cells of a skin in one part or in several. Raises DegenerateLayout."""
    return Tessellator(rest) if rest.part is None else RegionTessellator(rest)
