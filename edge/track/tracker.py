"""Identity from frame to frame, and the decision when it is lost.

Held: each pin is looked for where the last frames say it will be (`predict`), and `follow` judges what
was found there: a pin's motion since rest must be near that of its neighbours (their local affine map),
and off it no otherwise than in the last frame. What looks unlike the pin besides must go with its neighbours
closely: light beside a pin draws it aside, and a speck lies where a dark pin was. A pin that fails is lost,
not somewhere else: it moves with its neighbours until it is found again. Not held: `predict` is None until
`identify` finds the identities again with high confidence.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edge import _track
from edge.track.field import Lattice
from edge.track.identity import Identifier
from edge.types import Array, Index, Mask, Pins, Rest, Tracks

__all__ = ["Tracker"]

VELOCITY_DAMPING = 0.7  # share of the last motion that is expected again
# In steps to the next pin. How far a pin's motion may be off its neighbours' local map: the skin bends
# under a contact, by 0.34 steps at the most on the published 331-pin set; from frame to frame that bend
# changes slowly. A pin that was lost keeps the bend that it had, fading, and must fit that closely.
ODD_MOTION = 0.5
ODD_CHANGE = 0.25
ODD_RETURN = 0.35
BESIDE_SHARE = 0.5
# Of the bend, from frame to frame without the pin: one that blinks at the edge of a contact returns.
BEND_KEPT = 0.95
# A pin looks unlike itself where its brightness against the rest frame's, after the gain that all have in
# common, is off by so many sigmas of what it is off elsewhere in the frame, and by so much at the least,
# or where its sigma is so many times the usual one, and the more beyond where it was beyond at rest: glare
# is no news. Such a pin is off its neighbours' map by no more than so many steps, or times what two thirds
# of those neighbours that look right are off theirs; and so much weight these must have to be asked (two
# near ones). Chosen on other specks than those of the hazards' bench: with 50 of them the depth is as
# close as without (331 pins: 0.03 mm; 0.12 without this rule), with 30 % of the pins dark besides 0.04
# (1.9), and an untouched tip is untouched. A ball in clean light is felt as without it. Of a published
# video's 124 pins, in glare, it is 2, and as many of its touched frames have exactly one contact (96 %).
LIGHT_SIGMAS, LIGHT_LEAST, SIGMA_TIMES = 4.0, 0.03, 2.0
FIT, FIT_OF_USUAL, FIT_SUPPORT = 0.005, 4.0, 1.2
# The same after a search, unless all that `follow` missed were pins. Nothing is known of such a frame but
# itself, and under a sharp touch pins look odd and move oddly: what is left is for the next frames. A large
# sigma is no reason there: half-hidden pins at the rim of 600 published frames have it, and 300 of them would
# be lost.
FIT_FOUND = 0.04
# A common surprise of this much is as near to the next pin as to the own one: look at the whole frame.
JUMP = 0.35
# Share of all pins seen, and of those usually seen, at which the identities are given up: when a third
# vanish at once, what is left may be a lattice that slipped.
HELD_SHARE = 0.4
USUAL_SHARE = 0.65
DOUBT = 0.4  # the confidence said then: below what may be used
USUAL_FRAMES = 30.0  # time constant of what is usual
# While this share of the pins that a search once found is not seen, search anew every so many frames: a
# region that was lost as a whole does not come back by itself.
FULL_SHARE = 0.85
# A common surprise of this many steps, with fewer than this share of the usual pins: a leap that took some
# pins to their neighbours' blobs and lost others. Of 1442 gaps in a simulated tour 520 were followed with 200
# to 310 of 331 pins, up to 15 of them wrong; the same frames searched from nothing: all pins right.
LEAPT, FEWER = 0.1, 0.95
SEARCH_FRAMES = 60
# Frames without identities after which the last positions are only a guess, no evidence.
FRESH_FRAMES = 2


class Tracker:
    """Keeps which blob is which pin. Row i of everything is pin i of the rest frame."""

    def __init__(self, rest: Rest) -> None:
        """Raises DegenerateLayout: fewer than 4 pins at rest, or all on a line."""
        self._rest_xy = rest.xy_img
        self._lattice = Lattice(rest.xy_img, rest.pattern.pitch_px)
        mean = self._lattice.mean
        self._tip = (
            np.ascontiguousarray(rest.xy_img),
            self._lattice.step_px,
            mean.indptr.astype(np.int32),
            mean.indices.astype(np.int32),
            mean.data,
            self._lattice.close.astype(np.int32),
            self._lattice.pair.astype(np.int32),
            self._lattice.apart_px,
            np.array([ODD_MOTION, ODD_CHANGE, ODD_RETURN, BESIDE_SHARE, BEND_KEPT]),
            _look(rest.pins),
            np.array([LIGHT_SIGMAS, LIGHT_LEAST, SIGMA_TIMES, FIT, FIT_OF_USUAL, FIT_SUPPORT]),
        )
        self._found = np.array([LIGHT_SIGMAS, LIGHT_LEAST, np.inf, FIT_FOUND, FIT_OF_USUAL, FIT_SUPPORT])
        self._scratch = np.empty(7 * len(rest))
        self._identifier = Identifier(rest, self._lattice)
        self.forget()

    def forget(self) -> None:
        """Take the next frame for itself, as after a jump from rest."""
        self._xy = self._rest_xy.copy()
        self._velocity = np.zeros_like(self._xy)
        self._seen: Mask = np.zeros(len(self._xy), bool)
        self._bend = np.zeros_like(self._xy)  # how far each pin is off its neighbours' map
        self._held = False
        self._unheld = FRESH_FRAMES  # frames since the identities were held
        self._usual = 0.0  # share of the pins seen lately
        self._best = 0.0  # largest share that a search found
        self._since_search = 0  # frames
        self._fallback: tuple[Tracks, Array, Array] | None = None  # doubtful tracks, positions, bend

    def predict(self) -> Array | None:
        """(n, 2) px, where each pin is expected in the next frame; None: identities are not held."""
        return self._xy + self._velocity if self._held else None

    def follow(self, pins: Pins) -> Tracks:
        """Judge what was found at the predicted places.

        pins  row i is pin i; NaN where nothing was found
        Low confidence: too few pins, or all of them too far off; identify the whole frame then.
        """
        n = len(self._rest_xy)
        now, bend, xy = np.empty((n, 2)), np.empty((n, 2)), np.empty((n, 2))
        sigma, seen = np.empty(n), np.empty(n, dtype=np.bool_)
        n_seen, jump = _track.follow(
            (
                np.ascontiguousarray(pins.xy_img),
                np.ascontiguousarray(pins.sigma_px),
                np.ascontiguousarray(pins.brightness, np.float64),
                self._xy,
                self._velocity,
                self._bend,
                self._seen,
            ),
            self._tip,
            self._lattice.map,
            self._scratch,
            (now, bend, seen, xy, sigma),
        )
        share = n_seen / n
        sure = _sure(jump, share)
        self._since_search += 1
        unusual = share < USUAL_SHARE * self._usual
        unusual |= share < FULL_SHARE * self._best and self._since_search >= SEARCH_FRAMES
        unusual |= jump > LEAPT and share < FEWER * self._usual
        self._usual += (share - self._usual) / USUAL_FRAMES
        tracks = Tracks(xy, sigma, seen, sure)
        if unusual or sure < Tracks.LOW_CONFIDENCE:
            self._held = False
            self._fallback = (tracks, now, bend) if sure >= Tracks.LOW_CONFIDENCE else None
            return replace(tracks, confidence=min(sure, DOUBT))
        self._settle(now, VELOCITY_DAMPING * (now - self._xy), seen, bend)
        return tracks

    def identify(self, pins: Pins) -> Tracks:
        """Find the identities of unordered pins, from rest or from where they were last seen.

        When it is not sure or finds less, and `follow` doubted this very frame only for the number of
        pins that it missed, what `follow` had found stands.
        """
        n = len(self._rest_xy)
        identity = self._identifier.identify(pins.xy_img, [self._xy])
        seen = identity.blob >= 0
        xy, sigma = np.full((n, 2), np.nan), np.full(n, np.nan)
        xy[seen] = pins.xy_img[identity.blob[seen]]
        sigma[seen] = pins.sigma_px[identity.blob[seen]]
        expected, _, _ = self._lattice.predict(xy - self._rest_xy, seen)
        if n_found := int(np.count_nonzero(seen)):
            _track.doubt(
                _of_pins(pins.brightness, identity.blob),
                self._tip[-2],
                sigma,
                xy - self._rest_xy - expected,
                xy - self._rest_xy,
                self._lattice.step_px,
                self._tip[-1] if self._fallback is not None else self._found,
                self._lattice.map,
                self._scratch,
                seen,
            )
            if np.count_nonzero(seen) < n_found:
                xy[~seen], sigma[~seen] = np.nan, np.nan
                expected, _, _ = self._lattice.predict(xy - self._rest_xy, seen)
        now = np.where(seen[:, None], xy, self._rest_xy + expected)
        self._since_search = 0
        share = float(np.count_nonzero(seen)) / n
        confidence = identity.confidence
        if self._unheld < FRESH_FRAMES:
            confidence = max(confidence, self._continuity(now, identity.n_agree / n))
        fallback, self._fallback = self._fallback, None
        if fallback is not None and fallback[0].n_seen > identity.n_agree:
            confidence = 0.0
        if confidence >= Tracks.LOW_CONFIDENCE:
            self._usual, self._best = share, max(share, self._best)
            self._settle(now, np.zeros_like(now), seen, now - self._rest_xy - expected)
        elif fallback is not None:
            tracks, now, bend = fallback
            self._settle(now, VELOCITY_DAMPING * (now - self._xy), tracks.seen, bend)
            return tracks
        else:
            self._held = False
            self._unheld += 1
        return _tracks(now, sigma, seen, confidence)

    def _settle(self, now: Array, velocity: Array, seen: Mask, bend: Array) -> None:
        self._xy, self._velocity, self._seen, self._bend = now, velocity, seen, bend
        self._held, self._unheld, self._fallback = True, 0, None

    def _continuity(self, now: Array, share: float) -> float:
        """How sure it is that every pin went to `now` from where it was, and not its neighbour."""
        surprise = now - self._xy - self._velocity
        square = (surprise[:, 0] ** 2 + surprise[:, 1] ** 2) / self._lattice.step_px**2
        middle = len(square) // 2
        return _sure(float(np.sqrt(np.partition(square, middle)[middle])), share)


def _look(pins: Pins) -> Array:
    """(n, 2) how bright each pin is at rest, and how many times the usual its sigma is, at least 1."""
    return np.stack([pins.brightness, np.maximum(pins.sigma_px / np.median(pins.sigma_px), 1.0)], axis=1)


def _of_pins(of_blobs: Array, blob: Index) -> Array:
    """(n,) what is known of each pin's blob; whatever where it has none."""
    return np.ascontiguousarray(np.append(of_blobs, 0.0)[blob], np.float64)


def _sure(jump: float, share: float) -> float:
    """How sure the identities are.

    jump   median over the pins of what was not expected of their motion, in steps to the next pin
    share  of the pins that were seen
    """
    return min(1.0, share / (2 * HELD_SHARE), max(0.0, 1 - jump / (2 * JUMP)))


def _tracks(now: Array, sigma_px: Array, seen: Mask, confidence: float) -> Tracks:
    return Tracks(np.where(seen[:, None], now, np.nan), np.where(seen, sigma_px, np.nan), seen, confidence)
