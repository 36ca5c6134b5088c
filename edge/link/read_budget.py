"""Limits the reader's processor time: a flooded bus must not slow the loop."""

from __future__ import annotations

from edge.link.params import PARAMS, LinkParams

__all__ = ["ReadBudget"]


class ReadBudget:
    """cpu_s, now_s  processor time of the reader's thread, and the time."""

    def __init__(self, cpu_s: float, now_s: float, params: LinkParams = PARAMS) -> None:
        self._params = params
        self._cpu_s, self._since_s = cpu_s, now_s

    def pause_s(self, cpu_s: float, now_s: float) -> float:
        """How long to pause reading; 0.0: go on."""
        p = self._params
        used_s, passed_s = cpu_s - self._cpu_s, now_s - self._since_s
        pause_s = used_s / p.read_rel - passed_s
        if passed_s > p.read_window_s:
            self._cpu_s, self._since_s = cpu_s, now_s
        return pause_s if pause_s > p.read_pause_s else 0.0
