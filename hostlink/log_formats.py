"""Readers of CAN logs, one a format: each gives messages with their time, channel, identifier and data.

    candump  what `candump` prints: with -L, or plain, with any -t and with -x
    asc      ASCII logs of Vector's tools, `log2asc` and python-can
    blf      binary logs of Vector's tools and python-can

Rules
- A line that is no CAN frame costs that line: it is counted in `Skipped`. Damage of a `.blf` file costs what
  follows it: ValueError, after the messages before.
- A length in a file is not trusted: no line, object or container takes more memory than its limit here.
- Times are seconds since 1970 where the log has absolute ones, else since its beginning; NaN: it has none.
  Differences to the line before are recognised and added up.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO, TextIOWrapper
from itertools import chain, islice
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final, TextIO

if TYPE_CHECKING:
    import can

    from hostlink.log_blocks import Run

__all__ = ["HEAD_N", "Skipped", "read_asc", "read_blf", "read_blf_runs", "read_candump", "read_candump_runs"]

RunAt = Callable[[bytes, int, float], "tuple[Run, int] | None"]
HEAD_N: Final = 256  # messages at the beginning of a log that show what its times are
_BLOCK: Final = 1 << 20  # bytes of a log that are read at once
LINE_MAX: Final = 1024  # characters; the longest line, CAN FD with 64 bytes in an .asc, has some 350
FOREIGN_MAX: Final = 64 << 20  # characters; a foreign line as long as that is no text
DATA_MAX: Final = 64  # bytes
CONTAINER_MAX: Final = 32 << 20  # bytes; Vector's tools and python-can write containers of 128 KiB
_PIECE: Final = 1024  # bytes unpacked at once: what comes before damage is kept
_RELATIVE_MAX_S: Final = 1e8  # three years; a larger time counts from 1970

_TEXT: Final = re.ASCII | re.IGNORECASE | re.VERBOSE
_CANDUMP: Final = re.compile(
    r"""
    \s*(?:\((?P<time>\d{1,12}(?:\.\d{1,9})?)\)\s*|\((?P<date>\d{4}-\d\d-\d\d\ \d\d:\d\d:\d\d\.\d{6,9})\)\s*)?
    (?P<channel>[^\s()\#]{1,64})\s+
    (?:(?P<way>[RT])X\s+(?P<switch>[-B])\s+(?P<passive>[-E])\s+)?
    (?P<id>[\dA-F]{8}|[\dA-F]{3})
    (?: \#(?: R(?P<dlc>\d?) | \#(?P<flags>[\dA-F])(?P<fd>(?:[\dA-F]{2}){0,64})
             | (?P<classic>(?:[\dA-F]{2}){0,8}) )
        (?:_[9A-F])? (?:\s+(?P<end>[RT]))?
    |   \s+\[(?P<size>\d{1,2})\] (?:(?P<remote>\s+remote\ request) | (?P<plain>(?:\s+[\dA-F]{2}){0,64}))
        (?:\s+(?:ERRORFRAME|'.{0,8}'))?
    )\s*""",
    _TEXT,
)
_CANDUMP_TIME: Final = re.compile(r"\s*\((\d{1,12}(?:\.\d{1,9})?)\)", re.ASCII)
_ERROR_FLAG: Final = 1 << 29  # linux/can.h
_ID_MASK: Final = _ERROR_FLAG - 1
_BRS, _ESI = 1, 2

_ASC: Final = re.compile(
    r"""
    (?P<time>\d{1,12}\.\d{1,9})\s+
    (?: (?P<channel>\d{1,5})\s+
        (?: (?P<error>ErrorFrame)\b.* | (?P<id>[\dA-F]{1,10})(?P<ext>x?)\s+(?P<way>[RT]x)(?:Rq)?\s+
            (?: r\b.* | d\s+(?P<dlc>[\dA-F]{1,2})(?P<data>(?:\s+[\dA-F]{1,3})*)(?:\s+[A-Z].*)? ) )
    |   CANFD\s+(?P<fd_channel>\d{1,5})\s+(?P<fd_way>[RT]x)\s+
        (?: (?P<fd_error>ErrorFrame)\b.* | (?P<fd_id>[\dA-F]{1,10})(?P<fd_ext>x?)\s+(?:[^\W\d]\S*\s+)?
            (?P<switch>[01])\s+(?P<passive>[01])\s+[\dA-F]{1,2}\s+(?P<size>\d{1,2})
            (?P<fd>(?:\s+[\dA-F]+)*)(?:\s.*)? )
    )""",
    _TEXT,
)
_ASC_OTHER: Final = re.compile(  # lines of the format that are no frames
    r"//|date\s|base\s|(no\s+)?internal\s|(begin|end)\s+triggerblock|"
    r"\d+\.\d+\s+(start of|log trigger|\d+\s+statistic:|CAN\s+\d+\s+status:)",
    re.IGNORECASE,
)
_ASC_BEGIN: Final = re.compile(
    r"(?:date|begin\s+triggerblock)\s+\S+\s+(?P<month>\S+)\s+(?P<day>\d+)\s+(?P<hour>\d+):(?P<minute>\d+):"
    r"(?P<second>\d+(?:\.\d{1,9})?)\s*(?P<half>[ap]m)?\s+(?P<year>\d{4})",
    re.IGNORECASE,
)
#: English and German, as Vector's tools write them; a character that is no UTF-8 was replaced.
_MONTHS: Final = "jan feb mar,mär,m\ufffdr apr may,mai jun jul aug sep oct,okt nov dec,dez"


@dataclass(slots=True)
class Skipped:
    """The lines of a log that were no CAN frames: how many, and which came first."""

    lines_n: int = 0
    first: str = ""

    def add(self, number: int, line: str) -> None:
        """Count the line with this number."""
        self.first = self.first or f"line {number}, {line[:40].strip()!a}"
        self.lines_n += 1


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """The lines with something on them and their numbers; a longer one than LINE_MAX is cut off there.

    Raises  ValueError: a line without an end
    """
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        yield from _lines_of(file, 0)


def _lines_of(file: TextIO, number: int) -> Iterator[tuple[int, str]]:
    while line := file.readline(LINE_MAX):
        number += 1
        rest, read_n = line, 0
        while rest and not rest.endswith("\n"):
            rest = file.readline(1 << 16)
            read_n += len(rest)
            if read_n > FOREIGN_MAX:
                raise ValueError(f"line {number} has no end")
        if line.strip():
            yield number, line


def read_candump(path: Path, skipped: Skipped) -> Iterator[can.Message]:
    """The messages in a log of `candump`."""
    lines, damage = _candump_lines(path, skipped), None
    head: list[tuple[float, can.Message | None]] = []
    try:
        head.extend(islice(lines, HEAD_N))
    except (ValueError, OSError) as error:  # what comes before it is read
        damage = error
    adding, sum_s = _are_differences([stated_s for stated_s, _ in head if stated_s == stated_s]), 0.0
    for stated_s, message in chain(head, lines):
        sum_s += stated_s if stated_s == stated_s else 0.0
        if message is not None:
            message.timestamp = sum_s if adding else stated_s
            yield message
    if damage is not None:
        raise damage


def read_candump_runs(path: Path, skipped: Skipped) -> Iterator[can.Message | Run]:
    """The same as `read_candump`, runs of lines together; a log that begins with none is read by line."""
    from hostlink.log_blocks import run_of_lines

    with path.open("rb") as file:
        block, number = file.read(_BLOCK), 0
        if run_of_lines(block, 0, len(block)) is None:
            yield from read_candump(path, skipped)
            return
        while block:
            more = file.read(_BLOCK)
            at, end = 0, block.rfind(b"\n") + 1 if more else len(block)
            if not end and len(block) > FOREIGN_MAX:
                raise ValueError(f"line {number + 1} has no end")
            while at < end:
                run = run_of_lines(block, at, end)
                if run is not None:
                    yield run[0]
                    number, at = number + len(run[0].ids), run[1]
                    continue
                line = block[at : block.find(b"\n", at, end) + 1 or end]
                lines = _lines_of(TextIOWrapper(BytesIO(line), "utf-8", "replace"), number)
                for _, message in _messages_in(lines, skipped):
                    if message is not None:
                        yield message
                number += line.replace(b"\r\n", b"\n").count(b"\r") + 1
                at += len(line)
            block = block[end:] + more


def _candump_lines(path: Path, skipped: Skipped) -> Iterator[tuple[float, can.Message | None]]:
    return _messages_in(_lines(path), skipped)


def _messages_in(
    lines: Iterable[tuple[int, str]], skipped: Skipped
) -> Iterator[tuple[float, can.Message | None]]:
    """Time that each line states, for a difference counts whatever it is of; and its message."""
    for number, line in lines:
        found = _CANDUMP.fullmatch(line)
        message = None if found is None else _candump_message(found)
        if message is None:
            skipped.add(number, line)
            stamp = _CANDUMP_TIME.match(line)
            yield float(stamp[1]) if stamp else nan, None
        else:
            yield message.timestamp, message


def _candump_message(found: re.Match[str]) -> can.Message | None:
    """The message of a line; None: it is cut off, or its date is none."""
    import can

    size, date, channel = found["size"], found["date"], found["channel"]
    data = bytes.fromhex(found["fd"] or found["classic"] or found["plain"] or "")
    is_remote = found["remote"] is not None or found["dlc"] is not None
    if size is not None and not is_remote and int(size) != len(data):
        return None
    try:
        time_s = datetime.fromisoformat(date).timestamp() if date else float(found["time"] or nan)
    except (ValueError, OverflowError, OSError):
        return None
    can_id, flags, is_long = int(found["id"], 16), int(found["flags"] or "0", 16), len(found["id"]) > 3
    return can.Message(
        timestamp=time_s,
        arbitration_id=can_id & _ID_MASK,
        is_extended_id=is_long,
        is_error_frame=is_long and can_id & _ERROR_FLAG > 0,
        is_remote_frame=is_remote,
        is_fd=found["flags"] is not None or len(size or "") > 1,
        bitrate_switch=flags & _BRS > 0 or found["switch"] == "B",
        error_state_indicator=flags & _ESI > 0 or found["passive"] == "E",
        is_rx=(found["end"] or found["way"] or "R").upper() == "R",
        dlc=int(found["dlc"] or 0) if is_remote else len(data),
        data=None if is_remote else data,
        channel=int(channel) if channel.isdigit() else channel,
    )


def _are_differences(times_s: list[float]) -> bool:
    """Whether times at the beginning of a log are each the difference to the one before.

    Times since a beginning grow: the last quarter is later than the first one, whatever the order in between.
    """
    quarter = len(times_s) // 4
    if quarter < 2 or max(times_s) > _RELATIVE_MAX_S:
        return False
    return min(times_s[-quarter:]) <= max(times_s[:quarter])


def read_asc(path: Path, skipped: Skipped) -> Iterator[can.Message]:
    """The messages in an ASCII log of Vector's tools; its channel 1 is 0 here, as python-can has it."""
    begin_s, sum_s, base, adding = 0.0, 0.0, 16, False
    for number, text in _lines(path):
        line = text.strip()
        found = _ASC.fullmatch(line)
        if found is None:
            if begin := _ASC_BEGIN.match(line):
                begin_s = _begin_s(begin)
            elif line.lower().startswith("base "):
                base = 10 if "dec" in line.lower() else 16
                adding = "relative" in line.lower()
            if adding and (other := re.match(r"\d{1,12}\.\d{1,9}\s", line)):
                sum_s += float(other[0])
            if not _ASC_OTHER.match(line):
                skipped.add(number, line)
            continue
        sum_s = sum_s + float(found["time"]) if adding else float(found["time"])
        message = _asc_message(found, base)
        if message is None:
            skipped.add(number, line)
        else:
            message.timestamp = begin_s + sum_s
            yield message


def _asc_message(found: re.Match[str], base: int) -> can.Message | None:
    """The message of a line, without its time; None: it is cut off, or has a number that is too large."""
    import can

    is_fd = found["fd_channel"] is not None
    is_error = bool(found["error"] or found["fd_error"])
    is_remote = not (is_fd or is_error or found["dlc"])
    try:
        can_id = int(found["fd_id"] or found["id"] or "0", base)
        size = int(found["size"] or 0) if is_fd else min(int(found["dlc"] or "0", 16), 8)
        data = bytes(int(byte, base) for byte in (found["fd"] or found["data"] or "").split()[:size])
    except ValueError:  # a byte over 255, or hexadecimal digits in a log of decimal ones
        return None
    if can_id > _ID_MASK or len(data) != size or size > DATA_MAX:
        return None
    return can.Message(
        arbitration_id=can_id,
        is_fd=is_fd,
        is_error_frame=is_error,
        is_remote_frame=is_remote,
        is_extended_id=bool(found["ext"] or found["fd_ext"]),
        is_rx=(found["fd_way"] or found["way"] or "Rx").lower() == "rx",
        bitrate_switch=found["switch"] == "1",
        error_state_indicator=found["passive"] == "1",
        dlc=size,
        data=None if is_remote else data,
        channel=int(found["fd_channel"] or found["channel"]) - 1,
    )


def _begin_s(found: re.Match[str]) -> float:
    """The local time that a log's head states, s since 1970; 0 if it is none."""
    name = found["month"][:3].lower()
    month = next((k for k, names in enumerate(_MONTHS.split(" "), 1) if name in names.split(",")), 0)
    hour, half = int(found["hour"]), (found["half"] or "").lower()
    if half:
        hour = hour % 12 + 12 * (half == "pm")
    second = float(found["second"])
    try:
        day = datetime(int(found["year"]), month, int(found["day"]))
        return (
            day.replace(hour=hour, minute=int(found["minute"]), second=int(second)).timestamp() + second % 1.0
        )
    except (ValueError, OverflowError, OSError):
        return 0.0


# ---- blf ------------------------------------------------------------------------------------------------

_FILE: Final = struct.Struct("<4sL32x8H16x")  # signature, size of the file's header, time of the beginning
_OBJECT: Final = struct.Struct("<4sHHLL")  # signature, size and version of the header, size, type
_CONTAINER: Final = struct.Struct("<H14x")  # compression
_STAMP: Final = struct.Struct("<L4xQ")  # unit, time; at the same place in both versions of the header
_HEADER_SIZE: Final = {1: 32, 2: 40}
_CAN: Final = struct.Struct("<HBBL8s")  # channel, flags, dlc, identifier, data
_CAN_FD: Final = struct.Struct("<HBBL5xBB5x64s")  # ..., identifier, FD flags, bytes, data
_CAN_FD_64: Final = struct.Struct(
    "<BBBxL4xL18xBB4x"
)  # channel, dlc, bytes, id, flags, direction, end of data
_CAN_ERROR: Final = struct.Struct("<H8xBx4xL4x8s")  # channel, dlc, identifier, data
_FRAMES: Final = {1: _CAN, 86: _CAN, 100: _CAN_FD, 101: _CAN_FD_64, 73: _CAN_ERROR}  # by an object's type
_FILE_HEADER_MAX: Final = 1 << 16
_LOG_CONTAINER: Final = 10
_STORED, _ZLIB = 0, 2
_MARK: Final = b"LOBJ"


def read_blf(path: Path, _: Skipped, run_at: RunAt | None = None) -> Iterator[Any]:
    """The messages in a binary log; its channel 1 is 0 here. Raises ValueError: damaged."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_FILE.size)
        if len(head) < _FILE.size:
            raise ValueError("it is shorter than a BLF header")
        signature, at, *begin = _FILE.unpack(head)
        if signature != b"LOGG" or not _FILE.size <= at <= min(_FILE_HEADER_MAX, size):
            raise ValueError("it does not begin as a BLF file")
        begin_s, rest = _system_time(begin), b""
        while at < size:
            file.seek(at)
            plain, object_bytes, cut = _container(file, size - at)
            rest, wrong = yield from _blf_messages(rest + plain, begin_s, run_at)
            if wrong or cut:
                raise ValueError(f"{wrong or cut} at byte {at}")
            at += object_bytes + object_bytes % 4


def read_blf_runs(path: Path, skipped: Skipped) -> Iterator[can.Message | Run]:
    """The same as `read_blf`, runs of objects together."""
    from hostlink.log_blocks import run_of_objects

    return read_blf(path, skipped, run_of_objects)


def _system_time(parts: list[int]) -> float:
    """Windows' SYSTEMTIME as s since 1970; 0 if it is none."""
    year, month, _, day, hour, minute, second, ms = parts
    try:
        return datetime(year, month, day, hour, minute, second, ms * 1000, UTC).timestamp()
    except ValueError:
        return 0.0


def _container(file: BinaryIO, left: int) -> tuple[bytes, int, str]:
    """Content of the object here if it is a container, its size, and the problem that ends the reading."""
    head = file.read(_OBJECT.size)
    if len(head) < _OBJECT.size:
        return b"", 0, "cut off"
    signature, _, _, size, kind = _OBJECT.unpack(head)
    if signature != _MARK or size < _OBJECT.size:
        return b"", 0, "no object"
    if kind != _LOG_CONTAINER:
        return b"", size, "" if size <= left else "an object longer than the file"
    if size < _OBJECT.size + _CONTAINER.size:
        return b"", 0, "a container without a header"
    if min(size, left) > CONTAINER_MAX or size > max(left, CONTAINER_MAX):
        return b"", 0, "a container too large"
    data = file.read(min(size, left) - _OBJECT.size)
    (packed,) = _CONTAINER.unpack_from(data.ljust(_CONTAINER.size))
    plain, wrong = data[_CONTAINER.size :], ""
    if packed != _STORED:
        plain, wrong = _unpack(plain) if packed == _ZLIB else (b"", "a container packed in an unknown way")
    return plain, size, wrong or ("" if size <= left else "cut off")


def _unpack(packed: bytes) -> tuple[bytes, str]:
    """Content of a container up to its damage, and the problem; empty: none."""
    unpacker, plain = zlib.decompressobj(), bytearray()
    for at in range(0, len(packed), _PIECE):
        try:
            plain += unpacker.decompress(packed[at : at + _PIECE], CONTAINER_MAX + 1 - len(plain))
        except zlib.error:
            return bytes(plain), "a damaged container"
        if len(plain) > CONTAINER_MAX:
            return b"", "a container too large"
    return bytes(plain), ""


def _blf_messages(
    plain: bytes, begin_s: float, run_at: RunAt | None
) -> Generator[Any, None, tuple[bytes, str]]:
    """The messages of the objects here.

    Returns the beginning of an object that goes on in the next container, and the problem; empty: none.
    """
    at = 0
    while (begin := plain.find(_MARK, at, at + 8)) >= 0 and begin + _OBJECT.size <= len(plain):
        if run_at is not None and (found := run_at(plain, begin, begin_s)) is not None:
            run, at = found
            yield run
            continue
        _, _, version, size, kind = _OBJECT.unpack_from(plain, begin)
        if size < _OBJECT.size:
            return b"", "a container with an object of no length"
        if size > CONTAINER_MAX:
            return b"", "a container with an object too large"
        at = begin + size
        if at > len(plain):
            return plain[begin:], ""
        if version in _HEADER_SIZE and kind in _FRAMES:
            yield _blf_message(plain[begin:at], _HEADER_SIZE[version], _FRAMES[kind], begin_s)
    if begin < 0 and at + 8 <= len(plain):
        return b"", "no object where one should begin"
    return plain[at:], ""


def _blf_message(whole: bytes, head: int, form: struct.Struct, begin_s: float) -> can.Message:
    """The message in an object; zeros stand for what it is too short for."""
    import can
    from can.util import dlc2len

    end, whole = len(whole), whole.ljust(head + form.size, b"\0")
    unit, ticks = _STAMP.unpack_from(whole, _OBJECT.size)
    values = form.unpack_from(whole, head)
    is_sent = is_remote = is_fd = fast = passive = False
    if form is _CAN_FD_64:
        channel, dlc, size, can_id, flags, is_sent, stated_end = values
        data = whole[head + form.size : min(end, stated_end or end)][:size].ljust(min(size, DATA_MAX), b"\0")
        is_remote, is_fd, fast, passive = (flags & bit > 0 for bit in (0x10, 0x1000, 0x2000, 0x4000))
    elif form is _CAN_ERROR:
        channel, dlc, can_id, data = values
    else:
        channel, flags, dlc, can_id, *fd, data = values
        is_sent, is_remote = flags & 1 > 0, flags & 0x80 > 0
        if fd:
            is_fd, fast, passive = (fd[0] & bit > 0 for bit in (1, 2, 4))
            data = data[: fd[1]]
    size = dlc2len(dlc) if form in (_CAN_FD, _CAN_FD_64) else min(dlc, 8)
    return can.Message(
        timestamp=begin_s + ticks / (1e5 if unit == 1 else 1e9),
        arbitration_id=can_id & _ID_MASK,
        is_extended_id=can_id >> 31 > 0,
        is_error_frame=form is _CAN_ERROR,
        is_remote_frame=is_remote,
        is_fd=is_fd,
        bitrate_switch=fast,
        error_state_indicator=passive,
        is_rx=not is_sent,
        dlc=size,
        data=None if is_remote else data[: size if form in (_CAN, _CAN_ERROR) else DATA_MAX],
        channel=channel - 1,
    )
