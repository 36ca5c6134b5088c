"""Pin identity after a jump: which blob is which pin of the rest frame, and how certain that is.

The difficulty is not noise but the lattice itself: pins move by more than a pitch, and a field that is one
row off looks as regular as the right one. Nearest neighbour from rest fails on most loaded frames.

1. Coarse fits from several starts (`coarse`).
2. A coarse field is right over most of the tip and one row off elsewhere, with a seam between. Cut the links
   between neighbours along the seam and keep the largest piece: the seed.
3. Grow the seed outwards (`match.RegionGrower`): each pin is predicted by the local affine map of its matched
   neighbours and takes the nearest blob; every sweep matches every pin anew.
4. The hypothesis with the best score wins (`score`). Its alternatives are itself shifted by one lattice
   step: along six directions, around the tip, and in or out. Pins in rings fit themselves when each ring
   is rotated by one pin, but for the innermost six, so a wrong match can have 98 % of the pins agree.
   Where an alternative comes near, the identities cannot be known, and the confidence is low.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from edge.tracking.coarse import CoarseFit
from edge.tracking.links import Links
from edge.tracking.match import NearestBlob, RegionGrower
from edge.tracking.posterior import MotionModel, certain_match
from edge.tracking.score import Match, MatchScorer, largest_piece
from edge.tracking.tip import TrackedTip
from edge.types import Array, Index, Mask

__all__ = ["Identifier", "Identity"]


@dataclass(frozen=True, slots=True)
class Identity:
    """blob (n,) int32, the blob that is pin i, -1 where none; pins that agree with their neighbours; 0..1"""

    blob: Index
    agree_n: int
    confidence: float


@dataclass(frozen=True, slots=True)
class _BlobIndex:
    """xy (m, 2) px of all blobs, and which is nearest to a place."""

    xy: Array
    nearest: NearestBlob


class Identifier:
    """Finds identities from one unordered set of blobs, without prior knowledge but the rest frame."""

    def __init__(self, tip: TrackedTip) -> None:
        p, lattice = tip.params, tip.lattice
        self._tip = tip
        first = lattice.edges[:, 0]
        self._links = Links(len(tip), lattice.edges, p.seam * tip.local_pitch_px[first])
        self._bridges = _bridges(tip)
        self._gate_px = p.region_gate * tip.local_pitch_px
        self._region = RegionGrower(
            tip.affine, tip.rest_xy, self._gate_px, p.region_support_min, p.sweeps_max
        )
        self._coarse = CoarseFit(tip)
        self._scorer = MatchScorer(tip)
        self._model = MotionModel(tip)
        self._lattice_steps = _lattice_steps(tip)
        margin = 2 * tip.pitch_px
        self._low, self._high = tip.rest_xy.min(0) - margin, tip.rest_xy.max(0) + margin

    def identify(self, blob_xy: Array, guesses: list[Array] | None = None) -> Identity:
        """The most likely match.

        blob_xy  (m, 2) px, unordered
        guesses  (n, 2) px each, where the pins may be: further starts of the search
        """
        if len(blob_xy) < self._tip.params.blobs_min:
            return Identity(np.full(len(self._tip), -1, np.int32), 0, 0.0)
        scorer = self._scorer
        blobs = _BlobIndex(blob_xy, _nearest_blob(blob_xy, self._low, self._high, self._tip.params.raster_px))
        best, alternatives = self._search(blobs, guesses or [])
        margin = min(scorer.margin(best, other) for other in alternatives)
        # A match that was assigned anew may be better in itself, but is no further ahead of the alternatives.
        blob, known, certain = certain_match(self._model, blob_xy, best.blob, best.agree)
        again = scorer.score(blob_xy, blob, blob_xy[blob] - self._tip.rest_xy, known)
        best = max(best, again, key=lambda match: match.score)
        return Identity(np.where(certain, blob, -1), best.agree_n, min(margin, scorer.quality(best)))

    def _search(self, blobs: _BlobIndex, guesses: list[Array]) -> tuple[Match, list[Match]]:
        """The best match and its alternatives; ends with a match that can be trusted, or after
        `regions_max`."""
        p = self._tip.params
        best: Match | None = None
        alternative: Match | None = None
        tried: list[Match] = []
        regions_n = 0
        for k, (motion, seed) in enumerate(self._starts(blobs, guesses)):
            if any(match.contains(motion, seed, p.same_share) for match in tried):
                continue
            found, other, more = self._climb(blobs, motion, seed, p.regions_max - regions_n)
            regions_n += more
            tried.append(found)
            if best is None or alternative is None or found.score > best.score:
                best, alternative = found, other
            is_guess = k == 0 and bool(guesses)
            if self._trusted(best, alternative, len(blobs.xy), is_guess) or regions_n >= p.regions_max:
                break
        assert best is not None
        assert alternative is not None
        others = [m for m in tried if m is not best and not m.contains(best.motion, best.agree, p.same_share)]
        return best, [alternative, *others]

    def _climb(
        self, blobs: _BlobIndex, motion: Array, seed: Mask, regions_max: int
    ) -> tuple[Match, Match, int]:
        """The match that grows from a seed, or the better one among its neighbours; its best alternative; and
        how many were grown.
        """
        found = self._grow(blobs, motion, seed)
        other = self._best_alternative(blobs, found)
        regions_n = 2
        while other.score > found.score and regions_n < regions_max:
            found, other = other, self._best_alternative(blobs, other)
            regions_n += 1
        return found, other, regions_n

    def _trusted(self, best: Match, alternative: Match, blobs_n: int, is_guess: bool) -> bool:
        """Whether the search may end here."""
        p = self._tip.params
        confidence = min(self._scorer.margin(best, alternative), self._scorer.quality(best))
        trusted = confidence > p.trusted_confidence and best.clashes_n <= p.trusted_clashes_max
        if is_guess:
            trusted &= best.agree_n > p.guess_share_min * min(len(self._tip), blobs_n)
            trusted &= best.deformation_cost < p.guess_cost_max
        return trusted

    def _starts(self, blobs: _BlobIndex, guesses: list[Array]) -> Iterator[tuple[Array, Mask]]:
        """Motion (n, 2) and the pins (n,) to grow from: guesses unchanged, then coarse fits, best first."""
        p = self._tip.params
        for guess in guesses:
            blob, _, known = blobs.nearest.match(guess[None], self._gate_px)
            motion = blobs.xy[blob[0]] - self._tip.rest_xy
            seed = largest_piece(self._bridges, motion, known[0])
            if 2 * np.count_nonzero(seed) > len(seed):
                yield motion, seed
        motions, matched = self._coarse.fit(blobs.nearest, blobs.xy, guesses)
        tried: list[tuple[int, Mask]] = []
        for h in np.argsort(-self._agree_n(motions, matched), kind="stable"):
            seed = largest_piece(self._links, motions[h], matched[h])
            same = [((motions[h] == motions[k]).all(1) & seed & other).sum() for k, other in tried]
            if any(n > p.same_share * seed.sum() for n in same):
                continue
            yield motions[h], seed
            tried.append((int(h), seed))
            if len(tried) == p.coarse_tried_n:
                break
        # A row of pins hidden by glare splits a tip as a seam does: try again with links across gaps.
        for h, seed in tried[: p.bridged_n]:
            wide = largest_piece(self._bridges, motions[h], matched[h])
            if np.count_nonzero(wide) > p.bridge_gain_min * np.count_nonzero(seed):
                yield motions[h], wide

    def _best_alternative(self, blobs: _BlobIndex, match: Match) -> Match:
        """The best other match among those one lattice step away from this one."""
        predicted, _, gradient = self._tip.affine.predict(match.motion, match.known)
        steps, pitch = self._lattice_steps, self._tip.pitch_px
        x, y = steps[..., :1] / pitch, steps[..., 1:] / pitch
        moved = steps + x * gradient[:, 0] + y * gradient[:, 1]
        blob, _, known = blobs.nearest.match(self._tip.rest_xy + predicted + moved, self._gate_px)
        known &= blob != np.where(match.known, match.blob, -1)
        motion = blobs.xy[blob] - self._tip.rest_xy
        agree_n = self._agree_n(motion, known)
        h = int(agree_n.argmax())
        if agree_n[h] >= self._tip.params.alternative_share_min * match.agree_n:
            larger = self._grow(blobs, motion[h], largest_piece(self._links, motion[h], known[h]))
            same = larger.known & match.known & (larger.blob == match.blob)
            if 2 * same.sum() <= match.known.sum():  # otherwise it grew back into the match itself
                return larger
        return self._scorer.score(blobs.xy, blob[h], motion[h], known[h])

    def _agree_n(self, motion: Array, known: Mask) -> Index:
        """(h,) how many pins of each hypothesis agree with their neighbours."""
        off = self._tip.adjacency.disagreement(motion, known)
        return np.asarray(np.sum(off < self._tip.params.agree * self._tip.local_pitch_px, axis=1), np.int32)

    def _grow(self, blobs: _BlobIndex, motion: Array, seed: Mask) -> Match:
        blob, motion, known = self._region.grow(blobs.nearest, motion, seed)
        return self._scorer.score(blobs.xy, blob, motion, known)


def _bridges(tip: TrackedTip) -> Links:
    """Links of all near pins, so that a piece may reach over a gap; the further apart two are, the more they
    may differ.
    """
    p = tip.params
    row, column = np.nonzero(tip.lattice.weight)
    beside = tip.lattice.near[row, column]
    apart = np.hypot(*(tip.rest_xy[row] - tip.rest_xy[beside]).T)
    local = tip.local_pitch_px[row]
    limit = np.clip(p.seam * apart, p.seam * local, p.bridge_seam * local)
    return Links(len(tip), np.stack([row, beside], axis=1).astype(np.int32), limit)


def _lattice_steps(tip: TrackedTip) -> Array:
    """(10, n, 2) px, the steps that map a lattice onto itself: six directions, around the centre, in and
    out."""
    angle = np.arange(6) * np.pi / 3 + tip.lattice.direction_rad
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    straight = direction[:, None, :] * np.full((len(tip), 1), tip.pitch_px)
    around = tip.tangential * tip.pitch_px
    along = tip.radial * tip.local_pitch_px[:, None]
    return np.concatenate([straight, [around, -around, along, -along]])


def _nearest_blob(xy: Array, low: Array, high: Array, cell_px: float) -> NearestBlob:
    """The nearest blob to every place from low to high (2,) px, by a raster: its cells are labelled from
    the blobs.
    """
    low = np.minimum(xy.min(0), low) - cell_px
    columns, rows = np.ceil((np.maximum(xy.max(0), high) - low) / cell_px).astype(int) + 2
    empty = np.ones((rows, columns), np.uint8)
    column, row = np.rint((xy - low) / cell_px).astype(int).T
    empty[row, column] = 0
    _, label = cv2.distanceTransformWithLabels(empty, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    blob = np.zeros(int(label.max()) + 1, np.int32)
    blob[label[row, column]] = np.arange(len(xy))
    return NearestBlob(xy, blob[label], (float(low[0]), float(low[1])), 1 / cell_px)
