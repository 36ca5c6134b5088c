"""Checks of CAN logs before python-can reads them: it trusts a length, and a damaged one may be gigabytes.

.log  each line must have the form that `candump -L` writes
.blf  no object is longer than the file, no container unpacks to more than CONTAINER_MAX, and none of the
      objects within has no length: python-can would read that one for ever
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final

__all__ = ["LogLines", "WholePart", "find_blf_damage"]

LINE_MAX: Final = 512  # characters; the longest line, CAN FD with 64 bytes, has some 200
CONTAINER_MAX: Final = 32 << 20  # bytes; Vector's tools and python-can write containers of 128 KiB

_LINE: Final = re.compile(
    r"\(\d{1,12}(\.\d{1,9})?\)\s+\S{1,64}\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#"
    r"([Rr]\d?|#[0-7]([0-9A-Fa-f]{2}){0,64}|([0-9A-Fa-f]{2}){0,8})(\s+[RrTt])?\s*"
)
_FILE: Final = struct.Struct("<4sL64x")  # signature, size of the file's header
_OBJECT: Final = struct.Struct("<4sHHLL")  # signature, size and version of the header, size, type
_CONTAINER: Final = struct.Struct("<H14x")  # compression
_FILE_HEADER_MAX: Final = 1 << 16
_LOG_CONTAINER: Final = 10
_ZLIB: Final = 2


class LogLines:
    """The lines of a `.log` file, as python-can iterates them. Raises ValueError: another form."""

    def __init__(self, path: Path) -> None:
        self._file = path.open(encoding="ascii", errors="replace")

    def __iter__(self) -> Iterator[str]:
        n = 0
        while line := self._file.readline(LINE_MAX):
            n += 1
            if line.strip() and not _LINE.fullmatch(line):
                raise ValueError(f"line {n} is not one that candump -L writes: {line[:40].rstrip()!a}")
            yield line

    def close(self) -> None:
        self._file.close()


class WholePart:
    """A file up to `end`, as python-can reads it; nothing beyond is read."""

    def __init__(self, path: Path, end: int) -> None:
        self._file = path.open("rb")
        self._end = end

    def read(self, n_bytes: int = -1) -> bytes:
        left = max(0, self._end - self._file.tell())
        return self._file.read(left if n_bytes < 0 else min(n_bytes, left))

    def close(self) -> None:
        self._file.close()


def find_blf_damage(path: Path) -> tuple[int, str]:
    """How much of a `.blf` file can be read safely: (bytes, the problem at that place).

    bytes  the whole file, with an empty text, if there is no problem. An object that is cut off at the end of
           the file belongs to what can be read
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_FILE.size)
        if len(head) < _FILE.size:
            return 0, "it is shorter than a BLF header"
        signature, header_bytes = _FILE.unpack(head)
        if signature != b"LOGG" or not _FILE.size <= header_bytes <= _FILE_HEADER_MAX:
            return 0, "it does not begin as a BLF file"
        at, containers = header_bytes, _Containers()
        while at < size:
            file.seek(at)
            why = _object_damage(file, size - at, containers)
            if why:
                return (size if "cut off" in why else at), f"{why} at byte {at}"
            file.seek(at + 8)
            (object_bytes,) = struct.unpack("<L", file.read(4))
            at += object_bytes + object_bytes % 4
    return size, ""


def _object_damage(file: BinaryIO, left: int, containers: _Containers) -> str:
    """The problem of the object here; empty: none."""
    head = file.read(_OBJECT.size)
    if len(head) < _OBJECT.size:
        return "cut off"
    signature, _, _, size, kind = _OBJECT.unpack(head)
    if signature != b"LOBJ" or size < _OBJECT.size:
        return "no object"
    if kind != _LOG_CONTAINER:
        return "" if size <= left else "an object longer than the file"
    if size < _OBJECT.size + _CONTAINER.size:
        return "a container without a header"
    data = file.read(min(size, left) - _OBJECT.size)
    if size > left and size > CONTAINER_MAX:
        return "a container longer than the file"
    return containers.damage(data) or ("" if size <= left else "cut off")


class _Containers:
    """The containers of a file, in order: an object may go on in the next one."""

    def __init__(self) -> None:
        self._tail = b""

    def damage(self, data: bytes) -> str:
        """The problem of the next container, without the header that all objects have; empty: none."""
        if len(data) > CONTAINER_MAX:
            return "a container too large"
        plain = data[_CONTAINER.size :]
        if _CONTAINER.unpack_from(data.ljust(_CONTAINER.size))[0] == _ZLIB:
            try:
                plain = zlib.decompressobj().decompress(plain, CONTAINER_MAX + 1)
            except zlib.error:
                return "a damaged container"
            if len(plain) > CONTAINER_MAX:
                return "a container too large"
        plain, at = self._tail + plain, 0
        # As python-can goes from one to the next: up to four bytes of padding, then "LOBJ".
        while (begin := plain.find(b"LOBJ", at, at + 8)) >= 0 and begin + _OBJECT.size <= len(plain):
            size = _OBJECT.unpack_from(plain, begin)[3]
            if size < _OBJECT.size:
                return "a container with an object of no length"
            if begin + size > len(plain):
                break
            at = begin + size
        self._tail = plain[at:] if len(plain) - at <= CONTAINER_MAX else b""
        return ""
