"""Pin positions to cells: boundary, lost pins, rest areas. The areas themselves are computed in `mesh`."""

from __future__ import annotations

import numpy as np

from edge.cells.boundary import make_boundary, make_fence, rim_motion
from edge.cells.mesh import Mesh
from edge.cells.missing import Gap, LostPins
from edge.cells.params import PARAMS, CellsParams
from edge.cells.points import FramePoints
from edge.errors import DegenerateLayout
from edge.geometry.lattice import side_length_of
from edge.geometry.layout import circumcentres, must_span, spans
from edge.types import Array, Cells, Mask, Rest, Tracks

__all__ = ["Tessellator", "cell_polygons"]


class Tessellator:
    """Cells of the pins of one tip; keeps the triangulation of the last frame.

    rest.xy_img  (n, 2) px, n >= 3, finite, not all on a line
    Raises       DegenerateLayout
    """

    def __init__(self, rest: Rest, params: CellsParams = PARAMS) -> None:
        xy = np.ascontiguousarray(rest.xy_img, dtype=np.float64)
        must_span(xy, "rest frame")
        pitch_px = _side_length(xy)
        boundary, rim = make_boundary(xy, pitch_px, params)
        fence = make_fence(boundary)
        n, b, f = len(xy), len(boundary), len(fence)
        self._rest_img = xy
        motion = rim_motion(xy, rim, boundary, fence, pitch_px)
        self._points = FramePoints(xy, motion, np.concatenate([boundary, fence]))
        # The last frame's, in memory of `_points`.
        self._area, self._of_pins = self._points.area_px2, self._points.xy_img[:n]
        self._around = self._points.xy_img[n : n + b]
        self._lost = LostPins(xy, pitch_px)
        self._mesh = Mesh(n, b, f)
        self._rest_area_px2 = np.empty(n)
        self._mesh.update(self._points.xy_img, self._rest_area_px2)
        self._rest_area_px2.flags.writeable = False
        self._collapsed_px2 = np.finfo(float).eps ** 0.5 * float(self._rest_area_px2.sum())
        self._last_counts = False  # whether those are of the frame before
        self._gap = 0.0
        self._gap_img: Array | None = None
        self._changes = -1
        self._triangles = self._mesh.triangles()

    def prepare(self) -> None:
        """Make now what otherwise the first lost pin would wait for (20 ms)."""
        self._lost.precision  # noqa: B018

    @property
    def rest_area_px2(self) -> Array:
        """(n,) px2, area of each pin's cell on the rest frame."""
        return self._rest_area_px2

    def cells(self, tracks: Tracks) -> Cells:
        """Area of each pin's bounded cell in this frame.

        tracks.xy_img  (n, 2) px, row i is pin i; NaN where lost
        tracks.autocorrelation  how much the frame that this was called for before tells of lost pins
        Returns        new arrays; but `rest_area_px2` and `triangles` are shared by frames and read-only, and
                       `xy_img` is that of the tracks if no pin is lost
        Raises         DegenerateLayout: fewer than 3 visible pins, or all on a line
        """
        if tracks.n_seen < len(self._area) or self._gap_img is not None:
            self._set_lost(tracks.seen)
        autocorrelation, self._last_counts = tracks.autocorrelation if self._last_counts else 0.0, True
        try:
            changes = self._mesh.follow(self._points, tracks.xy_img, autocorrelation)
        except DegenerateLayout as error:
            raise DegenerateLayout(f"{self._seen_of(tracks)}: {error}") from error
        if not self._mesh.total_area >= self._collapsed_px2:  # rare, or NaN: a cell is not bounded
            self._must_not_have_collapsed(tracks)
        if changes != self._changes:
            self._triangles, self._changes = self._mesh.triangles(), changes
        xy, area = tracks.xy_img, self._area.copy()
        whole: Array | None = None
        if self._gap_img is not None:
            xy, whole = self._of_pins.copy(), self._area.copy()
            area[self._lost.gap[0]] = np.nan
        # By place: names cost 3,600 instructions a frame.
        around = self._around.copy()
        return Cells(area, self._rest_area_px2, xy, self._triangles, around, whole, self._gap, self._gap_img)

    def keep(self, tracks: Tracks) -> None:
        """Make a frame whose cells nobody needs the last one; all of its pins are seen."""
        self._of_pins[:] = tracks.xy_img
        self._last_counts = True

    def forget(self) -> None:
        """Let the next frame's areas depend on that frame alone, to the last bit."""
        self._mesh.forget()
        self._last_counts = False

    def _set_lost(self, seen: Mask) -> None:
        if self._lost.update(seen):
            self._points.set_missing(*self._lost.gap)
            self._gap, self._gap_img = _size_and_place(self._lost.gap, self._rest_img)

    def _must_not_have_collapsed(self, tracks: Tracks) -> None:
        total_px2 = float(np.nansum(self._area)) if spans(self._of_pins) else 0.0
        if total_px2 < self._collapsed_px2:
            raise DegenerateLayout(f"{self._seen_of(tracks)}: all on a line or at one place")

    def _seen_of(self, tracks: Tracks) -> str:
        return f"{len(self._area)} pins, {tracks.n_seen} of them seen"


def _size_and_place(gap: Gap, rest_img: Array) -> tuple[float, Array | None]:
    """`Cells.gap` and `Cells.gap_img`."""
    lost, _, inverse = gap
    if not len(lost):
        return 0.0, None
    # x and y of a pin: half of the sum over both is its variance along one axis.
    variance = np.diag(inverse).reshape(-1, 2).sum(axis=1) / 2.0
    total = float(variance.sum())
    return total / len(rest_img), variance @ rest_img[lost] / total


def _side_length(xy: Array) -> float:
    """Median length of the sides of the pins' triangles, px."""
    mesh = Mesh(len(xy), 0)
    mesh.update(xy, np.empty(len(xy)))
    return side_length_of(xy, mesh.triangles())


def cell_polygons(cells: Cells) -> list[Array]:
    """Corners of each pin's cell, for drawings.

    Returns  one (k, 2) px array a pin, going round the pin; (0, 2) where the area is NaN
    """
    points = np.concatenate([cells.xy_img, cells.boundary_img])
    centre = circumcentres(points, cells.triangles)
    pin = cells.triangles.ravel()
    corner = np.repeat(centre, 3, axis=0)
    arm = corner - points[pin]
    # A cell is convex and holds its pin: the angle about the pin puts the corners in order.
    order = np.lexsort((np.arctan2(arm[:, 1], arm[:, 0]), pin))
    n = len(cells.xy_img)
    starts = np.searchsorted(pin[order], np.arange(n + 1))
    corner = corner[order]
    return [
        corner[starts[i] : starts[i + 1]] if np.isfinite(cells.area_px2[i]) else np.empty((0, 2))
        for i in range(n)
    ]
