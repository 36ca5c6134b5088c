"""What the loop has done, in numbers: counters, and quantiles of the last frames' times."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from edge.types import Array

__all__ = ["LATENCIES", "Ring", "Statistics"]

LATENCIES = 1 << 14  # frames that the latency statistics look back on: 68 s at 240 frames/s


@dataclass(slots=True)
class Statistics:
    """What the loop has done since it started. Times: median, 99 %, 99.9 % of the last `LATENCIES` frames."""

    frames_n: int = 0
    lost_by_camera_n: int = 0
    dropped_n: int = 0
    searched_n: int = 0
    unsure_n: int = 0
    damaged_n: int = 0
    beats_n: int = 0
    sent_n: int = 0
    pins_n: int = 0
    held_min_n: int = 0
    held_median_n: int = 0
    drift_px: float = 0.0
    rate_hz: float = 0.0
    compute_us: tuple[float, float, float] = (0.0, 0.0, 0.0)
    latency_us: tuple[float, float, float] = (0.0, 0.0, 0.0)
    faults: dict[str, int] = field(default_factory=dict)


class Ring:
    """The last values of a series, preallocated."""

    def __init__(self, size: int = LATENCIES) -> None:
        self._values = np.zeros(size)
        self._n = 0

    def add(self, value: float) -> None:
        """One more; it takes the oldest one's place."""
        self._values[self._n % len(self._values)] = value
        self._n += 1

    @property
    def values(self) -> Array:
        """As many as there are, in no order."""
        return self._values[: min(self._n, len(self._values))]

    def quantiles(self) -> tuple[float, float, float]:
        """Median, 99 %, 99.9 %; zeros while there is nothing."""
        if not self._n:
            return (0.0, 0.0, 0.0)
        a, b, c = np.quantile(self.values, (0.5, 0.99, 0.999))
        return (float(a), float(b), float(c))
