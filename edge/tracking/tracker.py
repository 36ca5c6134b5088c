"""Identity from frame to frame, and the decision when it is lost.

Held: each pin is searched for where the last frames predict it (`predict`), and `follow` checks what was
found there: a pin's motion since rest must be near that of its neighbours, and its residual must have changed
little since the last frame. A pin with an anomalous brightness or centroid sigma is accepted only with a
small residual: stray light biases the centroid, and a speck may lie where a dark pin was. A rejected pin
counts as lost, not as moved: it moves with its neighbours until it is found again. Not held: `predict` is
None until `identify` finds the identities again with high confidence.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from edge.tracking.follow import Follower
from edge.tracking.search import Identifier, Identity
from edge.tracking.tip import TrackedTip
from edge.types import Array, Pins, Rest, Tracks


class Tracker:
    """Keeps which blob is which pin. Row i of everything is pin i of the rest frame."""

    def __init__(self, rest: Rest, found: Pins | None = None, expected: Array | None = None) -> None:
        """The arrays that all frames share; None: arrays of its own.

        found     what is found in a frame at the predicted places
        expected  (n, 2) px, the predicted places; written
        Raises    DegenerateLayout: fewer than 4 pins at rest, or all on a line
        """
        self._tip = TrackedTip(rest)
        self._n = len(self._tip)
        tip, n = self._tip, self._n
        self._found = found or Pins(np.empty((n, 2)), np.empty(n), np.empty(n), np.empty(n))
        self._expected = np.empty((n, 2)) if expected is None else expected
        self._follower = Follower(tip.lattice, tip.photometric, tip.params, self._found, self._expected)
        self._identifier = Identifier(self._tip)
        self.forget()

    def forget(self) -> None:
        """Treat the next frame on its own, as after a jump from rest."""
        self._follower.reset()
        self.held = False  # whether the identities are known: the next frame's pins can be followed
        self._confidence = 0.0  # of the identities that are held, or were
        self._fresh = False  # the last positions are of the frame before: later they are no evidence
        self._fallback: Tracks | None = None  # what `follow` found and refused in this frame

    def predict(self) -> Array | None:
        """(n, 2) px, where each pin is expected in the next frame; None: identities are not held."""
        return self._expected if self.held else None

    def follow(self, pins: Pins | None = None, again: Callable[[], object] | None = None) -> Tracks:
        """Check what was found at the predicted places.

        pins   row i is pin i; NaN where nothing was found; None: those in `found`
        again  reads the same image at the predicted places, for pins that leapt out of their windows
        The confidence is that of the search that found the identities; none: too few pins, or all of them too
        far off, and the whole frame is to be searched.
        """
        if pins is not None:
            found = self._found
            found.xy_img[:], found.sigma_px[:] = pins.xy_img, pins.sigma_px
            found.brightness[:] = pins.brightness
        xy, sigma, seen, seen_n, autocorrelation, goes_on, is_held = self._follower.follow(again)
        tracks = Tracks(xy, sigma, seen, seen_n, self._confidence, autocorrelation)
        self.held = is_held
        if is_held:
            self._fresh, self._fallback = True, None
            return tracks
        self._fallback = tracks if goes_on else None
        return replace(tracks, confidence=0.0)

    def identify(self, pins: Pins) -> Tracks:
        """Find the identities of unordered pins, from rest or from where they were last seen.

        If the search is uncertain or holds fewer pins, and `follow` refused this frame only because too few
        pins were found, the result of `follow` is kept.
        """
        identity = self._identifier.identify(pins.xy_img, [self._follower.last_xy()])
        fallback, self._fallback = self._fallback, None
        xy, sigma = self._seen(pins, identity, searched=fallback is None)
        seen = np.isfinite(xy[:, 0])
        predicted, _, _ = self._tip.affine.predict(xy - self._tip.lattice.rest_xy, seen)
        now = np.where(seen[:, None], xy, self._tip.lattice.rest_xy + predicted)
        seen_n = int(np.count_nonzero(seen))
        confidence = identity.confidence
        # Most pins are to tell where the others are.
        if self._fresh and 2 * identity.known_n >= self._n and not self._follower.strayed(now):
            confidence = max(confidence, self._confidence)
        if fallback is not None and fallback.n_seen > seen_n:
            confidence = 0.0
        if confidence >= Tracks.LOW_CONFIDENCE:
            self._confidence = confidence
            autocorrelation = self._follower.settle(now, now - self._tip.lattice.rest_xy - predicted, seen)
            self._hold()
            return Tracks(xy, sigma, seen, seen_n, confidence, autocorrelation)
        if fallback is not None:
            self._follower.accept()
            self._hold()
            return fallback
        self.held = self._fresh = False
        return Tracks(xy, sigma, seen, seen_n, confidence)

    def _hold(self) -> None:
        self.held, self._fresh, self._fallback = True, True, None

    def _seen(self, pins: Pins, identity: Identity, searched: bool) -> tuple[Array, Array]:
        """(n, 2) and (n,) px, place and sigma of each pin's blob; NaN where it has none, or an outlier."""
        n = self._n
        seen = identity.blob >= 0
        xy, sigma = np.full((n, 2), np.nan), np.full(n, np.nan)
        xy[seen] = pins.xy_img[identity.blob[seen]]
        sigma[seen] = pins.sigma_px[identity.blob[seen]]
        if seen.any():
            motion = xy - self._tip.lattice.rest_xy
            predicted, _, _ = self._tip.affine.predict(motion, seen)
            blob = np.maximum(identity.blob, 0)
            of_pins = Pins(xy, sigma, pins.radius_px[blob], pins.brightness[blob])
            seen = self._tip.photometric.accepted(of_pins, motion, motion - predicted, seen, searched)
            xy[~seen], sigma[~seen] = np.nan, np.nan
        return xy, sigma
