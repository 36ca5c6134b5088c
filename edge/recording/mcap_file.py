"""The records of an MCAP file, which may be damaged or malicious.

It is read chunk by chunk; damage is counted in `faults`, and reading goes on. Memory is bounded before it is
allocated: no length may point beyond the end of the file (`_Bounded`), no chunk unpacks to more than
`UNPACKED_MAX`, its records are read one by one, and few wait for earlier ones.
"""

import io
import struct
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from heapq import heappop, heappush
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from edge.errors import SourceError
from edge.limits import IMAGE_PIXELS
from edge.recording.mcap_writer import PARAMS
from hostlink.input_file import open_input
from hostlink.mcap_chunk import UNPACKED_MAX, unpack_chunk


class RawMessage(NamedTuple):
    """One message as stored."""

    topic: str
    schema: str
    encoding: str
    log_ns: int
    sequence: int
    data: bytes


def damage(*more: type[Exception]) -> tuple[type[Exception], ...]:
    """The errors of the mcap library and its decompressors on damaged bytes, and `more`."""
    from google.protobuf.message import DecodeError
    from mcap.exceptions import McapError
    from zstandard import ZstdError

    # ValueError: CRC, UTF-8, lengths; RuntimeError: lz4, deep JSON; KeyError, IndexError: opcodes
    known = (ValueError, RuntimeError, KeyError, IndexError, MemoryError, OverflowError, struct.error)
    return (McapError, DecodeError, ZstdError, *known, *more)


class _Bounded:
    """A file that raises ValueError where more is read than it has: no damaged length allocates memory."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.size = file.seek(0, io.SEEK_END)
        file.seek(0)

    def read(self, n_bytes: int = -1) -> bytes:
        left = self.size - self._file.tell()
        if left and n_bytes > left:
            raise ValueError(f"a record of {n_bytes} bytes, {left} are left")
        return self._file.read(n_bytes)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        if whence == io.SEEK_SET and not 0 <= offset <= self.size:
            raise ValueError(f"offset {offset} lies outside of the file")
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def records(self) -> Iterator[Any]:
        """Records from here to the end; chunks are not unpacked."""
        from mcap.exceptions import EndOfFile
        from mcap.stream_reader import StreamReader

        stream: Any = self
        reader = StreamReader(stream, skip_magic=True, emit_chunks=True, record_size_limit=UNPACKED_MAX)
        try:
            yield from reader.records
        except EndOfFile:
            if self.tell() < self.size:
                raise

    def summary(self) -> Any:
        """The file's index; None: it has none. Raises one of `damage`."""
        from mcap.reader import SeekingReader

        stream: Any = self
        return SeekingReader(stream, record_size_limit=UNPACKED_MAX).get_summary()


@contextmanager
def _opened(path: Path) -> Iterator[_Bounded]:
    """The file, opened after its magic bytes. Raises SourceError: does not exist, not MCAP."""
    try:
        file = open_input(path)
    except OSError as error:
        raise SourceError(f"recording {path}: {error.strerror}; give an existing MCAP file") from error
    with file:
        if file.read(8) != b"\x89MCAP0\r\n":
            raise SourceError(f"recording {path}: not an MCAP file; give one that `edge run --record` wrote")
        yield _Bounded(file)


def _chunks(file: _Bounded, faults: Counter[str]) -> Iterator[Any]:
    """Schemas, channels and chunks in order of time if there is an index, else all records as in the file."""
    from mcap.records import Chunk

    broken = damage(OSError)
    summary = None
    try:
        summary = file.summary()
    except broken:
        faults["truncated"] += 1
    if summary is not None and summary.chunk_indexes:
        yield from summary.schemas.values()
        yield from summary.channels.values()
        indexes = {index.chunk_start_offset: index for index in summary.chunk_indexes}
        for at, _ in sorted(indexes.items(), key=lambda item: (item[1].message_start_time, item[0])):
            try:
                yield _record_at(file, at, 0, Chunk)
            except broken:
                faults["damaged chunk"] += 1
        return
    file.seek(8)
    try:
        yield from file.records()
    except broken:
        faults["truncated"] = 1


def _record_at(file: _Bounded, offset: int, end: int, kind: type[Any]) -> Any:
    """A record by the index. Raises one of `damage`: not this kind, or before the end of the one before."""
    if offset < end:  # one record, listed a thousand times, would be held as often
        raise ValueError("records overlap")
    file.seek(offset)
    record = next(file.records(), None)
    if not isinstance(record, kind):
        raise ValueError("another record than the index says")
    return record


def _unpacked(chunk: Any, faults: Counter[str]) -> Iterator[Any]:
    """The records in a chunk, one by one, up to its damage, which is counted; none where the CRC is wrong."""
    try:
        yield from _Bounded(io.BytesIO(unpack_chunk(chunk).data)).records()
    except damage():
        faults["damaged chunk"] += 1


def raw_messages(path: Path, faults: Counter[str]) -> Iterator[RawMessage]:
    """All messages in order of time; damaged ones are counted.

    As many bytes wait for earlier messages as the largest image has; a message that stands still later in the
    file comes when it is met.
    Raises  SourceError: does not exist, not MCAP
    """
    held: list[tuple[int, int, RawMessage]] = []  # a heap
    held_bytes = 0
    for n, message in enumerate(_messages(path, faults)):
        heappush(held, (message.log_ns, n, message))
        held_bytes += len(message.data) + PARAMS.item_bytes
        while held_bytes > IMAGE_PIXELS and len(held) > 1:
            first = heappop(held)[2]
            held_bytes -= len(first.data) + PARAMS.item_bytes
            yield first
    while held:
        yield heappop(held)[2]


def _messages(path: Path, faults: Counter[str]) -> Iterator[RawMessage]:
    """All messages as the chunks have them."""
    from mcap.records import Channel, Chunk, Message, Schema

    schemas: dict[int, str] = {}
    channels: dict[int, Channel] = {}
    with _opened(path) as file:
        for record in _chunks(file, faults):
            for item in _unpacked(record, faults) if isinstance(record, Chunk) else [record]:
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
                    encoding = channel.message_encoding
                    yield RawMessage(channel.topic, name, encoding, item.log_time, item.sequence, item.data)


def image_count(path: Path, topic: str | None) -> int:
    """Messages on a topic, from the file's index; 0: it has none, as after a kill."""
    with _opened(path) as file:
        try:
            summary = file.summary()
            if summary is None or summary.statistics is None:
                return 0
            counts = summary.statistics.channel_message_counts
            return sum(n for id, n in counts.items() if summary.channels[id].topic == topic)
        except damage(OSError):
            return 0


def read_metadata(path: str | Path) -> dict[str, dict[str, str]]:
    """Key-value pairs by the record's name; `voronoi_touch` is the recorder's own. Raises SourceError."""
    from mcap.records import Metadata

    broken = damage(OSError)
    found: list[Metadata] = []
    with _opened(Path(path)) as file:
        try:
            summary = file.summary()
            if summary is not None:
                end = 0
                for index in sorted(summary.metadata_indexes, key=lambda index: index.offset):
                    found.append(_record_at(file, index.offset, end, Metadata))
                    end = file.tell()
                return {record.name: dict(record.metadata) for record in found}
        except broken:
            found.clear()
        file.seek(8)
        with suppress(*broken):  # truncated: what was read before remains valid
            found.extend(record for record in file.records() if isinstance(record, Metadata))
    return {record.name: dict(record.metadata) for record in found}
