"""The pins of a skin that the image shows in several parts: the identities of each part are its own.

A touch may shift or turn one view alone, and no search over the whole finds that. A pin does not leave its
part, so a blob is one of the part whose pin at rest is nearest to it.
"""

import numpy as np

from edge.geometry.neighbours import nearest_of
from edge.geometry.parts import joined, parts_of, pins_of
from edge.tracking.tracker import Tracker
from edge.types import Array, Index, Pins, Rest, Tracks


class RegionTracker:
    """A `Tracker` of each part, with the same calls and arguments; part (n,): of each pin."""

    def __init__(self, rest: Rest, part: Index, found: Pins | None, expected: Array | None) -> None:
        self._rest_img, self._part = rest.xy_img, part
        self._parts = [(rows, Tracker(own)) for rows, own in parts_of(rest)]
        self._found, self._expected = found or rest.pins, expected
        self.forget()

    @property
    def held(self) -> bool:
        """Whether the identities of all parts are known."""
        return all(tracker.held for _, tracker in self._parts)

    def forget(self) -> None:
        """Treat the next frame on its own, as after a jump from rest."""
        self._followed: list[Tracks] = []  # the parts in the frame in hand; none: they were not
        for _, tracker in self._parts:
            tracker.forget()

    def follow(self) -> Tracks:
        """Check what was found at the predicted places, in each part."""
        self._followed = [tracker.follow(pins_of(self._found, rows)) for rows, tracker in self._parts]
        return self._joined(self._followed)

    def identify(self, pins: Pins) -> Tracks:
        """Find the identities of unordered pins in each part; one that could be followed stays as it is."""
        near = nearest_of(self._rest_img, pins.xy_img)[1][:, 0]
        part, tracks = self._part[near], []
        for k, (rows, tracker) in enumerate(self._parts):
            if self._followed and tracker.held:
                tracks.append(self._followed[k])
            else:
                tracks.append(tracker.identify(pins_of(pins, part == self._part[rows[0]])))
        self._followed = []
        return self._joined(tracks)

    def _joined(self, of_parts: list[Tracks]) -> Tracks:
        """The tracks of all parts, as certain as the least certain one."""
        rows = [rows for rows, _ in self._parts]
        for own, tracker in self._parts:
            if self._expected is not None and tracker.held:
                self._expected[own] = tracker.predict()
        lost_n = np.array([len(t.seen) - t.n_seen for t in of_parts])
        autocorrelation = float(lost_n @ [t.autocorrelation for t in of_parts]) / max(int(lost_n.sum()), 1)
        return Tracks(
            joined(rows, [t.xy_img for t in of_parts]),
            joined(rows, [t.sigma_px for t in of_parts]),
            joined(rows, [t.seen for t in of_parts]),
            sum(t.n_seen for t in of_parts),
            min(t.confidence for t in of_parts),
            autocorrelation,
        )


def tracker_of(
    rest: Rest, found: Pins | None = None, expected: Array | None = None
) -> Tracker | RegionTracker:
    """The tracker of a skin in one part or in several; arguments and errors are those of `Tracker`."""
    if rest.part is None:
        return Tracker(rest, found, expected)
    return RegionTracker(rest, rest.part, found, expected)
