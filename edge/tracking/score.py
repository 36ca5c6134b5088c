"""How good a match is, and how far it is ahead of another.

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
    """Scores matches of one tip."""

    def __init__(self, tip: TrackedTip) -> None:
        self._tip = tip
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
