"""Statistics of the loop: counters, and quantiles of the last frames' times."""

import time
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from edge.params import PARAMS
from edge.types import Array

_NONE = (0.0, 0.0, 0.0)  # quantiles while there are no frames


def _labelled(label: str, default: Any = 0) -> Any:
    """A field with what it says to people; the last word is the unit."""
    return field(default=default, metadata={"label": label})


@dataclass(slots=True)
class LoopStatistics:
    """Statistics since the loop started. Quantiles are of the last `latencies_n` frames."""

    frames_n: int = _labelled("images processed")
    lost_by_camera_n: int = _labelled("images lost before they reached this process")
    dropped_n: int = _labelled("images replaced by a newer one")
    full_searches_n: int = _labelled("searches of the whole image")
    unidentified_n: int = _labelled("images without values: pins not identified")
    failed_n: int = _labelled("images that could not be processed")
    keepalives_n: int = _labelled("samples sent while no image came")
    sent_n: int = _labelled("samples sent, all sinks")
    pins_n: int = _labelled("pins of the rest frame")
    pins_seen_min_n: int = _labelled("pins seen, least")
    pins_seen_median_n: int = _labelled("pins seen, median")
    drift_px: float = _labelled("largest drift subtracted, px", 0.0)
    rate_hz: float = _labelled("images a second", 0.0)
    compute_us: tuple[float, float, float] = _labelled("computing, median / 99 % / 99.9 %, us", _NONE)
    latency_us: tuple[float, float, float] = _labelled("capture to sample, median / 99 % / 99.9 %, us", _NONE)
    faults: dict[str, int] = field(default_factory=dict, metadata={"label": "faults, how often each"})


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
    """Median, 99 %, 99.9 %."""
    if not values.size:
        return _NONE
    a, b, c = np.quantile(values, (0.5, 0.99, 0.999))
    return (float(a), float(b), float(c))
