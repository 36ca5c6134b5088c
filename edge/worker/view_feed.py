"""Sends the loop's results to viewers: at most 30 times a second, and only while somebody watches."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from math import nan
from typing import TYPE_CHECKING, Any

from edge.worker.messages import Show
from edge.worker.params import PARAMS
from hostlink.wire import FAULTS

if TYPE_CHECKING:
    from edge.pipeline import Result
    from edge.runtime.loop import Loop
    from edge.types import Features, Frame, Rest
    from hostlink.wire import State

_MEANING = {fault.code: fault.meaning for fault in FAULTS}


class ViewFeed:
    """Collects new results and combines them; runs in the loop's thread.

    put      sends a message to the worker; False: the memory is full
    watched  whether anybody watches
    """

    def __init__(self, loop: Loop, put: Callable[[Any], bool]) -> None:
        self._loop = loop
        self._put = put
        self.watched = False
        self._results_n = 0
        self._result_s = time.monotonic()
        self._latest: tuple[Result, State] | None = None
        self._rows: deque[tuple[float, ...]] = deque(maxlen=PARAMS.recent_n)
        self._due_s = 0.0
        self._shown: tuple[Frame | None, Result | None, Rest | None] = (None, None, None)

    @property
    def pending_n(self) -> int:
        """Rows of the charts that wait for the next picture."""
        return len(self._rows)

    def on_result(self, result: Result, state: State) -> None:
        """Note a result; a result callback of the loop."""
        self._latest = (result, state)
        self._results_n += 1
        self._result_s = time.monotonic()
        if self.watched:
            self._rows.append(_row(self._result_s, state, result.features))

    def on_tick(self) -> None:
        """Send new results, if anybody watches; after each turn of the loop."""
        now_s = time.monotonic()
        if not self.watched or now_s < self._due_s:
            return
        loop = self._loop
        frame, (result, state) = loop.frame, self._latest or (None, None)
        rest = loop.pipeline.rest if loop.pipeline else None
        frame_shown, result_shown, rest_shown = self._shown
        is_idle = frame is frame_shown and result is result_shown and not self._rows
        if is_idle and now_s < self._due_s - PARAMS.show_s + PARAMS.keepalive_s:
            return
        is_new = result is not result_shown
        show = Show(
            now_s,
            self._result_s,
            self._results_n,
            list(self._rows),
            None if frame is frame_shown else frame,
            result if is_new else None,
            state if is_new else None,
            None if rest is rest_shown else rest,
            self._about(),
        )
        self._due_s = now_s + PARAMS.show_s
        if self._put(show):
            self._shown = (frame, result, rest)
            self._rows.clear()

    def was_recorded(self, frame: Frame, result: Result | None) -> None:
        """The worker has received this frame for the recording: it need not be sent again for viewing."""
        if self.watched:
            self._shown = (frame, result or self._shown[1], self._shown[2])

    def set_watched(self, watched: bool) -> None:
        """The first viewer came, or the last one left; the next message is complete."""
        if not (watched and self.watched):
            self._rows.clear()
            self.forget_shown()
        self.watched = watched

    def forget_shown(self) -> None:
        """A new worker needs a complete message."""
        self._shown = (None, None, None)

    def _about(self) -> dict[str, Any]:
        """The data that do not come from a frame."""
        loop = self._loop
        return {
            "faults": [[_MEANING[code], message] for code, message in loop.faults.active.items()],
            "taring": loop.taring,
            "tares_n": loop.tares_n,
            "calibrated": loop.calibration is not None,
            "dropped_n": loop.source.dropped_n,
        }


def _row(at_s: float, state: State, features: Features | None) -> tuple[float, ...]:
    """One sample in the order of `edge.view.scene.CHART`."""
    shear = None if features is None else features.shear_px
    volume = None if features is None else features.volume_px2
    return (
        at_s,
        state.displacement_mm,
        state.shear_x_mm,
        state.shear_y_mm,
        state.torsion_deg,
        state.force_n,
        state.force_x_n,
        state.force_y_n,
        state.slip_margin,
        state.latency_us / 1e3,
        nan if volume is None else volume,
        *((nan, nan) if shear is None else shear.tolist()),
    )
