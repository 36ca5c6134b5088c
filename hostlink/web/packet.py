"""The packet sent to the browser 30 times a second: one binary message, read without copying.

    4 bytes   length of the header, little-endian
    header    JSON, padded with blanks to a multiple of 4
    arrays    one behind the other, each padded to a multiple of 4

The header's "arrays" gives the place of each array: name -> [type, number of bytes, offset from the header's
end]. Types: "f4", "i2", "u1", ... and "jpeg". NaN is null in the header and NaN in arrays.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from math import isfinite
from typing import Any

__all__ = ["pack_packet", "plain", "unpack_packet"]

_LETTERS = {"f4": "f", "i2": "h", "u1": "B", "u2": "H"}  # types, as `struct` has them
_ALIGN = 4  # typed arrays of 4-byte numbers must start on multiples of 4


def pack_packet(header: Mapping[str, Any], arrays: Mapping[str, tuple[str, bytes]] | None = None) -> bytes:
    """One message.

    header  JSON-able; NaN and infinity become null
    arrays  name -> (type, the bytes, little-endian)
    """
    places: dict[str, list[Any]] = {}
    body: list[bytes] = []
    at = 0
    for name, (kind, data) in (arrays or {}).items():
        places[name] = [kind, len(data), at]
        gap = -len(data) % _ALIGN
        body += [data, bytes(gap)]
        at += len(data) + gap
    text = json.dumps({**plain(header), "arrays": places}, separators=(",", ":")).encode()
    text += b" " * (-len(text) % _ALIGN)
    return b"".join([len(text).to_bytes(4, "little"), text, *body])


def unpack_packet(data: bytes) -> tuple[dict[str, Any], dict[str, bytes | tuple[float, ...]]]:
    """Header and arrays by name: a JPEG as bytes, others as numbers.

    Raises  ValueError: not such a packet
    """
    try:
        length = int.from_bytes(data[:4], "little")
        header = json.loads(data[4 : 4 + length])
        arrays: dict[str, bytes | tuple[float, ...]] = {}
        for name, (kind, size, at) in header.pop("arrays").items():
            part = data[4 + length + at : 4 + length + at + size]
            arrays[name] = part if kind == "jpeg" else _numbers(kind, part, size)
    except (AttributeError, KeyError, RecursionError, TypeError, struct.error) as error:
        raise ValueError(f"not a packet: {error}") from None
    return header, arrays


def _numbers(kind: str, data: bytes, size: int) -> tuple[float, ...]:
    letter = _LETTERS[kind]
    return struct.unpack(f"<{size // struct.calcsize(letter)}{letter}", data)


def plain(value: Any) -> Any:
    """The value in plain JSON types: no NaN, no tuples."""
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: plain(v) for name, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return value
