"""`edge.track.tracker` in plain NumPy: the same method, the oracle of `follow`.

Held: each pin is looked for where the last frames say it will be (`predict`), and `follow` judges what
was found there: a pin's motion since rest must be near that of its neighbours (their local affine map),
and off it no otherwise than in the last frame. A pin that fails is lost, not somewhere else: it moves
with its neighbours until it is found again. Not held: `predict` is None until `identify` finds the
identities again with high confidence.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edge.track.field import Lattice
from edge.track.identity import Identifier
from edge.types import Array, Mask, Pins, Rest, Tracks

__all__ = ["Tracker"]

VELOCITY_DAMPING = 0.7  # share of the last motion that is expected again
# In steps to the next pin. How far a pin's motion may be off its neighbours' local map: the skin bends
# under a contact, by 0.34 steps at the most on the published 331-pin set; from frame to frame that bend
# changes slowly. A pin that was lost keeps the bend that it had, fading, and must fit that closely.
ODD_MOTION = 0.5
ODD_CHANGE = 0.25
ODD_RETURN = 0.35
BESIDE_SHARE = 0.5
BEND_KEPT = 0.95
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
SEARCH_FRAMES = 60
# What looks unlike the pin must go closely with its neighbours; see `edge.track.tracker`.
LIGHT_SIGMAS, LIGHT_LEAST, SIGMA_TIMES = 4.0, 0.03, 2.0
FIT, FIT_FOUND, FIT_OF_USUAL, FIT_SUPPORT = 0.005, 0.04, 4.0, 1.2
# Frames without identities after which the last positions are only a guess, no evidence.
FRESH_FRAMES = 2


class Tracker:
    """Keeps which blob is which pin. Row i of everything is pin i of the rest frame."""

    def __init__(self, rest: Rest) -> None:
        """Raises DegenerateLayout: fewer than 4 pins at rest, or all on a line."""
        self._rest_xy, self._rest_light = rest.xy_img, rest.pins.brightness
        self._usual_sigma = np.maximum(rest.pins.sigma_px / np.median(rest.pins.sigma_px), 1.0)
        self._lattice = Lattice(rest.xy_img, rest.pattern.pitch_px)
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
        predicted = self._xy + self._velocity
        found = np.isfinite(pins.xy_img[:, 0])
        motion = pins.xy_img - self._rest_xy
        seen, common = self._judge(motion, predicted - self._rest_xy, found)
        bend = motion - common
        seen = self._keep_apart(pins.xy_img, bend - self._bend, seen)
        seen = self._doubt(pins, motion, bend, seen, FIT, SIGMA_TIMES)
        hidden = ~seen
        now = pins.xy_img.copy()
        bend[hidden] = BEND_KEPT * self._bend[hidden]
        now[hidden] = (self._rest_xy + common + bend)[hidden]
        share = float(np.count_nonzero(seen)) / len(seen)
        sure = self._continuity(now, share)
        self._since_search += 1
        unusual = share < USUAL_SHARE * self._usual
        unusual |= share < FULL_SHARE * self._best and self._since_search >= SEARCH_FRAMES
        self._usual += (share - self._usual) / USUAL_FRAMES
        tracks = _tracks(now, pins.sigma_px, seen, sure)
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
        blob = np.where(seen, identity.blob, 0)
        of_pins = Pins(xy, sigma, pins.radius_px[blob], pins.brightness[blob])
        motion = xy - self._rest_xy
        fit, times = (FIT_FOUND, np.inf) if self._fallback is None else (FIT, SIGMA_TIMES)
        seen = self._doubt(of_pins, motion, motion - expected, seen, fit, times)
        expected, _, _ = self._lattice.predict(motion, seen)
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
        jump = float(np.sqrt(np.partition(square, middle)[middle]))
        return min(1.0, share / (2 * HELD_SHARE), max(0.0, 1 - jump / (2 * JUMP)))

    def _judge(self, motion: Array, predicted: Array, found: Mask) -> tuple[Mask, Array]:
        """Which found pins are believed, and the motion (n, 2) that the neighbours expect of each."""
        # A lost pin comes back beside pins that were seen: a lost region heals from its edge inwards.
        limit = ODD_CHANGE * self._lattice.step_px
        lost = np.flatnonzero(~self._seen)
        if len(lost):
            beside = self._seen[self._lattice.close[lost]].mean(1) >= BESIDE_SHARE
            limit[lost] = ODD_RETURN * beside * self._lattice.step_px[lost]
        seen, common = found, predicted
        alone = predicted  # motion of a pin that is not seen
        for _ in range(2):  # the second round without those that the first one threw out
            # A lost pin moves as its neighbours, which may be lost pins that move as theirs.
            for _ in range(1 if seen.all() else 2):
                common = self._lattice.mean @ np.where(seen[:, None], motion, alone)
                alone = common + self._bend
            bend = motion - common
            change = bend - self._bend
            good = change[:, 0] ** 2 + change[:, 1] ** 2 < limit**2
            good &= bend[:, 0] ** 2 + bend[:, 1] ** 2 < (ODD_MOTION * self._lattice.step_px) ** 2
            before, seen = seen, found & good
            if np.array_equal(seen, before):
                break
        return seen, common

    def _keep_apart(self, xy: Array, off: Array, seen: Mask) -> Mask:
        """Of two tracks that came too near to each other, the one that surprised more is lost."""
        first, second = self._lattice.pair.T
        x, y = xy[:, 0], xy[:, 1]
        clash = (x[first] - x[second]) ** 2 + (y[first] - y[second]) ** 2 < self._lattice.apart_px**2
        clash &= seen[first] & seen[second]  # NaN, not found, compares as False
        if not clash.any():
            return seen
        first, second = first[clash], second[clash]
        surprise = (off**2).sum(1)
        kept = seen.copy()
        kept[np.where(surprise[first] > surprise[second], first, second)] = False
        return kept

    def _doubt(self, pins: Pins, motion: Array, bend: Array, seen: Mask, fit: float, times: float) -> Mask:
        """The seen pins without those that look unlike themselves and do not go with their neighbours."""
        least = fit * self._lattice.step_px
        odd = seen & ((bend**2).sum(1) > least**2)
        if not odd.any():
            return seen
        light = pins.brightness / self._rest_light
        light = np.abs(light / _upper_median(light[seen]) - 1.0)
        unlike = max(LIGHT_SIGMAS * 1.4826 * _upper_median(light[seen]), LIGHT_LEAST)
        unsure = times * _upper_median(pins.sigma_px[seen]) * self._usual_sigma
        right = seen & (light <= unlike) & (pins.sigma_px <= unsure)
        expected, support, _ = self._lattice.predict(motion, right)
        off = np.where(support < FIT_SUPPORT, np.nan, ((motion - expected) ** 2).sum(1))
        kept = seen.copy()
        for i in np.flatnonzero(odd & ~right & (off >= least**2)):
            near = self._lattice.near[i][self._lattice.weight[i] > 0]
            around = np.sort(off[near[right[near]]])
            around = around[np.isfinite(around)]
            if len(around):
                kept[i] = off[i] < FIT_OF_USUAL**2 * around[2 * len(around) // 3]
        return kept


def _upper_median(values: Array) -> float:
    return float(np.sort(values)[len(values) // 2])


def _tracks(now: Array, sigma_px: Array, seen: Mask, confidence: float) -> Tracks:
    return Tracks(np.where(seen[:, None], now, np.nan), np.where(seen, sigma_px, np.nan), seen, confidence)
