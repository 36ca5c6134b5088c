r"""The artificial points round the pins, and how they move with the rim.

Rules
- On the rest frame a ball of `ball_pitches` rolls round the pins, outside. The boundary is the outline that
  it cannot reach, one pitch outside of the pins that it touches. No hull and no fitted circle are assumed, so
  any layout works (hexagonal, rings, spokes, square, non-convex, in parts); gaps that the ball cannot enter
  belong to the tip. So do holes: pins that the rest frame missed.

          (   ball  )
       o   `.     .'   o       o  pins that the ball touches: the rim
      /  \___`---'___/  \      ___  boundary: arcs of one pitch about them, and between two of them
                                    an arc about the ball's centre

- It is sampled arc by arc, so that the samples rotate, shift and scale with the pins.
- A fence stands round it, needed by the triangulation only (`edge.cells.mesh` says why); it moves by the
  affine fit alone and so stays convex.
- The boundary moves linearly with the rim pins: by an affine fit to all of them, plus the residual motion of
  the nearest rim pins. It follows translation, rotation, scaling and shearing of the tip exactly, local
  motion of the rim smoothly.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from edge.geometry.layout import affine_terms
from edge.geometry.neighbours import pairs_within
from edge.types import Array, Index

# Weights below this share of the largest vanish in the rounding of single precision.
NEGLIGIBLE = 1e-8
# Arcs of the ball's path shorter than this (rad) come from rounding: the ball touches three pins at once.
ARC_MIN = 1e-6


@dataclass(frozen=True, slots=True)
class CellsParams:
    """Parameters by name, pitches of the pins; the evidence for each is in docs/tuning.md, "Cells"."""

    ball_pitches: float = 3.0  # radius of the ball that rolls round the pins
    step_pitches: float = 0.7  # largest distance of boundary points along an arc


PARAMS = CellsParams()


def make_boundary(xy: Array, pitch_px: float) -> tuple[Array, Index]:
    """Artificial points, in order round the tip or each of its parts, (b, 2) px; (r,) the rim pins' rows."""
    # A pitch further out, so that a rim cell ends half a pitch from its pin, as an inner cell does.
    ball, offset = PARAMS.ball_pitches * pitch_px, pitch_px
    step = PARAMS.step_pitches * pitch_px
    pin, start, length = _ways_of_the_ball(xy, ball)
    comes = xy[pin] + ball * _direction(start)  # ball's centre where it first touches this pin
    leaves = xy[pin] + ball * _direction(start + length)  # and where it touches the next one as well
    points: list[Array] = []
    rim: list[int] = []
    waiting = np.ones(len(pin), dtype=bool)
    while waiting.any():
        loop = [int(np.argmax(waiting))]
        while True:
            waiting[loop[-1]] = False
            follower = int(np.argmin(((comes - leaves[loop[-1]]) ** 2).sum(axis=1)))
            if not waiting[follower]:
                break
            loop.append(follower)
        x, y = np.concatenate([np.stack([comes[k], leaves[k]]) for k in loop]).T
        polygon = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
        segments = 0.5 * ball**2 * np.sum(length[loop] - np.sin(length[loop]))
        if polygon + segments < 0:
            continue  # the ball ran round the inside of a hole
        for k, then in zip(loop, [*loop[1:], loop[0]], strict=True):
            points.append(_arc(xy[pin[k]], offset, float(start[k]), float(length[k]), step))
            to_this, to_then = xy[pin[k]] - leaves[k], xy[pin[then]] - leaves[k]
            turn = np.arctan2(to_this[0] * to_then[1] - to_this[1] * to_then[0], float(to_this @ to_then))
            if turn < -ARC_MIN:  # opposite to the sense about a pin
                begin = float(np.arctan2(to_this[1], to_this[0]))
                points.append(_arc(leaves[k], ball - offset, begin, float(turn), step))
            rim.append(int(pin[k]))
    return np.concatenate(points), np.unique(np.array(rim)).astype(np.int32)


def _ways_of_the_ball(xy: Array, ball: float) -> tuple[Index, Array, Array]:
    """Arcs of the ball's centre while it touches one pin alone: (a,) pin, start rad, length rad."""
    pairs = pairs_within(xy, 2 * ball)
    pin, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    to_other = xy[other] - xy[pin]
    distance = np.hypot(to_other[:, 0], to_other[:, 1])
    _, first = np.unique(xy, axis=0, return_index=True)
    used = (distance > 0) & (distance < 2 * ball) & np.isin(pin, first)
    pin, to_other, distance = pin[used], to_other[used], distance[used]
    half = np.arccos(distance / (2 * ball))
    start = np.mod(np.arctan2(to_other[:, 1], to_other[:, 0]) - half, 2 * np.pi)
    order = np.argsort(pin + start / 8.0)  # by pin, then by start, which is less than 8: one sort, not two
    pin, start, end = pin[order], start[order], start[order] + 2 * half[order]
    # A row a pin, behind its intervals empty ones.
    count = np.bincount(pin, minlength=len(xy))
    column = np.arange(len(pin)) - (np.cumsum(count) - count)[pin]
    starts = np.full((len(xy), max(1, count.max())), np.inf)
    ends = np.full_like(starts, -np.inf)
    starts[pin, column], ends[pin, column] = start, end
    wrapped = ends.max(axis=1) - 2 * np.pi  # the part covered by intervals that begin before 0
    reach = np.maximum.accumulate(np.column_stack([wrapped, ends[:, :-1]]), axis=1)
    alone = first[count[first] == 0]
    reach[alone, 0], starts[alone, 0] = 0.0, 2 * np.pi
    which, at = np.nonzero((starts - reach > ARC_MIN) & np.isfinite(starts))
    return which.astype(np.int32), reach[which, at], (starts - reach)[which, at]


def _direction(angle: Array) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _arc(centre: Array, radius: float, start: float, turn: float, step: float) -> Array:
    """(k, 2) points on an arc, at most `step` apart, half of that from its ends."""
    k = max(1, int(np.ceil(abs(turn) * radius / step - 1e-6)))  # 1e-6: rounding must not add a point
    angle = start + turn * (np.arange(k) + 0.5) / k
    return np.asarray(centre + radius * _direction(angle))


def make_fence(boundary: Array) -> Array:
    """(f, 2) px, a circle of points of twice the boundary's reach, that far apart from it and each other."""
    centre = boundary.min(axis=0) + np.ptp(boundary, axis=0) / 2
    reach = float(np.hypot(*(boundary - centre).T).max())
    steps = int(np.ceil(2 * np.pi * 2))
    return np.asarray(centre + 2 * reach * _direction(2 * np.pi * np.arange(steps) / steps))


class RimMotion(NamedTuple):
    """How boundary and fence follow r rim pins: an affine fit to all, and the residuals of the near ones.

    fit     (3, r) float64, least squares: coefficients of 1, x, y (px, at rest) in the motion of the rim pins
    weight  (b + f, r) float64, of the rim pins' residuals; rows of the boundary sum to 1, of the fence to 0
    """

    fit: Array
    weight: Array


def rim_motion(rim: Array, boundary: Array, fence: Array, pitch_px: float) -> RimMotion:
    """The constants of a tip; rim (r, 2) px at rest. Rim pins within a pitch count most."""
    centre = rim.mean(axis=0)
    scale = float(np.abs(rim - centre).max())
    fit: Array = np.linalg.pinv(affine_terms(rim, centre, scale)).astype(np.float64)
    fit[1:] /= scale
    fit[0] -= centre @ fit[1:]
    distance2 = ((boundary[:, None, :] - rim[None, :, :]) ** 2).sum(axis=2)
    distance2 -= distance2.min(axis=1, keepdims=True)  # far from every pin, the nearest still counts
    weight = np.exp(-0.5 * distance2 / pitch_px**2)
    weight[weight < NEGLIGIBLE] = 0.0
    weight /= weight.sum(axis=1, keepdims=True)
    return RimMotion(fit, np.pad(weight, ((0, len(fence)), (0, 0))))
