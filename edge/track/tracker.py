"""Identity from frame to frame, and the decision when it is lost.

Held: each pin is looked for where the last frames say it will be (`predict`), and `follow` judges what
was found there: a pin whose motion is not its neighbours' motion is lost, not somewhere else, and is
predicted from them until it comes back. Not held: `predict` is None until `identify` finds the
identities again with high confidence.
"""

from __future__ import annotations

import numpy as np

from edge.track.field import Lattice
from edge.track.identity import Identifier
from edge.types import Array, Mask, Pins, Rest, Tracks

__all__ = ["Tracker"]

VELOCITY_DAMPING = 0.7  # share of the last motion that is expected again
ODD = 0.35  # pitches off the neighbours' local map at which a pin is no longer believed
APART = 0.5  # pitches; no two tracks come closer
HELD_SHARE = 0.4  # of all pins seen; below it, the identities are given up


class Tracker:
    """Keeps which blob is which pin. Row i of everything is pin i of the rest frame."""

    def __init__(self, rest: Rest) -> None:
        """Raises DegenerateLayout: fewer than 4 pins at rest, or all on a line."""
        self._rest_xy = rest.xy_img
        self._pitch_px = rest.pattern.pitch_px
        self._lattice = Lattice(rest.xy_img, rest.pattern.pitch_px)
        self._identifier = Identifier(rest, self._lattice)
        self._xy = rest.xy_img.copy()
        self._velocity = np.zeros_like(self._xy)
        self._held = False

    def predict(self) -> Array | None:
        """(n, 2) px, where each pin is expected in the next frame; None: identities are not held."""
        return self._xy + self._velocity if self._held else None

    def follow(self, pins: Pins) -> Tracks:
        """Judge what was found at the predicted places.

        pins  row i is pin i; NaN where nothing was found
        """
        xy = pins.xy_img
        seen = np.isfinite(xy[:, 0])
        motion = np.where(seen[:, None], xy - self._rest_xy, 0.0)
        expected, support, _ = self._lattice.predict(motion[None], seen[None])
        odd = np.hypot(*(motion - expected[0]).T) > ODD * self._pitch_px
        if np.any(odd & seen):
            expected, support, _ = self._lattice.predict(motion[None], (seen & ~odd)[None])
            odd = np.hypot(*(motion - expected[0]).T) > ODD * self._pitch_px
        seen = seen & ~odd
        return self._settle(pins, seen, xy, expected[0], support[0])

    def identify(self, pins: Pins) -> Tracks:
        """Find the identities of unordered pins, from rest or from where they were last seen."""
        guesses = [self._xy]
        identity = self._identifier.identify(pins.xy_img, guesses)
        found = identity.blob >= 0
        blob = np.where(found, identity.blob, 0)
        held = identity.confidence >= Tracks.LOW_CONFIDENCE
        xy = (
            np.where(found[:, None], pins.xy_img[blob], np.nan)
            if len(pins)
            else np.full_like(self._xy, np.nan)
        )
        sigma = np.where(found, pins.sigma_px[blob], np.nan) if len(pins) else np.full(len(found), np.nan)
        self._held = held
        if held:
            motion = np.where(found[:, None], xy - self._rest_xy, 0.0)
            expected, _, _ = self._lattice.predict(motion[None], found[None])
            self._xy = np.where(found[:, None], xy, self._rest_xy + expected[0])
            self._velocity = np.zeros_like(self._xy)
        return Tracks(xy, sigma, found, identity.confidence)

    def _settle(self, pins: Pins, seen: Mask, xy: Array, expected: Array, support: Array) -> Tracks:
        near = self._lattice.near
        place = np.where(seen[:, None], xy, np.nan)
        gap = place[near] - place[:, None]
        close = (gap**2).sum(-1) < (APART * self._pitch_px) ** 2
        if close.any():
            off = np.hypot(*(place - self._rest_xy - expected).T)
            seen = seen & ~(close & (off[near] <= off[:, None])).any(1)
        guess = np.where((support > 1.0)[:, None], self._rest_xy + expected, self._xy + self._velocity)
        now = np.where(seen[:, None], xy, guess)
        self._velocity = VELOCITY_DAMPING * (now - self._xy)
        self._xy = now
        share = float(seen.mean())
        self._held = share >= HELD_SHARE
        return Tracks(
            np.where(seen[:, None], xy, np.nan),
            np.where(seen, pins.sigma_px, np.nan),
            seen,
            min(1.0, share / (2 * HELD_SHARE)),
        )
