"""Consistent Overhead Byte Stuffing: removes zero bytes, so that 0x00 can separate frames.

Each zero is replaced by the distance to the next one; an overhead of one byte per 254. After any damage
the receiver is back in step at the next 0x00.

Source: S. Cheshire, M. Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Trans. Networking 7(2), 1999.
"""

from __future__ import annotations

from typing import Final

from hostlink.wire.errors import CorruptFrame

__all__ = ["decode", "encode"]

_RUN: Final = 254  # longest run of non-zero bytes in one block


def encode(data: bytes) -> bytes:
    """`data` without zero bytes; the separator is the caller's."""
    out = bytearray()
    blocks = data.split(b"\0")
    for left, block in zip(range(len(blocks) - 1, -1, -1), blocks, strict=True):
        at = 0
        while len(block) - at > _RUN or (left and len(block) - at == _RUN):
            out.append(_RUN + 1)
            out += block[at : at + _RUN]
            at += _RUN
        out.append(len(block) - at + 1)
        out += block[at:]
    return bytes(out)


def decode(data: bytes) -> bytes:
    """The inverse of `encode`. Raises CorruptFrame: a zero byte, or a block that runs past the end."""
    if 0 in data:
        raise CorruptFrame("COBS block with a zero byte")
    out = bytearray()
    at = 0
    while at < len(data):
        code = data[at]
        block = data[at + 1 : at + code]
        if len(block) != code - 1:
            raise CorruptFrame("COBS block cut short")
        out += block
        at += code
        if code <= _RUN and at < len(data):
            out.append(0)
    return bytes(out)
