"""The artificial points round the pins, and how they move with the rim.

Rules
- On the rest frame the boundary is the outline of the union of discs of one pitch radius round all pins:
  no hull, no fitted circle, so any layout will do (hexagonal, rings, square, non-convex, in parts).
- It is sampled by arcs, symmetrically, so that it turns, shifts and scales with the pins.
- A fence stands round it, for the triangulation's sake only (`_cells.c` says why); it moves by the affine
  fit alone and so stays convex.
- The boundary moves by a constant matrix on the rim pins' motion: an affine fit to all of them, plus what the
  nearest rim pins do beside that fit. It follows translation, rotation, scaling and shearing of the tip
  exactly, local motion of the rim smoothly.
"""

from __future__ import annotations

import numpy as np

from edge.tessellate.layout import affine_terms
from edge.types import Array, Index, Mask

__all__ = ["carry_matrix", "make_boundary", "make_fence"]

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
# Distance of the fence from the farthest artificial point, and of its points from each other. Boundary
# points half a pitch apart then need to be 0.1 pitches off a line to change their triangles.
FENCE_PITCHES = 2.5
# Reach of a rim pin's own motion along the boundary, in pitches (Gaussian sigma).
RIM_REACH_PITCHES = 1.0


def make_boundary(xy: Array, pitch_px: float) -> tuple[Array, Index]:
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


def make_fence(boundary: Array, pitch_px: float) -> Array:
    """(f, 2) px, a circle of points round the boundary."""
    centre = boundary.min(axis=0) + np.ptp(boundary, axis=0) / 2
    gap = FENCE_PITCHES * pitch_px
    radius = float(np.hypot(*(boundary - centre).T).max()) + gap
    steps = int(np.ceil(2 * np.pi * radius / gap))
    angle = 2 * np.pi * np.arange(steps) / steps
    fence: Array = centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return fence


def _exposed(middle: Array, half: Array) -> list[tuple[float, float]]:
    """Arcs of a circle that no interval middle +- half covers: (start, length), rad."""
    if len(middle) == 0:
        return [(0.0, 2 * np.pi)]
    start = np.mod(middle - half, 2 * np.pi)
    order = np.argsort(start)
    start, end = start[order], start[order] + 2 * half[order]
    wrapped = end.max() - 2 * np.pi  # what the intervals before this turn cover of it
    reach = np.maximum.accumulate(np.concatenate([[wrapped], end[:-1]]))
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


def carry_matrix(rim: Array, boundary: Array, fence: Array, pitch_px: float) -> Array:
    """(b + f, r): motion of the rim pins to motion of boundary and fence; every row sums to 1."""
    centre = rim.mean(axis=0)
    scale = float(np.abs(rim - centre).max())
    terms = affine_terms(rim, centre, scale)
    fit = np.linalg.pinv(terms)
    to_pin = boundary[:, None, :] - rim[None, :, :]
    distance2 = (to_pin**2).sum(axis=2)
    distance2 -= distance2.min(axis=1, keepdims=True)  # far from every pin, the nearest still counts
    weight = np.exp(-0.5 * distance2 / (RIM_REACH_PITCHES * pitch_px) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    matrix: Array = affine_terms(np.concatenate([boundary, fence]), centre, scale) @ fit
    matrix[: len(boundary)] += weight - weight @ terms @ fit
    return matrix
