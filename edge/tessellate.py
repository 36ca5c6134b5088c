"""Pins to bounded Voronoi cells: the area that belongs to each pin.

Idea (paper, "Construction of Voronoi Cell Data"): artificial points round the pins, denser than the
pins, bound the cells of the outer pins; the cells of the artificial points themselves are thrown away.

Rules
- The boundary. On the rest frame it is the outline of the union of discs of one pitch radius round all
  pins: no hull, no fitted circle, so any layout will do (hexagonal, rings, square, non-convex). It is
  sampled at most half a pitch apart. Holes narrower than two pitches belong to the tip.
- The boundary moves with the rim, by a constant matrix: an affine fit to all rim pins, plus what the
  nearest rim pins do beside it. So it follows translation, rotation, scaling and shearing of the tip
  exactly, and local motion of the rim smoothly. Rest areas come from the same rule at zero motion.
- A pin's area is the area of its Voronoi cell among pins and artificial points. The bounded polygon is
  the set of places nearer to a pin than to an artificial point; its area is the sum of all pins' areas.
- A lost pin is put where its neighbours say it should be (least bending of the displacement field,
  exact for affine motion), so that its cell does not go to them. Its own area is NaN.
- Pins at one and the same place share their common cell in equal parts. A pin that broke through the
  boundary has no bounded cell: NaN.
- Decisions and areas are as exact as `_cells.c` says; the triangulation is kept from frame to frame.
"""

from __future__ import annotations

import numpy as np

from edge._cells import Mesh
from edge.errors import DegenerateLayout
from edge.types import Array, Cells, Index, Mask, Rest, Tracks

__all__ = ["Tessellator", "cell_polygons"]

# Distance of the artificial points from the rim pins, in pitches: the rim cell then ends half a pitch
# outside of its pin, as an inner cell does. Every hole between regular neighbours is covered, too.
BOUNDARY_PITCHES = 1.0
# Angle between artificial points on one disc; pi/6 is 0.52 pitches: denser than the pins.
ARC_STEP = np.pi / 6
# Exposed arcs shorter than this get no point: at a pin that only just belongs to the rim, noise of the
# rest frame would decide. 0.1 of a pitch is a quarter of the pins' own spacing on the boundary.
ARC_MIN = 0.1
# Outlines that fit into a square of this many pitches are holes: a single pin's outline spans 2.
HOLE_PITCHES = 1.9
# Reach of a rim pin's own motion along the boundary, in pitches (Gaussian sigma).
RIM_REACH_PITCHES = 1.0
# Neighbours that predict a pin: within this many pitches. Two rings of a hexagonal lattice.
NEIGHBOUR_PITCHES = 2.1
# Motion is called affine-predictable from this many neighbours on; fewer, and their mean is taken.
NEIGHBOURS_MIN = 4
# Directions in which pins spread less than this share of their longest extent count as a line.
LINE = 1e-9


class Tessellator:
    """Cells of the pins of one tip; keeps the triangulation of the last frame.

    rest.xy_img  (n, 2) px, n >= 3, finite, not all on a line
    Raises       DegenerateLayout
    """

    def __init__(self, rest: Rest) -> None:
        xy = np.ascontiguousarray(rest.xy_img, dtype=np.float64)
        _must_span(xy, "rest frame")
        self._rest_img = xy
        self._pitch_px = _pitch(xy)
        self._boundary_rest_img, self._rim = _boundary(xy, self._pitch_px)
        self._carry = _carry_matrix(xy[self._rim], self._boundary_rest_img, self._pitch_px)
        self._bending: Array | None = None  # made when the first pin is lost
        self._lost: tuple[bytes, Mask, Array] | None = None  # prediction for the last set of lost pins
        n, b = len(xy), len(self._boundary_rest_img)
        self._mesh = Mesh(n + b, n)
        self._points = np.empty((n + b, 2))
        self._changes = -1
        self._triangles: Index = np.empty((0, 3), dtype=np.int32)
        self._rest_area_px2 = np.empty(n)
        self._points[:n] = xy
        self._points[n:] = self._boundary_rest_img
        self._mesh.update(self._points, self._rest_area_px2)
        self._rest_area_px2.flags.writeable = False

    @property
    def rest_area_px2(self) -> Array:
        """(n,) px2, area of each pin's cell on the rest frame."""
        return self._rest_area_px2

    def cells(self, tracks: Tracks) -> Cells:
        """Area of each pin's bounded cell in this frame.

        tracks.xy_img  (n, 2) px, row i is pin i; NaN where lost
        Returns        new arrays, except `rest_area_px2` and `triangles`, which frames share (read-only)
        Raises         DegenerateLayout: fewer than 3 visible pins, or all on a line
        """
        n = len(self._rest_img)
        xy = tracks.xy_img
        seen = tracks.seen
        all_seen = bool(seen.all())
        if not all_seen:
            xy = self._predict_lost(xy, seen)
        boundary = self._boundary(xy)
        self._points[:n] = xy
        self._points[n:] = boundary
        area = np.empty(n)
        try:
            changes = self._mesh.update(self._points, area)
        except ValueError as error:
            raise DegenerateLayout(f"{n} pins, {tracks.n_seen} of them seen: {error}") from error
        if changes != self._changes:
            self._triangles = np.frombuffer(self._mesh.triangles(), dtype=np.int32).reshape(-1, 3)
            self._changes = changes
        if not all_seen:
            area[~seen] = np.nan
        return Cells(
            area_px2=area,
            rest_area_px2=self._rest_area_px2,
            xy_img=xy,
            triangles=self._triangles,
            boundary_img=boundary,
        )

    def _boundary(self, xy: Array) -> Array:
        """(b, 2) px, the artificial points for pins at `xy`."""
        motion = xy[self._rim] - self._rest_img[self._rim]
        shift = motion[0].copy()  # taken out, so that a far origin costs no digits
        motion -= shift
        out: Array = self._carry @ motion
        out += self._boundary_rest_img
        out += shift
        return out

    def _predict_lost(self, xy: Array, seen: Mask) -> Array:
        """`xy` with lost pins put where the bending of the displacement field is least."""
        if int(np.count_nonzero(seen)) < 3:
            raise DegenerateLayout(
                f"{np.count_nonzero(seen)} pins seen; cells need at least 3 that span a plane"
            )
        key = seen.tobytes()
        if self._lost is None or self._lost[0] != key:
            _must_span(self._rest_img[seen], "seen pins")
            if self._bending is None:
                self._bending = _bending_matrix(self._rest_img, self._pitch_px)
            lost = ~seen
            operator = -np.linalg.solve(self._bending[np.ix_(lost, lost)], self._bending[np.ix_(lost, seen)])
            self._lost = (key, lost, operator)
        _, lost, operator = self._lost
        motion = xy[seen] - self._rest_img[seen]
        shift = motion[0].copy()
        motion -= shift
        full = np.array(xy)
        full[lost] = operator @ motion + self._rest_img[lost] + shift
        return full


def cell_polygons(cells: Cells) -> list[Array]:
    """Corners of each pin's cell, for drawings.

    Returns  one (k, 2) px array a pin, going round the pin; (0, 2) where the area is NaN
    """
    points = np.concatenate([cells.xy_img, cells.boundary_img])
    a, b, c = (points[cells.triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    u2, v2 = (u * u).sum(axis=1), (v * v).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = a + np.stack([v[:, 1] * u2 - u[:, 1] * v2, u[:, 0] * v2 - v[:, 0] * u2], axis=1) / (
            2 * cross[:, None]
        )
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


def _must_span(xy: Array, what: str) -> None:
    """Raises DegenerateLayout unless `xy` has three points off a line."""
    if not np.isfinite(xy).all():
        raise DegenerateLayout(f"{what}: a coordinate is not finite")
    if len(xy) < 3:
        raise DegenerateLayout(f"{what}: {len(xy)} pins; cells need at least 3 that span a plane")
    spread = np.linalg.svd(xy - xy.mean(axis=0), compute_uv=False)
    if not spread[1] > LINE * spread[0]:
        raise DegenerateLayout(f"{what}: all {len(xy)} pins on a line; cells need pins that span a plane")


def _pitch(xy: Array) -> float:
    """Median distance of a pin to the nearest pin at another place, px."""
    nearest = np.empty(len(xy))
    for i, p in enumerate(xy):
        distance = np.hypot(*(xy - p).T)
        nearest[i] = distance[distance > 0].min()
    return float(np.median(nearest))


def _boundary(xy: Array, pitch_px: float) -> tuple[Array, Index]:
    """Artificial points, and which pins carry them.

    Returns  (b, 2) px; (r,) indices of the rim pins
    """
    radius = BOUNDARY_PITCHES * pitch_px
    points: list[Array] = []
    owners: list[int] = []
    _, first = np.unique(xy, axis=0, return_index=True)
    for i in np.sort(first):
        to_other = xy - xy[i]
        distance = np.hypot(to_other[:, 0], to_other[:, 1])
        near = (distance > 0) & (distance < 2 * radius)
        middle = np.arctan2(to_other[near, 1], to_other[near, 0])
        half = np.arccos(distance[near] / (2 * radius))
        for start, length in _exposed(middle, half):
            steps = max(1, int(np.ceil(length / ARC_STEP - 1e-6)))  # 1e-6: rounding must not add a point
            angle = start + length * (np.arange(steps) + 0.5) / steps
            points.append(xy[i] + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
            owners.extend([int(i)] * steps)
    boundary = np.concatenate(points)
    keep = _without_holes(boundary, radius)
    return boundary[keep], np.unique(np.array(owners)[keep]).astype(np.int32)


def _exposed(middle: Array, half: Array) -> list[tuple[float, float]]:
    """Arcs of a circle that no interval middle +- half covers: (start, length), rad."""
    if len(middle) == 0:
        return [(0.0, 2 * np.pi)]
    start = np.mod(middle - half, 2 * np.pi)
    order = np.argsort(start)
    start, end = start[order], start[order] + 2 * half[order]
    reach = np.maximum.accumulate(end)
    reach = np.concatenate([[reach[-1] - 2 * np.pi], reach[:-1]])  # covered so far, once round
    return [(float(r), float(s - r)) for r, s in zip(reach, start, strict=True) if s - r > ARC_MIN]


def _without_holes(boundary: Array, radius: float) -> Mask:
    """True for the points on outlines that are wider than a hole."""
    unvisited = np.ones(len(boundary), dtype=bool)
    keep = np.zeros(len(boundary), dtype=bool)
    while unvisited.any():
        chain = np.zeros(len(boundary), dtype=bool)
        front = [int(np.argmax(unvisited))]
        unvisited[front] = False
        while front:
            i = front.pop()
            chain[i] = True
            to_other = boundary - boundary[i]
            close = unvisited & (np.hypot(to_other[:, 0], to_other[:, 1]) < 1.5 * ARC_STEP * radius)
            unvisited &= ~close
            front.extend(np.flatnonzero(close).tolist())
        span = np.ptp(boundary[chain], axis=0)
        keep |= chain & (np.hypot(*span) > HOLE_PITCHES * radius)
    return keep


def _affine_terms(xy: Array, centre: Array, scale: float) -> Array:
    """(n, 3): 1, x, y about `centre` in units of `scale`."""
    return np.column_stack([np.ones(len(xy)), (xy - centre) / scale])


def _carry_matrix(rim: Array, boundary: Array, pitch_px: float) -> Array:
    """(b, r): motion of the rim pins to motion of the artificial points; every row sums to 1."""
    centre = rim.mean(axis=0)
    scale = float(np.abs(rim - centre).max())
    terms = _affine_terms(rim, centre, scale)
    fit = np.linalg.pinv(terms)
    to_pin = boundary[:, None, :] - rim[None, :, :]
    distance2 = (to_pin**2).sum(axis=2)
    distance2 -= distance2.min(axis=1, keepdims=True)  # far from every pin, the nearest still counts
    weight = np.exp(-0.5 * distance2 / (RIM_REACH_PITCHES * pitch_px) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    affine = _affine_terms(boundary, centre, scale) @ fit
    matrix: Array = affine + weight - weight @ terms @ fit
    return np.ascontiguousarray(matrix)


def _bending_matrix(xy: Array, pitch_px: float) -> Array:
    """(n, n) symmetric, positive on every set of pins that leaves three others that span a plane.

    u^T B u is the sum over pins of (u_i - what its neighbours predict)^2: the prediction is an affine
    fit, so that any affine motion costs nothing.
    """
    n = len(xy)
    residual = np.eye(n)
    for i in range(n):
        to_other = xy - xy[i]
        distance = np.hypot(to_other[:, 0], to_other[:, 1])
        distance[i] = np.inf
        reach = max(NEIGHBOUR_PITCHES * pitch_px, float(np.partition(distance, min(n, 6) - 1)[min(n, 6) - 1]))
        near = np.flatnonzero(distance <= reach)
        near = near[near != i]
        weight = np.exp(-0.5 * (distance[near] / pitch_px) ** 2)
        terms = _affine_terms(xy[near], xy[i], pitch_px)
        root = np.sqrt(weight)[:, None]
        if len(near) >= NEIGHBOURS_MIN:
            residual[i, near] -= np.linalg.pinv(terms * root, rcond=1e-6)[0] * root[:, 0]
        else:
            residual[i, near] -= weight / weight.sum()
    matrix: Array = residual.T @ residual
    # The faintest pull to the first seen pin's motion keeps the solution unique where a whole
    # separate group of pins is lost.
    return matrix + 1e-12 * np.eye(n) * np.trace(matrix) / n
