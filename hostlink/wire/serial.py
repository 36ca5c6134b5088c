r"""The format on a serial line: COBS blocks between 0x00, one type byte, an E2E profile 5 payload.

    0x00 | COBS( type | CRC-16 | counter | version | body | CRC-32 ) | 0x00
                      \____________ payload ____________/

Rules
- A payload of type STATE is the CAN FD state frame as it is, one of type DETAIL a detail segment.
- The CRC-32 (of `zlib`, little-endian) covers type and payload. It replaces the checks that CAN's controllers
  do below the frame: a bare line has no check of its own, and 16 bits alone let one in 32768 of the
  frames with four or more flipped bits pass.
- The data id of a payload is `DATA_ID + type`: a frame cannot pass for one of another type.
- The counter runs per type and direction; a response repeats the counter of its request.
- A sender begins with 0x00 too: noise on an idle line ends there and costs no frame.
- Requests are served in order, one at a time; who waits sets the timeout (`ObjectRequest` is safe to
  repeat: reading and writing a segment at an offset is idempotent).
- A body is at most 255 bytes: at 921600 baud a full one takes 2.9 ms, less than a sample's time at
  240 Hz, so that an upload never holds the samples up.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final
from zlib import crc32

from hostlink.wire import cobs
from hostlink.wire.e2e import check_p5, protected_p5
from hostlink.wire.errors import CorruptFrame
from hostlink.wire.fields import DATA_ID, HEADER_SIZE, OLDER, VERSION

__all__ = [
    "BODY_MAX",
    "CHUNK_MAX",
    "FRAME_MAX",
    "Message",
    "ObjectReply",
    "ObjectRequest",
    "Op",
    "data_id_of",
    "decode_frame",
    "encode_frame",
    "pack_emergency",
    "pack_message",
    "unpack_emergency",
    "unpack_message",
]

BODY_MAX: Final = 255
_TRAILER: Final = 4  # CRC-32
FRAME_MAX: Final = 1 + HEADER_SIZE + BODY_MAX + _TRAILER + 2  # COBS adds 2 to so long a frame
CHUNK_MAX: Final = 192  # bytes of object data in one request or reply


class Message(IntEnum):
    """The type byte."""

    STATE = 0
    DETAIL = 1
    REQUEST = 2  # host to node: ObjectRequest
    REPLY = 3  # node to host: ObjectReply
    HEARTBEAT = 4  # node to host: one byte, CiA 301 NMT state
    EMERGENCY = 5  # node to host: 8 bytes, as on CAN
    NMT = 6  # host to node: one byte, CiA 301 NMT command
    SYNC = 7  # host to node: empty


def data_id_of(kind: Message, version: int = VERSION) -> int:
    """Data id of a payload of this type; of a version that is not decoded, as of this one."""
    return (OLDER[version].data_id if version in OLDER else DATA_ID) + kind & 0xFFFF


def encode_frame(kind: Message, payload: bytes) -> bytes:
    """The bytes to write for a protected payload (a state frame, a detail segment, `pack_message`)."""
    frame = bytes((kind,)) + payload
    return b"\0" + cobs.encode(frame + crc32(frame).to_bytes(4, "little")) + b"\0"


def decode_frame(block: bytes) -> tuple[int, bytes]:
    """(type byte, payload) of the block between two separators. Raises CorruptFrame."""
    frame = cobs.decode(block)
    if len(frame) < 1 + HEADER_SIZE + _TRAILER or crc32(frame[:-_TRAILER]) != int.from_bytes(
        frame[-_TRAILER:], "little"
    ):
        raise CorruptFrame("serial frame with a wrong length or CRC-32")
    return frame[0], frame[1:-_TRAILER]


def pack_message(kind: Message, body: bytes, counter: int) -> bytes:
    """Protected payload around a body. Raises ValueError: body longer than 255 bytes."""
    if len(body) > BODY_MAX:
        raise ValueError(f"serial body of {len(body)} bytes: at most {BODY_MAX} fit")
    return protected_p5(bytes((VERSION,)) + body, counter, data_id_of(kind))


def unpack_message(kind: Message, payload: bytes) -> tuple[int, bytes]:
    """(counter, body) of a protected payload. Raises CorruptFrame."""
    if not HEADER_SIZE <= len(payload) <= HEADER_SIZE + BODY_MAX or not check_p5(
        payload, data_id_of(kind, payload[HEADER_SIZE - 1])
    ):
        raise CorruptFrame(f"serial {kind.name} frame with a wrong length or CRC")
    return payload[2], payload[HEADER_SIZE:]


class Op(IntEnum):
    """The operation of a request."""

    READ = 1
    WRITE = 2


@dataclass(frozen=True, slots=True)
class ObjectRequest:
    """Read or write (a segment of) an object.

    offset  of the segment; objects of up to 192 bytes have one, at 0
    total   length of the whole object, when writing; the write takes effect with its last segment
    data    the segment, when writing
    """

    op: Op
    index: int
    sub: int
    offset: int = 0
    total: int = 0
    data: bytes = b""

    _HEAD = struct.Struct("<BHBII")

    def pack(self) -> bytes:
        """The body. Raises ValueError: more than 192 bytes of data."""
        if len(self.data) > CHUNK_MAX:
            raise ValueError(f"segment of {len(self.data)} bytes: at most {CHUNK_MAX}")
        return self._HEAD.pack(self.op, self.index, self.sub, self.offset, self.total) + self.data

    @classmethod
    def unpack(cls, body: bytes) -> ObjectRequest:
        """Raises CorruptFrame."""
        try:
            op, index, sub, offset, total = cls._HEAD.unpack_from(body)
            return cls(Op(op), index, sub, offset, total, body[cls._HEAD.size :])
        except (struct.error, ValueError) as error:
            raise CorruptFrame(f"object request: {error}") from None


@dataclass(frozen=True, slots=True)
class ObjectReply:
    """Answer to a request; a read gets the segment, a write an empty one.

    abort   0, or the CiA 301 abort code
    offset  of the segment
    total   length of the whole object: when reading, repeat until offset + len(data) == total
    """

    index: int
    sub: int
    abort: int = 0
    offset: int = 0
    total: int = 0
    data: bytes = b""

    _HEAD = struct.Struct("<HBIII")

    def pack(self) -> bytes:
        """The body. Raises ValueError: more than 192 bytes of data."""
        if len(self.data) > CHUNK_MAX:
            raise ValueError(f"segment of {len(self.data)} bytes: at most {CHUNK_MAX}")
        return self._HEAD.pack(self.index, self.sub, self.abort, self.offset, self.total) + self.data

    @classmethod
    def unpack(cls, body: bytes) -> ObjectReply:
        """Raises CorruptFrame."""
        try:
            index, sub, abort, offset, total = cls._HEAD.unpack_from(body)
        except struct.error as error:
            raise CorruptFrame(f"object reply: {error}") from None
        return cls(index, sub, abort, offset, total, body[cls._HEAD.size :])


_EMERGENCY: Final = struct.Struct("<HBBHxx")


def pack_emergency(emcy: int, register: int, fault: int, status: int) -> bytes:
    """The 8 bytes of an emergency message: CiA 301 code and register, our fault's code, status bits.

    emcy 0 and fault 0: all faults are gone.
    """
    return _EMERGENCY.pack(emcy, register, fault, status & 0xFFFF)


def unpack_emergency(data: bytes) -> tuple[int, int, int, int]:
    """(emcy, register, fault, status). Raises CorruptFrame."""
    if len(data) != _EMERGENCY.size:
        raise CorruptFrame(f"emergency of {len(data)} bytes")
    emcy, register, fault, status = _EMERGENCY.unpack(data)
    return emcy, register, fault, status
