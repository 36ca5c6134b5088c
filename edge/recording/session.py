"""The recording of a running loop, if there is one: its failures end the recording, not the loop."""

import logging
import time
from collections.abc import Callable

from edge.faults.registry import FaultRegistry
from edge.params import PARAMS
from edge.types import Frame, Result
from hostlink.wire import FaultCode, State

log = logging.getLogger(__name__)


class RecordingSession:
    """Passes each turn of the loop to a recorder, which may be in another process, and keeps its state.

    put     sends what the `Recorder`'s method of this name is given; False: it is lost. None: nothing is
            recorded. Changed between two frames only, by the loop
    fault   why nothing is recorded any more
    lost_n  turns that the recorder was too slow for, and has not been told of
    """

    def __init__(self, registry: FaultRegistry) -> None:
        self.put: Callable[..., bool] | None = None
        self.fault: str | None = None
        self.lost_n = self._reported_n = self._noted_n = 0
        self._registry = registry
        self._ended = ""  # why the last recording ended
        self._slow_until_s = 0.0
        registry.listeners.append(self._note)

    def begin(self, put: Callable[..., bool]) -> None:
        """Record from the next turn on."""
        self.fault, self.lost_n, self._reported_n = None, 0, 0
        self.put = put

    def take(self, frame: Frame, result: Result | None, state: State) -> None:
        if self.put is None:
            return
        try:
            if self.lost_n and self.put("count_lost", self.lost_n):
                self.lost_n = 0
            self.lost_n += not self.put("take", frame, result, state)
        except Exception as error:
            log.exception("recording ends here")
            self.put = None
            self._ended, self._noted_n, self._slow_until_s = f"recording: {error}", 0, 0.0
            self._registry.report(FaultCode.DISK_FULL, True, self._ended)

    @property
    def dropped_n(self) -> int:
        """Messages that the disk or the recorder was too slow for."""
        return self._reported_n + self.lost_n

    def on_report(self, dropped_n: int, fault: str | None) -> None:
        """The recorder has lost messages, or cannot go on."""
        self._reported_n, self.fault = dropped_n, fault

    def trouble(self) -> str:
        """Empty, or why the recording has gaps or has ended: for `BoardMonitor`, from its thread."""
        if self.put is None:
            return self._ended
        if self.fault is not None:
            return f"recording: {self.fault}"
        now_s = time.monotonic()
        self._ended = ""
        if self.dropped_n != self._noted_n:
            self._noted_n, self._slow_until_s = self.dropped_n, now_s + PARAMS.patience_s
        return "recording: the disk is too slow" if now_s < self._slow_until_s else ""

    def _note(self, code: FaultCode, active: bool, message: str) -> None:
        put, (level, what) = self.put, ("warning", "on") if active else ("info", "off")
        if put is not None:
            put("event", level, f"{code.name} {what}: {message}")
