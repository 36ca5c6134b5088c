# cython: annotation_typing=False, wraparound=True
"""Order and time of one node's samples: what is new, lost, old or repeated, whether one sender sent them all,
and when they were taken on the host's clock, with a bound of the error.

Sequence      sample number and E2E counter -> deliver or not, and how many were lost before it
SenderWatch   sample number and capture time -> is there a second sender with this node number?
Evidence      frames with a wrong CRC -> noise, or another version?
ClockMap      capture time and arrival -> time on the host's clock

Every sample carries the time at which it was sent on the device's clock (capture time + capture-to-send
latency, us). It arrives on the host's clock a transit later, and a transit is never negative:

    host - device
      ^      .      .  .     .           . each dot: one sample = true offset + its transit
      |   .     .  .     .  .   .
      |  _._______.___________.____      lower hull = offset + shortest transit, slope = drift
      |  - - - - - - - - - - - - - -     round trips put a floor under it
      +------------------------------> device time

Rules
- The upper bound of the offset is the least seen, bucket by bucket (1 s), extrapolated with the slope.
- The lower bound comes from round trips (`bracket`): a reply cannot be sent before the question.
  Without one, the shortest transit is assumed to be below `transit_s`, which sets the bound.
- The estimate is the middle, the error half the width. They hold as long as the two clocks drift apart by
  less than DRIFT_MAX, and the drift varies by less than WANDER once it is known.
- The mapping restarts when the device reports a clock step or a boot (`restart`), and when a sample
  contradicts it: captured before the previous one, or arrived before it can have been sent. A host that was
  suspended causes this too: its clock stood still, or the 32-bit microseconds wrapped.
- If all samples are late, the clock may have been set back by less than their spacing. After
  LATE_RUN of them in a row the error covers that. After LATE_S without one in time the mapping restarts,
  and until the next round trip the error covers the other cause, a longer transit.
- After a restart, or a long pause, the first samples may all be late (a host that was delayed):
  for SETTLE_N samples and SETTLE_SPAN_S the error is larger by SETTLE_S.
- The 32-bit microseconds (71 min) are unwrapped with the host's clock.

Compiled where a compiler is, with the C types in `order_and_time.pxd`; the same without.

Source: line under all points, hull edge above the mean abscissa: Moon, Skelly, Towsley 1999,
"Estimation and removal of clock skew from network delay measurements".
"""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import astuple, dataclass
from itertools import pairwise
from math import inf
from operator import add
from typing import Final, NamedTuple

__all__ = [
    "DRIFT_MAX", "EVIDENCE_P5", "EVIDENCE_P11", "ClockMap", "Evidence", "LinkStatistics", "SenderWatch",
    "Sequence",
]  # fmt: skip

WINDOW: Final = 64  # samples; a bus that reorders does not hold one back for longer
RESTART_RUN: Final = 8  # samples of another sequence, and none of the known one, that show a restart
EVIDENCE_P5: Final = 3  # frames that imply one foreign data id: chance of noise doing that is 2**-48
EVIDENCE_P11: Final = 6  # of 12 bits each: 2**-60
SUSPECT_N: Final = 3  # samples that go back to another sequence: a restart causes one, a late sample another
_COUNTERS: Final = 256  # more than any counter
_KNOWN_N: Final = 2 * WINDOW
_SEEN_ALL: Final = int("1" * WINDOW, 2)  # a shift would be one of 32 bits where this is compiled
SENDER_SPAN_US: Final = 10_000_000  # capture times of one sender's samples within WINDOW

WRAP_US = 1 << 32
_TIME_BITS = WRAP_US - 1
LONG_US = 1e18  # of 64 bits; no two messages are further apart than 30,000 years
BUCKET_S = 1.0
BUCKETS = 32  # half a minute: long enough for a slope, short enough to follow temperature
SLOPE_AFTER_S = 5.0  # over a shorter span, jitter of 0.1 ms looks like 20 ppm or more
DRIFT_MAX = 200e-6  # two cheap crystals of +-100 ppm each
WANDER = 2e-6  # change of the drift by temperature within half a minute
TRANSIT_S = 2e-3  # shortest transit assumed without a round trip: one frame plus a driver's wake-up
EARLY_S = 0.5e-3  # a sample this much earlier than possible: the clock was set forward
LATE_RUN = 8  # late samples in a row: a single stall of the host makes fewer
LATE_N, LATE_S = 16, 1.0  # of so many messages, and in this time, one has a transit near the shortest
SETTLE_N, SETTLE_SPAN_S = 8, 0.1  # messages, and their time, of which one has a transit near the shortest
SETTLE_S = 0.05  # a longer delay of the host at that moment gives a wrong bound until it has caught up
DRIFTED_S = 0.5e-3  # after a pause in which the clocks may drift more than this, the mapping settles anew


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
        self._known = [-1] * 128  # by the number's remainder by _KNOWN_N: number << 32 | capture time
        self.add(sample, time_us)

    def is_near(self, sample: int, time_us: int) -> bool:
        passed_us = _signed(time_us - self._time_us)
        steps = self._steps_to(sample)
        return -WINDOW <= steps <= WINDOW and -SENDER_SPAN_US <= passed_us <= SENDER_SPAN_US

    def is_used(self, sample: int, time_us: int) -> bool:
        """Whether this number, not a new one, was another image's."""
        known = self._known[sample % _KNOWN_N]
        return self._steps_to(sample) <= 0 and known >> 32 == sample and known & _TIME_BITS != time_us

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
        self._present: _Track | None = None
        self._other: _Track | None = None  # the one before
        self._suspect_n = 0
        self._quiet_n = 0  # samples since the last suspect one

    def see(self, sample: int, time_us: int) -> bool:
        """Whether this sample shows a second sender."""
        present, other = self._present, self._other
        if present is not None and present.is_near(sample, time_us):
            used = present.is_used(sample, time_us)
            present.add(sample, time_us)
            return self._is_second(used)
        self._present, self._other = other, present
        if other is not None and other.is_near(sample, time_us):
            other.add(sample, time_us)
            return self._is_second(True)
        self._present = _Track(sample, time_us)
        return False

    def restart(self) -> None:
        """The node reports a restart."""
        self._present = self._other = None
        self._suspect_n = 0

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


class _Bucket(NamedTuple):
    at_s: float  # device time of the least offset
    offset_s: float


class ClockMap:
    """Maps one device's clock to the host's. It receives every sample, and can be queried at any time.

    transit_s   assumed bound of the shortest transit until a round trip is known
    lateness_s  how much later than the shortest transit the last sample came
    restarts    times the mapping restarted
    """

    def __init__(self, transit_s: float = TRANSIT_S) -> None:
        self._transit_s = transit_s
        self._lock = threading.Lock()  # samples come from the link's thread, round trips from the user's
        self._acquire, self._release = self._lock.acquire, self._lock.release
        self.restarts = 0
        self._begin()

    def _begin(self) -> None:
        self._buckets: deque[_Bucket] = deque(maxlen=BUCKETS - 1)  # all but the newest,
        self._lowest_at_s = self._lowest_offset_s = 0.0  # the one of them that bounds every time after them,
        self._closed_s = inf  # and this is when that begins
        self._newest_at_s = self._newest_offset_s = 0.0  # the newest bucket
        self._floors: deque[_Bucket] = deque(maxlen=4)  # lower bounds of the offset, newest last
        self._bucket_start_s = 0.0
        self._slope = 0.0
        self._wander = DRIFT_MAX
        self._is_known = False  # anything was observed: then of the last message
        self._last_us = 0  # the unwrapped device time
        self._last_host_s = 0.0
        self._captured_us = -WRAP_US  # unwrapped, of the last sample
        self._settle_span_s = SETTLE_SPAN_S
        self._settling_n = 0  # messages since the beginning or a pause,
        self._settling_from_s = 0.0  # and the device time of the first
        self.lateness_s = 0.0
        self._on_time_s = -inf  # device time of the last message that was not late
        self._late_n = 0  # late ones since then,
        self._late_since_s = 0.0  # from this host time on,
        self._late_least_s = inf  # by at least this
        self._uncertainty_s = 0.0  # lateness that caused the last restart

    def restart(self) -> None:
        """The device's clock has changed: it booted, or reported a clock step."""
        with self._lock:
            self._restart()

    def take(self, capture_us: int, latency_us: float, host_s: float) -> tuple[float, float]:
        """A sample, captured at `capture_us` (modulo 2**32) and sent `latency_us` later, arrived at `host_s`.

        Samples must come in the order in which they were captured. Returns the capture and its error, s.
        """
        self._acquire()  # `with` takes four times as long
        try:
            captured_us = self._unwrap(capture_us, host_s)
            if captured_us < self._captured_us:
                self._restart()  # captures are in order, so the clock stepped back
                captured_us = capture_us
            delay_us = int(latency_us + 0.5)
            self._observe(captured_us + delay_us, host_s)
            self._captured_us = captured_us
            return self._host_time(captured_us)
        finally:
            self._release()

    def bracket(self, asked_s: float, device_us: int, answered_s: float) -> None:
        """A round trip: the device read its clock as `device_us` between two moments of the host's."""
        with self._lock:
            unwrapped_us = self._unwrap(device_us, answered_s)
            at_s = unwrapped_us * 1e-6
            if self._is_known and asked_s - at_s > self._bounds(at_s)[0] + EARLY_S:
                self._restart()  # the clock was set back: messages would have arrived before they were sent
            self._observe(unwrapped_us, answered_s)
            self._floors.append(_Bucket(at_s, asked_s - at_s))
            self._uncertainty_s = 0.0

    # ------------------------------------------------------------------------------------------------

    def _restart(self) -> None:
        self.restarts += self._is_known
        self._begin()

    def _host_time(self, unwrapped_us: int) -> tuple[float, float]:
        at_s = unwrapped_us * 1e-6
        upper, lower = self._bounds(at_s)
        error_s = (upper - lower) / 2 + self._uncertainty_s
        if not self._is_settled(at_s) and not self._floors:
            error_s += SETTLE_S
        if self._late_n and at_s > self._on_time_s and self._late_n >= LATE_RUN:
            error_s += self._late_least_s
        return at_s + (upper + lower) / 2, error_s

    def _observe(self, unwrapped_us: int, host_s: float) -> None:
        at_s = unwrapped_us * 1e-6
        offset_s = host_s - at_s
        if self._is_known and self._contradicts(at_s, offset_s, host_s):
            uncertainty_s = self._uncertainty_s
            self._restart()
            self._uncertainty_s = uncertainty_s
        if self._settling_n == 0 or (host_s - self._last_host_s) * self._wander > DRIFTED_S:
            self._settling_n, self._settling_from_s = 0, at_s
        self._settling_n += 1
        self._last_us, self._last_host_s = unwrapped_us, host_s
        if not self._is_known or at_s >= self._bucket_start_s + BUCKET_S:
            if self._is_known:
                self._close_bucket()
            self._is_known, self._bucket_start_s = True, at_s
            self._newest_at_s, self._newest_offset_s = at_s, offset_s
        elif offset_s + self._slope * (self._newest_at_s - at_s) < self._newest_offset_s:
            self._newest_at_s, self._newest_offset_s = at_s, offset_s

    def _close_bucket(self) -> None:
        self._buckets.append(_Bucket(self._newest_at_s, self._newest_offset_s))
        self._closed_s = self._newest_at_s
        self._fit()
        steepest = self._slope + self._wander
        least = inf
        for at_s, offset_s in self._buckets:
            if offset_s - steepest * at_s < least:
                least = offset_s - steepest * at_s
                self._lowest_at_s, self._lowest_offset_s = at_s, offset_s

    def _is_settled(self, at_s: float) -> bool:
        return self._settling_n >= SETTLE_N and at_s - self._settling_from_s >= self._settle_span_s

    def _contradicts(self, at_s: float, offset_s: float, host_s: float) -> bool:
        """Whether the message does not fit the map; then `_uncertainty_s` is that of a new one."""
        upper, lower = self._bounds(at_s)
        self.lateness_s = max(0.0, offset_s - upper)
        if offset_s < lower - EARLY_S:
            self._uncertainty_s = 0.0
            return True
        if offset_s < lower:
            self._floors.clear()  # they contradict the message: the clock has stepped a little
        if self.lateness_s <= self._transit_s:
            self._on_time_s = at_s
            if self._late_n:
                self._late_n, self._late_least_s = 0, inf
            return False
        if self._late_n == 0:
            self._late_since_s = host_s
        self._late_n += 1
        self._late_least_s = min(self._late_least_s, self.lateness_s)
        if self._late_n < LATE_N or host_s - self._late_since_s < LATE_S:
            return False
        # The clock was set back by that, or the transit has become that much longer.
        self._uncertainty_s = self._late_least_s
        return True

    def _unwrap(self, device_us: int, host_s: float) -> int:
        if not self._is_known:
            return device_us
        passed_us = int(min(max((host_s - self._last_host_s) * 1e6, -LONG_US), LONG_US))
        expected_us = self._last_us + passed_us
        return expected_us + _signed(device_us - expected_us)

    def _bounds(self, at_s: float) -> tuple[float, float]:
        """Highest and lowest offset consistent with the samples at device time `at_s`."""
        slope, wander = self._slope, self._wander
        best_s = at_s - self._newest_at_s
        upper = self._newest_offset_s + slope * best_s + wander * abs(best_s)
        if at_s >= self._closed_s:
            passed_s = at_s - self._lowest_at_s
            bound = self._lowest_offset_s + slope * passed_s + wander * abs(passed_s)
            if bound < upper:
                upper, best_s = bound, passed_s
        else:
            for bucket_at_s, offset_s in self._buckets:
                passed_s = at_s - bucket_at_s
                bound = offset_s + slope * passed_s + wander * abs(passed_s)
                if bound < upper:
                    upper, best_s = bound, passed_s
        # A round trip's bound widens with the drift; the assumed one does not.
        lower = upper - 2 * wander * abs(best_s) - self._transit_s
        for bucket_at_s, offset_s in self._floors or ():
            passed_s = at_s - bucket_at_s
            lower = max(lower, offset_s + slope * passed_s - wander * abs(passed_s))
        return upper, min(lower, upper)

    def _fit(self) -> None:
        """Slope of the lower hull's edge above the mean abscissa, and how far to trust it."""
        points = list(self._buckets)  # the newest one has only begun
        if len(points) < 3 or points[-1][0] - points[0][0] < SLOPE_AFTER_S:
            return
        hull: list[tuple[float, float]] = []
        for x, y in points:
            while len(hull) > 1 and _turns_right(hull[-2], hull[-1], (x, y)):
                hull.pop()
            hull.append((x, y))
        middle = sum(x for x, _ in points) / len(points)
        left, right = next((a, b) for a, b in pairwise(hull) if a[0] <= middle <= b[0])
        slope = (right[1] - left[1]) / (right[0] - left[0])
        if abs(slope) > DRIFT_MAX:
            return
        spread = sum(y - (left[1] + slope * (x - left[0])) for x, y in points) / len(points)
        self._slope = slope
        self._wander = min(DRIFT_MAX, WANDER + 2 * spread / (points[-1][0] - points[0][0]))


def _turns_right(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    """Whether b lies on or above the line from a to c, so that it is not part of the lower hull."""
    return (b[0] - a[0]) * (c[1] - a[1]) <= (b[1] - a[1]) * (c[0] - a[0])


def _signed(difference_us: int) -> int:
    """A difference modulo 2**32 as the nearest signed number."""
    return (difference_us + (WRAP_US >> 1) & WRAP_US - 1) - (WRAP_US >> 1)
