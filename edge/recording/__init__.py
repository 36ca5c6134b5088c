"""Recordings: camera images, results of the stages, samples sent to the bus; one MCAP file.

    with Recorder("press.mcap", tip={"serial": "T-0042"}) as recorder:
        for frame in source:
            recorder.frame(frame)

    for frame in RecordingSource("press.mcap"):
        ...

- The file is plain MCAP with Foxglove's schemas, so that Foxglove, Lichtblick and PlotJuggler open it
  without a plug-in, and the `mcap` library's own reader validates it.
- The writer never blocks the loop and never raises into it: a bounded queue, its own thread, and counts of
  dropped messages.
- A truncated file can be read up to its last complete chunk.

Names are imported when they are first used: a finger that neither records nor replays needs none of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from edge.recording.messages import cloud_to_array
    from edge.recording.reader import (
        RecordingSource,
        open_recording,
        read_attachments,
        read_messages,
        read_metadata,
    )
    from edge.recording.topics import TOPICS
    from edge.recording.writer import Recorder

__all__ = [
    "TOPICS",
    "Recorder",
    "RecordingSource",
    "cloud_to_array",
    "open_recording",
    "read_attachments",
    "read_messages",
    "read_metadata",
]

_MODULE_OF = {
    "TOPICS": "topics",
    "Recorder": "writer",
    "RecordingSource": "reader",
    "cloud_to_array": "messages",
    "open_recording": "reader",
    "read_attachments": "reader",
    "read_messages": "reader",
    "read_metadata": "reader",
}

if not TYPE_CHECKING:  # or a type checker would take any name for one of ours

    def __getattr__(name: str) -> object:
        """A public name."""
        if name not in _MODULE_OF:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(import_module(f"edge.recording.{_MODULE_OF[name]}"), name)
        return value
