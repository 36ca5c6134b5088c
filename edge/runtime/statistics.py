"""Statistics of the loop: counters, and quantiles of the last frames' times."""

import time
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np

from edge.params import PARAMS
from edge.types import Array

Quantiles = tuple[float, float, float]  # median, 99 %, 99.9 %


@dataclass(slots=True)
class LoopStatistics:
    """Statistics since the loop started, each with what it says to people; the last word is the unit.
    Quantiles are of the last `latencies_n` frames.
    """

    frames_n: Annotated[int, "images processed"] = 0
    lost_by_camera_n: Annotated[int, "images lost before they reached this process"] = 0
    dropped_n: Annotated[int, "images replaced by a newer one"] = 0
    full_searches_n: Annotated[int, "searches of the whole image"] = 0
    failed_n: Annotated[int, "images that could not be processed"] = 0
    keepalives_n: Annotated[int, "samples sent while no image came"] = 0
    sent_n: Annotated[int, "samples sent, all sinks"] = 0
    pins_n: Annotated[int, "pins of the rest frame"] = 0
    pins_seen_min_n: Annotated[int, "pins seen, least"] = 0
    pins_seen_median_n: Annotated[int, "pins seen, median"] = 0
    drift_px: Annotated[float, "largest drift subtracted, px"] = 0.0
    rate_hz: Annotated[float, "images a second"] = 0.0
    compute_us: Annotated[Quantiles, "computing, median / 99 % / 99.9 %, us"] = (0.0, 0.0, 0.0)
    latency_us: Annotated[Quantiles, "capture to sample, median / 99 % / 99.9 %, us"] = (0.0, 0.0, 0.0)
    faults: Annotated[dict[str, int], "faults, how often each"] = field(default_factory=dict)
    without_values: Annotated[dict[str, int], "images without values, why"] = field(default_factory=dict)


class StatisticsCollector:
    """Counts while the loop runs, in `counts`; `snapshot` adds the values measured elsewhere."""

    def __init__(self, size: int = PARAMS.latencies_n) -> None:
        self.counts = LoopStatistics()
        self.started_s = time.monotonic()
        #: Of each frame: since when its latency counts, when work on it began, when it was computed and sent,
        #: ns; and the pins seen, NaN: there is no rest frame.
        self.last = deque[tuple[int, int, int, int, float]](maxlen=size)

    def snapshot(self, **measured: Any) -> LoopStatistics:
        """A copy of the present values; measured: fields of `LoopStatistics` that the caller knows."""
        last = np.array(list(self.last), np.float64).reshape(-1, 5)
        since_ns, begun_ns, computed_ns, sent_ns, seen = last.T
        counts, seen = self.counts, np.rint(seen[~np.isnan(seen)])
        elapsed_s = time.monotonic() - self.started_s
        return replace(
            counts,
            pins_seen_min_n=int(seen.min()) if seen.size else 0,
            pins_seen_median_n=int(np.median(seen)) if seen.size else 0,
            rate_hz=counts.frames_n / elapsed_s if counts.frames_n else 0.0,
            compute_us=_quantiles((computed_ns - begun_ns) / 1e3),
            latency_us=_quantiles((sent_ns - since_ns) / 1e3),
            **measured,
        )


def _quantiles(values: Array) -> Quantiles:
    """Zeros while there are none."""
    median, rare, rarest = np.quantile(values if values.size else 0.0, (0.5, 0.99, 0.999)).tolist()
    return median, rare, rarest
