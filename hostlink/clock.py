"""The sensor's time on the host's clock, with a bound of the error.

Every sample tells when it was sent on the device's clock (capture time + capture-to-send latency, us).
It arrives on the host's monotonic clock a transit later, and a transit is never negative:

    host - device
      ^      .      .  .     .           . each dot: one sample = true offset + its transit
      |   .     .  .     .  .   .
      |  _._______.___________.____      lower hull = offset + shortest transit, slope = drift
      |  - - - - - - - - - - - - - -     round trips put a floor under it
      +------------------------------> device time

Rules
- The upper bound of the offset is the least seen, bucket by bucket (1 s), carried on with the slope.
- The lower bound comes from round trips (`bracket`): a reply cannot leave before the question was asked.
  Without one, the shortest transit is taken to lie below `transit_s`, and the bound says just that much.
- The estimate is the middle, the error half the width. True as long as the two clocks drift apart by
  less than DRIFT_MAX, and the drift wanders by less than WANDER once it is known.
- A device that restarts begins a new time: samples from the future, or a run of samples all far too
  late, start over. The 32-bit microseconds (71 min) are unwrapped by what the host's clock says.

Source: line under all points, hull edge above the mean abscissa: Moon, Skelly, Towsley 1999,
"Estimation and removal of clock skew from network delay measurements".
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import pairwise

__all__ = ["ClockMap", "HostTime"]

WRAP_US = 1 << 32
BUCKET_S = 1.0
BUCKETS = 32  # half a minute: long enough for a slope, short enough to follow temperature
SLOPE_AFTER_S = 5.0  # below this span jitter of 0.1 ms would pass for 20 ppm and more
DRIFT_MAX = 200e-6  # two cheap crystals of +-100 ppm each
WANDER = 2e-6  # change of the drift by temperature within half a minute
TRANSIT_S = 2e-3  # shortest transit assumed without a round trip: one frame plus a driver's wake-up
FUTURE_S = 0.01  # earlier than possible by more than this: the device's clock was set anew
LATE_S = 1.0  # later than this RESTART_RUN times running: the same
RESTART_RUN = 16


@dataclass(frozen=True, slots=True)
class HostTime:
    """A moment on the host's monotonic clock: `time_s` as `time.monotonic()` gives it, +- `error_s`."""

    time_s: float
    error_s: float


@dataclass(slots=True)
class _Bucket:
    at_s: float  # device time of the least offset
    offset_s: float


class ClockMap:
    """Maps one device's clock to the host's. Feed it every sample; ask it at any time.

    transit_s   what the shortest transit is assumed to stay below until a round trip is known
    """

    def __init__(self, transit_s: float = TRANSIT_S) -> None:
        self._transit_s = transit_s
        self.restarts = 0
        self._forget()

    def _forget(self) -> None:
        self._buckets: deque[_Bucket] = deque(maxlen=BUCKETS)
        self._floors: deque[_Bucket] = deque(maxlen=4)  # lower bounds of the offset, newest last
        self._bucket_start_s = 0.0
        self._slope = 0.0
        self._wander = DRIFT_MAX
        self._last_us: int | None = None  # unwrapped device time
        self._last_host_s = 0.0
        self._late_run = 0

    @property
    def drift_ppm(self) -> float:
        """How much faster the host's clock runs than the device's; 0 until known."""
        return self._slope * 1e6

    def observe(self, device_us: int, host_s: float) -> None:
        """A message said `device_us` (modulo 2**32) when it was sent and came in at `host_s`."""
        at_s = self._unwrap(device_us, host_s) * 1e-6
        offset_s = host_s - at_s
        if self._buckets:
            upper, lower = self._bounds(at_s)
            if offset_s < lower - FUTURE_S or self._is_restart(offset_s > upper + LATE_S):
                self.restarts += 1
                self._forget()
                at_s = self._unwrap(device_us, host_s) * 1e-6
                offset_s = host_s - at_s
        self._last_us, self._last_host_s = round(at_s * 1e6), host_s
        if not self._buckets or at_s >= self._bucket_start_s + BUCKET_S:
            self._bucket_start_s = at_s
            self._buckets.append(_Bucket(at_s, offset_s))
            self._fit()
        elif offset_s + self._slope * (self._buckets[-1].at_s - at_s) < self._buckets[-1].offset_s:
            self._buckets[-1] = _Bucket(at_s, offset_s)

    def bracket(self, asked_s: float, device_us: int, answered_s: float) -> None:
        """A round trip: the device read its clock as `device_us` between two moments of the host's."""
        at_s = self._unwrap(device_us, answered_s) * 1e-6
        self._floors.append(_Bucket(at_s, asked_s - at_s))
        self.observe(device_us, answered_s)

    def to_host(self, device_us: int) -> HostTime | None:
        """Host time of a moment of the device (modulo 2**32, within 35 min of the last sample).

        None before anything was observed.
        """
        if self._last_us is None:
            return None
        at_s = (self._last_us + _signed(device_us - self._last_us)) * 1e-6
        upper, lower = self._bounds(at_s)
        return HostTime(at_s + (upper + lower) / 2, (upper - lower) / 2)

    # ------------------------------------------------------------------------------------------------

    def _unwrap(self, device_us: int, host_s: float) -> int:
        if self._last_us is None:
            return device_us
        expected_us = self._last_us + round((host_s - self._last_host_s) * 1e6)
        return expected_us + _signed(device_us - expected_us)

    def _is_restart(self, late: bool) -> bool:
        self._late_run = self._late_run + 1 if late else 0
        return self._late_run >= RESTART_RUN

    def _bounds(self, at_s: float) -> tuple[float, float]:
        """Highest and lowest offset that what was seen allows at device time `at_s`."""
        upper, best = min(
            ((self._carried(b, at_s) + self._wander * abs(at_s - b.at_s), b) for b in self._buckets),
            key=lambda pair: pair[0],
        )
        floors = [self._carried(b, at_s) - self._wander * abs(at_s - b.at_s) for b in self._floors]
        # A round trip loses its worth as the drift eats it; the assumption always holds.
        floors.append(self._carried(best, at_s) - self._wander * abs(at_s - best.at_s) - self._transit_s)
        return upper, min(max(floors), upper)

    def _carried(self, bucket: _Bucket, at_s: float) -> float:
        return bucket.offset_s + self._slope * (at_s - bucket.at_s)

    def _fit(self) -> None:
        """Slope of the lower hull's edge above the mean abscissa, and how far to trust it."""
        points = [(b.at_s, b.offset_s) for b in self._buckets][:-1]  # the newest bucket has only begun
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
    return (difference_us + WRAP_US // 2) % WRAP_US - WRAP_US // 2
