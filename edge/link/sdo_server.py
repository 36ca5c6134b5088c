"""The SDO server of CiA 301: objects over CAN, in frames of 8 bytes.

`canopen` has one, but its transfers share state: a stray segment can write with the state that a read has
left.

- Values of up to 4 bytes need one frame each way and no state. A longer one starts a transfer; while it is
  under way another one is refused (NOT_NOW). A client that disappeared blocks it for `idle_s` at most.
- A segment that does not belong to the transfer ends it. One that comes again just as it was (its answer was
  late or lost) gets the same answer again, and moves nothing: a host repeats after a timeout.
- So does the write of a short value, if it was done. Our hosts number these in the bytes behind the value,
  which CiA 301 leaves open. Another client's counts as repeated where the client had time to give up waiting
  and no other request came between. What was refused is judged anew.
- During a block transfer nothing is answered but its own client: it would take an answer for a segment.
"""

import math
import time
from collections.abc import Callable, Sequence

from edge.limits import FILE_BYTES
from edge.link.object_server import Aborted, ObjectServer, size_of
from edge.link.params import PARAMS
from edge.link.sdo_transfer import BlockDownload, BlockTransfer, BlockUpload, SegmentTransfer, Transfer
from hostlink.wire import Abort
from hostlink.wire.sdo import (
    ANSWER_TO,
    EXPEDITED,
    HEAD,
    SEGMENTS,
    SIZE_GIVEN,
    SPECIFIER,
    Block,
    Sdo,
    expedited,
    goes_on,
    pack_abort,
)

DOWNLOAD_MAX = FILE_BYTES  # bounds the memory that a client can take
TOO_LONG = f"longer than {DOWNLOAD_MAX >> 20} MiB, so no calibration"
_NO_REPEAT = (b"", b"")  # the last segment and its answer; none


class SdoServer:
    """Answers the SDO requests to one node.

    objects     what is read and written
    send        sends the 8 bytes of an answer
    send_block  sends these instead of those it was given before that still wait, and lets samples pass
    """

    def __init__(
        self,
        objects: ObjectServer,
        send: Callable[[bytes], None],
        send_block: Callable[[Sequence[bytes]], object],
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._objects, self._clock_s = objects, clock_s
        self._send, self._send_block = send, send_block
        self._transfer: Transfer | None = None
        self._repeated = _NO_REPEAT
        self._written: dict[bytes, float] = {}  # short writes that were done, and when last asked for
        self._present = self._previous = b""  # requests
        self._handlers = {
            Sdo.DOWNLOAD: self._download,
            Sdo.UPLOAD: self._upload,
            Sdo.ABORT: self._aborted,
            Sdo.BLOCK_UPLOAD: self._block_upload,
            Sdo.BLOCK_DOWNLOAD: self._block_download,
        }

    def reset(self) -> None:
        """Forget the transfer under way."""
        self._transfer, self._repeated = None, _NO_REPEAT
        self._send_block(())

    def request(self, data: bytes) -> None:
        """Handle the 8 bytes of a request."""
        data = bytes(data)
        self._previous, self._present = self._present, data
        segment, answer = self._repeated
        if data == segment:
            self._send(answer)
            return
        command, index, sub = HEAD.unpack_from(data)
        specifier, transfer = command & SPECIFIER, self._transfer
        if transfer is not None and command != Sdo.ABORT:
            try:
                if self._go_on(transfer, data):
                    return
            except Aborted as error:
                self.reset()
                self._send(pack_abort(transfer.index, transfer.sub, error.code))
                return
        nameless = specifier in SEGMENTS or goes_on(command)
        try:
            if nameless or specifier not in self._handlers:
                raise Aborted(Abort.TOGGLE if specifier in SEGMENTS else Abort.COMMAND)
            self._handlers[specifier](command, index, sub, data)
        except Aborted as error:
            index, sub = (0, 0) if nameless else (index, sub)
            self._send(pack_abort(index, sub, error.code))

    def _go_on(self, transfer: Transfer, data: bytes) -> bool:
        """Answer a frame of the transfer under way; False: this is another request, and to be answered."""
        answers, now_s = transfer.take(data), self._clock_s()
        in_blocks = isinstance(transfer, BlockTransfer)
        if answers is None:
            if in_blocks and now_s - transfer.last_used_s >= PARAMS.idle_s:
                self.reset()  # its client has disappeared
                return False
            return in_blocks and transfer.moved
        transfer.moved, transfer.last_used_s = True, now_s
        written = transfer.writes and transfer.done
        if transfer.writes:
            self._check_length(len(transfer.data))
        if written:
            self._objects.write(transfer.index, transfer.sub, bytes(transfer.data))
        if transfer.done:
            self._transfer = None
        if written or not in_blocks:
            self._repeated = (data, answers[0])
            self._send(answers[0])
        elif answers:
            self._send_block(answers)
        return True

    def _begin(self, transfer: Transfer) -> None:
        other, transfer.last_used_s = self._transfer, self._clock_s()
        if other is not None and transfer.last_used_s - other.last_used_s < PARAMS.idle_s:
            asked = (other.index, other.sub, other.writes)
            if other.moved or asked != (transfer.index, transfer.sub, transfer.writes):
                raise Aborted(Abort.NOT_NOW)
        self._transfer, self._repeated = transfer, _NO_REPEAT

    def _upload(self, command: int, index: int, sub: int, data: bytes) -> None:
        value = self._read(index, sub)
        if len(value) <= 4:
            self._send(expedited(ANSWER_TO[Sdo.UPLOAD], index, sub, value))
            return
        self._begin(SegmentTransfer(index, sub, False, bytearray(value)))
        self._send_head(ANSWER_TO[Sdo.UPLOAD] | SIZE_GIVEN, index, sub, len(value))

    def _download(self, command: int, index: int, sub: int, data: bytes) -> None:
        if command & EXPEDITED:
            size = 4 - (command >> 2 & 3) if command & SIZE_GIVEN else size_of(index, sub)
            self._write_once(index, sub, data, size)
        else:
            announced = self._announced(data, command & SIZE_GIVEN)
            self._begin(SegmentTransfer(index, sub, True, bytearray(), announced))
        self._send_head(ANSWER_TO[Sdo.DOWNLOAD], index, sub, 0)

    def _block_upload(self, command: int, index: int, sub: int, data: bytes) -> None:
        value, crc = self._read(index, sub), command & Block.CRC
        self._begin(BlockUpload(index, sub, False, bytearray(value), has_crc=crc > 0, n_max=data[4]))
        self._send_head(ANSWER_TO[Sdo.BLOCK_UPLOAD] | Block.SIZE_GIVEN | crc, index, sub, len(value))

    def _block_download(self, command: int, index: int, sub: int, data: bytes) -> None:
        announced, crc = self._announced(data, command & Block.SIZE_GIVEN), command & Block.CRC
        self._begin(BlockDownload(index, sub, True, bytearray(), announced, has_crc=crc > 0))
        self._send_head(ANSWER_TO[Sdo.BLOCK_DOWNLOAD] | crc, index, sub, Block.DOWNLOAD_N)

    def _aborted(self, command: int, index: int, sub: int, data: bytes) -> None:
        """The client aborts; not answered."""
        transfer = self._transfer
        if transfer is not None and (index, sub) in ((transfer.index, transfer.sub), (0, 0)):
            self.reset()

    def _send_head(self, command: int, index: int, sub: int, number: int) -> None:
        self._send(HEAD.pack(command, index, sub) + number.to_bytes(4, "little"))

    def _read(self, index: int, sub: int) -> bytes:
        value = self._objects.read(index, sub)
        if not value:
            raise Aborted(Abort.NO_DATA)
        return value

    def _write_once(self, index: int, sub: int, data: bytes, size: int) -> None:
        """Write a short value, but not again where the request is a repetition."""
        now_s = self._clock_s()
        ago_s = now_s - self._written.pop(data, -math.inf)
        if any(data[4 + size :]):
            repeats = ago_s < PARAMS.repeat_s
        else:  # no client waits for less than a quarter of the time after which it counts as gone
            repeats = data == self._previous and PARAMS.idle_s / 4 < ago_s < PARAMS.idle_s
        if not repeats:
            self._objects.write(index, sub, data[4 : 4 + size])
        self._written[data] = now_s
        if len(self._written) > PARAMS.control_n:
            del self._written[next(iter(self._written))]

    def _announced(self, data: bytes, given: int) -> int | None:
        """The length of the value to come; None: not known."""
        size = int.from_bytes(data[4:8], "little") if given else None
        self._check_length(size or 0)
        return size

    def _check_length(self, size: int) -> None:
        if size > DOWNLOAD_MAX:
            self._objects.refusal = TOO_LONG
            raise Aborted(Abort.LENGTH)
