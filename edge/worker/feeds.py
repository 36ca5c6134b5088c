"""Sends new results from the loop's thread to the worker, for viewers."""

import time
from collections import deque
from collections.abc import Callable
from math import nan

from edge.runtime.loop import Loop
from edge.types import Features, Frame, Rest, Result
from edge.view.scene import CHARTED
from edge.worker.params import PARAMS
from hostlink.web.limits import WebLimits
from hostlink.wire import FAULTS, State

_MEANING = {fault.code: fault.meaning for fault in FAULTS}


class ViewFeed:
    """Sends new results to viewers with `put`, as often as the page draws, while somebody watches."""

    def __init__(self, loop: Loop, put: Callable[..., bool]) -> None:
        self._loop, self._put = loop, put
        self.watched = False
        self._results_n = 0
        self._result_s = time.monotonic()
        self._latest: tuple[Result, State] | None = None
        self._rows: deque[tuple[float, ...]] = deque()
        self._due_s = self._sent_s = 0.0
        self._shown: tuple[Frame | None, tuple[Result, State] | None, Rest | None]
        self.forget_shown()

    def on_result(self, result: Result, state: State) -> None:
        """Note a result; a result callback of the loop."""
        self._latest = (result, state)
        self._results_n += 1
        self._result_s = time.monotonic()
        if self.watched:
            self._rows.append(_row(self._result_s, state, result.features))
            while self._result_s - self._rows[0][0] >= PARAMS.recent_s:  # too old for a chart
                self._rows.popleft()

    def on_tick(self) -> None:
        """Send new results, if anybody watches; after each turn of the loop."""
        now_s = time.monotonic()
        if not self.watched or now_s < self._due_s:
            return
        loop = self._loop
        frame, latest = loop.frame, self._latest
        rest = loop.measurement.pipeline.rest if loop.measurement.pipeline else None
        frame_shown, latest_shown, rest_shown = self._shown
        is_idle = frame is frame_shown and latest is latest_shown and not self._rows
        if is_idle and now_s < self._sent_s + PARAMS.report_s:
            return
        sent = self._put(
            "show",
            now_s,
            self._result_s,
            self._results_n,
            list(self._rows),
            None if frame is frame_shown else frame,
            None if latest is latest_shown else latest,
            None if rest is rest_shown else rest,
            {
                "faults": [[_MEANING[code], message] for code, message in loop.faults.active.items()],
                "taring": loop.measurement.tare.busy,
                "tares_n": loop.measurement.tares_n,
                "calibrated": loop.measurement.calibration is not None,
                "dropped_n": loop.source.dropped_n,
            },
        )
        # Due by the clock, not a period after this frame: so as many are sent as the page draws.
        period_s = 1.0 / WebLimits().rate_hz
        self._due_s = max(self._due_s, now_s - period_s) + period_s
        self._sent_s = now_s
        if sent:
            self._shown = (frame, latest, rest)
            self._rows.clear()

    def set_watched(self, watched: bool) -> None:
        """The first viewer came, or the last one left; the next message is complete."""
        if not (watched and self.watched):
            self._rows.clear()
            self.forget_shown()
        self.watched = watched

    def forget_shown(self) -> None:
        """A new worker needs a complete message."""
        self._shown = (None, None, None)


def _row(at_s: float, state: State, features: Features | None) -> tuple[float, ...]:
    """One sample in the order of `edge.view.scene.CHART`."""
    volume_px2, shear_px = nan, [nan, nan]
    if features is not None:
        volume_px2 = nan if features.volume_px2 is None else features.volume_px2
        shear_px = shear_px if features.shear_px is None else features.shear_px.tolist()
    sent = [getattr(state, name) for name in CHARTED]
    return (at_s, *sent, state.latency_us / 1e3, volume_px2, *shear_px)
