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
"""

from __future__ import annotations

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
