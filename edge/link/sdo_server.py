"""The SDO server of CiA 301: objects over CAN, in frames of 8 bytes.

`canopen` has one, but its transfers share state: a stray segment can write with the state that a read has
left. Here one segmented transfer is under way at a time, with its own state.

Rules
- Values of up to 4 bytes need one frame each way and no state: they are served at any time.
- A longer one starts a transfer. While it is under way another one is refused (NOT_NOW); a client that
  disappeared blocks it for `idle_s` at most. A request that is repeated before the first segment restarts it.
- A segment must belong to the transfer: the same direction, the expected toggle bit, not beyond the announced
  size. Any other ends the transfer. An abort for its object, or for none, ends it too.
- A segment that comes again just as it was (its answer was late or lost) gets the same answer again, and
  moves nothing. CiA 301 has no repetition; `canopen`'s client repeats after a timeout.
- Block transfer is not offered: a block upload is answered as a plain one, as CiA 301 allows.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from edge.limits import CALIBRATION_BYTES
from edge.link.object_server import Aborted, ObjectServer
from edge.link.params import PARAMS
from hostlink.wire import Abort

__all__ = ["DOWNLOAD_MAX", "TOO_LONG", "SdoServer"]

DOWNLOAD_MAX = CALIBRATION_BYTES  # bounds the memory that a client can take
TOO_LONG = f"longer than {DOWNLOAD_MAX >> 20} MiB, so no calibration"

# Command specifiers, upper three bits of the first byte (CiA 301, 7.2.4.3).
DOWNLOAD_SEGMENT, DOWNLOAD, UPLOAD, UPLOAD_SEGMENT, ABORT, BLOCK_UPLOAD = 0x00, 0x20, 0x40, 0x60, 0x80, 0xA0
UPLOAD_RESPONSE, DOWNLOAD_RESPONSE, UPLOAD_SEGMENT_RESPONSE, DOWNLOAD_SEGMENT_RESPONSE = (
    0x40,
    0x60,
    0x00,
    0x20,
)
EXPEDITED, SIZE_GIVEN, TOGGLE, LAST = 0x02, 0x01, 0x10, 0x01
_HEAD = struct.Struct("<BHB")
_SEGMENT = 7
_NO_REPEAT = (b"", b"")  # the last segment and its answer; none


@dataclass(slots=True)
class _Transfer:
    """A value of more than 4 bytes being transferred.

    writes   the client writes (download); else it reads
    data     received so far, or still to be sent
    size     announced; None: it was not
    moved    a segment was transferred
    """

    index: int
    sub: int
    writes: bool
    data: bytearray
    size: int | None = None
    toggle: int = 0
    moved: bool = False
    last_used_s: float = field(default_factory=time.monotonic)


class SdoServer:
    """Answers the SDO requests to one node.

    objects  what is read and written
    send     sends the 8 bytes of an answer
    """

    def __init__(
        self,
        objects: ObjectServer,
        send: Callable[[bytes], None],
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._objects, self._send, self._clock_s = objects, send, clock_s
        self._transfer: _Transfer | None = None
        self._repeated = _NO_REPEAT
        self._handlers = {
            DOWNLOAD_SEGMENT: self._download_segment,
            DOWNLOAD: self._download,
            UPLOAD: self._upload,
            UPLOAD_SEGMENT: self._upload_segment,
            ABORT: self._aborted,
            BLOCK_UPLOAD: self._upload,
        }

    @property
    def held_bytes(self) -> int:
        """Memory taken by the transfer under way."""
        return len(self._transfer.data) if self._transfer else 0

    def reset(self) -> None:
        """Forget the transfer under way."""
        self._transfer, self._repeated = None, _NO_REPEAT

    def request(self, data: bytes) -> None:
        """Handle the 8 bytes of a request."""
        segment, answer = self._repeated
        if data == segment:
            self._send(answer)
            return
        command, index, sub = _HEAD.unpack_from(data)
        handler = self._handlers.get(command & 0xE0)
        try:
            if handler is None:
                raise Aborted(Abort.GENERAL)
            handler(command, index, sub, data)
        except Aborted as error:
            if command & 0xE0 in (DOWNLOAD_SEGMENT, UPLOAD_SEGMENT):  # has no object of its own
                transfer = self._transfer
                self.reset()
                index, sub = (transfer.index, transfer.sub) if transfer else (0, 0)
            self._send(struct.pack("<BHBL", ABORT, index, sub, error.code))

    # ---- starting -----------------------------------------------------------------------------------

    def _upload(self, command: int, index: int, sub: int, data: bytes) -> None:
        value = self._objects.read(index, sub)
        if not value:
            raise Aborted(Abort.NO_DATA)
        head = UPLOAD_RESPONSE | SIZE_GIVEN
        if len(value) <= 4:
            head |= EXPEDITED | (4 - len(value)) << 2
            self._send(_HEAD.pack(head, index, sub) + value.ljust(4, b"\0"))
            return
        self._begin(_Transfer(index, sub, False, bytearray(value), len(value), last_used_s=self._clock_s()))
        self._send(_HEAD.pack(head, index, sub) + len(value).to_bytes(4, "little"))

    def _download(self, command: int, index: int, sub: int, data: bytes) -> None:
        if command & EXPEDITED:
            size = 4 - (command >> 2 & 3) if command & SIZE_GIVEN else 4
            self._objects.write(index, sub, data[4 : 4 + size])
        else:
            size = int.from_bytes(data[4:8], "little")
            self._check_length(size if command & SIZE_GIVEN else 0)
            announced = size if command & SIZE_GIVEN else None
            self._begin(_Transfer(index, sub, True, bytearray(), announced, last_used_s=self._clock_s()))
        self._send(_HEAD.pack(DOWNLOAD_RESPONSE, index, sub) + bytes(4))

    def _begin(self, transfer: _Transfer) -> None:
        other = self._transfer
        if other is not None and self._clock_s() - other.last_used_s < PARAMS.idle_s:
            asked = (other.index, other.sub, other.writes)
            if other.moved or asked != (transfer.index, transfer.sub, transfer.writes):
                raise Aborted(Abort.NOT_NOW)
        self._transfer, self._repeated = transfer, _NO_REPEAT

    # ---- segments -----------------------------------------------------------------------------------

    def _current(self, command: int, writes: bool) -> _Transfer:
        """The transfer that this segment belongs to."""
        transfer = self._transfer
        if transfer is None or transfer.writes != writes:
            raise Aborted(Abort.TOGGLE)
        if command & TOGGLE != transfer.toggle:
            raise Aborted(Abort.TOGGLE)
        transfer.toggle ^= TOGGLE
        transfer.moved = True
        transfer.last_used_s = self._clock_s()
        return transfer

    def _upload_segment(self, command: int, index: int, sub: int, data: bytes) -> None:
        transfer = self._current(command, writes=False)
        part = bytes(transfer.data[:_SEGMENT])
        del transfer.data[:_SEGMENT]
        head = UPLOAD_SEGMENT_RESPONSE | command & TOGGLE | (_SEGMENT - len(part)) << 1
        if not transfer.data:
            head |= LAST
            self._transfer = None
        self._answer_segment(data, bytes((head,)) + part.ljust(_SEGMENT, b"\0"))

    def _download_segment(self, command: int, index: int, sub: int, data: bytes) -> None:
        transfer = self._current(command, writes=True)
        transfer.data += data[1 : 8 - (command >> 1 & 7)]
        size = len(transfer.data)
        self._check_length(size)
        last = bool(command & LAST)
        if transfer.size is not None and (size > transfer.size or (last and size < transfer.size)):
            raise Aborted(Abort.LENGTH)
        if last:
            self._objects.write(transfer.index, transfer.sub, bytes(transfer.data))
            self._transfer = None
        self._answer_segment(data, bytes((DOWNLOAD_SEGMENT_RESPONSE | command & TOGGLE,)) + bytes(_SEGMENT))

    def _answer_segment(self, segment: bytes, answer: bytes) -> None:
        self._repeated = (bytes(segment), answer)
        self._send(answer)

    def _check_length(self, size: int) -> None:
        if size > DOWNLOAD_MAX:
            self._objects.refusal = TOO_LONG
            raise Aborted(Abort.LENGTH)

    def _aborted(self, command: int, index: int, sub: int, data: bytes) -> None:
        """The client aborts; not answered."""
        transfer = self._transfer
        if transfer is not None and (index, sub) in ((transfer.index, transfer.sub), (0, 0)):
            self.reset()
