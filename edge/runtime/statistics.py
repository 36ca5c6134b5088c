"""Statistics of the loop: counters, and quantiles of the last frames' times."""

import time
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from edge.params import PARAMS
from edge.types import Array


@dataclass(slots=True)
class LoopStatistics:
    """Statistics since the loop started. `edge.cli.summary.LABELS` has a label for each."""

    frames_n: int = 0  # images that were processed
    lost_by_camera_n: int = 0  # gaps in the camera's numbering: images that never reached this process
    dropped_n: int = 0  # images that a newer one replaced before they were processed
    full_searches_n: int = 0  # frames in which the pins were searched for in the whole image
    unidentified_n: int = 0  # frames without values, because pins could not be identified
    failed_n: int = 0  # frames that could not be processed at all
    keepalives_n: int = 0  # samples without values, sent while no image came
    sent_n: int = 0  # samples that left, summed over the sinks
    pins_n: int = 0  # pins of the rest frame
    pins_seen_min_n: int = 0  # pins seen in a frame, of the last `latencies_n` frames
    pins_seen_median_n: int = 0
    drift_px: float = 0.0  # largest slow drift that is subtracted now
    rate_hz: float = 0.0  # frames a second
    #: Image taken up to sample ready: median, 99 %, 99.9 % of the last `latencies_n` frames.
    compute_us: tuple[float, float, float] = (0.0, 0.0, 0.0)
    latency_us: tuple[float, float, float] = (0.0, 0.0, 0.0)  # capture to sample sent, likewise
    faults: dict[str, int] = field(default_factory=dict)  # how often each fault appeared
    without_values: dict[str, int] = field(default_factory=dict)  # images, by the fault that explains it


class StatisticsCollector:
    """Counts while the loop runs.

    counts  the counters; `snapshot` adds the values measured elsewhere
    """

    def __init__(self, size: int = PARAMS.latencies_n) -> None:
        self.counts = LoopStatistics()
        self.started_s = time.monotonic()
        self._last = deque[tuple[float, float, float]](maxlen=size)  # frames' times, us, and pins seen

    def add(self, compute_us: float, latency_us: float, pins_n: float) -> None:
        """Note a frame in place of the oldest.

        pins_n  pins seen; NaN: there is no rest frame
        """
        self._last.append((compute_us, latency_us, pins_n))

    def snapshot(self, **measured: Any) -> LoopStatistics:
        """A copy of the present values.

        measured  fields of `LoopStatistics` that the caller knows
        """
        counts, last = self.counts, np.array(list(self._last)).reshape(-1, 3)
        seen = np.rint(last[~np.isnan(last[:, 2]), 2])
        elapsed_s = time.monotonic() - self.started_s
        return replace(
            counts,
            pins_seen_min_n=int(seen.min()) if seen.size else 0,
            pins_seen_median_n=int(np.median(seen)) if seen.size else 0,
            rate_hz=counts.frames_n / elapsed_s if counts.frames_n else 0.0,
            compute_us=_quantiles(last[:, 0]),
            latency_us=_quantiles(last[:, 1]),
            **measured,
        )


def _quantiles(values: Array) -> tuple[float, float, float]:
    """Median, 99 %, 99.9 %; zeros while there are none."""
    if not values.size:
        return (0.0, 0.0, 0.0)
    a, b, c = np.quantile(values, (0.5, 0.99, 0.999))
    return (float(a), float(b), float(c))
