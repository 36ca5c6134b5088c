"""The pins of a skin that the image shows in several parts: the identities of each part are its own.

A touch may shift or turn one view alone, and no search over the whole finds that. A part whose identities are
not known has no pins, and is searched for by itself, by its own pattern, while the others are followed.
A pin does not leave its part, so a blob is one of the part whose pin at rest is nearest to it.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from edge.geometry.neighbours import nearest_of
from edge.geometry.parts import parts_of, pins_of
from edge.tracking.tracker import Tracker
from edge.types import Array, Index, PinPattern, Pins, Rest, Tracks


class RegionTracker:
    """A `Tracker` of each part, with the same calls and arguments; part (n,): of each pin."""

    def __init__(self, rest: Rest, part: Index, found: Pins | None, expected: Array | None) -> None:
        self._rest_img, self._part = rest.xy_img, part
        self._parts = [(rows, own.pattern, Tracker(own)) for rows, own in parts_of(rest)]
        self._found, self._expected = found or rest.pins, expected
        self.forget()

    @property
    def held(self) -> bool:
        """Whether the identities of any part are known."""
        return any(tracker.held for *_, tracker in self._parts)

    def forget(self) -> None:
        """Treat the next frame on its own, as after a jump from rest."""
        self._followed: list[Tracks | None] = [None] * len(self._parts)  # the parts in the frame in hand
        for *_, tracker in self._parts:
            tracker.forget()

    def follow(self) -> Tracks:
        """Check what was found at the places predicted of the parts held; confidence 0: one is not held."""
        for k, (rows, _, tracker) in enumerate(self._parts):
            self._followed[k] = tracker.follow(pins_of(self._found, rows)) if tracker.held else None
        tracks = self._joined(self._followed)
        return tracks if all(tracker.held for *_, tracker in self._parts) else replace(tracks, confidence=0.0)

    def search(self, find: Callable[[PinPattern], Pins]) -> tuple[Tracks, bool]:
        """Identify what is found of the patterns of the parts that could not be followed.

        Returns  the tracks, without the parts that are not identified, unless none is; whether the identities
                 of any part come of this search, or none are known
        """
        of_parts: list[Tracks | None] = []
        anew = False
        for k, (_, pattern, tracker) in enumerate(self._parts):
            tracks = self._followed[k] if tracker.held else None
            if tracks is None:
                tracks = self._identified(k, find(pattern))
                anew |= tracker.held
            of_parts.append(tracks)
        self._followed = [None] * len(self._parts)
        if not self.held:
            return self._joined(of_parts), True
        held = [t if part[-1].held else None for t, part in zip(of_parts, self._parts, strict=True)]
        return self._joined(held), anew

    def identify(self, pins: Pins) -> Tracks:
        """Find the identities of unordered pins in all parts, as certain as the least certain one."""
        return self._joined([self._identified(k, pins) for k in range(len(self._parts))])

    def _identified(self, k: int, pins: Pins) -> Tracks:
        rows, _, tracker = self._parts[k]
        near = nearest_of(self._rest_img, pins.xy_img)[1][:, 0]
        return tracker.identify(pins_of(pins, self._part[near] == self._part[rows[0]]))

    def _joined(self, of_parts: Sequence[Tracks | None]) -> Tracks:
        """The tracks of all parts, as certain as the least certain one; None: its pins are lost."""
        n = len(self._part)
        xy, sigma, seen = np.full((n, 2), np.nan), np.full(n, np.nan), np.zeros(n, np.bool_)
        for (rows, _, tracker), tracks in zip(self._parts, of_parts, strict=True):
            if tracks is not None:
                xy[rows], sigma[rows], seen[rows] = tracks.xy_img, tracks.sigma_px, tracks.seen
            if self._expected is not None:
                self._expected[rows] = tracker.predict() if tracker.held else np.nan
        known = [tracks for tracks in of_parts if tracks is not None]
        lost_n = np.array([len(t.seen) - t.n_seen for t in known])
        autocorrelation = float(lost_n @ [t.autocorrelation for t in known]) / max(int(lost_n.sum()), 1)
        confidence = min(t.confidence for t in known)
        return Tracks(xy, sigma, seen, sum(t.n_seen for t in known), confidence, autocorrelation)


def tracker_of(
    rest: Rest, found: Pins | None = None, expected: Array | None = None
) -> Tracker | RegionTracker:
    """The tracker of a skin in one part or in several; arguments and errors are those of `Tracker`."""
    if rest.part is None:
        return Tracker(rest, found, expected)
    return RegionTracker(rest, rest.part, found, expected)
