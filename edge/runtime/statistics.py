"""Statistics of the loop: counters, and quantiles of the last frames' times."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from edge.params import PARAMS
from edge.types import Array

__all__ = ["LoopStatistics", "RingBuffer", "StatisticsCollector"]


@dataclass(slots=True)
class LoopStatistics:
    """Statistics since the loop started. `edge.cli.summary.LABELS` has a label for each.

    frames_n            images that were processed
    lost_by_camera_n    gaps in the camera's numbering: images that never reached this process
    dropped_n           images that a newer one replaced before they were processed
    full_searches_n     frames in which the pins were searched for in the whole image
    unidentified_n      frames without values, because pins could not be identified
    failed_n            frames that could not be processed at all
    keepalives_n        samples without values, sent while no image came
    sent_n              samples that left, summed over the sinks
    pins_n              pins of the rest frame
    pins_seen_min_n, pins_seen_median_n  pins seen in a frame, of the last `latencies_n` frames
    drift_px            largest slow drift that is subtracted now
    rate_hz             frames a second
    compute_us          image taken up to sample ready: median, 99 %, 99.9 % of the last `latencies_n` frames
    latency_us          capture to sample sent, likewise
    faults              how often each fault appeared
    """

    frames_n: int = 0
    lost_by_camera_n: int = 0
    dropped_n: int = 0
    full_searches_n: int = 0
    unidentified_n: int = 0
    failed_n: int = 0
    keepalives_n: int = 0
    sent_n: int = 0
    pins_n: int = 0
    pins_seen_min_n: int = 0
    pins_seen_median_n: int = 0
    drift_px: float = 0.0
    rate_hz: float = 0.0
    compute_us: tuple[float, float, float] = (0.0, 0.0, 0.0)
    latency_us: tuple[float, float, float] = (0.0, 0.0, 0.0)
    faults: dict[str, int] = field(default_factory=dict)


class RingBuffer:
    """The last values of a series, preallocated."""

    def __init__(self, size: int = PARAMS.latencies_n) -> None:
        self._values = np.zeros(size)
        self._n = 0

    def add(self, value: float) -> None:
        """Append one, in place of the oldest."""
        self._values[self._n % len(self._values)] = value
        self._n += 1

    @property
    def values(self) -> Array:
        """As many as there are, in no order."""
        return self._values[: min(self._n, len(self._values))]

    def quantiles(self) -> tuple[float, float, float]:
        """Median, 99 %, 99.9 %; zeros while it is empty."""
        if not self._n:
            return (0.0, 0.0, 0.0)
        a, b, c = np.quantile(self.values, (0.5, 0.99, 0.999))
        return (float(a), float(b), float(c))


class StatisticsCollector:
    """Counts while the loop runs.

    counts  the counters; `snapshot` adds the values measured elsewhere
    """

    def __init__(self) -> None:
        self.counts = LoopStatistics()
        self.compute_us, self.latency_us, self.pins_seen = RingBuffer(), RingBuffer(), RingBuffer()
        self.started_s = time.monotonic()

    def snapshot(self, **measured: Any) -> LoopStatistics:
        """A copy of the present values.

        measured  fields of `LoopStatistics` that the caller knows
        """
        counts, seen = self.counts, self.pins_seen.values
        elapsed_s = time.monotonic() - self.started_s
        return replace(
            counts,
            pins_seen_min_n=int(seen.min()) if seen.size else 0,
            pins_seen_median_n=int(np.median(seen)) if seen.size else 0,
            rate_hz=counts.frames_n / elapsed_s if counts.frames_n else 0.0,
            compute_us=self.compute_us.quantiles(),
            latency_us=self.latency_us.quantiles(),
            **measured,
        )
