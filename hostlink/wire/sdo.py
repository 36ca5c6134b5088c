"""SDO frames (CiA 301, 7.2.4.3): 8 bytes, of which the first says what they are.

first frame, its answer, abort   specifier and flags | index, sub-index | size, value or abort code
segment, its answer              specifier, toggle and flags | up to 7 bytes
segment of a block               number and flag | up to 7 bytes
"""

from __future__ import annotations

import struct
from typing import Final

__all__ = [
    "ANSWER_TO",
    "BLOCKS",
    "EXPEDITED",
    "HEAD",
    "LAST",
    "NAMELESS",
    "SEGMENT",
    "SEGMENTS",
    "SIZE_GIVEN",
    "SPECIFIER",
    "TOGGLE",
    "Block",
    "Sdo",
    "expedited",
    "goes_on",
    "pack_abort",
    "pack_segment",
    "segment_data",
]

HEAD: Final = struct.Struct("<BHB")  # command, index, sub-index
NAMELESS: Final = bytes(3)  # an abort that names no object
SEGMENT: Final = 7  # bytes of one segment
SPECIFIER: Final = 0xE0  # bits of the first byte
EXPEDITED, SIZE_GIVEN, TOGGLE, LAST = 0x02, 0x01, 0x10, 0x01


class Sdo:
    """The client's command specifiers. An abort is the same both ways."""

    DOWNLOAD_SEGMENT = 0x00
    DOWNLOAD = 0x20
    UPLOAD = 0x40
    UPLOAD_SEGMENT = 0x60
    ABORT = 0x80
    BLOCK_UPLOAD = 0xA0
    BLOCK_DOWNLOAD = 0xC0


class Block:
    """Block transfer: flags of its first frames, subcommands of later ones, and the last segment's flag."""

    SIZE_GIVEN, CRC = 0x02, 0x04
    END, RECEIVED, START = 0x01, 0x02, 0x03
    LAST = 0x80
    N_MAX = 127  # segments for one acknowledgement
    DOWNLOAD_N = 31  # of them in a download: from 32 on their first bytes are those of requests


#: The server's specifier of an answer that is no abort.
ANSWER_TO: Final = {
    Sdo.DOWNLOAD_SEGMENT: 0x20,
    Sdo.DOWNLOAD: 0x60,
    Sdo.UPLOAD: 0x40,
    Sdo.UPLOAD_SEGMENT: 0x00,
    Sdo.BLOCK_UPLOAD: 0xC0,
    Sdo.BLOCK_DOWNLOAD: 0xA0,
}
SEGMENTS: Final = (Sdo.DOWNLOAD_SEGMENT, Sdo.UPLOAD_SEGMENT)  # they name no object
BLOCKS: Final = (Sdo.BLOCK_UPLOAD, Sdo.BLOCK_DOWNLOAD)


def goes_on(command: int) -> bool:
    """Whether this is a later frame of a block transfer, but no segment; it names no object."""
    subcommand = {Sdo.BLOCK_UPLOAD: 3, Sdo.BLOCK_DOWNLOAD: 1}.get(command & SPECIFIER, 0)
    return bool(command & subcommand)


def expedited(specifier: int, index: int, sub: int, value: bytes, unused: bytes = b"") -> bytes:
    """A frame with a value of 1 to 4 bytes; `unused` fills the bytes behind it."""
    command = specifier | EXPEDITED | SIZE_GIVEN | (4 - len(value)) << 2
    return (HEAD.pack(command, index, sub) + value + unused).ljust(8, b"\0")


def pack_segment(command: int, part: bytes) -> bytes:
    """A segment with up to 7 bytes."""
    return bytes((command | (SEGMENT - len(part)) << 1,)) + part.ljust(SEGMENT, b"\0")


def segment_data(frame: bytes) -> bytes:
    """The inverse of `pack_segment`: its bytes of data."""
    return frame[1 : 8 - (frame[0] >> 1 & 7)]


def pack_abort(index: int, sub: int, code: int) -> bytes:
    """An abort, from either side."""
    return HEAD.pack(Sdo.ABORT, index, sub) + code.to_bytes(4, "little")
