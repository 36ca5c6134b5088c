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
    patience_s: float = 1.0  # of waiting for a link or an image, and of reporting a failed write
    check_s: float = 0.04  # between checks of what changes slowly: the board, the focus, the drift
    hysteresis_rel: float = 0.1  # of the level at which a fault appears; so far back, it clears
    astray_rel: float = 0.05  # share of the pins that may be beyond a limit for reasons of their own


PARAMS = RuntimeParams()
