"""The packet sent to the browser 30 times a second: one binary message, read without copying.

    4 bytes   length of the header, little-endian
    header    JSON, padded with blanks to a multiple of 4
    arrays    one behind the other, each padded to a multiple of 4

The header's "arrays" gives the place of each array: name -> [type, number of bytes, offset from the header's
end]. Types: "f4", "i2", "u1", ... and "jpeg". NaN is null in the header and NaN in arrays.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import isfinite
from typing import Any

__all__ = ["pack_packet", "plain"]

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


def plain(value: Any) -> Any:
    """As plain JSON types: no NaN, no tuples."""
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: plain(v) for name, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return value
