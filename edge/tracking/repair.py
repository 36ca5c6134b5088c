"""Inconsistent places of a match, where a sharp contact bends the skin more than neighbours can predict.

Idea: region growing (`search`) stops where the motion changes by half a pitch from one pin to the next;
beyond that, a row may have slipped by one and still look regular. Such a place has unmatched pins and
unassigned blobs side by side. Its pins and those next to them are assigned anew: if there are as many blobs
as pins, each pin gets one, by least total squared distance from where a smooth surface through the
surrounding pins predicts it. Such an assignment cannot cross over.

Rules
- If the counts differ, nothing can be concluded: unmatched pins stay unmatched. So do they where the skin
  would fold, tear, or bend more than it can in one piece. Pins beside such a place stay if they fit those
  further out.
- An unmatched pin without an unassigned blob near is a dark pin, not an inconsistent place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from edge.geometry.thin_plate import thin_plate_at
from edge.tracking.tip import TrackedTip
from edge.types import Array, Index, Mask

__all__ = ["repair"]


@dataclass(frozen=True, slots=True)
class _Blobs:
    """xy (m, 2) px, all blobs; complete: hardly one is missing or false."""

    xy: Array
    complete: bool


def repair(tip: TrackedTip, blob_xy: Array, blob: Index, matched: Mask) -> tuple[Index, Mask]:
    """The match (n,) with its inconsistent places assigned, or unmatched.

    blob_xy  (m, 2) px, all blobs
    blob     (n,) index of the blob of each pin, where matched
    """
    p, pitch = tip.params, tip.pitch_px
    unassigned = np.ones(len(blob_xy), np.bool_)
    unassigned[blob[matched]] = False
    if matched.all() or not unassigned.any() or np.count_nonzero(matched) < p.repair_around_min:
        return blob, matched
    whole = bool(np.mean(matched) > p.repair_whole_share)
    crowded = unassigned & (_distance(blob_xy, blob_xy[blob[matched]]) < p.free_space * pitch)
    few = p.complete_share * len(tip)
    complete = whole and abs(len(blob_xy) - len(tip)) < few and int(np.count_nonzero(crowded)) < few
    blobs = _Blobs(blob_xy, complete)
    if not complete:
        unassigned &= ~crowded
    for place in _places(tip, ~matched):
        if matched[place].any():  # repaired with the one before
            continue
        now = _with_predicted(tip, blob_xy[blob], matched, place)
        if now is None:
            continue
        near = blob_xy[unassigned][_distance(blob_xy[unassigned], now[place]) < p.clash_reach * pitch]
        if len(near) < p.repair_blobs_min:
            continue
        beside = _distance(now, near) < p.repair_beside * pitch
        repaired = _repair_widening(tip, blobs, blob, matched, unassigned, beside, place)
        if repaired is not None:
            blob, uncertain = repaired
            matched = matched | uncertain
            unassigned[blob[uncertain]] = False
            continue
        certain_n = max(p.repair_certain_blobs, p.repair_certain_share * np.count_nonzero(unassigned))
        if complete or (whole and len(near) >= certain_n):
            uncertain = _widened(tip, beside, p.repair_lost_margin, place)
            matched = matched & ~(uncertain & ~_fitting(tip, blob_xy[blob], matched, uncertain))
    return blob, matched


def _repair_widening(
    tip: TrackedTip, blobs: _Blobs, blob: Index, matched: Mask, unassigned: Mask, beside: Mask, place: Index
) -> tuple[Index, Mask] | None:
    """The repaired match and the pins (n,) that were assigned anew, with as few rings around as possible."""
    margins = tip.params.repair_margins
    for margin in margins if blobs.complete else margins[:1]:
        uncertain = _widened(tip, beside, margin, place)
        repaired = _repair_place(tip, blobs, blob, matched, unassigned, uncertain)
        if repaired is not None:
            return repaired, uncertain
    return None


def _repair_place(
    tip: TrackedTip, blobs: _Blobs, blob: Index, matched: Mask, unassigned: Mask, uncertain: Mask
) -> Index | None:
    """The match with all uncertain pins assigned; None where that cannot be done, or is implausible."""
    pins = _rows(uncertain)
    around = _around(tip, matched & ~uncertain, pins)
    if around is None:
        return None
    predicted = _predicted(tip, blobs.xy[blob], around, pins)
    near = _rows(unassigned)
    near = near[_distance(blobs.xy[near], predicted) < tip.params.clash_reach * tip.pitch_px]
    theirs = np.append(blob[uncertain & matched], near)
    if len(theirs) != len(pins):
        return None
    now = np.where(around[:, None], blobs.xy[blob], 0.0)
    repaired = blob.copy()
    repaired[pins] = theirs[_assign(tip, now, around, pins, blobs.xy[theirs], predicted)]
    motion = blobs.xy[repaired] - tip.rest_xy
    return repaired if _plausible(tip, motion, matched | uncertain, uncertain, blobs.complete) else None


def _assign(
    tip: TrackedTip, now: Array, around: Mask, pins: Index, blob_xy: Array, predicted: Array
) -> Index:
    """(k,) which of the blobs (k, 2) each pin has; predicted again from the assignment until it no longer
    changes.
    """
    both = around.copy()
    both[pins] = True
    chosen = np.empty(0, np.int64)
    for _ in range(tip.params.repair_rounds):
        before, chosen = chosen, linear_sum_assignment(cdist(predicted, blob_xy, "sqeuclidean"))[1]
        if np.array_equal(before, chosen):
            break
        now[pins] = blob_xy[chosen]
        predicted = _predicted(tip, now, both, pins)
    return np.asarray(chosen, np.int32)


def _with_predicted(tip: TrackedTip, now: Array, matched: Mask, place: Index) -> Array | None:
    """(n, 2) px, positions with a place's pins where those around predict them; None: these are too few."""
    around = _around(tip, matched, place)
    if around is None:
        return None
    now[place] = _predicted(tip, now, around, place)
    return now


def _fitting(tip: TrackedTip, now: Array, matched: Mask, uncertain: Mask) -> Mask:
    """(n,) the uncertain pins whose blob is where the matched ones around predict it; now (n, 2) px."""
    fits = np.zeros(len(matched), np.bool_)
    pins = _rows(uncertain)
    around = _around(tip, matched & ~uncertain, pins)
    if around is not None:
        predicted = _predicted(tip, now, around, pins)
        fits[pins] = np.hypot(*(now[pins] - predicted).T) < tip.params.repair_fits * tip.local_pitch_px[pins]
    return fits


def _around(tip: TrackedTip, matched: Mask, pins: Index) -> Mask | None:
    """(n,) the matched pins round a place; None where they are too few to predict it."""
    p = tip.params
    if len(pins) > p.repair_largest * len(matched):
        return None
    around = matched & (_distance(tip.rest_xy, tip.rest_xy[pins]) < p.repair_reach * tip.pitch_px)
    return around if np.count_nonzero(around) >= p.repair_around_min else None


def _distance(points: Array, others: Array) -> Array:
    """(k,) from each point to the nearest of the others."""
    return np.asarray(cKDTree(others).query(points)[0], np.float64)


def _rows(mask: Mask) -> Index:
    return np.flatnonzero(mask).astype(np.int32)


def _widened(tip: TrackedTip, pins: Mask, rings: int, place: Index) -> Mask:
    """(n,) the pins with so many rings of neighbours around, and the place itself."""
    a, b = tip.lattice.edges.T
    wide = pins.copy()
    for _ in range(rings):
        wide[np.append(b[wide[a]], a[wide[b]])] = True
    wide[place] = True
    return wide


def _places(tip: TrackedTip, unmatched: Mask) -> list[Index]:
    """Unmatched pins that are neighbours of each other, one array a place."""
    a, b = tip.lattice.edges.T
    tie = unmatched[a] & unmatched[b]
    n = len(unmatched)
    graph = coo_matrix((np.ones(int(tie.sum()), np.bool_), (a[tie], b[tie])), shape=(n, n))
    label = np.where(unmatched, connected_components(graph, directed=False)[1], -1)
    return [_rows(label == k) for k in np.unique(label[unmatched])]


def _predicted(tip: TrackedTip, now: Array, known: Mask, pins: Index) -> Array:
    """(k, 2) px, the thin plate through the known pins' motion, read at `pins`."""
    knots, points = tip.rest_xy[known] / tip.pitch_px, tip.rest_xy[pins] / tip.pitch_px
    motion = now[known] - tip.rest_xy[known]
    return tip.rest_xy[pins] + thin_plate_at(knots, motion, points, tip.params.repair_ridge)


def _plausible(tip: TrackedTip, motion: Array, known: Mask, uncertain: Mask, complete: bool) -> bool:
    """Whether the skin is in one piece, unfolded and smooth, where it was uncertain."""
    p, lattice = tip.params, tip.lattice
    corner = lattice.triangles
    corner = corner[uncertain[corner].any(1) & known[corner].all(1)]
    now = tip.rest_xy + motion
    share = _twice_area(now[corner]) / _twice_area(tip.rest_xy[corner])
    if np.any(share < p.repair_area_range[0]) or np.any(share > p.repair_area_range[1]):
        return False
    rows = np.flatnonzero(uncertain)
    predicted, _, _ = tip.affine.predict(motion, known)
    residual = np.hypot(*(motion - predicted)[rows].T)
    residual_max = p.repair_residual_max_complete if complete else p.repair_residual_max
    if np.any(residual > residual_max * tip.local_pitch_px[rows]):
        return False
    first, second = lattice.pairs.T
    both = (uncertain[first] | uncertain[second]) & known[first] & known[second]
    gap = np.hypot(*(now[first[both]] - now[second[both]]).T)
    share_min = p.repair_apart_complete if complete else 1.0
    return not np.any(gap < share_min * lattice.distance_min_px[both])


def _twice_area(corner: Array) -> Array:
    """(t, 3, 2) -> (t,) with sign."""
    u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], np.float64)
