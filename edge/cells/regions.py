"""Cells of a skin that the image shows in several parts: none reaches from one part into the next."""

import numpy as np

from edge.cells.tessellator import Tessellator
from edge.geometry.parts import joined, parts_of, tracks_of
from edge.types import Cells, Index, Rest, Tracks


class RegionTessellator:
    """A `Tessellator` of each part, with the same calls; of no part may all pins be lost."""

    def __init__(self, rest: Rest) -> None:
        self._parts = [(rows, Tessellator(own)) for rows, own in parts_of(rest)]
        self._rows = [rows for rows, _ in self._parts]
        self._n = len(rest)
        self.rest_area_px2 = joined(self._rows, [part.rest_area_px2 for _, part in self._parts])

    def prepare(self) -> None:
        """Make now what otherwise the first lost pin would wait for."""
        for _, tessellator in self._parts:
            tessellator.prepare()

    def cells(self, tracks: Tracks) -> Cells:
        """Area of each pin's bounded cell in this frame. Raises DegenerateLayout, of any part."""
        of_parts = [tessellator.cells(tracks_of(tracks, rows)) for rows, tessellator in self._parts]
        whole = gap_img = None
        gaps = [cells.gap * len(cells.area_px2) / self._n for cells in of_parts]
        if tracks.n_seen < self._n:
            of_all = [cells.area_px2 if cells.whole_px2 is None else cells.whole_px2 for cells in of_parts]
            whole = joined(self._rows, of_all)
            places = [cells.gap_img for cells in of_parts]
            gap_img = np.sum([g * at for g, at in zip(gaps, places, strict=True) if at is not None], axis=0)
            gap_img = gap_img / sum(gaps)
        return Cells(
            joined(self._rows, [cells.area_px2 for cells in of_parts]),
            self.rest_area_px2,
            joined(self._rows, [cells.xy_img for cells in of_parts]),
            self._triangles(of_parts),
            np.concatenate([cells.boundary_img for cells in of_parts]),
            whole,
            sum(gaps),
            gap_img,
        )

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
