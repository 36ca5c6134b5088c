"""An MCAP file that grows by whole chunks: what the kernel has been given survives a kill.

A power cut may lose more: an fsync for each chunk would stall an SD card; the file is synced when it is
closed.
"""

import os
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from edge.errors import SinkError
from edge.recording.topics import Topic, proto, schema_of

Compression = Literal["none", "lz4", "zstd"]


@dataclass(frozen=True, slots=True)
class RecordingParams:
    """Parameters by name; evidence in docs/tuning.md, "Recording"."""

    chunk_age_s: float = 0.5  # a chunk of the file is closed at this age, or full: a kill costs so much
    item_bytes: int = 512  # memory of a queued message without its arrays, roughly


PARAMS = RecordingParams()


class McapWriter:
    """One open file; used by one thread. Raises SinkError: it exists already, or cannot be created."""

    def __init__(
        self, path: Path, compression: Compression, metadata: Mapping[str, str], overwrite: bool
    ) -> None:
        try:
            from mcap.writer import CompressionType, Writer
        except ImportError as error:
            raise SinkError(f"recording: {error}; install voronoi-touch[edge] or -e .[edge]") from error
        proto("RawImage")
        self.written_n: Counter[str] = Counter()  # messages by topic, in chunks that are closed or open
        try:
            self._file: Any = path.open("wb" if overwrite else "xb")
        except FileExistsError as error:
            raise SinkError(f"recording: {path} exists; give another name") from error
        except OSError as error:
            advice = "give a folder that can be written"
            raise SinkError(f"recording: cannot write {path}: {error.strerror}; {advice}") from error
        self._writer: Any = Writer(self._file, compression=CompressionType[compression.upper()])
        self._channels: dict[str, int] = {}
        self._chunk_open, self._chunk_since_s = False, 0.0
        self._writer.start(profile="", library="voronoi-touch")
        self._writer.add_metadata("voronoi_touch", dict(metadata))
        try:
            self._file.flush()
        except OSError as error:
            with suppress(OSError):  # closing writes the same bytes again
                self._file.close()
            raise SinkError(f"recording: cannot write {path}: {error.strerror}; free some space") from error

    def add(self, topic: Topic, log_ns: int, publish_ns: int, sequence: int, data: bytes) -> None:
        """Append a message. Raises OSError."""
        if topic.name not in self._channels:
            message_encoding, schema_encoding, schema = schema_of(topic)
            schema_id = self._writer.register_schema(topic.schema, schema_encoding, schema)
            channel = self._writer.register_channel(topic.name, message_encoding, schema_id)
            self._channels[topic.name] = channel
        if not self._chunk_open:
            self._chunk_open, self._chunk_since_s = True, time.monotonic()
        self._writer.add_message(self._channels[topic.name], log_ns, data, publish_ns, sequence)
        self.written_n[topic.name] += 1

    def add_attachment(self, now_ns: int, name: str, data: bytes, media_type: str) -> None:
        """A file inside of the recording. Raises OSError."""
        self.end_chunk()
        self._writer.add_attachment(now_ns, now_ns, name, media_type, data)
        self._file.flush()

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Key-value pairs. Raises OSError."""
        self.end_chunk()
        self._writer.add_metadata(name, dict(values))
        self._file.flush()

    @property
    def chunk_due_s(self) -> float | None:
        """Time until the open chunk is to be closed, s; None: none is open."""
        if not self._chunk_open:
            return None
        return max(0.0, self._chunk_since_s + PARAMS.chunk_age_s - time.monotonic())

    def end_chunk(self) -> None:
        """Close the chunk and hand it to the kernel: it then survives a kill. Raises OSError."""
        self._writer.flush()
        self._chunk_open = False

    def finish(self) -> None:
        """Write the last chunk and the index, and sync the file to the disk. Raises OSError."""
        self.end_chunk()
        self._writer.finish()
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Raises OSError: the buffered tail did not fit."""
        self._file.close()
