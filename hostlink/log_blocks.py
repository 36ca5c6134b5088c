"""Lines of a candump log, and objects of a binary one, many at once: for tables of recordings. Needs NumPy.

A run is a number of CAN FD frames of 64 bytes that follow each other and are alike in all but their numbers.
What is in no run is read one by one, by `hostlink.log_formats`: there is what a line or an object means.
"""

from __future__ import annotations

import re
from typing import Any, Final, NamedTuple

import numpy as np

__all__ = ["Run", "run_of_lines", "run_of_objects"]

SIZE: Final = 64  # bytes of a frame
_LEAST: Final = 4  # a shorter run costs more than its frames alone
_LINE: Final = re.compile(
    rb"\((?P<s>\d{9,10})\.(?P<us>\d{6})\) (?P<channel>[!-~]{1,16}) (?P<id>[\dA-Fa-f]{3})"
    rb"##(?P<flags>[\dA-Fa-f])(?P<data>[\dA-Fa-f]{128})(?P<way> [RT])?\n"
)
_CHANNEL: Final = re.compile(rb"[^\s()#]+")
_BEGUN_S: Final = 100_000_000  # as in `log_formats`: a larger time counts from 1970
_EXACT_S: Final = 9_000_000_000  # a larger one has more digits with its microseconds than a double
_HEX: Final = np.full(256, 255, np.uint8)
_HEX[list(b"0123456789abcdef")] = _HEX[list(b"0123456789ABCDEF")] = range(16)


class Run(NamedTuple):
    """Frames of 64 bytes: of each its time, identifier and channel, and the data of all."""

    times_s: list[float]
    ids: list[int]
    channels: list[str | int]
    data: bytes


def run_of_lines(block: bytes, at: int, end: int) -> tuple[Run, int] | None:
    """The lines with absolute times from here on, and where they end; None: read the line here by itself."""
    first = _LINE.match(block, at)
    if first is None or int(first["s"]) <= _BEGUN_S:
        return None
    size = first.end() - at
    rows = np.frombuffer(block, np.uint8, (end - at) // size * size, at).reshape(-1, size)
    rows = rows[: _whole_n(rows[:, -1] == ord("\n"))]

    def of(name: str) -> np.ndarray:
        return rows[:, first.start(name) - at : first.end(name) - at]

    numbers = ["s", "us", "channel", "id", "flags", "data", *(["way"] if first["way"] else [])]
    fixed = np.ones(size, bool)
    for name in numbers:
        fixed[first.start(name) - at : first.end(name) - at] = False
    good = (rows[:, fixed] == rows[0, fixed]).all(axis=1)
    digits = np.concatenate([of("s"), of("us")], axis=1) - np.uint8(ord("0"))
    time_us = digits @ 10 ** np.arange(digits.shape[1])[::-1]
    good &= (digits < 10).all(axis=1) & (time_us < _EXACT_S * 10**6)
    nibbles = _HEX[np.concatenate([of("id"), of("flags"), of("data")], axis=1)]
    good &= (nibbles < 16).all(axis=1)
    if first["way"]:
        good &= (of("way")[:, 0] == ord(" ")) & np.isin(of("way")[:, 1], list(b"RT"))
    channel = of("channel")
    if (channel == channel[0]).all():
        names = [first["channel"]] * len(rows)
    else:
        names = np.ascontiguousarray(channel).view(f"S{channel.shape[1]}")[:, 0].tolist()
    known = {name: _channel_of(name, channel.shape[1]) for name in set(names)}
    if None in known.values():
        good &= [known[name] is not None for name in names]
    n = _whole_n(good)
    if n < _LEAST:
        return None
    nibbles = nibbles[:n]
    ids = nibbles[:, :3] @ np.array([256, 16, 1])
    data = nibbles[:, 4::2] << 4 | nibbles[:, 5::2]
    channels: list[Any] = [known[name] for name in names[:n]]
    return Run((time_us[:n] / 1e6).tolist(), ids.tolist(), channels, data.tobytes()), at + n * size


def _whole_n(good: np.ndarray) -> int:
    """How many are good before the first that is not."""
    return len(good) if good.all() else int(good.argmin())


def _channel_of(name: bytes, size: int) -> str | int | None:
    if len(name) != size or not name.isascii() or not _CHANNEL.fullmatch(name):
        return None
    return int(name) if name.isdigit() else name.decode()


_OBJECT: Final = np.dtype(
    {
        "names": ["mark", "version", "size", "kind", "unit", "ticks", "channel", "flags", "id",
                  "bytes", "data"],
        "formats": ["<u4", "<u2", "<u4", "<u4", "<u4", "<u8", "<u2", "u1", "<u4", "u1", "V64"],
        "offsets": [0, 6, 8, 12, 16, 24, 32, 34, 36, 46, 52],
        "itemsize": 116,
    }
)  # fmt: skip
_MARK: Final = int.from_bytes(b"LOBJ", "little")
_KIND: Final = 100  # CAN_FD_MESSAGE, as python-can writes it
_REMOTE: Final = 0x80


def run_of_objects(plain: bytes, at: int, begin_s: float) -> tuple[Run, int] | None:
    """The same as `run_of_lines`, of the objects in a container; its channel 1 is 0 here."""
    rows = np.frombuffer(plain, _OBJECT, (len(plain) - at) // _OBJECT.itemsize, at)
    rows = rows[: _whole_n(rows["mark"] == _MARK)]
    good = (rows["version"] == 1) & (rows["size"] == _OBJECT.itemsize) & (rows["kind"] == _KIND)
    good &= (rows["bytes"] == SIZE) & (rows["flags"] & _REMOTE == 0) & (rows["id"] < 1 << 11)
    n = _whole_n(good)
    if n < _LEAST:
        return None
    rows = rows[:n]
    times_s = begin_s + rows["ticks"] / np.where(rows["unit"] == 1, 1e5, 1e9)
    run = Run(
        [round(time_s, 6) for time_s in times_s.tolist()],
        rows["id"].tolist(),
        (rows["channel"].astype(np.int64) - 1).tolist(),
        rows["data"].tobytes(),
    )
    return run, at + n * _OBJECT.itemsize
