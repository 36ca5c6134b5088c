"""What is recorded in each turn of the loop: the image, its results, the sample sent to the bus."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from pathlib import Path

from edge.cells import cell_polygons
from edge.pipeline import Result
from edge.recording import Recorder
from edge.types import Frame
from edge.view.palette import cell_rgba
from hostlink.wire import State, pack_state, unpack_state

__all__ = ["FrameRecorder"]


class FrameRecorder:
    """A recorder in the loop's own process; implements `session.Recording`."""

    def __init__(self, recorder: Recorder) -> None:
        self.recorder = recorder

    @property
    def path(self) -> Path:
        return self.recorder.path

    @property
    def fault(self) -> str | None:
        return self.recorder.fault

    @property
    def dropped_n(self) -> int:
        return self.recorder.dropped_n

    def take(self, frame: Frame, result: Result | None, state: State) -> None:
        """Record a frame, with or without a result. Queues references; the recorder's thread encodes them."""
        recorder = self.recorder
        recorder.frame(frame)
        if result is not None:
            cells, features = result.cells, result.features
            recorder.pins(frame, result.tracks, features)
            if cells is not None and features is not None:
                recorder.cells(
                    frame, cells, lambda: cell_polygons(cells), lambda: cell_rgba(features.area_change)
                )
                recorder.features(frame, features)
            recorder.reading(frame, result.reading)
        # Rounded and saturated as on the wire: a recording holds what the host received.
        payload = partial(pack_state, state, state.sample)
        recorder.sample(frame, lambda: asdict(unpack_state(payload())), payload)

    def event(self, level: str, text: str) -> None:
        """Record a line of the log."""
        self.recorder.event(level, text)
