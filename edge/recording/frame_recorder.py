"""What a recording holds of each turn of the loop: the image, what was made of it, what the bus carried."""

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
    """A recorder as the loop sees it (`session.Recording`), in the process that it is used in."""

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
        """Record a frame, with a result or without. References only: the recorder's thread does the rest."""
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
        # As the wire has it, rounded and saturated: what a recording says is what a host was told.
        payload = partial(pack_state, state, state.sample)
        recorder.sample(frame, lambda: asdict(unpack_state(payload())), payload)

    def event(self, level: str, text: str) -> None:
        """Record a line of the log."""
        self.recorder.event(level, text)
