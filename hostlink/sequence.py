# cython: annotation_typing=False
"""Order of one node's samples: what is new, lost, old or repeated; and whether one sender sent them all.

Sequence      sample number and E2E counter -> deliver or not, and how many were lost before it
SenderWatch   sample number and capture time -> is there a second sender with this node number?
Evidence      frames with a wrong CRC -> noise, or another version?

Compiled where a compiler is, with the C types in `sequence.pxd`; the same without.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from operator import add
from typing import Final

__all__ = ["EVIDENCE_P5", "EVIDENCE_P11", "Evidence", "LinkStatistics", "SenderWatch", "Sequence"]

WINDOW: Final = 64  # samples; a bus that reorders does not hold one back for longer
RESTART_RUN: Final = 8  # samples of another sequence, and none of the known one, that show a restart
EVIDENCE_P5: Final = 3  # frames that imply one foreign data id: chance of noise doing that is 2**-48
EVIDENCE_P11: Final = 6  # of 12 bits each: 2**-60
SUSPECT_N: Final = 3  # samples that go back to another sequence: a restart causes one, a late sample another
_COUNTERS: Final = 256  # more than any counter
_KNOWN_N: Final = 2 * WINDOW
_SEEN_ALL: Final = int("1" * WINDOW, 2)  # a shift would be one of 32 bits where this is compiled
SENDER_SPAN_US: Final = 10_000_000  # capture times of one sender's samples within WINDOW


@dataclass(slots=True)
class LinkStatistics:
    """Counts of one node's samples and frames.

    received_n       samples delivered
    lost_n           samples sent that did not arrive, or arrived damaged
    corrupt_n        frames with a wrong CRC, length or content; serial: also blocks that are not a frame
    duplicate_n      repeated samples; dropped
    out_of_order_n   samples that arrived after a newer one; dropped, and no longer counted as lost
    late_n           samples delivered, but later than the fastest by more than the limit
    restart_n        times the sample number restarted
    foreign_n        frames of another version
    stray_n          classic parts that belong to no sample in progress
    second_sender_n  frames that show that two senders use this node number
    detail_n, detail_lost_n  detail frames delivered; begun and not completed
    """

    received_n: int = 0
    lost_n: int = 0
    corrupt_n: int = 0
    duplicate_n: int = 0
    out_of_order_n: int = 0
    late_n: int = 0
    restart_n: int = 0
    foreign_n: int = 0
    stray_n: int = 0
    second_sender_n: int = 0
    detail_n: int = 0
    detail_lost_n: int = 0

    def __add__(self, other: LinkStatistics) -> LinkStatistics:
        return LinkStatistics(*map(add, astuple(self), astuple(other)))


class Sequence:
    """Which of one node's samples to deliver; counts what was lost, repeated or old."""

    def __init__(self, statistics: LinkStatistics) -> None:
        self._statistics = statistics
        self._is_begun = False
        self._sample = 0  # newest delivered
        self._counter = 0
        self._stride = 1  # sample numbers from one sent sample to the next: the sensor's divider
        self._seen = 0  # bit i: sample number newest - i was delivered
        self._other_run = 0  # samples of what may be a new sequence,
        self._other = 0  # and the newest number of it

    def accept(self, sample: int, counter: int, modulus: int) -> int:
        """Number of samples lost before this one; negative: it must not be delivered."""
        if not self._is_begun:
            return self._begin(sample, counter)
        ahead = (sample - self._sample) & 0xFFFF
        if ahead == 0 or ahead > 0x8000:
            return self._old(sample, counter, (self._sample - sample) & 0xFFFF)
        steps = (counter - self._counter + _COUNTERS * modulus) % modulus  # C keeps the sign
        if steps == 0:
            steps = modulus
        if ahead > steps * self._stride:
            steps += modulus * max(0, round((float(ahead) / self._stride - steps) / modulus))
        steps = max(1, min(steps, ahead))
        if steps == 1:
            self._stride = ahead
        self._seen = (self._seen << ahead if ahead < WINDOW else 0) & _SEEN_ALL | 1
        self._sample, self._counter, self._other_run = sample, counter, 0
        if steps > 1:
            self._statistics.lost_n += steps - 1
        return steps - 1

    def restart(self) -> None:
        """The node reports a restart."""
        self._is_begun = False

    def _begin(self, sample: int, counter: int) -> int:
        self._is_begun, self._sample, self._counter, self._stride = True, sample, counter, 1
        self._seen, self._other_run = 1, 0
        return 0

    def _old(self, sample: int, counter: int, age: int) -> int:
        """A repetition, a late sample, or the first samples after an unnoticed restart."""
        if age < WINDOW:
            if self._seen >> age & 1:
                self._statistics.duplicate_n += 1
            else:
                bit = 1
                self._seen |= bit << age
                self._statistics.out_of_order_n += 1
                self._statistics.lost_n = max(0, self._statistics.lost_n - 1)
            return -1
        follows = self._other_run > 0 and 0 < (sample - self._other) & 0xFFFF < 0x8000
        self._other, self._other_run = sample, self._other_run + 1 if follows else 1
        if self._other_run >= RESTART_RUN:
            self._statistics.restart_n += 1
            return self._begin(sample, counter)
        self._statistics.out_of_order_n += 1
        return -1


class _Track:
    """Samples that may be one sender's: the newest, and the last ones' capture times by number."""

    def __init__(self, sample: int, time_us: int) -> None:
        self._known = [-1] * _KNOWN_N  # by the number's remainder: number << 32 | capture time
        self.add(sample, time_us)

    def is_near(self, sample: int, time_us: int) -> bool:
        passed_us = (time_us - self._time_us + 0x8000_0000 & 0xFFFF_FFFF) - 0x8000_0000
        steps = self._steps_to(sample)
        return -WINDOW <= steps <= WINDOW and -SENDER_SPAN_US <= passed_us <= SENDER_SPAN_US

    def is_used(self, sample: int, time_us: int) -> bool:
        """Whether this number, not a new one, was another image's."""
        known = self._known[sample % _KNOWN_N]
        return self._steps_to(sample) <= 0 and known >> 32 == sample and known & 0xFFFF_FFFF != time_us

    def add(self, sample: int, time_us: int) -> None:
        """Make this the newest sample."""
        self._sample, self._time_us = sample, time_us
        known = sample
        self._known[sample % _KNOWN_N] = known << 32 | time_us

    def _steps_to(self, sample: int) -> int:
        return (sample - self._sample + 0x8000 & 0xFFFF) - 0x8000


class SenderWatch:
    """Finds a second sender with one node number: its samples interleave with those of the first.

    A restart goes back in the sample numbers once. Two senders do so again and again: to numbers that the
    other one has used for other images, or to a sequence far from the other's.
    """

    def __init__(self) -> None:
        self._tracks: list[_Track] = []  # at most two, the present one first
        self._suspect_n = 0
        self._quiet_n = 0  # samples since the last suspect one

    def see(self, sample: int, time_us: int) -> bool:
        """Whether this sample shows a second sender."""
        for i, track in enumerate(self._tracks):
            if track.is_near(sample, time_us):
                used = track.is_used(sample, time_us)
                track.add(sample, time_us)
                if i:
                    self._tracks.reverse()
                return self._is_second(bool(i) or used)
        self._tracks = [_Track(sample, time_us), *self._tracks[:1]]
        return False

    def restart(self) -> None:
        """The node reports a restart."""
        self._tracks, self._suspect_n = [], 0

    def _is_second(self, suspect: bool) -> bool:
        if suspect:
            self._suspect_n, self._quiet_n = self._suspect_n + 1, 0
            return self._suspect_n >= SUSPECT_N
        self._quiet_n += 1
        if self._quiet_n > WINDOW:
            self._suspect_n = 0
        return False


class Evidence:
    """Distinguishes another version from noise: the same foreign data id implied by frame after frame."""

    def __init__(self, needed: int) -> None:
        self._needed = needed
        self._implied: tuple[int, int] | None = None  # version, data id
        self._frames: set[bytes] = set()

    def weigh(self, version: int, data_id: int, frame: bytes) -> bool:
        """Whether the frames so far are sufficient. A repeated frame adds none."""
        if self._implied != (version, data_id):
            self._implied, self._frames = (version, data_id), set()
        if len(self._frames) < self._needed:
            self._frames.add(bytes(frame))
        return len(self._frames) >= self._needed

    def clear(self) -> None:
        """A frame of our own version came."""
        self._implied = None
