# cython: annotation_typing=False
"""The work on every state frame: its E2E header and check, and decoding a field of it when that is read.

Compiled where a compiler is, with the C types in `body.pxd`; the same without. A body is the frame's version
and fields, which a received sample keeps.
"""

from __future__ import annotations

from binascii import crc_hqx
from math import nan
from struct import Struct
from typing import Any, Final, TypeVar
from zlib import crc32

from hostlink.wire.e2e import protected_p5
from hostlink.wire.errors import CorruptFrame
from hostlink.wire.fields import CHECK_SIZE, DATA_ID, HEADER_SIZE, OLDER, STATE_SIZE, VERSION, Field
from hostlink.wire.status import status_of

__all__ = ["NUMBER", "Decoded", "FromFrame", "body_in", "frame_of", "received"]

T = TypeVar("T", bound="FromFrame")
_AT: Final = HEADER_SIZE - 1
_END: Final = STATE_SIZE - CHECK_SIZE
_OURS: Final = VERSION
_SIZE: Final = STATE_SIZE
_ID: Final = DATA_ID
_COMPILED: Final = not __file__.endswith(".py")  # a loop over bytes is slow where it is not


def body_in(frame: bytes) -> bytes:
    """Version and fields of a frame, which may be a bytearray, too.

    Raises CorruptFrame: length, CRC, version or check is wrong
    """
    if len(frame) != _SIZE:
        raise CorruptFrame(f"state frame of {len(frame)} bytes instead of {_SIZE}")
    if not _COMPILED:
        frame = bytes(frame)
    at = frame
    is_ours = at[_AT] == _OURS
    older = None if is_ours else OLDER.get(at[_AT])
    data_id = _ID if older is None else older.data_id
    if _crc_of(frame, data_id) != at[0] | at[1] << 8:
        raise CorruptFrame("state frame with a wrong CRC")
    if not is_ours and older is None:
        raise CorruptFrame("state frame whose version does not fit its CRC")
    body = at[_AT:_END]
    if _check_of(body) != at[_END] | at[_END + 1] << 8:
        raise CorruptFrame("state frame whose content does not fit its check")
    return body


def frame_of(body: bytes, counter: int) -> bytes:
    """The frame around version and fields: E2E header, check."""
    if not _COMPILED or len(body) != _END - _AT:
        return protected_p5(body + (crc32(body) & 0xFFFF).to_bytes(CHECK_SIZE, "little"), counter, _ID)
    check = _check_of(body)
    to, at = _FRAME, body
    to[_AT - 1] = counter & 0xFF
    for i in range(_END - _AT):
        to[_AT + i] = at[i]
    to[_END], to[_END + 1] = check & 0xFF, check >> 8
    register = _register_of(to, _ID)
    to[0], to[1] = register & 0xFF, register >> 8
    return to[:_SIZE]  # type: ignore[return-value]  # compiled, it is a C array, whose slice is bytes


def _check_of(body: bytes) -> int:
    """The check of version and fields."""
    if not _COMPILED:
        return crc32(body) & 0xFFFF
    at = body
    register = 0xFFFF_FFFF
    for i in range(_END - _AT):
        register = register >> 8 ^ _CHECK_STEPS[(register ^ at[i]) & 0xFF]
    return ~register & 0xFFFF


def _crc_of(frame: bytes, data_id: int) -> int:
    """The CRC that `e2e.check_p5` compares."""
    if not _COMPILED:
        return crc_hqx(data_id.to_bytes(2, "little"), crc_hqx(frame[2:], 0xFFFF))
    return _register_of(frame, data_id)


def _register_of(frame: bytes | bytearray, data_id: int) -> int:
    register = 0xFFFF
    for i in range(2, _SIZE):
        register = (register << 8 & 0xFFFF) ^ _STEPS[register >> 8 ^ frame[i]]
    register = (register << 8 & 0xFFFF) ^ _STEPS[register >> 8 ^ data_id & 0xFF]
    return (register << 8 & 0xFFFF) ^ _STEPS[register >> 8 ^ data_id >> 8]


NUMBER: Final = Struct("d")
_STEPS = [crc_hqx(bytes([byte]), 0) for byte in range(256)]  # by what a byte changes the register
_CHECK_STEPS = [crc32(bytes([byte ^ 0xFF])) ^ 0xFF00_0000 for byte in range(256)]
_FRAME = bytearray(_SIZE)  # it is written in one go, without a change of threads


class FromFrame:
    """The part of its frame that a received sample keeps.

    body   version and fields; None: the sample was made of values
    exact  where the body was made of values, these: of each field in turn a double; None: they are its own
    """

    body: bytes | None
    exact: bytes | None


if not _COMPILED:
    setattr(FromFrame, "body", None)  # noqa: B010
    setattr(FromFrame, "exact", None)  # noqa: B010


_new = FromFrame.__new__


def received(kind: type[T], body: bytes, exact: bytes | None = None) -> T:
    """A sample of this class, derived from `FromFrame`, that keeps the body."""
    state = _new(kind)
    if _COMPILED:
        state.body, state.exact = body, exact
    else:  # it is frozen
        state.__dict__.update(body=body, exact=exact)
    return state


class Decoded:
    """A field of a sample that came as a frame: decoded when it is read.

    An instance's own values come before this; a sample that was made of values has the default here.
    """

    def __init__(self, field: Field, place: int, at: int, default: object) -> None:
        self._default, self._place, self._at, self._size = default, place, at, field.size
        self._span = 1 << 8 * field.size
        self._top = (self._span >> 1 if field.signed else self._span) - 1
        self._scale = field.scale
        self._whole = field.scale if isinstance(field.scale, int) else 0  # whole numbers stay such
        self._plain, self._status = field.plain, field.name == "status"
        self._nan = -1 if field.plain else field.raw_nan(8 * field.size)

    def __get__(self, state: FromFrame | None, owner: type) -> Any:
        return self._of(state)

    def _of(self, state: FromFrame | None) -> Any:
        if state is None or state.body is None:
            return self._default  # of the class, too: what `dataclasses.fields` and a reader of the class see
        if state.exact is not None:
            (number,) = NUMBER.unpack_from(state.exact, self._place * NUMBER.size)
            return status_of(int(number)) if self._status else int(number) if self._plain else number
        return self.value(state.body)

    def value(self, body: bytes) -> Any:
        """The value."""
        raw = self.raw(body)
        if self._plain:
            return status_of(raw) if self._status else raw
        if raw == self._nan:
            return nan
        return raw * self._whole if self._whole else raw * self._scale

    def raw(self, body: bytes) -> int:
        """The raw value."""
        at, read = self._at, body
        raw = read[at]
        if self._size > 1:
            raw |= read[at + 1] << 8
        if self._size > 2:
            high = read[at + 3]
            raw |= read[at + 2] << 16 | high << 24
        return raw - self._span if raw > self._top else raw
