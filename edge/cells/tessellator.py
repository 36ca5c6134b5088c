"""Pin positions to cells: boundary, lost pins, rest areas. The areas themselves are computed in `mesh`."""

import numpy as np

from edge.cells.boundary import make_boundary, make_fence, rim_motion
from edge.cells.mesh import Mesh
from edge.cells.missing import LostPins
from edge.errors import DegenerateLayout
from edge.geometry.copies import Copies
from edge.geometry.layout import circumcentres, must_span, spans
from edge.types import Array, Cells, Rest, Tracks


class Tessellator:
    """Cells of the pins of one tip; keeps the triangulation of the last frame.

    rest_area_px2  (n,) px2, area of each pin's cell on the rest frame

    rest.xy_img    (n, 2) px, n >= 3, finite, not all on a line
    Raises         DegenerateLayout
    """

    def __init__(self, rest: Rest) -> None:
        xy = np.ascontiguousarray(rest.xy_img, dtype=np.float64)
        must_span(xy, "rest frame")
        pitch_px = _side_length(xy)
        boundary, rim = make_boundary(xy, pitch_px)
        fence = make_fence(boundary)
        rest_img = np.concatenate([xy, boundary, fence])
        # The points are the pins, which stay at rest, the boundary and the fence; areas are the last frame's.
        self._points, self._area = rest_img.copy(), np.empty(len(xy))
        self._around = self._points[len(xy) : len(xy) + len(boundary)]
        self._last_img: Array = xy  # of the last frame, with predictions for lost pins
        self._areas, self._arounds = Copies(self._area), Copies(self._around)
        self._lost = LostPins(xy, pitch_px)
        self._mesh = Mesh(len(xy), len(boundary), len(fence))
        motion = rim_motion(xy[rim], boundary, fence, pitch_px)
        self._mesh.attach(rest_img, rim, motion, self._points, self._area)
        self._changes = self._mesh.update(self._points, self._area)
        self._triangles = self._mesh.triangles()
        self.rest_area_px2 = self._area.copy()
        self.rest_area_px2.flags.writeable = False
        self._collapsed_px2 = float(np.finfo(float).eps ** 0.5 * self.rest_area_px2.sum())
        self._last_counts = False  # whether those are of the frame before

    def prepare(self) -> None:
        """Make now what otherwise the first lost pin would wait for (20 ms); from any thread."""
        self._lost.precision  # noqa: B018

    def cells(self, tracks: Tracks, drawn: bool = True) -> Cells:
        """Area of each pin's bounded cell in this frame.

        drawn          somebody wants their triangles
        tracks.xy_img  (n, 2) px, row i is pin i; NaN where lost
        tracks.autocorrelation  how much the frame that this was called for before tells of lost pins
        Returns        new arrays; but `rest_area_px2` and `triangles` are shared by frames and read-only, and
                       `xy_img` is that of the tracks if no pin is lost
        Raises         DegenerateLayout: fewer than 3 visible pins, or all on a line
        """
        n, xy = len(self._area), tracks.xy_img
        are_lost = tracks.n_seen < n
        if are_lost:
            self._lost.update(tracks.seen)
            autocorrelation = tracks.autocorrelation if self._last_counts else 0.0
            xy = self._lost.fill(xy, self._last_img, autocorrelation)
        self._last_img, self._last_counts = xy, True
        try:
            changes = self._mesh.follow(xy)
        except DegenerateLayout as error:
            raise DegenerateLayout(f"{self._seen_of(tracks)}: {error}") from error
        if not self._mesh.total_area >= self._collapsed_px2:  # rare, or NaN: a cell is not bounded
            self._must_not_have_collapsed(tracks)
        if drawn and changes != self._changes:
            self._triangles, self._changes = self._mesh.triangles(), changes
        triangles = self._triangles if drawn else None
        area, around, whole = self._areas.take(), self._arounds.take(), None
        if not are_lost:
            return Cells(area, self.rest_area_px2, xy, triangles, around)
        whole = area.copy()
        area[self._lost.lost] = np.nan
        gap, gap_img = self._lost.gap, self._lost.gap_img
        # The fields are given by place: names cost 3,600 instructions a frame.
        return Cells(area, self.rest_area_px2, xy, triangles, around, whole, gap, gap_img)

    def keep(self, tracks: Tracks) -> None:
        """Make a frame whose cells nobody needs the last one; all of its pins are seen."""
        self._last_img, self._last_counts = tracks.xy_img, True

    def forget(self) -> None:
        """Let the next frame's areas depend on that frame alone, to the last bit."""
        self._mesh.forget()
        self._last_counts = False

    def _must_not_have_collapsed(self, tracks: Tracks) -> None:
        total_px2 = float(np.nansum(self._area)) if spans(self._last_img) else 0.0
        if total_px2 < self._collapsed_px2:
            raise DegenerateLayout(f"{self._seen_of(tracks)}: all on a line or at one place")

    def _seen_of(self, tracks: Tracks) -> str:
        return f"{len(self._area)} pins, {tracks.n_seen} of them seen"


def _side_length(xy: Array) -> float:
    """Median length of the sides of the pins' triangles, px.

    It is longer than `pitch_of` by the sides that cross from ring to ring: by 2 % where pins are in rings.
    """
    mesh = Mesh(len(xy), 0)
    mesh.update(xy, np.empty(len(xy)))
    corners = mesh.triangles()
    sides = xy[corners] - xy[np.roll(corners, -1, axis=1)]
    return float(np.median(np.hypot(sides[..., 0], sides[..., 1])))


def cell_polygons(cells: Cells) -> list[Array]:
    """Corners of each pin's cell in turn, (k, 2) px, for drawings; (0, 2) where the area is NaN, or no
    triangles are there.
    """
    n = len(cells.xy_img)
    if cells.triangles is None:
        return [np.empty((0, 2))] * n
    points = np.concatenate([cells.xy_img, cells.boundary_img])
    centre = circumcentres(points, cells.triangles)
    pin = cells.triangles.ravel()
    corner = np.repeat(centre, 3, axis=0)
    arm = corner - points[pin]
    # A cell is convex and holds its pin: the angle about the pin puts the corners in order.
    order = np.lexsort((np.arctan2(arm[:, 1], arm[:, 0]), pin))
    starts = np.searchsorted(pin[order], np.arange(n + 1))
    corner = corner[order]
    return [
        corner[starts[i] : starts[i + 1]] if np.isfinite(cells.area_px2[i]) else np.empty((0, 2))
        for i in range(n)
    ]
