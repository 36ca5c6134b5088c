"""Pin identity after a jump: which blob is which pin of the rest frame, and how sure that is.

The hard case is not noise but the lattice itself: pins move by more than a pitch, and a field that is
one row off looks as tidy as the right one. Nearest neighbour from rest fails on most loaded frames.

1. From several shifts of the rest frame, fit a motion field that gains freedom while its gate closes:
   affine, then polynomials up to degree 4 (match one-to-one, fit, match again).
2. Such a field is right over most of the tip and one row off elsewhere, with a seam between. Cut the
   neighbour graph along the seam and keep the largest piece: the seed.
3. Grow the seed outwards: each pin is predicted by the local affine map of its matched neighbours,
   and takes the nearest blob; every sweep judges every pin anew.
4. The hypothesis with most pins that agree with their neighbours wins. Its rivals are itself shifted by
   one lattice step: along six directions, round the tip, and in or out. Pins in rings fit themselves when
   each ring turns by one pin, but for the innermost six, so a slip can have 98 % of the pins agree. Where
   a rival comes near, nobody knows, and confidence says so.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from edge import _track
from edge.track.field import Lattice, Polynomial
from edge.track.mend import mend
from edge.types import Array, Index, Mask, Rest

__all__ = ["Identifier", "Identity"]

Blob = Index

# Degree and gate (in pitches) of each round of the coarse fit.
SCHEDULE = ((1, 0.6), (1, 0.5), (2, 0.5), (2, 0.45), (3, 0.4), (3, 0.4), (4, 0.35), (4, 0.35))
# Shifts to start from: hexagonal grid with this step in pitches, out to this many steps.
START_STEP, START_RINGS = 0.5, 2
# Coarse fits that are tried, and matches that are grown in all, rivals included: half a millisecond each.
N_GROWN, MOST_GROWN = 5, 16
PRUNE_ROUND, N_PRUNED = 3, 8  # round of the schedule after which only the best starts go on
SWEEPS = 24
GROW_GATE = 0.38  # steps to the next pin, how far from its prediction a blob may be while growing
GROW_SUPPORT = 1.2  # sum of neighbours' weights that carries a prediction: two near ones
SEAM = 0.35  # steps, difference in motion of two neighbours that cuts the graph
BRIDGE_SEAM = 0.5  # the same of pins further from each other
N_BRIDGED, WIDER = (
    2,
    1.2,
)  # coarse fits whose largest piece may reach over gaps, where that makes it so much larger
AGREE = 0.22  # steps, 4 px on the published 331-pin set
CLASH = 0.8  # pitches; a free blob this near to a hole should have filled it
ROOM = 0.5  # pitches; a free blob nearer to a matched one is no pin: real compressed pins keep 0.75
# Confidence, calibrated on simulated jumps of six layouts (rings, hexagonal, square; 127 to 331 pins) with
# up to 50 % lost pins, 50 false blobs and half the tip hidden. Of 1500 others, 1 of 35 wrong matches was
# above 0.5, and of 1050 right ones with at least 70 % of the pins in view and none of the tip hidden 6
# were below. Wrong ones have a lead of 0..2 pins (a shifted lattice), or more free blobs in clumps of
# holes than chance puts there (a seam through the tip), or too few pins to tell.
FULL_LEAD = 6.0  # pins ahead of the best rival
CHANCE = 0.08  # free blobs in clumps a hole, where pins are missing and false blobs lie at random
FULL_DOUBT = 6.0  # standard deviations above chance
# Where hardly a blob is missing or false (share of all pins), holes beside as many free blobs are a match
# that is wrong in part. Turned by 20 to 45 degrees, rings leave 0.14 of the pins so; a published frame 0.02.
COUNTED, LEAST_TORN, FULL_TORN = 0.03, 0.08, 0.2
LEAST_SHARE, FULL_SHARE = 0.38, 0.86  # of the pins agreeing
SAME = 0.9  # share of a coarse match that makes it one that was tried
SURE, FEW_CLASHES = 0.6, 2  # then the search ends
# A sharp tool tears the middle of the field: this share of clashes is forgiven where so many pins agree.
FORGIVEN, MOST = 0.025, 0.8
# How far a pin may be off its neighbours' affine map: in steps, or against what two thirds of its neighbours
# keep within. Of 33000 pins of the published 331-pin set 5 are further off (median 0.016 steps, 99.9 % 0.17);
# false blobs that a pin took lie anywhere within AGREE. Beside missing pins no more than FIT_BESIDE, and
# FIT_TORN where free blobs lie near these: they are not missing, then, but elsewhere.
BELIEF_ROUNDS, FIT, FIT_OF_USUAL, FIT_BESIDE, FIT_TORN = 2, 0.06, 3.0, 0.16, 0.12
# Where blobs are free among lost pins: neighbours, of six, that a pin must have in the end, and free blobs
# BESIDE it, in pitches, that speak against it, both against what is usual in the frame; with few of them
# how far off these it may be, in steps, and how near a free blob may be, in pitches. Of 494000 pins in
# view, in 2785 sure frames of simulated jumps with seven hazards (127 and 331 pins), 42 are swapped and
# 35700 lost without this, 3 and 41300 with it; of the published set none is lost by it. What is lost comes
# back in the frames that follow; a swapped pin may stay.
WITNESSES, WITNESSES_FEW, RING, BESIDE, BY_CHANCE, FIT_FEW, CROWDED = 2, 3.6, 6, 1.3, 2.0, 0.08, 0.3
WHOLE = 0.8  # share of its neighbours that a pin must have, not to stand beside missing ones
ISLAND = 8  # pins that must hang together to be believed
EFFORT = 3.0  # pins, for a root-mean-square motion of one step
# Pins, for a mean motion of one step round the tip's middle: what rings turned by one pin need, and what skin
# held at its rim cannot do. In 150 published frames, twisted by up to 5 degrees, it is 0.15 steps at most:
# a match that is turned further has no lead by needing less of it than its rival.
TURN, TURNED = 40.0, 0.15
GUESSED_SHARE = 0.9  # of all pins or blobs: then a guess that was grown needs no comparison with coarse fits
GUESSED_EFFORT = 10.0  # pins; further or more turned from rest a guess has to stand the comparison
WORTH_GROWING = 0.4  # share of the winner's agreeing pins that a rival has before it grows
RASTER_PX = 2.0  # cell of the nearest-blob table; coarse fits need no more


@dataclass(frozen=True, slots=True)
class Identity:
    """blob (n,) index of the blob that is pin i, -1 where none; agreeing pins; 0..1"""

    blob: Blob
    n_agree: int
    confidence: float


@dataclass(frozen=True, slots=True)
class _Match:
    """One hypothesis.

    blob (n,), motion (n, 2) px, known (n,)   which blob each pin has, and whether it has one
    agree (n,)  known, and moving as its neighbours
    n_clash     pins without an agreeing blob, in clumps, that have a free blob near
    n_torn      pins without an agreeing blob, where as many blobs are free and hardly one is missing or false
    turn        mean motion round the tip's middle, steps
    effort      how far the pins moved, counted as so many pins lost: of two matches that are equally good,
                the one that needs less motion
    """

    blob: Blob
    motion: Array
    known: Mask
    agree: Mask
    n_clash: int
    n_torn: int
    turn: float
    effort: float

    @property
    def n_agree(self) -> int:
        return int(np.count_nonzero(self.agree))

    @property
    def score(self) -> float:
        return self.n_agree - self.n_clash - self.effort

    def holds(self, motion: Array, known: Mask) -> bool:
        """Whether growing this coarse match would most likely end here again."""
        same = known & self.known & (motion == self.motion).all(-1)
        return bool(np.sum(same) > SAME * np.sum(known))


@dataclass(frozen=True, slots=True)
class _Links:
    """Pairs of pins (a, b) that hang together where their motion differs by less than seam_px."""

    a: Blob
    b: Blob
    seam_px: Array


class _Nearest:
    """Nearest blob to a point from a table: exact to RASTER_PX, constant time."""

    def __init__(self, xy: Array, low: Array, high: Array) -> None:
        self.xy = np.ascontiguousarray(xy)
        left, top = low = np.minimum(xy.min(0), low) - RASTER_PX
        columns, rows = np.ceil((np.maximum(xy.max(0), high) - low) / RASTER_PX).astype(int) + 2
        empty = np.ones((rows, columns), np.uint8)
        column, row = np.rint((xy - low) / RASTER_PX).astype(int).T
        empty[row, column] = 0
        _, label = cv2.distanceTransformWithLabels(empty, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
        blob = np.zeros(int(label.max()) + 1, np.int32)
        blob[label[row, column]] = np.arange(len(xy))
        self.table = (self.xy, blob[label], int(columns), float(left), float(top), 1 / RASTER_PX)

    def match(self, at: Array, gate_px: Array) -> tuple[Blob, Array, Mask]:
        """at (h, n, 2), gate_px (n,) -> nearest blob (h, n), squared distance, whether it is ours: within
        the gate, and no other pin of the hypothesis is nearer to it."""
        shape = at.shape[:-1]
        blob, square, ours = np.empty(shape, np.int32), np.empty(shape), np.empty(shape, np.bool_)
        _track.match(np.ascontiguousarray(at), gate_px, self.table, blob, square, ours)
        return blob, square, ours


class Identifier:
    """Finds identities from one unordered set of blobs, with nothing known but the rest frame."""

    def __init__(self, rest: Rest, lattice: Lattice) -> None:
        n = len(rest)
        self._step_px = lattice.step_px
        self._rest_xy = np.ascontiguousarray(rest.xy_img)
        self._pitch_px = rest.pattern.pitch_px
        self._lattice = lattice
        first, second = lattice.edge.T
        self._link = _Links(_c_index(first), _c_index(second), SEAM * self._step_px[first])
        self._gate_px = GROW_GATE * self._step_px
        row, column = np.nonzero(lattice.weight)
        beside = lattice.near[row, column]
        apart = np.hypot(*(rest.xy_img[row] - rest.xy_img[beside]).T)
        seam = np.clip(SEAM * apart, SEAM * self._step_px[row], BRIDGE_SEAM * self._step_px[row])
        self._bridge = _Links(_c_index(row), _c_index(beside), seam)
        self._polynomial = Polynomial(rest.xy_img, max(degree for degree, _ in SCHEDULE))
        k = range(-START_RINGS, START_RINGS + 1)
        step = START_STEP * self._pitch_px
        shift = [(a + b / 2, b * np.sqrt(0.75)) for a in k for b in k if abs(a + b) <= START_RINGS]
        out = rest.xy_img - rest.pattern.centre_img
        far = np.maximum(np.hypot(*out.T), 1e-9)
        along = out * (self._step_px / far)[:, None]
        round_ = np.stack([-out[:, 1], out[:, 0]], axis=1) * (self._pitch_px / far)[:, None]
        self._round = round_ / self._pitch_px
        swell = out * (np.median(self._step_px) / far.max())
        self._shifts = np.concatenate(
            [np.array(shift)[:, None, :] * step + np.zeros((n, 1)), swell[None], -swell[None]]
        )
        angle = np.arange(6) * np.pi / 3 + self._lattice.direction_rad
        straight = np.stack([np.cos(angle), np.sin(angle)], axis=1)[:, None, :] * np.full(
            (n, 1), self._pitch_px
        )
        self._steps = np.concatenate([straight, [round_, -round_, along, -along]])
        margin = 2 * self._pitch_px
        self._low, self._high = rest.xy_img.min(0) - margin, rest.xy_img.max(0) + margin

    def identify(self, blob_xy: Array, guesses: list[Array] | None = None) -> Identity:
        """blob_xy (m, 2) px, unordered; guesses: (n, 2) px, where the pins may be, tried as well."""
        n, m = len(self._rest_xy), len(blob_xy)
        if m < 4:
            return Identity(np.full(n, -1, np.int32), 0, 0.0)
        nearest = _Nearest(blob_xy, self._low, self._high)
        best, rival = None, None
        tried: list[_Match] = []
        n_grown = 0
        for k, (motion, seed) in enumerate(self._starts(nearest, guesses or [])):
            if any(m.holds(motion, seed) for m in tried):
                continue
            found = self._grow(nearest, motion, seed)
            other = self._rival(nearest, found)
            n_grown += 2
            while other.score > found.score and n_grown < MOST_GROWN:
                found, other = other, self._rival(nearest, other)
                n_grown += 1
            tried.append(found)
            if best is None or rival is None or found.score > best.score:
                best, rival = found, other
            sure = min(self._lead(best, rival), self._soundness(best)) > SURE and best.n_clash <= FEW_CLASHES
            if k == 0 and guesses:
                sure &= best.n_agree > GUESSED_SHARE * min(n, m) and best.effort < GUESSED_EFFORT
            if sure or n_grown >= MOST_GROWN:
                break
        assert best is not None
        assert rival is not None
        rivals = [rival, *(m for m in tried if m is not best and not m.holds(best.motion, best.agree))]
        # What is mended explains itself: it makes a match sound, but puts it no further ahead.
        lead = min(self._lead(best, other) for other in rivals)
        believed = self._believed(best)
        torn = best.n_clash > 0
        blob, good = mend(self._lattice, blob_xy, best.blob, believed)
        if np.count_nonzero(good) > np.count_nonzero(believed):
            best = self._mended(best, blob, good, blob_xy)
        good = self._witnessed(blob_xy, blob, good, torn)
        return Identity(np.where(good, blob, -1), best.n_agree, min(lead, self._soundness(best)))

    def _mended(self, match: _Match, blob: Blob, good: Mask, blob_xy: Array) -> _Match:
        """The match with what was torn in one piece again: pins without a blob are what still clashes."""
        motion = blob_xy[blob] - self._rest_xy
        lost = len(good) - int(np.count_nonzero(good))
        turn, effort = self._effort(motion[good] / self._step_px[good, None], self._round[good])
        return _Match(
            blob, motion, good, good, min(match.n_clash, lost), min(match.n_torn, lost), turn, effort
        )

    def _starts(self, nearest: _Nearest, guesses: list[Array]) -> Iterator[tuple[Array, Mask]]:
        """Motion (n, 2) and the pins (n,) to grow from: guesses as they are, then coarse fits, best first."""
        for guess in guesses:
            blob, _, known = nearest.match(guess[None], self._gate_px)
            motion = nearest.xy[blob[0]] - self._rest_xy
            seed = self._largest_piece(motion, known[0], self._bridge)
            if 2 * np.count_nonzero(seed) > len(seed):
                yield motion, seed
        start = self._rest_xy + self._shifts
        if guesses:
            start = np.concatenate([np.stack(guesses), start])
        motion, known = self._coarse(nearest, start)
        score = np.sum(self._lattice.disagreement(motion, known) < AGREE * self._step_px, axis=1)
        tried: list[tuple[int, Mask]] = []
        for h in np.argsort(-score, kind="stable"):
            seed = self._largest_piece(motion[h], known[h], self._link)
            same = [
                ((motion[h] == motion[k]).all(1) & seed & other).sum() > SAME * seed.sum()
                for k, other in tried
            ]
            if any(same):
                continue
            yield motion[h], seed
            tried.append((int(h), seed))
            if len(tried) == N_GROWN:
                break
        # Pins that glare hides in a row part a tip as a seam does: once more, across the gaps.
        for h, seed in tried[:N_BRIDGED]:
            wide = self._largest_piece(motion[h], known[h], self._bridge)
            if np.count_nonzero(wide) > WIDER * np.count_nonzero(seed):
                yield motion[h], wide

    def _believed(self, best: _Match) -> Mask:
        """(n,) the agreeing pins, without those that fit their neighbours worse than these fit theirs.

        A false blob in the place of a missing pin agrees, but not as closely as a pin does. At the edge of a
        clump that a sharp tool tore two pins may have changed places and still agree. Lost is better:
        `follow` gets them back.
        """
        ring = self._lattice.ring
        n = len(best.agree)
        around = np.maximum((ring < n).sum(1), 1)
        most = FIT_TORN if best.n_clash else FIT_BESIDE
        good = best.agree
        for _ in range(BELIEF_ROUNDS):
            expected, _, _ = self._lattice.predict(best.motion, good)
            off = np.hypot(*(best.motion - expected).T) / self._step_px
            beside = np.append(np.where(good, off, np.nan), np.nan)[ring]
            known = np.isfinite(beside).sum(1)
            # At the edge of a contact the field has a crease, and half of a pin's neighbours lie in it.
            usual = np.take_along_axis(np.sort(beside, axis=1), (2 * known // 3)[:, None], 1)[:, 0]
            whole = known >= WHOLE * around
            limit = np.maximum(FIT, FIT_OF_USUAL * usual)
            limit = np.where(whole, limit, np.minimum(limit, most))
            good = good & (off < limit) & (3 * known >= around)
        # What that leaves of a torn clump are islands; a large one may have slipped by a step as a whole.
        label = self._pieces(best.motion, good, self._link)
        good = good & (np.bincount(label[good], minlength=n)[label] >= ISLAND)
        good = self._largest_piece(best.motion, good, self._bridge)
        # Two that came too near to each other: one is a reflection, or both are one.
        first, second = self._lattice.pair.T
        gap = self._rest_xy[first] + best.motion[first] - self._rest_xy[second] - best.motion[second]
        clash = good[first] & good[second] & ((gap**2).sum(1) < self._lattice.apart_px**2)
        first, second = first[clash], second[clash]
        good[np.where(off[first] > off[second], first, second)] = False
        return good

    def _witnessed(self, blob_xy: Array, blob: Blob, good: Mask, torn: bool) -> Mask:
        """(n,) of a torn match, the good pins with more neighbours to speak for them than free blobs against.

        At the rim of what was lost a blob may be that of the next pin, further in; and where a free blob
        hardly has room beside a pin's own, either may be the pin.
        """
        own, ring = blob_xy[blob], self._lattice.ring
        motion = own - self._rest_xy
        around = np.maximum((ring < len(good)).sum(1), 1)
        apart = cdist(own, blob_xy)
        beside, crowding = apart < BESIDE * self._pitch_px, apart < CROWDED * self._pitch_px
        before = 0
        while before != (before := int(np.count_nonzero(good))) and before:
            free = np.ones(len(blob_xy), bool)
            free[blob[good]] = False
            crowded = crowding[:, free].any(1)
            if not (torn or np.any(crowded & good)):
                break
            against = beside[:, free].sum(1)
            against = against - BY_CHANCE * against[good].mean()  # false blobs lie anywhere
            witnesses = np.append(good, False)[ring].sum(1) / around
            witnesses = RING * witnesses / witnesses[good].mean()
            off = np.hypot(*(motion - self._lattice.predict(motion, good)[0]).T) / self._step_px
            spoken = (witnesses >= WITNESSES) & (witnesses >= against + 1)
            good = good & spoken & ((witnesses > WITNESSES_FEW) | ((off < FIT_FEW) & ~crowded))
        return good

    def _lead(self, best: _Match, rival: _Match) -> float:
        """0..1, from how far the match is ahead of this rival.

        That it needs less motion makes up for a few pins, no more, and for none where it is turned further
        than skin does turn.
        """
        most = 0.0 if abs(best.turn) > TURNED else FULL_LEAD
        ease = min(rival.effort - best.effort, most)
        lead = best.n_agree - rival.n_agree + (rival.n_clash - best.n_clash) / 2 + ease
        return float(np.clip(lead / FULL_LEAD, 0, 1))

    def _soundness(self, best: _Match) -> float:
        """0..1, from the free blobs that ought to fill holes and the share of the pins that agree."""
        n = len(best.known)
        matched = best.n_agree / n
        # A sharp tool bends the skin more than an affine map follows: a few pins in one place disagree
        # though they are right. That is forgiven where nearly all the others agree.
        sharp = FORGIVEN * n * float(np.clip((matched - MOST) / (0.9 - MOST), 0, 1))
        expected = CHANCE * (n - best.n_agree)
        doubt = max(0.0, best.n_clash - expected - sharp) / np.sqrt(expected + 2)
        share = (matched - LEAST_SHARE) / (FULL_SHARE - LEAST_SHARE)
        whole = (FULL_TORN - best.n_torn / n) / (FULL_TORN - LEAST_TORN)
        return float(np.clip(min(1 - doubt / FULL_DOUBT, share, whole), 0, 1))

    def _rival(self, nearest: _Nearest, best: _Match) -> _Match:
        """The best other match among those one lattice step away from this one."""
        expected, _, gradient = self._lattice.predict(best.motion, best.known)
        x, y = self._steps[..., :1] / self._pitch_px, self._steps[..., 1:] / self._pitch_px
        step = self._steps + x * gradient[:, 0] + y * gradient[:, 1]
        blob, _, known = nearest.match(self._rest_xy + expected + step, self._gate_px)
        known &= blob != np.where(best.known, best.blob, -1)
        motion = nearest.xy[blob] - self._rest_xy
        agree = np.sum(self._lattice.disagreement(motion, known) < AGREE * self._step_px, axis=1)
        h = int(agree.argmax())
        if agree[h] < WORTH_GROWING * best.n_agree:
            return self._judge(nearest, blob[h], motion[h], known[h])
        grown = self._grow(nearest, motion[h], self._largest_piece(motion[h], known[h], self._link))
        same = grown.known & best.known & (grown.blob == best.blob)
        if 2 * same.sum() > best.known.sum():  # it grew back into the match that it should rival
            return self._judge(nearest, blob[h], motion[h], known[h])
        return grown

    def _coarse(self, nearest: _Nearest, start: Array) -> tuple[Array, Mask]:
        at = start
        for k, (degree, gate) in enumerate(SCHEDULE):
            gate_px = gate * self._step_px
            blob, square, ours = nearest.match(at, 2.5 * gate_px)
            weight = np.where(ours, np.exp(np.where(ours, -0.5 * square / gate_px**2, 0.0)), 0.0)
            if k == PRUNE_ROUND:
                keep = np.argsort(-weight.sum(1), kind="stable")[:N_PRUNED]
                blob, weight = blob[keep], weight[keep]
            at = self._rest_xy + self._polynomial.smooth(nearest.xy[blob] - self._rest_xy, weight, degree)
        blob, _, ours = nearest.match(at, SEAM * self._step_px)
        return nearest.xy[blob] - self._rest_xy, ours

    def _largest_piece(self, motion: Array, known: Mask, links: _Links) -> Mask:
        label = self._pieces(motion, known, links)
        return label == np.bincount(label[known], minlength=1).argmax() if known.any() else known

    def _pieces(self, motion: Array, known: Mask, links: _Links) -> Blob:
        """(n,) label of the piece that each known pin hangs together with."""
        label = np.empty(len(known), np.int32)
        _track.pieces(motion, known, links.a, links.b, links.seam_px, label)
        return label

    def _grow(self, nearest: _Nearest, motion: Array, seed: Mask) -> _Match:
        motion, known, blob = motion.copy(), seed.copy(), np.empty(len(seed), np.int32)
        _track.grow(
            motion,
            known,
            blob,
            self._lattice.map,
            nearest.table,
            self._rest_xy,
            self._gate_px,
            GROW_SUPPORT,
            SWEEPS,
        )
        return self._judge(nearest, blob, motion, known)

    def _effort(self, steps: Array, round_: Array) -> tuple[float, float]:
        """Turn, and what a motion takes, in pins.

        steps (k, 2) of the pins that agree, round_ (k, 2) the way round the tip there
        The mean is taken off both: of a tip that is seen in part a shift is no turn.
        """
        if not len(steps):
            return 0.0, 0.0
        round_ = round_ - round_.mean(0)
        turn = float(np.sum((steps - steps.mean(0)) * round_)) / max(float(np.sum(round_**2)), 1e-9)
        return turn, EFFORT * float(np.sqrt(np.mean(steps**2))) + TURN * turn**2

    def _judge(self, nearest: _Nearest, blob: Blob, motion: Array, known: Mask) -> _Match:
        """Count what speaks for a match, and what against it."""
        n = len(known)
        agree = self._lattice.disagreement(motion[None], known[None])[0] < AGREE * self._step_px
        turn, effort = self._effort(motion[agree] / self._step_px[agree, None], self._round[agree])
        free = np.ones(len(nearest.xy), bool)
        free[blob[agree]] = False
        n_free = int(np.count_nonzero(free))
        counted = abs(len(free) - n) < COUNTED * n
        n_torn = min(n - int(np.count_nonzero(agree)), n_free) if counted else 0
        ring = self._lattice.ring
        clump = ~agree & (2 * np.append(~agree, False)[ring].sum(1) >= (ring < n).sum(1))
        if not agree.any() or not free.any() or not clump.any():
            return _Match(blob, motion, known, agree, 0, n_torn, turn, effort)
        loose = nearest.xy[free]
        room = cdist(loose, nearest.xy[~free]).min(1) > ROOM * self._pitch_px
        expected, _, _ = self._lattice.predict(motion, agree)
        place = (self._rest_xy + expected)[clump]
        clash = cdist(loose[room], place) < CLASH * self._pitch_px
        n_clash = min(int(clash.any(0).sum()), int(clash.any(1).sum()))
        return _Match(blob, motion, known, agree, n_clash, n_torn, turn, effort)


def _c_index(index: NDArray[np.intp]) -> Index:
    return np.ascontiguousarray(index, np.int32)
