"""The recording of a running loop, if there is one: its failures end the recording, not the loop."""

import logging
import time
from typing import Protocol

from edge.faults.registry import FaultRegistry
from edge.params import PARAMS
from edge.types import Frame, Result
from hostlink.wire import FaultCode, State

log = logging.getLogger(__name__)


class Recording(Protocol):
    """A recorder as the loop sees it. Calls must return at once.

    fault      why nothing is recorded any more
    dropped_n  messages that were lost, because the disk is too slow
    """

    @property
    def fault(self) -> str | None: ...

    @property
    def dropped_n(self) -> int: ...

    def take(self, frame: Frame, result: Result | None, state: State) -> None: ...

    def event(self, level: str, text: str) -> None: ...


class RecordingSession:
    """Passes each turn of the loop to the recorder, and keeps its state.

    recorder  None: nothing is recorded. Changed between two frames only, by the loop
    """

    def __init__(self, registry: FaultRegistry) -> None:
        self.recorder: Recording | None = None
        self._registry = registry
        self._ended = ""  # why the last recording ended
        self._dropped_n = 0
        self._slow_until_s = 0.0
        registry.listeners.append(self._note)

    def take(self, frame: Frame, result: Result | None, state: State) -> None:
        if self.recorder is None:
            return
        try:
            self.recorder.take(frame, result, state)
        except Exception as error:
            log.exception("recording ends here")
            self.recorder = None
            self._ended, self._dropped_n, self._slow_until_s = f"recording: {error}", 0, 0.0
            self._registry.report(FaultCode.DISK_FULL, True, self._ended)

    def trouble(self) -> str:
        """Empty, or why the recording has gaps or has ended: for `BoardMonitor`, from its thread."""
        recorder = self.recorder
        if recorder is None:
            return self._ended
        if recorder.fault is not None:
            return f"recording: {recorder.fault}"
        now_s = time.monotonic()
        self._ended = ""
        if recorder.dropped_n != self._dropped_n:
            self._dropped_n, self._slow_until_s = recorder.dropped_n, now_s + PARAMS.patience_s
        return "recording: the disk is too slow" if now_s < self._slow_until_s else ""

    def _note(self, code: FaultCode, active: bool, message: str) -> None:
        """Record that a fault appeared or cleared."""
        recorder = self.recorder
        if recorder is not None:
            recorder.event(
                "warning" if active else "info", f"{code.name} {'on' if active else 'off'}: {message}"
            )
