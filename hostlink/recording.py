"""Recordings of the link: CAN logs of `candump` and Vector tools, and bytes of a serial line.

    .log     candump -L text      exact: identifier, FD flags, data, channel, direction, time
    .blf     Vector binary log    exact but for channel names, which become numbers
    .serial  bytes as received    text line "voronoi-touch serial 1" (or "... 2 node 3", if the number of the
                                  finger on the line is not 1), then records of
                                  8 bytes time (us, little-endian), 4 bytes length, the bytes

Read only:

    .log     all else that `candump` prints: plain, with any -t
    .asc     ASCII log of Vector's tools
    .mcap    samples that `edge run --record` and `hostlink bridge --record` wrote

Rules
- "Exact" is to the microsecond, the resolution of `.log`; times are rounded to it when written.
- Time never runs backwards in a log: a message stamped earlier than the previous one gets that one's time (as
  candump's format does by itself; here for both formats), and `LogWriter.stepped_n` counts it.
- Formats that would lose time or data are refused, with the reason. (6,000 FD frames each, python-can 4.6)
- A line that is no frame costs that line; a warning counts them. Other damage costs what follows it, and then
  LogError names the place. A record cut off by a loss of power ends a `.serial` file.
- Fingers with one number on several channels of a log are several fingers: UsageError lists the channels, of
  which one must be chosen.
"""

from __future__ import annotations

import logging
import re
import struct
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from copy import copy
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, BinaryIO, Final

from hostlink.decoder import SERIAL_NODE, CanDecoder, Event, Sample, SerialDecoder
from hostlink.errors import LogError, UsageError, VersionMismatch
from hostlink.log_formats import (
    HEAD_N,
    Skipped,
    read_asc,
    read_blf,
    read_blf_runs,
    read_candump,
    read_candump_runs,
)
from hostlink.mcap_samples import MCAP_SUFFIX, read_mcap

if TYPE_CHECKING:
    import can

__all__ = [
    "CAN_SUFFIXES",
    "READ_SUFFIXES",
    "SERIAL_SUFFIX",
    "LogWriter",
    "SerialWriter",
    "check_suffix",
    "decode_blocks",
    "decode_recording",
    "decoder_for",
    "read_log",
    "read_serial",
]

log = logging.getLogger(__name__)

CAN_SUFFIXES: Final = (".log", ".blf")  # those that are written
SERIAL_SUFFIX: Final = ".serial"
Formats = dict[str, Callable[[Path, Skipped], Iterator[Any]]]
_FORMATS: Final[Formats] = {".log": read_candump, ".blf": read_blf, ".asc": read_asc}
_RUNS: Final[Formats] = _FORMATS | {".log": read_candump_runs, ".blf": read_blf_runs}
READ_SUFFIXES: Final = (*CAN_SUFFIXES, SERIAL_SUFFIX, ".asc", MCAP_SUFFIX)

REFUSED: Final = {
    ".asc": "absolute time is lost when other tools read it back",
    ".csv": "FD flags are lost",
    ".db": "rows may be missing right after it was closed",
    ".trc": "it has no CAN FD",
    ".mf4": "it needs asammdf, which nothing else here does",
    ".gz": "a power cut would lose the whole file; compress it when it is finished",
}

_MAGIC: Final = b"voronoi-touch serial 1\n"
_MAGIC_NODE: Final = re.compile(rb"voronoi-touch serial 2 node ([1-9][0-9]{0,2})\n")
_MAGIC_MAX: Final = 40
_RECORD: Final = struct.Struct("<QI")
_RECORD_MAX: Final = 1 << 24  # a larger length is damage, not a chunk of a serial port


def check_suffix(path: Path | str, allowed: tuple[str, ...] = READ_SUFFIXES) -> Path:
    """The path, if its format keeps everything. Raises LogError: it does not, or it is unknown."""
    path = Path(path)
    suffix = path.suffix.lower()
    if path.is_dir():
        raise LogError(f"{path}: is a folder; give a file that ends in {' or '.join(allowed)}")
    if suffix not in allowed:
        reason = REFUSED.get(suffix, "unknown format" if suffix else "no suffix")
        raise LogError(f"{path}: {reason}; use {' or '.join(allowed)}")
    return path


BLF_CHANNELS = 0xFFFF  # a file counts channels from 1, in 16 bits


class LogWriter:
    """Writes CAN messages to a `.log` or `.blf` file; a context manager.

    stepped_n  messages whose time was earlier than that of the one before
    Raises     LogError: format refused, or the file cannot be written
    """

    def __init__(self, path: Path | str) -> None:
        import can

        self.path = check_suffix(path, CAN_SUFFIXES)
        self.written_n = 0
        self.stepped_n = 0
        self._last_s: float | None = None
        self._binary = self.path.suffix.lower() == ".blf"
        try:
            self._writer: Any = (can.BLFWriter if self._binary else can.CanutilsLogWriter)(str(self.path))
        except OSError as error:
            raise LogError(f"{self.path}: cannot be written: {error.strerror}") from None

    def write(self, message: can.Message) -> None:
        """Appends a message. Raises LogError: the file cannot be written (disk full)."""
        from can.util import channel2int

        time_s = round(message.timestamp, 6)
        if self._last_s is not None and time_s < self._last_s:
            time_s = self._last_s
            self.stepped_n += 1
        self._last_s = time_s
        message = _with_time(message, time_s)
        if self._binary:  # .blf has 16 bits for a channel; a name with no small number in it is channel 0
            number = channel2int(message.channel)
            message.channel = number if number is not None and number < BLF_CHANNELS else 0
        try:
            self._writer.on_message_received(message)
        except OSError as error:
            raise LogError(f"{self.path}: cannot be written: {error.strerror}") from error
        self.written_n += 1

    def close(self) -> None:
        """Ends the file. Raises LogError: buffered data cannot be written (disk full)."""
        try:
            self._writer.stop()
        except OSError as error:
            raise LogError(f"{self.path}: cannot be written: {error.strerror}") from error

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _with_time(message: can.Message, time_s: float) -> can.Message:
    """The message with another time; the caller's own is not changed."""
    message = copy(message)
    message.timestamp = time_s
    return message


def read_log(path: Path | str) -> Iterator[can.Message]:
    """The messages of a `.log`, `.blf` or `.asc` file, in order, times in whole microseconds.

    A warning of `logging` counts the lines that were skipped because they are no frames.
    Raises LogError: no such file, no frame in it, format refused, or damaged (after the messages before)
    """
    return _counted(Path(path), _FORMATS)


def _counted(path: Path, formats: Formats) -> Iterator[Any]:
    """Messages, or runs of them, with what `read_log` says of others."""
    skipped, read_n = Skipped(), 0
    for message in _read(path, skipped, formats):
        yield message
        read_n += 1
    if skipped.lines_n and not read_n:
        raise LogError(f"{path}: no line is a frame as candump or Vector's tools write it: {skipped.first}")
    if skipped.lines_n:
        log.warning("%s: skipped lines that are no CAN frames: %d; %s", path, skipped.lines_n, skipped.first)


def _read(path: Path, skipped: Skipped, formats: Formats) -> Iterator[Any]:
    check_suffix(path, tuple(_FORMATS))
    if not path.is_file():
        raise LogError(f"{path}: no such file")
    read_n = 0
    try:
        for message in formats[path.suffix.lower()](path, skipped):
            if isinstance(message, tuple):  # a run
                read_n += len(message[0])
            else:
                message.timestamp = round(message.timestamp, 6)
                read_n += 1
            yield message
    except (ValueError, OSError) as error:
        messages = "message" if read_n == 1 else "messages"
        raise LogError(f"{path}: damaged after {read_n} {messages}: {error}") from None


class SerialWriter:
    """Writes the bytes of a serial line to a `.serial` file; a context manager.

    node    number of the finger on the line
    Raises  LogError: wrong suffix, or the file cannot be written
    """

    def __init__(self, path: Path | str, node: int = SERIAL_NODE) -> None:
        self.path = check_suffix(path, (SERIAL_SUFFIX,))
        try:
            self._file = self.path.open("wb")
            self._file.write(_MAGIC if node == SERIAL_NODE else b"voronoi-touch serial 2 node %d\n" % node)
        except OSError as error:
            raise LogError(f"{self.path}: cannot be written: {error.strerror}") from None

    def write(self, data: bytes, time_s: float) -> None:
        """Appends a chunk that arrived at this time (s, >= 0)."""
        try:
            self._file.write(_RECORD.pack(round(time_s * 1e6), len(data)) + data)
        except OSError as error:
            raise LogError(f"{self.path}: cannot be written: {error.strerror}") from error

    def close(self) -> None:
        """Ends the file. Raises LogError: buffered data cannot be written (disk full)."""
        try:
            self._file.close()
        except OSError as error:
            raise LogError(f"{self.path}: cannot be written: {error.strerror}") from error

    def __enter__(self) -> SerialWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def read_serial(path: Path | str) -> Iterator[tuple[float, bytes]]:
    """The chunks of a `.serial` file: (time s, bytes).

    Raises LogError: no such file, not such a file, or damaged (after the chunks before the damage)
    """
    path = check_suffix(path, (SERIAL_SUFFIX,))
    if not path.is_file():
        raise LogError(f"{path}: no such file")
    with path.open("rb") as file:
        _read_node(path, file)
        while len(head := file.read(_RECORD.size)) == _RECORD.size:
            time_us, size = _RECORD.unpack(head)
            if size > _RECORD_MAX:
                raise LogError(f"{path}: damaged at byte {file.tell() - _RECORD.size}")
            data = file.read(size)
            if len(data) < size:
                return
            yield time_us / 1e6, data


def _read_node(path: Path, file: BinaryIO) -> int:
    """Number of the finger on the line, from the first line of a `.serial` file."""
    line = file.readline(_MAGIC_MAX)
    if line == _MAGIC:
        return SERIAL_NODE
    found = _MAGIC_NODE.fullmatch(line)
    if found is None:
        raise LogError(f"{path}: not a serial recording of this version")
    return int(found[1])


def decoder_for(path: Path | str) -> CanDecoder | SerialDecoder:
    """A new decoder for a recording. Raises LogError: not a recording that can be read."""
    path = check_suffix(path)
    if path.suffix.lower() != SERIAL_SUFFIX:
        return CanDecoder()
    if not path.is_file():
        raise LogError(f"{path}: no such file")
    with path.open("rb") as file:
        return SerialDecoder(_read_node(path, file))


def decode_recording(
    path: Path | str,
    decoder: CanDecoder | SerialDecoder | None = None,
    channel: str | int | None = None,
    finger: int | None = None,
) -> Iterator[Event]:
    """The events in a recording of any of the formats, arrival times as recorded (NaN: the log has none).

    decoder  to use; the caller can then read its statistics. It must fit the kind of recording; `.mcap`
             needs none.
    channel  name or number of the bus in the log whose events are wanted; None: all
    finger   number of the finger whose samples are wanted; None: all
    Raises   LogError; VersionMismatch: recorded from a sensor of another version; TypeError: wrong decoder;
             UsageError: a finger is on several channels, or the log has no such channel
    """
    path = check_suffix(path)
    if path.suffix.lower() == MCAP_SUFFIX:
        if channel is not None:
            raise UsageError(f"{path}: has no channels; leave --channel out")
        yield from _wanted(read_mcap(path), finger)
        return
    is_serial = path.suffix.lower() == SERIAL_SUFFIX
    if decoder is None:
        decoder = decoder_for(path)
    if isinstance(decoder, SerialDecoder) is not is_serial:
        raise TypeError(f"{path}: needs a {'SerialDecoder' if is_serial else 'CanDecoder'}")
    if isinstance(decoder, CanDecoder):
        yield from _decode_log(path, decoder, channel, finger)
        return
    if channel is not None:
        raise UsageError(f"{path}: a serial line has no channels")
    for time_s, data in read_serial(path):
        yield from _wanted(decoder.receive(data, time_s), finger)


def _decode_log(
    path: Path, decoder: CanDecoder, channel: str | int | None, finger: int | None
) -> Iterator[Event]:
    # The buses of a log mostly begin together: the choice is asked for before anything is given.
    if channel is None and _on_several(path, decoder, finger, HEAD_N):
        raise _choose(path, decoder, finger)
    channel_of: dict[int, str] = {}
    channels: dict[str, None] = {}
    for message in read_log(path):
        on = str(message.channel)
        channels[on] = None
        if channel is not None and on != str(channel):
            continue
        for event in _wanted(_receive(decoder, message), finger):
            if isinstance(event, Sample) and channel_of.setdefault(event.finger, on) != on:
                raise _choose(path, decoder, finger)
            yield event
    _check_channel(path, channel, channels)


def decode_blocks(path: Path | str, channel: str | int | None = None) -> Iterator[Event]:
    """The same events, many messages at once, samples bare (see `CanDecoder`): for tables. Needs NumPy.

    Where `decode_recording` gives events before an error, this may not.
    """
    path = check_suffix(path)
    if path.suffix.lower() in (SERIAL_SUFFIX, MCAP_SUFFIX):
        yield from decode_recording(path, channel=channel)
        return
    decoder = CanDecoder(bare=True)
    if channel is None and _on_several(path, decoder, None, HEAD_N):
        raise _choose(path, decoder, None)
    channels: dict[str, None] = {}
    for message in _counted(path, _RUNS):
        is_run = isinstance(message, tuple)
        on = message.channels if is_run else [message.channel]
        channels |= dict.fromkeys(map(str, dict.fromkeys(on)))
        if is_run:
            wanted = None if channel is None else [str(name) == str(channel) for name in on]
            times_s, ids, names, data = message[:4]
            yield from decoder.receive_run(times_s, ids, names, data, wanted)
        elif channel is None or str(message.channel) == str(channel):
            yield from _receive(decoder, message)
        if channel is None and decoder.is_on_several:
            raise _choose(path, decoder, None)
    _check_channel(path, channel, channels)


def _check_channel(path: Path, channel: str | int | None, channels: Iterable[str]) -> None:
    if channel is not None and str(channel) not in channels:
        raise UsageError(f"{path}: no channel {channel}; it has {', '.join(channels) or 'none'}")


def _receive(decoder: CanDecoder, message: can.Message) -> list[Event]:
    if message.is_error_frame or message.is_remote_frame or message.is_extended_id:
        return []
    return decoder.receive(message.arbitration_id, message.data, message.timestamp, message.channel)


def _wanted(events: Iterable[Event], finger: int | None) -> Iterator[Event]:
    return (e for e in events if finger is None or not isinstance(e, Sample) or e.finger == finger)


def _on_several(
    path: Path, like: CanDecoder, finger: int | None, messages_n: int | None
) -> dict[int, list[str]]:
    """The fingers with samples on several channels in so many messages, and these."""
    decoder = CanDecoder(like.ids)
    found: dict[int, dict[str, None]] = {}
    with suppress(LogError):
        for message in islice(_read(path, Skipped(), _FORMATS), messages_n):
            with suppress(VersionMismatch):
                for event in _wanted(_receive(decoder, message), finger):
                    if isinstance(event, Sample):
                        found.setdefault(event.finger, {})[str(message.channel)] = None
    return {number: list(channels) for number, channels in found.items() if len(channels) > 1}


def _choose(path: Path, like: CanDecoder, finger: int | None) -> UsageError:
    """The error where several fingers have one number."""
    several = _on_several(path, like, finger, None)
    channels = ", ".join(sorted({name for names in several.values() for name in names}))
    fingers = ", ".join(map(str, sorted(several)))
    return UsageError(
        f"{path}: finger {fingers} is on several channels: {channels}; "
        "choose one by --channel (channel= in Python)"
    )
