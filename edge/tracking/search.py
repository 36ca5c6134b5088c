"""Pin identity after a jump: which blob is which pin of the rest frame, and how certain that is.

The difficulty is not noise but the lattice itself: pins move by more than a pitch, and a field that is one
row off looks as regular as the right one. Nearest neighbour from rest fails on most loaded frames.

1. Coarse fits from several starts (`coarse`).
2. A coarse field is right over most of the tip and one row off elsewhere, with a seam between. Cut the links
   between neighbours along the seam and keep the largest piece: the seed.
3. Grow the seed outwards (`match.RegionGrower`): each pin is predicted by the local affine map of its matched
   neighbours and takes the nearest blob; every sweep matches every pin anew.
4. The hypothesis with the largest posterior wins (`hypothesis`). Its alternatives are the other ones and
   itself shifted by one lattice step: along six directions, around the tip, and in or out. Pins in rings fit
   themselves when each ring is rotated by one pin, but for the innermost six, so a wrong match can have 98 %
   of the pins agree. Where an alternative comes near, the identities cannot be known.
5. The confidence is the probability that the best hypothesis is right: that it is, of those that were found,
   by its lead in posterior; and that the right one was found, by what `found_evidence` lists.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import erf, sqrt

import cv2
import numpy as np

from edge.geometry.lattice import groups_of
from edge.geometry.layout import affine_terms
from edge.tracking.coarse import CoarseFit
from edge.tracking.hypothesis import Hypothesis, certain_match
from edge.tracking.match import NearestBlob, RegionGrower
from edge.tracking.motion_model import MotionModel
from edge.tracking.tip import TrackedTip
from edge.types import Array, Index, Mask


@dataclass(frozen=True, slots=True)
class Identity:
    """blob (n,) int32, the blob that is pin i, -1 where none is certain; how many have one, certain or not;
    the probability that all are right
    """

    blob: Index
    known_n: int
    confidence: float


@dataclass(frozen=True, slots=True)
class Links:
    """Pairs (p, 2) of pins that are linked where their motion differs by less than limit_px (p,)."""

    pairs: Index
    limit_px: Array

    def largest_piece(self, motion: Array, known: Mask) -> Mask:
        """(n,) the known pins of the largest piece; motion (n, 2) px, known (n,)."""
        a, b = self.pairs.T
        step = motion[a] - motion[b]
        linked = known[a] & known[b] & ((step**2).sum(1) < self.limit_px**2)
        piece = groups_of(len(known), a[linked], b[linked])
        return np.asarray(piece == np.bincount(piece[known]).argmax()) if known.any() else known


class Identifier:
    """Finds identities from one unordered set of blobs, without prior knowledge but the rest frame."""

    def __init__(self, tip: TrackedTip) -> None:
        p, lattice = tip.params, tip.lattice
        self._tip = tip
        self._gate_px = p.gate * tip.lattice.local_pitch_px
        self._region_gate_px = p.region_gate * tip.lattice.local_pitch_px
        self._links = Links(lattice.edges, self._gate_px[lattice.edges[:, 0]])
        row, column = np.nonzero(lattice.weight)
        beside = np.stack([row, lattice.near[row, column]], axis=1).astype(np.int32)
        self._bridges = Links(beside, self._gate_px[row])
        # Each sweep takes a match on by a pitch and more: so many take it across the tip.
        sweeps_n = int(np.ceil(np.ptp(tip.lattice.rest_xy, axis=0).max() / tip.lattice.pitch_px))
        self._region = RegionGrower(
            tip.affine, tip.lattice.rest_xy, self._region_gate_px, p.support_min, sweeps_n
        )
        self._coarse = CoarseFit(tip)
        self._model = MotionModel(tip)
        self._lattice_steps = _lattice_steps(tip)
        margin = 2 * tip.lattice.pitch_px
        self._low, self._high = tip.lattice.rest_xy.min(0) - margin, tip.lattice.rest_xy.max(0) + margin

    def identify(self, blob_xy: Array, guesses: list[Array] | None = None) -> Identity:
        """The most likely match.

        blob_xy  (m, 2) px, unordered
        guesses  (n, 2) px each, where the pins may be: further starts of the search
        """
        if not len(blob_xy):
            return Identity(np.full(len(self._tip), -1, np.int32), 0, 0.0)
        # A cell's diagonal is the radius of a pin: all of it is within a radius of a disc's centre in it.
        cell_px = self._tip.rest.pattern.pin_radius_px / np.sqrt(2)
        blobs = _nearest_blob(blob_xy, self._low, self._high, cell_px)
        found, *others = self._search(blobs, guesses or [])
        again, certain = certain_match(found)
        best = max(found, again, key=lambda match: match.log_posterior)
        # A match that was assigned anew may be better in itself, but is no further ahead of the others.
        confidence = self._confidence(best, _ahead(found, others))
        return Identity(np.where(certain, again.blob, -1), best.known_n, confidence)

    def _search(self, blobs: NearestBlob, guesses: list[Array]) -> list[Hypothesis]:
        """All hypotheses, the best first; ends with one to be trusted, or without another start."""
        p = self._tip.params
        tried: list[Hypothesis] = []
        for motion, seed in self._starts(blobs, guesses):
            self._climb(blobs, self._grow(blobs, motion, seed), tried)
            tried.sort(key=lambda match: -match.log_posterior)
            confidence = self._confidence(tried[0], _ahead(tried[0], tried[1:]))
            if confidence > p.posterior_min:
                break
        return tried

    def _climb(self, blobs: NearestBlob, found: Hypothesis, tried: list[Hypothesis]) -> None:
        """Add a hypothesis and its alternatives by one lattice step, from the better one again and again."""
        tried.append(found)
        while True:
            alternative = self._best_alternative(blobs, found)
            tried.append(alternative)
            if alternative.log_posterior <= found.log_posterior:
                break
            found = alternative

    def _confidence(self, best: Hypothesis, ahead: float) -> float:
        """Probability that the best hypothesis is the right one of those that were found, and that the right
        one was found.

        ahead  of the best alternative, standard deviations
        """
        if not best.known_n:
            return 0.0
        odds = float(np.dot(self._tip.params.found_weights, found_evidence(best)))  # their logarithm
        return best_of_two(ahead) * float(0.5 + 0.5 * np.tanh(0.5 * odds))

    def _starts(self, blobs: NearestBlob, guesses: list[Array]) -> Iterator[tuple[Array, Mask]]:
        """Motion (n, 2) and the pins (n,) to grow from: guesses unchanged, then coarse fits, best first."""
        for guess in guesses:
            blob, _, known = blobs.match(guess[None], self._gate_px)
            motion = blobs.all_xy[blob[0]] - self._tip.lattice.rest_xy
            seed = self._bridges.largest_piece(motion, known[0])
            if 2 * np.count_nonzero(seed) > len(seed):
                yield motion, seed
        motions, matched = self._coarse.fit(blobs, guesses)
        best = np.argsort(-self._agree_n(motions, matched), kind="stable")
        seeds = [self._links.largest_piece(motions[h], matched[h]) for h in best]
        for h, seed in zip(best, seeds, strict=True):
            yield motions[h], seed
        # A row of pins hidden by glare splits a tip as a seam does: try again with links across gaps.
        for h, seed in zip(best, seeds, strict=True):
            wide = self._bridges.largest_piece(motions[h], matched[h])
            if np.count_nonzero(wide) > np.count_nonzero(seed):
                yield motions[h], wide

    def _best_alternative(self, blobs: NearestBlob, match: Hypothesis) -> Hypothesis:
        """The best other match among those one lattice step away from this one."""
        tip = self._tip
        motion = blobs.all_xy[match.blob] - tip.lattice.rest_xy
        predicted, _, gradient = tip.affine.predict(motion, match.known)
        steps = self._lattice_steps
        x, y = steps[..., :1] / tip.lattice.pitch_px, steps[..., 1:] / tip.lattice.pitch_px
        moved = steps + x * gradient[:, 0] + y * gradient[:, 1]
        blob, _, known = blobs.match(tip.lattice.rest_xy + predicted + moved, self._gate_px)
        known &= blob != np.where(match.known, match.blob, -1)
        motion = blobs.all_xy[blob] - tip.lattice.rest_xy
        h = int(self._agree_n(motion, known).argmax())
        larger = self._grow(blobs, motion[h], self._links.largest_piece(motion[h], known[h]))
        # It may have grown back into the match itself.
        return larger if larger.differs(match) else Hypothesis(self._model, blobs.all_xy, blob[h], known[h])

    def _agree_n(self, motions: Array, known: Mask) -> Index:
        """(h,) how many pins of each hypothesis (h, n, 2) px, (h, n) move as their neighbours predict."""
        count = np.empty(len(motions), np.int32)
        for h, motion in enumerate(motions):
            predicted, _, _ = self._tip.affine.predict(motion, known[h])
            agree = ((motion - predicted) ** 2).sum(1) < self._gate_px**2
            count[h] = np.count_nonzero(known[h] & agree)
        return count

    def _grow(self, blobs: NearestBlob, motion: Array, seed: Mask) -> Hypothesis:
        blob, _, known = self._region.grow(blobs, motion, seed)
        return Hypothesis(self._model, blobs.all_xy, blob, known)


def found_evidence(best: Hypothesis) -> tuple[float, float, float, float]:
    """Evidence that the search found the right hypothesis: a constant; the root of how far its certain pins
    are off an affine motion, pitches; the root of that motion's rotation, rad; and the logarithm of the
    posterior for each pin, as if the motion were equally rough in all frames and pins missing at random.
    """
    certain, tip = best.certain(), best.model.tip
    if not certain.any():
        return 1.0, 0.0, 0.0, -np.inf
    terms = affine_terms(tip.lattice.rest_xy[certain], tip.rest.pattern.centre_img, tip.lattice.pitch_px)
    motion = best.motion[certain]
    fit = np.linalg.lstsq(terms, motion, rcond=None)[0]
    bent = np.sqrt(np.mean(np.sum((motion - terms @ fit) ** 2, axis=1)))
    rotation = abs(fit[1, 1] - fit[2, 0]) / 2
    posterior = (best.log_posterior - best.log_together) / best.known_n
    posterior += np.log(np.median(best.spread[certain]))
    return 1.0, float(np.sqrt(bent)), float(np.sqrt(rotation)), float(posterior)


def best_of_two(ahead: float) -> float:
    """Probability that the better of two hypotheses is right, by its lead in standard deviations (Vuong,
    Likelihood ratio tests for model selection, Econometrica 57, 1989): a half if they tie.
    """
    return 0.5 + 0.5 * erf(ahead / sqrt(2))


def _ahead(best: Hypothesis, others: list[Hypothesis]) -> float:
    """How far the logarithm of its posterior is above that of its best alternative, or of no match at all, in
    standard deviations: it is a sum over the pins, each off by about 1.
    """
    alternatives = [match.log_posterior for match in others if match.differs(best)]
    above = max(best.log_posterior - max(alternatives, default=0.0), 0.0)
    return above / sqrt(max(best.known_n, 1))


def _lattice_steps(tip: TrackedTip) -> Array:
    """(10, n, 2) px, the steps that map a lattice onto itself: six directions, around the centre, in and
    out."""
    angle = np.arange(6) * np.pi / 3 + tip.lattice.direction_rad
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    straight = direction[:, None, :] * np.full((len(tip), 1), tip.lattice.pitch_px)
    around = tip.tangential * tip.lattice.pitch_px
    along = tip.radial * tip.lattice.local_pitch_px[:, None]
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
