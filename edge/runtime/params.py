"""Chosen numbers of the loop's surroundings; the evidence for each is in docs/tuning.md, "Runtime"."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["PARAMS", "RuntimeParams"]


@dataclass(frozen=True, slots=True)
class RuntimeParams:
    """Parameters by name. Units: s, seconds; n, items; rel, a share."""

    switch_s: float = 2e-4  # longest wait of the loop's thread for the interpreter
    watchdog_rel: float = 0.25  # of the watchdog's time between two messages
    latencies_n: int = 1 << 14  # frames that the statistics of times look back on
    log_s: float = 10.0  # a fault that flickers gets at most one pair of lines in this time
    failed_write_s: float = 1.0  # how long a failed write is reported as a storage fault


PARAMS = RuntimeParams()
