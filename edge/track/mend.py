"""Torn places of a match: where a sharp tool bends the skin more than neighbours can tell.

Idea: growing from neighbour to neighbour (`identity`) breaks off where the motion changes by half a step from
one pin to the next; behind the break a row may have slipped by one, and looks tidy there. Such a place has
lost pins and free blobs side by side. Its pins and those next to it are set free, and if there are as many
blobs as pins, each has one: the assignment of least total squared distance, a transport that never crosses
over, from where a smooth surface through the pins around expects them.

Rules
- Counts that differ prove nothing: then what was lost stays lost. So does it where the skin would fold, tear,
  or bend beyond what it does in one piece. Pins beside such a place stay where they fit those further out.
- A lost pin without a free blob near is a dark pin, and no torn place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from edge.track.field import Lattice
from edge.types import Array, Index, Mask

__all__ = ["mend"]

Blob = Index

FREE_NEAR = 0.8  # pitches; a free blob this near to where a lost pin is expected should have been its own
ROOM = 0.5  # pitches; a free blob nearer to a pin's own is no pin
BESIDE = 1.2  # pitches round such a blob, where pins are in doubt with it
MARGINS = (1, 3, 5)  # rings of neighbours that are set free besides; a slip may reach far
# Free blobs in one place, and their share of all free ones, that are no chance: false blobs lie anywhere.
# What cannot be mended there is lost, and what is round it where it does not fit the pins further out.
TORN_LEAST, TORN_SURE, TORN_SHARE = 2, 5, 0.5
# Rings round a place that stays torn, and steps off the smooth surface further out, that a pin there may be.
# Without any of this 96 pins of 744 sure frames were swapped and 3646 missed (331 pins: 240 simulated jumps
# of four hazards, 600 rendered flat presses); at 0.1, 0.15, 0.2 steps 3, 7, 12 of 763 and 4288, 3542, 3202.
LOST_MARGIN, FITS = 1, 0.15
LARGEST = 0.5  # of all pins; a larger place has too little round it to say where its pins are
REACH = 3.5  # pitches round the place, of the pins that say where its own are expected
LEAST_ROUND = 8  # pins
ROUNDS = 6  # of expecting and assigning, at the most; it stops where nothing changes
STIFF = 0.05  # ridge of the smooth surface, on distances in pitches; chosen, not tuned
# Area of the skin between three neighbours, now over then: 0.16 to 3.4 in simulated presses of 5 mm by a ball
# of 2 mm (60 presses); not measured on the published sets.
SHRINK_MAX, STRETCH_MAX = 0.15, 5.0
# Steps off the neighbours' local map: 0.34 on the published sets, to 0.94 before a ball of 2 mm that was
# dragged. That is believed where hardly a blob is missing or false: equal counts are no chance then.
BEND_MAX, BEND_MAX_COUNTED, COUNTED = 0.45, 1.0, 0.03
WHOLE = 0.75  # share of the pins that are good: with fewer, holes and false blobs meet by chance
APART_COUNTED = 0.6  # likewise, of the distance that tracks keep


@dataclass(frozen=True, slots=True)
class _Blobs:
    """xy (m, 2) px, all blobs; counted: hardly one is missing or false."""

    xy: Array
    counted: bool


def mend(lattice: Lattice, blob_xy: Array, blob: Blob, good: Mask) -> tuple[Blob, Mask]:
    """The match (n,) with its torn places assigned, or lost.

    blob_xy  (m, 2) px, all blobs
    blob     (n,) index of the blob of each pin, where good
    """
    free = np.ones(len(blob_xy), bool)
    free[blob[good]] = False
    if good.all() or not free.any() or np.count_nonzero(good) < LEAST_ROUND:
        return blob, good
    rest, pitch = lattice.rest_xy, lattice.pitch_px
    whole = bool(np.mean(good) > WHOLE)
    crowded = free & (cKDTree(blob_xy[blob[good]]).query(blob_xy)[0] < ROOM * pitch)
    few = COUNTED * len(rest)
    counted = whole and abs(len(blob_xy) - len(rest)) < few and int(np.count_nonzero(crowded)) < few
    blobs = _Blobs(blob_xy, counted)
    if not blobs.counted:
        free &= ~crowded
    for place in _places(lattice, ~good):
        if good[place].any():  # mended with the one before
            continue
        around = _around(lattice, good, place)
        if around is None:
            continue
        now = blob_xy[blob]
        now[place] = _expected(rest, now, around, place, pitch)
        loose = blob_xy[free][cKDTree(now[place]).query(blob_xy[free])[0] < FREE_NEAR * pitch]
        if len(loose) < TORN_LEAST:
            continue
        beside = cKDTree(loose).query(now)[0] < BESIDE * pitch
        for margin in MARGINS if blobs.counted else MARGINS[:1]:
            doubted = _widened(lattice, beside, margin)
            doubted[place] = True
            mended = _mend_one(lattice, blobs, blob, good, free, doubted)
            if mended is not None:
                blob, good = mended, good | doubted
                free[blob[doubted]] = False
                break
        else:
            sure = len(loose) >= max(TORN_SURE, TORN_SHARE * np.count_nonzero(free)) and whole
            if blobs.counted or sure:
                doubted = _widened(lattice, beside, LOST_MARGIN)
                doubted[place] = True
                good = good & ~(doubted & ~_fitting(lattice, blob_xy[blob], good, doubted))
    return blob, good


def _mend_one(
    lattice: Lattice, blobs: _Blobs, blob: Blob, good: Mask, free: Mask, doubted: Mask
) -> Blob | None:
    """The match with all doubted pins assigned; None where that cannot be done, or not be believed."""
    rest, pitch = lattice.rest_xy, lattice.pitch_px
    pins = _rows(doubted)
    around = _around(lattice, good & ~doubted, pins)
    if around is None:
        return None
    expected = _expected(rest, blobs.xy[blob], around, pins, pitch)
    near = _rows(free)
    near = near[cKDTree(expected).query(blobs.xy[near])[0] < FREE_NEAR * pitch]
    theirs = np.append(blob[doubted & good], near)
    if len(theirs) != len(pins):
        return None
    mended = blob.copy()
    mended[pins] = _assign(rest, blobs.xy, blob, around, pins, theirs, expected, pitch)
    motion = blobs.xy[mended] - rest
    return mended if _sound(lattice, motion, good | doubted, doubted, blobs.counted) else None


def _fitting(lattice: Lattice, now: Array, good: Mask, doubted: Mask) -> Mask:
    """(n,) the doubted pins whose blob is where the good ones around expect it; now (n, 2) px."""
    fits = np.zeros(len(good), bool)
    pins = _rows(doubted)
    around = _around(lattice, good & ~doubted, pins)
    if around is not None:
        expected = _expected(lattice.rest_xy, now, around, pins, lattice.pitch_px)
        fits[pins] = np.hypot(*(now[pins] - expected).T) < FITS * lattice.step_px[pins]
    return fits


def _around(lattice: Lattice, good: Mask, pins: Blob) -> Mask | None:
    """(n,) the good pins round a place; None where they are too few to say what to expect of it."""
    if len(pins) > LARGEST * len(good):
        return None
    rest = lattice.rest_xy
    around = good & (cKDTree(rest[pins]).query(rest)[0] < REACH * lattice.pitch_px)
    return around if np.count_nonzero(around) >= LEAST_ROUND else None


def _rows(mask: Mask) -> Index:
    return np.flatnonzero(mask).astype(np.int32)


def _widened(lattice: Lattice, pins: Mask, rings: int) -> Mask:
    a, b = lattice.edge.T
    wide = pins.copy()
    for _ in range(rings):
        wide[np.append(b[wide[a]], a[wide[b]])] = True
    return wide


def _places(lattice: Lattice, lost: Mask) -> list[Blob]:
    """Lost pins that are neighbours of each other, one array a place."""
    a, b = lattice.edge.T
    tie = lost[a] & lost[b]
    n = len(lost)
    graph = coo_matrix((np.ones(int(tie.sum()), bool), (a[tie], b[tie])), shape=(n, n))
    label = np.where(lost, connected_components(graph, directed=False)[1], -1)
    return [_rows(label == k) for k in np.unique(label[lost])]


def _expected(rest: Array, now: Array, known: Mask, pins: Blob, pitch: float) -> Array:
    """(k, 2) px, the thin plate through the known pins' motion, read at `pins`."""
    knots, at = rest[known] / pitch, rest[pins] / pitch
    middle = knots.mean(0)
    flat = np.column_stack([np.ones(len(knots)), knots - middle])
    size = len(knots)
    system = np.zeros((size + 3, size + 3))
    system[:size, :size] = _plate(knots, knots) + STIFF * np.eye(size)
    system[:size, size:], system[size:, :size] = flat, flat.T
    right = np.zeros((size + 3, 2))
    right[:size] = now[known] - rest[known]
    terms = np.linalg.solve(system, right)
    reading = np.column_stack([_plate(at, knots), np.ones(len(at)), at - middle])
    return np.asarray(rest[pins] + reading @ terms, np.float64)


def _plate(a: Array, b: Array) -> Array:
    square = cdist(a, b, "sqeuclidean")
    return np.asarray(0.5 * square * np.log(np.maximum(square, 1e-12)), np.float64)


def _assign(
    rest: Array,
    blob_xy: Array,
    blob: Blob,
    around: Mask,
    pins: Blob,
    blobs: Blob,
    expected: Array,
    pitch: float,
) -> Blob:
    """(k,) which of the blobs each pin has."""
    now = np.where(around[:, None], blob_xy[blob], 0.0)
    both = around.copy()
    both[pins] = True
    chosen = np.empty(0, np.int64)
    for _ in range(ROUNDS):
        cost = cdist(expected, blob_xy[blobs], "sqeuclidean")
        before, chosen = chosen, linear_sum_assignment(cost)[1]
        if np.array_equal(before, chosen):
            break
        now[pins] = blob_xy[blobs[chosen]]
        expected = _expected(rest, now, both, pins, pitch)
    return np.asarray(blobs[chosen], np.int32)


def _sound(lattice: Lattice, motion: Array, known: Mask, doubted: Mask, counted: bool) -> bool:
    """Whether the skin is in one piece, unfolded and smooth, where it was in doubt."""
    corner = lattice.corner
    corner = corner[doubted[corner].any(1) & known[corner].all(1)]
    now = lattice.rest_xy + motion
    share = _twice_area(now[corner]) / _twice_area(lattice.rest_xy[corner])
    if np.any(share < SHRINK_MAX) or np.any(share > STRETCH_MAX):
        return False
    rows = np.flatnonzero(doubted)
    expected, _, _ = lattice.predict(motion, known)
    off = np.hypot(*(motion - expected)[rows].T)
    if np.any(off > (BEND_MAX_COUNTED if counted else BEND_MAX) * lattice.step_px[rows]):
        return False
    first, second = lattice.pair.T
    both = (doubted[first] | doubted[second]) & known[first] & known[second]
    gap = np.hypot(*(now[first[both]] - now[second[both]]).T)
    return not np.any(gap < (APART_COUNTED if counted else 1.0) * lattice.apart_px[both])


def _twice_area(corner: Array) -> Array:
    """(t, 3, 2) -> (t,) with sign."""
    u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], np.float64)
