# cython: annotation_typing=False
"""What is done with every received state frame: its checks, and decoding a field of it when that is read.

Compiled where a compiler is, with the C types in `body.pxd`; the same without. A body is the frame's version and
fields, which a received sample keeps.
"""

from __future__ import annotations

from binascii import crc_hqx
from math import nan
from typing import Any, Final
from zlib import crc32

from hostlink.wire.errors import CorruptFrame
from hostlink.wire.fields import CHECK_SIZE, DATA_ID, HEADER_SIZE, OLDER, STATE_SIZE, VERSION, Field
from hostlink.wire.status import status_of

__all__ = ["BODY", "Decoded", "body_in"]

BODY: Final = "body"  # its name among the values of a received sample
_KEY: Final = BODY
_AT: Final = HEADER_SIZE - 1
_END: Final = STATE_SIZE - CHECK_SIZE
_OURS: Final = VERSION
_ID: Final = DATA_ID.to_bytes(2, "little")


def body_in(frame: bytes) -> bytes:
    """Version and fields of a frame. Raises CorruptFrame: length, CRC, version or check is wrong."""
    if len(frame) != STATE_SIZE:
        raise CorruptFrame(f"state frame of {len(frame)} bytes instead of {STATE_SIZE}")
    is_ours = frame[_AT] == _OURS
    older = None if is_ours else OLDER.get(frame[_AT])
    data_id = _ID if older is None else older.data_id.to_bytes(2, "little")
    crc = crc_hqx(data_id, crc_hqx(frame[2:], 0xFFFF))  # as `e2e.check_p5`
    if crc != frame[0] | frame[1] << 8:
        raise CorruptFrame("state frame with a wrong CRC")
    if not is_ours and older is None:
        raise CorruptFrame("state frame whose version does not fit its CRC")
    body = frame[_AT:_END]
    if crc32(body) & 0xFFFF != frame[_END] | frame[_END + 1] << 8:
        raise CorruptFrame("state frame whose content does not fit its check")
    return body


class Decoded:
    """A field of a sample that came as a frame: decoded when it is read.

    An instance's own values come before this; a sample that was made of values has the default here.
    """

    def __init__(self, field: Field, at: int, default: object) -> None:
        self._default, self._at, self._size = default, at, field.size
        self._span = 1 << 8 * field.size
        self._top = (self._span >> 1 if field.signed else self._span) - 1
        self._scale = field.scale
        self._plain, self._status = field.plain, field.name == "status"
        self._nan = -1 if field.plain else field.raw_nan(8 * field.size)

    def __get__(self, state: Any, owner: type) -> Any:
        if state is None:
            return self._default  # of the class: what `dataclasses.fields` and a reader of the class see
        return self._of(state.__dict__)

    def _of(self, values: dict[str, Any]) -> Any:
        body = values.get(_KEY)
        return self._default if body is None else self.value(body)

    def value(self, body: bytes) -> Any:
        """The value."""
        raw = self.raw(body)
        if self._plain:
            return status_of(raw) if self._status else raw
        return nan if raw == self._nan else raw * self._scale

    def raw(self, body: bytes) -> int:
        """The raw value."""
        at, raw = self._at, body[self._at]
        if self._size > 1:
            raw |= body[at + 1] << 8
        if self._size > 2:
            high = body[at + 3]
            raw |= body[at + 2] << 16 | high << 24
        return raw - self._span if raw > self._top else raw
