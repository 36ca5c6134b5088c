"""How good a match is, how far it is ahead of another, and which of its pins are certain.

Idea: pins agree where they move as their neighbours do. Two things count against a match: clashes (groups of
unmatched pins with unassigned blobs near, which should have been theirs) and the deformation that it takes. A
match that is one lattice step off looks just as regular, so only the margin to the best alternative shows
whether it is the right one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from edge.tracking.links import Links
from edge.tracking.tip import TrackedTip
from edge.types import Array, Index, Mask

__all__ = ["Match", "MatchScorer", "largest_piece"]


@dataclass(frozen=True, slots=True)
class Match:
    """One hypothesis.

    blob (n,), motion (n, 2) px, known (n,)   which blob each pin has, and whether it has one
    agree (n,)        known, and moving as its neighbours
    clashes_n         pins in clumps without an agreeing blob that have an unassigned blob near
    inconsistent_n    pins without an agreeing blob, where as many blobs are unassigned and hardly one is
                      missing
    mean_rotation     mean motion around the tip's centre, pitches
    deformation_cost  how far the pins moved, in pins: of two matches that are equally good, the one that
                      needs less motion is better
    """

    blob: Index
    motion: Array
    known: Mask
    agree: Mask
    clashes_n: int
    inconsistent_n: int
    mean_rotation: float
    deformation_cost: float

    @property
    def agree_n(self) -> int:
        return int(np.count_nonzero(self.agree))

    @property
    def score(self) -> float:
        return self.agree_n - self.clashes_n - self.deformation_cost

    def contains(self, motion: Array, known: Mask, share: float) -> bool:
        """Whether it contains this share of a coarse match: growing that would most likely end here again."""
        same = known & self.known & (motion == self.motion).all(-1)
        return bool(np.sum(same) > share * np.sum(known))


def largest_piece(links: Links, motion: Array, known: Mask) -> Mask:
    """(n,) the known pins of the largest piece formed by the links."""
    label = links.pieces(motion, known)
    return np.asarray(label == np.bincount(label[known], minlength=1).argmax()) if known.any() else known


class MatchScorer:
    """Scores matches of one tip.

    links, bridges  neighbours that hang together, and pins further apart, across gaps
    """

    def __init__(self, tip: TrackedTip, links: Links, bridges: Links) -> None:
        self._tip = tip
        self._links, self._bridges = links, bridges
        self._adjacent_n = (tip.lattice.adjacent < len(tip)).sum(1)

    def score(self, blob_xy: Array, blob: Index, motion: Array, known: Mask) -> Match:
        """Count the evidence for and against a match; blob_xy (m, 2) px, all blobs."""
        p, n = self._tip.params, len(known)
        off = self._tip.adjacency.disagreement(motion[None], known[None])[0]
        agree = off < p.agree * self._tip.local_pitch_px
        rotation, cost = self._deformation(motion, agree)
        unassigned = _unassigned(blob_xy, blob, agree)
        complete = abs(len(unassigned) - n) < p.complete_share * n
        inconsistent = (n - np.count_nonzero(agree), np.count_nonzero(unassigned)) if complete else (0,)
        match = Match(blob, motion, known, agree, 0, int(min(inconsistent)), rotation, cost)
        clashes = self._clashes(match, blob_xy, unassigned)
        return Match(blob, motion, known, agree, clashes, match.inconsistent_n, rotation, cost)

    def repaired(self, match: Match, blob: Index, matched: Mask, blob_xy: Array) -> Match:
        """The match after its repair: only pins that are still unmatched count as clashes."""
        motion = blob_xy[blob] - self._tip.rest_xy
        lost = len(matched) - int(np.count_nonzero(matched))
        rotation, cost = self._deformation(motion, matched)
        clashes, inconsistent = min(match.clashes_n, lost), min(match.inconsistent_n, lost)
        return Match(blob, motion, matched, matched, clashes, inconsistent, rotation, cost)

    def margin(self, best: Match, alternative: Match) -> float:
        """0..1, from how many pins the match is ahead of an alternative.

        A lower deformation cost makes up for a few pins at most, and for none if the match is rotated further
        than the skin can be.
        """
        p = self._tip.params
        most = 0.0 if abs(best.mean_rotation) > p.rotation_max else p.full_margin
        saved = min(alternative.deformation_cost - best.deformation_cost, most)
        ahead = best.agree_n - alternative.agree_n + (alternative.clashes_n - best.clashes_n) / 2 + saved
        return float(np.clip(ahead / p.full_margin, 0, 1))

    def quality(self, match: Match) -> float:
        """0..1, from the clashes and the share of the pins that agree, without regard to alternatives."""
        p, n = self._tip.params, len(match.known)
        agreeing = match.agree_n / n
        # A sharp contact bends the skin more than an affine map can follow: a few pins in one place disagree
        # though they are right. That is forgiven where nearly all the others agree.
        forgiven = p.forgiven_share * n * _ramp(agreeing, *p.forgiven_range)
        by_chance = p.chance_clashes * (n - match.agree_n)
        sigmas = max(0.0, match.clashes_n - by_chance - forgiven) / np.sqrt(by_chance + 2)
        least, full = p.agreeing_range
        share = (agreeing - least) / (full - least)
        few, many = p.unmatched_range
        consistent = (many - match.inconsistent_n / n) / (many - few)
        return float(np.clip(min(1 - sigmas / p.clash_sigmas_max, share, consistent), 0, 1))

    def inliers(self, match: Match) -> Mask:
        """(n,) the agreeing pins without those that fit their neighbours much worse than the neighbours fit
        theirs.

        A false blob in the place of a missing pin agrees, but less closely than a pin does; beside an
        inconsistent place two pins may have changed places and still agree. Pins that are left out here are
        found again by `follow`.
        """
        good, residual = self._of_small_residual(match)
        # Small pieces are remains of an inconsistent place; a large separate one may have slipped by a step
        # as a whole.
        label = self._links.pieces(match.motion, good)
        good = good & (np.bincount(label[good], minlength=len(good))[label] >= self._tip.params.island_min)
        good = largest_piece(self._bridges, match.motion, good)
        # Two matched too near to each other: one is a reflection, or both are the same pin.
        first, second = self._tip.lattice.pairs.T
        now = self._tip.rest_xy + match.motion
        gap = now[first] - now[second]
        too_near = good[first] & good[second] & ((gap**2).sum(1) < self._tip.lattice.distance_min_px**2)
        first, second = first[too_near], second[too_near]
        good[np.where(residual[first] > residual[second], first, second)] = False
        return good

    def neighbour_consistent(self, blob_xy: Array, blob: Index, matched: Mask, inconsistent: bool) -> Mask:
        """(n,) of an inconsistent match, the pins that have more matched neighbours than unassigned blobs
        near.

        At the rim of a lost region a blob may be that of the next pin, further in; and an unassigned blob
        very close to a pin's own may be the pin as well.
        """
        p = self._tip.params
        own, adjacent = blob_xy[blob], self._tip.lattice.adjacent
        motion = own - self._tip.rest_xy
        around = np.maximum(self._adjacent_n, 1)
        apart = cdist(own, blob_xy)
        near = apart < p.unassigned_reach * self._tip.pitch_px
        crowding = apart < p.crowded * self._tip.pitch_px
        before = 0
        while before != (before := int(np.count_nonzero(matched))) and before:
            unassigned = _unassigned(blob_xy, blob, matched)
            crowded = crowding[:, unassigned].any(1)
            if not (inconsistent or np.any(crowded & matched)):
                break
            against = near[:, unassigned].sum(1)
            against = against - p.unassigned_by_chance * against[matched].mean()  # false blobs lie anywhere
            neighbours = np.append(matched, False)[adjacent].sum(1) / around
            neighbours = p.neighbours_of * neighbours / neighbours[matched].mean()
            residual = self._residual(motion, matched)
            consistent = (neighbours >= p.neighbours_min) & (neighbours >= against + 1)
            close = (residual < p.residual_few) & ~crowded
            matched = matched & consistent & ((neighbours > p.neighbours_few) | close)
        return matched

    def _of_small_residual(self, match: Match) -> tuple[Mask, Array]:
        """(n,) the agreeing pins that fit the map of their neighbours, and (n,) all residuals in local
        pitches.
        """
        p, adjacent = self._tip.params, self._tip.lattice.adjacent
        around = np.maximum(self._adjacent_n, 1)
        beside = p.inlier_residual_inconsistent if match.clashes_n else p.inlier_residual_beside
        good, residual = match.agree, np.empty(0)
        for _ in range(p.inlier_rounds):
            residual = self._residual(match.motion, good)
            of_adjacent = np.append(np.where(good, residual, np.nan), np.nan)[adjacent]
            known = np.isfinite(of_adjacent).sum(1)
            # At the edge of a contact the field has a crease, and half of a pin's neighbours lie in it.
            baseline = np.take_along_axis(np.sort(of_adjacent, axis=1), (2 * known // 3)[:, None], 1)[:, 0]
            limit = np.maximum(p.inlier_residual, p.inlier_residual_ratio * baseline)
            limit = np.where(known >= p.whole_share * around, limit, np.minimum(limit, beside))
            good = good & (residual < limit) & (3 * known >= around)
        return good, residual

    def _residual(self, motion: Array, known: Mask) -> Array:
        """(n,) distance of each pin from where its known neighbours predict it, local pitches."""
        predicted, _, _ = self._tip.affine.predict(motion, known)
        return np.asarray(np.hypot(*(motion - predicted).T) / self._tip.local_pitch_px)

    def _deformation(self, motion: Array, agree: Mask) -> tuple[float, float]:
        """Mean rotation in pitches, and the deformation cost in pins, of the pins that agree.

        The mean is subtracted from both motion and direction: otherwise a shift of a partly seen tip counts
        as rotation.
        """
        if not agree.any():
            return 0.0, 0.0
        p = self._tip.params
        moved = motion[agree] / self._tip.local_pitch_px[agree, None]
        around = self._tip.tangential[agree]
        around = around - around.mean(0)
        rotation = float(np.sum((moved - moved.mean(0)) * around)) / max(float(np.sum(around**2)), 1e-9)
        cost = p.cost_per_pitch * float(np.sqrt(np.mean(moved**2))) + p.cost_of_rotation * rotation**2
        return rotation, cost

    def _clashes(self, match: Match, blob_xy: Array, unassigned: Mask) -> int:
        """Pins in clumps without an agreeing blob that have an unassigned blob near."""
        p, adjacent = self._tip.params, self._tip.lattice.adjacent
        clump = ~match.agree & (2 * np.append(~match.agree, False)[adjacent].sum(1) >= self._adjacent_n)
        if not match.agree.any() or not unassigned.any() or not clump.any():
            return 0
        blobs = blob_xy[unassigned]
        has_space = cdist(blobs, blob_xy[~unassigned]).min(1) > p.free_space * self._tip.pitch_px
        predicted, _, _ = self._tip.affine.predict(match.motion, match.agree)
        place = (self._tip.rest_xy + predicted)[clump]
        clash = cdist(blobs[has_space], place) < p.clash_reach * self._tip.pitch_px
        return min(int(clash.any(0).sum()), int(clash.any(1).sum()))


def _unassigned(blob_xy: Array, blob: Index, matched: Mask) -> Mask:
    """(m,) the blobs that no matched pin has."""
    free = np.ones(len(blob_xy), np.bool_)
    free[blob[matched]] = False
    return free


def _ramp(value: float, low: float, high: float) -> float:
    return float(np.clip((value - low) / (high - low), 0, 1))
