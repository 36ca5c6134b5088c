"""The lattice of pins at rest: neighbours, pitch, and stencils over the neighbours.

Idea: pins sit on one skin, so their motion is a smooth function of the rest position, and near pins predict
each other. The predictions are linear in the motion: their weights depend on the rest frame alone and are
computed once.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from edge.errors import DegenerateLayout
from edge.geometry.layout import spans
from edge.geometry.neighbours import nearest_of
from edge.types import Array, Index, Mask

# A hexagonal lattice has these: pins of the first ring, of the first two; where the third is, in pitches.
N_RING, N_TWO_RINGS, THIRD_RING = 6, 18, 7.0**0.5
# Singular values below this share of the largest count as zero: pins on a line determine no slope across it.
RANK_TOLERANCE = 1e-4


@dataclass(frozen=True, slots=True)
class LatticeParams:
    """Parameters by name; evidence in docs/tuning.md. Lengths are in pitches."""

    longest_edge: float = 1.6  # pins further apart are no neighbours: there is a bay of the hull
    near_width: float = 1.6  # of the Gaussian weight
    distance_min: float = 0.5  # no two tracks come nearer, or than this share of a shorter distance at rest
    closest_n: int = 8


PARAMS = LatticeParams()


def pitch_of(xy: Array) -> float:
    """Median over the pins of the mean distance to the three nearest; xy (n, 2) any unit, same unit out."""
    distance, _ = nearest_of(xy, xy, 4)
    return float(np.median(distance[:, 1:].mean(axis=1)))


def nearest(xy: Array, k: int) -> Index:
    """Each pin itself and its k nearest ones, of xy (n, 2).

    Returns  (n, k + 1) int32, nearest first, the lower row first of two at one distance; fewer columns
             where there are fewer pins
    """
    row = nearest_of(xy, xy, k + 1)[1]
    own = row == np.arange(len(xy))[:, None]
    return np.take_along_axis(row, np.argsort(~own, axis=1, kind="stable"), axis=1)


def slope_stencil(xy: Array, pitch: float) -> tuple[Index, Array]:
    """Slope of a motion at each pin as a constant weighting of its first ring: the plane of least squares.

    xy, pitch  (n, 2) and the pitch, same unit
    Returns    (n, 7) int32, the pin itself and the six nearest; (n, 2, 7) float64 per unit: their weights in
               the slopes along x and along y. Fewer columns where there are fewer pins; where the plane is
               not determined, the shortest of the solutions.
    """
    ring = nearest(xy, N_RING)
    plane = np.linalg.pinv(_terms((xy[ring] - xy[:, None]) / pitch, 1), rcond=RANK_TOLERANCE)
    return ring, np.ascontiguousarray(plane[:, 1:] / pitch)


def groups_of(n: int, a: Index, b: Index) -> Index:
    """(n,) the lowest row of the group that each of n belongs to; rows a (p,) and b (p,) are linked."""
    label = np.arange(n, dtype=np.int32)
    while True:
        lowest = label.copy()
        np.minimum.at(lowest, a, label[b])
        np.minimum.at(lowest, b, label[a])
        lowest = lowest[lowest]  # what a row has, those that point to it have
        if np.array_equal(lowest, label):
            return label
        label = lowest


def inside_hull(points: Array, xy: Array, margin: float = 0.0) -> Mask:
    """(m,) which of the places xy (m, 2) are in the hull of points (n, 2), or within `margin` of it."""
    hull = cv2.convexHull(points.astype(np.float32))
    margin += float(np.abs(hull).max() * np.finfo(np.float32).eps)  # a place on the border is in it
    return np.array([cv2.pointPolygonTest(hull, (float(x), float(y)), True) >= -margin for x, y in xy], bool)


def residual_stencil(xy: Array, pitch: float) -> tuple[Index, Array]:
    """How far a pin's motion is off the quadratic through its two rings, as a constant weighting.

    Weighted least squares (Gaussian of `near_width` pitches), so an affine motion has no residual.

    xy, pitch  (n, 2) and the pitch, same unit
    Returns    (n, 19) int32, the pin itself and the eighteen nearest; (n, 19) float64: their weights. The
               squares of a row sum to 1, so that the noise of a residual is that of a pin.
    """
    near = nearest(xy, N_TWO_RINGS)
    away = (xy[near[:, 1:]] - xy[:, None]) / pitch
    root = np.sqrt(_gaussian((away**2).sum(axis=2)))
    fit = np.linalg.pinv(_terms(away, 2) * root[..., None], rcond=RANK_TOLERANCE)[:, 0] * root
    error = np.concatenate([np.ones((len(xy), 1)), -fit], axis=1)
    return near, error / np.sqrt((error**2).sum(axis=1, keepdims=True))


def _gaussian(square: Array) -> Array:
    """Weight of a neighbour by the square of its distance in pitches."""
    return np.asarray(np.exp(-0.5 * square / PARAMS.near_width**2), np.float64)


def _terms(away: Array, degree: int) -> Array:
    """(n, k, 3 or 6): 1, x, y, and for degree 2 the squares, of (n, k, 2) offsets."""
    x, y = away[..., 0], away[..., 1]
    terms = [np.ones_like(x), x, y]
    if degree == 2:
        terms += [x * x, x * y, y * y]
    return np.stack(terms, axis=-1)


class Lattice:
    """Neighbours of each pin at rest.

    rest_xy          (n, 2) float64, px
    pitch_px         of the tip
    edges            (e, 2) int32, Delaunay edges, each once, none longer than `longest_edge` pitches
    adjacent         (n, k) int32, Delaunay neighbours, filled up with n
    direction_rad    of the edges, modulo 60 degrees
    near             (n, 18) int32, nearest pins, nearest first; fewer columns where there are fewer pins
    offset           (n, 18, 2) to these, pitches
    weight           (n, 18) of these by distance, zero from the third ring on
    closest          (n, closest_n) int32, the first columns of near
    local_pitch_px   (n,) distance to the next pin, a median over the neighbourhood: the unit of all
                     thresholds
    pairs            (p, 2) int32, each pin and its closest ones, each pair once
    distance_min_px  (p,) that the tracks of such a pair keep
    """

    def __init__(self, rest_xy: Array, pitch_px: float) -> None:
        """Raises DegenerateLayout: fewer than 4 pins, or all on a line."""
        self.n = n = len(rest_xy)
        if n < 4:
            raise DegenerateLayout(f"{n} pins in the rest frame; tracking needs at least 4")
        self.rest_xy = rest_xy
        self.pitch_px = pitch_px
        self.edges = _edges(rest_xy, PARAMS.longest_edge * pitch_px)
        along = rest_xy[self.edges[:, 1]] - rest_xy[self.edges[:, 0]]
        sixfold = np.angle(np.sum(np.exp(6j * np.arctan2(along[:, 1], along[:, 0])))) / 6
        self.direction_rad = float(sixfold)
        self.adjacent = _adjacent(self.edges, n)

        near = nearest(rest_xy, N_TWO_RINGS)
        self.near = np.ascontiguousarray(near[:, 1:])
        self.offset = (rest_xy[self.near] - rest_xy[:, None]) / pitch_px
        distance = np.hypot(self.offset[..., 0], self.offset[..., 1])
        self.weight = np.where(distance < THIRD_RING, _gaussian(distance**2), 0.0)
        # Rows may be much denser one way than the other; it is the nearest neighbour that a pin can be
        # mistaken for.
        nearest_px = distance[:, 0] * pitch_px
        self.local_pitch_px: Array = np.median(nearest_px[near[:, : PARAMS.closest_n]], axis=1)
        # Pins that are close at rest may stay close.
        self.closest = np.ascontiguousarray(self.near[:, : PARAMS.closest_n])
        columns = self.closest.shape[1]
        pin = np.repeat(np.arange(n, dtype=np.int32), columns)
        both = np.sort(np.stack([pin, self.closest.ravel()], axis=1))
        self.pairs, first = np.unique(both, axis=0, return_index=True)
        apart = distance[:, :columns].ravel()[first]
        self.distance_min_px = PARAMS.distance_min * np.minimum(apart, 1.0) * pitch_px


def _edges(xy: Array, longest: float) -> Index:
    """(e, 2) Delaunay edges and hull's sides, each once, none longer. Raises DegenerateLayout: on a line."""
    if not spans(xy):
        raise DegenerateLayout("all pins of the rest frame lie on one line")
    corner = np.floor(xy.min(axis=0))
    at = (xy - corner).astype(np.float32)
    width, height = np.ceil(at.max(axis=0)).astype(int) + 1
    mesh = cv2.Subdiv2D((0, 0, int(width), int(height)))
    mesh.insert(at)
    row = {(x, y): k for k, (x, y) in enumerate(at.tolist())}
    ends = np.asarray(mesh.getEdgeList()).tolist()
    among = [(row[x, y], row[u, v]) for x, y, u, v in ends if (x, y) in row and (u, v) in row]
    hull = cv2.convexHull(at, returnPoints=False)[:, 0]
    both = np.vstack([np.array(among).reshape(-1, 2), np.column_stack([hull, np.roll(hull, 1)])])
    edges = np.unique(np.sort(both, axis=1), axis=0).astype(np.int32)
    short = np.hypot(*(xy[edges[:, 0]] - xy[edges[:, 1]]).T) < longest
    return np.asarray(edges[short], np.int32)


def _adjacent(edges: Index, n: int) -> Index:
    """(n, k) the pins connected to each pin by an edge, filled up with n."""
    both = np.vstack([edges, edges[:, ::-1]])
    both = both[np.argsort(both[:, 0], kind="stable")]
    degree = np.bincount(both[:, 0], minlength=n)
    adjacent = np.full((n, max(1, int(degree.max()))), n, np.int32)
    column = np.arange(len(both)) - np.repeat(np.cumsum(degree) - degree, degree)
    adjacent[both[:, 0], column] = both[:, 1]
    return adjacent
