"""The recorder in the loop's process (`edge.recording.session.Recording`): sends everything to the worker."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from edge.worker.messages import Event, RecordingReport, Take

if TYPE_CHECKING:
    from edge.pipeline import Result
    from edge.types import Frame
    from hostlink.wire import State


class RecordingFeed:
    """Sends each turn of the loop to the recorder, and keeps its state.

    put          sends a message to the worker; False: the memory is full
    on_recorded  called with each turn that was sent: the worker has its image and result
    report       the worker's last report on the recording
    """

    def __init__(
        self, put: Callable[[Any], bool], on_recorded: Callable[[Frame, Result | None], None]
    ) -> None:
        self._put = put
        self._on_recorded = on_recorded
        self.report = RecordingReport()
        self.failure: str | None = None  # the worker itself has failed
        self._lost_n = self._lost_reported_n = 0

    def begin(self) -> None:
        """Begin another recording."""
        self.report = RecordingReport()
        self.failure = None
        self._lost_n = self._lost_reported_n = 0

    def take(self, frame: Frame, result: Result | None, state: State) -> None:
        """Record a turn of the loop."""
        lost_n = self.unreported_n
        if not self._put(Take(frame, result, state, lost_n)):
            self._lost_n += 1
            return
        self._lost_reported_n += lost_n
        self._on_recorded(frame, result)

    def event(self, level: str, text: str) -> None:
        """Record a line of the log; from any thread."""
        self._put(Event(level, text))

    @property
    def unreported_n(self) -> int:
        """Turns that were lost before the worker, and not reported to it yet."""
        return self._lost_n - self._lost_reported_n

    @property
    def lost_n(self) -> int:
        """Turns that were lost before the worker."""
        return self._lost_n

    @property
    def fault(self) -> str | None:
        """Why recording has stopped."""
        return self.failure or self.report.fault

    @property
    def dropped_n(self) -> int:
        """Messages that the disk or the worker was too slow for."""
        return self.report.dropped_n + self.unreported_n
