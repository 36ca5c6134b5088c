"""Reads recordings back: ours, and any MCAP file with a Foxglove image topic.

- Chunk by chunk, never the whole file in memory. Where the file has its index, damage to one chunk
  costs that chunk alone; where it has none (killed, truncated), everything up to the last complete
  chunk comes out.
- Damage in the middle is counted in `faults` and carried on; only a file that gives no image at all
  is an error.
- Frames come out with `Clock.RECORDED`: their time may be compared with one another, not with now.
  `recorded_clock` says which clock it was.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import IO, Any, Literal, NamedTuple, Protocol

import msgspec
import numpy as np

from edge.errors import SourceError
from edge.recording.images import decode_image
from edge.recording.topics import TOPICS, proto
from edge.types import Clock, Frame, Image

__all__ = ["RecordingSource", "open_recording", "read_attachments", "read_messages", "read_metadata"]

_RATE_FRAMES = 16  # intervals that the rate is taken from where the file does not name it
_LIMIT = 1 << 30  # bytes of one record; ours stay near 1 MiB, and a damaged length must not eat the memory
_IMAGE_SCHEMAS = ("foxglove.RawImage", "foxglove.CompressedImage")


class _Raw(NamedTuple):
    """One message as stored."""

    topic: str
    schema: str
    encoding: str
    log_ns: int
    sequence: int
    data: bytes


def _damage(*more: type[Exception]) -> tuple[type[Exception], ...]:
    """What the mcap library and its decompressors raise on damaged bytes, and `more`."""
    from google.protobuf.message import DecodeError
    from mcap.exceptions import McapError
    from zstandard import ZstdError

    # ValueError: CRC, UTF-8; RuntimeError: lz4; KeyError, IndexError: opcodes; MemoryError: lengths
    return (
        McapError,
        DecodeError,
        ZstdError,
        struct.error,
        ValueError,
        RuntimeError,
        KeyError,
        IndexError,
        MemoryError,
        OverflowError,
        *more,
    )


def _open(path: Path) -> IO[bytes]:
    try:
        file = path.open("rb")
    except OSError as error:
        raise SourceError(f"recording {path}: {error.strerror}; give an existing MCAP file") from error
    if file.read(8) != b"\x89MCAP0\r\n":
        file.close()
        raise SourceError(f"recording {path}: not an MCAP file; give a file that `record` wrote")
    file.seek(0)
    return file


def _chunks(file: IO[bytes], faults: Counter[str]) -> Iterator[Any]:
    """Schema, channel and chunk records; by the index where there is one, else in the file's order."""
    from mcap.data_stream import ReadDataStream
    from mcap.reader import SeekingReader
    from mcap.records import Channel, Chunk, Message, Schema
    from mcap.stream_reader import StreamReader

    broken = _damage(OSError)
    summary = None
    try:
        summary = SeekingReader(file, record_size_limit=_LIMIT).get_summary()
    except broken:
        faults["truncated"] += 1
    if summary is not None and summary.chunk_indexes:
        yield from summary.schemas.values()
        yield from summary.channels.values()
        for index in sorted(summary.chunk_indexes, key=lambda index: index.chunk_start_offset):
            file.seek(index.chunk_start_offset + 9)
            try:
                chunk = Chunk.read(ReadDataStream(file))
            except broken:
                faults["damaged chunk"] += 1
            else:
                yield chunk
        return
    file.seek(0)
    try:
        for record in StreamReader(file, emit_chunks=True, record_size_limit=_LIMIT).records:
            if isinstance(record, Schema | Channel | Chunk | Message):
                yield record
    except broken:
        faults["truncated"] = 1


def _raw_messages(path: Path, faults: Counter[str]) -> Iterator[_Raw]:
    """All messages in the file's order; what is damaged is counted."""
    from mcap.records import Channel, Chunk, Message, Schema
    from mcap.stream_reader import breakup_chunk

    broken = _damage()
    schemas: dict[int, str] = {}
    channels: dict[int, Channel] = {}
    with _open(path) as file:
        for record in _chunks(file, faults):
            try:
                records = breakup_chunk(record, validate_crc=True) if isinstance(record, Chunk) else [record]
            except broken:
                faults["damaged chunk"] += 1
                continue
            for item in records:
                if isinstance(item, Schema):
                    schemas[item.id] = item.name
                elif isinstance(item, Channel):
                    channels[item.id] = item
                elif isinstance(item, Message):
                    channel = channels.get(item.channel_id)
                    if channel is None:
                        faults["message without channel"] += 1
                        continue
                    name = schemas.get(channel.schema_id, "")
                    yield _Raw(
                        channel.topic, name, channel.message_encoding, item.log_time, item.sequence, item.data
                    )


def read_messages(path: str | Path, topics: Sequence[str] | None = None) -> Iterator[tuple[str, int, Any]]:
    """(topic, log time ns, message) in the file's order: JSON as dict, Foxglove as protobuf object.

    Clouds of pins and cells become arrays through `cloud_to_array`.
    Raises SourceError: not there, not MCAP
    """
    faults: Counter[str] = Counter()
    for raw in _raw_messages(Path(path), faults):
        if topics is not None and raw.topic not in topics:
            continue
        if raw.encoding == "json":
            yield raw.topic, raw.log_ns, msgspec.json.decode(raw.data)
        elif raw.encoding == "protobuf" and raw.schema.startswith("foxglove."):
            yield (
                raw.topic,
                raw.log_ns,
                proto(raw.schema.removeprefix("foxglove.")).FromString(raw.data),
            )


def read_attachments(path: str | Path) -> dict[str, bytes]:
    """Attached files by name; the last one of a name wins."""
    return {record.name: record.data for record in _loose(Path(path), "attachments")}


def read_metadata(path: str | Path) -> dict[str, dict[str, str]]:
    """Key-value pairs by the record's name; `voronoi_touch` is the recorder's own."""
    return {record.name: dict(record.metadata) for record in _loose(Path(path), "metadata")}


def _loose(path: Path, kind: Literal["attachments", "metadata"]) -> list[Any]:
    """Records of one kind that stand outside of the chunks: by the index, else by reading on."""
    from mcap.reader import SeekingReader
    from mcap.records import Attachment, Metadata
    from mcap.stream_reader import StreamReader

    broken = _damage(OSError)
    found: list[Any] = []
    with _open(path) as file:
        try:
            reader = SeekingReader(file, record_size_limit=_LIMIT)
            return list(reader.iter_attachments() if kind == "attachments" else reader.iter_metadata())
        except broken:
            file.seek(0)
        try:
            for record in StreamReader(file, emit_chunks=True, record_size_limit=_LIMIT).records:
                if isinstance(record, Attachment if kind == "attachments" else Metadata):
                    found.append(record)
        except broken:
            return found  # truncated: what came before it stands
    return found


class RecordingSource:
    """FrameSource over an MCAP file. Iterating again starts again.

    topic   image topic; None: /camera/image, else the first one with images
    Raises  SourceError: not there, not MCAP, no images, another size in the middle is a fault instead
    """

    live = False

    def __init__(self, path: str | Path, topic: str | None = None) -> None:
        self.path = Path(path)
        self.name = f"recording {self.path}"
        self.dropped_n = 0
        self.faults: Counter[str] = Counter()
        self._closed = False
        self.metadata = read_metadata(self.path)
        self._topic = topic
        faults: Counter[str] = Counter()
        first = list(islice(self._frames(faults), 1))
        if not first and (faults["truncated"] or faults["damaged chunk"]):
            how = "cut off" if faults["truncated"] else "damaged"
            raise SourceError(f"{self.name}: {how} before its first whole image; copy or record it again")
        if not first:
            wanted = f"on topic {topic}" if topic else "on any topic"
            raise SourceError(f"{self.name}: no complete image {wanted}; record again or name another topic")
        height, width = first[0][0].image.shape
        self.size_px = (width, height)
        self.recorded_clock = first[0][1]
        self.rate_hz = self._rate_hz()

    def _rate_hz(self) -> float:
        """As the recorder was told, else the median of the first intervals."""
        try:
            told = float(self.metadata.get("voronoi_touch", {}).get("rate_hz", "0"))
        except ValueError:
            told = 0.0
        if told > 0:
            return told
        images = (raw.log_ns for raw in _raw_messages(self.path, Counter()) if self._is_image(raw))
        steps = np.diff(list(islice(images, _RATE_FRAMES + 1)))
        return 1e9 / float(np.median(steps)) if len(steps) and np.median(steps) > 0 else 0.0

    def _is_image(self, raw: _Raw) -> bool:
        if raw.schema not in _IMAGE_SCHEMAS:
            return False
        self._topic = self._topic or raw.topic
        return raw.topic == self._topic

    def _frames(self, faults: Counter[str]) -> Iterator[tuple[Frame, Clock]]:
        about: dict[str, Any] = {}
        about_ns = truth_ns = -1
        truth: dict[str, Any] | None = None
        n = 0
        broken = _damage(TypeError, msgspec.DecodeError)
        for raw in _raw_messages(self.path, faults):
            try:
                if raw.topic == TOPICS["frame"].name:
                    about, about_ns = msgspec.json.decode(raw.data, type=dict), raw.log_ns
                elif raw.topic == TOPICS["truth"].name:
                    truth, truth_ns = msgspec.json.decode(raw.data, type=dict).get("truth"), raw.log_ns
                elif self._is_image(raw):
                    image = decode_image(raw.schema, raw.data)
                    known = about if about_ns == raw.log_ns else {}
                    frame, clock = _frame(image, raw, known, n, truth if truth_ns == raw.log_ns else None)
                    n += 1
                    yield frame, clock
            except broken:
                faults["damaged message"] += 1

    def __iter__(self) -> Iterator[Frame]:
        faults: Counter[str] = Counter()
        self.faults = faults
        for frame, _ in self._frames(faults):
            if self._closed:
                return
            if frame.image.shape != (self.size_px[1], self.size_px[0]):
                faults["other image size"] += 1
                continue
            yield frame

    @property
    def truncated(self) -> bool:
        """The file ends in the middle; known once it has been read to its end."""
        return self.faults["truncated"] > 0

    @property
    def frames_n(self) -> int:
        """Images that the file's index counts; 0: it has none, as after a kill."""
        from mcap.reader import SeekingReader

        with _open(self.path) as file:
            try:
                summary = SeekingReader(file, record_size_limit=_LIMIT).get_summary()
            except _damage(OSError):
                return 0
        if summary is None or summary.statistics is None:
            return 0
        counts = summary.statistics.channel_message_counts
        return sum(n for id, n in counts.items() if summary.channels[id].topic == self._topic)

    def attachments(self) -> dict[str, bytes]:
        return read_attachments(self.path)

    def close(self) -> None:
        self._closed = True


def _frame(
    image: Image, raw: _Raw, about: dict[str, Any], n: int, truth: dict[str, Any] | None
) -> tuple[Frame, Clock]:
    """A frame from another tool's file has no `about`: log time and a running number stand in."""
    bits = int(about.get("bits", 16 if image.dtype == np.uint16 else 8))
    frame = Frame(
        image=image,
        capture_ns=int(about.get("capture_ns", raw.log_ns)),
        sequence=int(about.get("sequence", raw.sequence or n)),
        clock=Clock.RECORDED,
        bits=bits,
        truth=truth,
    )
    return frame, Clock(about.get("clock", Clock.RECORDED))


class _Options(Protocol):
    """What `open_recording` wants of the settings of a source."""

    @property
    def extra(self) -> Mapping[str, str]: ...


def open_recording(where: str, options: _Options) -> RecordingSource:
    """The scheme `mcap:FILE?topic=...`, and files that end in .mcap. Raises SourceError."""
    for key in options.extra:
        if key != "topic":
            raise SourceError(f"recording {where}: unknown key {key!r}; known: topic")
    return RecordingSource(where, options.extra.get("topic"))
