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
from edge.link.sdo_transfer import BlockDownload, BlockTransfer, BlockUpload, Transfer
from hostlink.wire import Abort
from hostlink.wire.sdo import (
    ANSWER_TO,
    EXPEDITED,
    HEAD,
    LAST,
    SEGMENT,
    SEGMENTS,
    SIZE_GIVEN,
    SPECIFIER,
    TOGGLE,
    Block,
    Sdo,
    expedited,
    goes_on,
    pack_abort,
    pack_segment,
    segment_data,
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
        send_block: Callable[[Sequence[bytes]], None],
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._objects, self._clock_s = objects, clock_s
        self._send, self._send_block = send, send_block
        self._transfer: Transfer | None = None
        self._repeated = _NO_REPEAT
        self._written: dict[bytes, float] = {}  # short writes that were done, and when last asked for
        self._newest = b""
        self._handlers = {
            Sdo.DOWNLOAD_SEGMENT: self._download_segment,
            Sdo.DOWNLOAD: self._download,
            Sdo.UPLOAD: self._upload,
            Sdo.UPLOAD_SEGMENT: self._upload_segment,
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
        segment, answer = self._repeated
        if data == segment:
            self._send(answer)
            return
        command, index, sub = HEAD.unpack_from(data)
        handler = self._handlers.get(command & SPECIFIER)
        block = None if command == Sdo.ABORT else self._block()
        try:
            if block is not None and self._go_on(block, data):
                return
            block = None
            if handler is None:
                raise Aborted(Abort.COMMAND)
            handler(command, index, sub, data)
        except Aborted as error:
            if block is not None or command & SPECIFIER in SEGMENTS:
                transfer = self._transfer
                self.reset()
                index, sub = (transfer.index, transfer.sub) if transfer else (0, 0)
            elif goes_on(command):
                index, sub = 0, 0
            self._send(pack_abort(index, sub, error.code))
        self._newest = data

    def _upload(self, command: int, index: int, sub: int, data: bytes) -> None:
        self._answer_upload(index, sub, self._read(index, sub))

    def _block_upload(self, command: int, index: int, sub: int, data: bytes) -> None:
        if goes_on(command):
            raise Aborted(Abort.COMMAND)
        value, crc = self._read(index, sub), command & Block.CRC
        self._begin(
            BlockUpload(index, sub, False, bytearray(value), len(value), has_crc=crc > 0, n_max=data[4])
        )
        head = HEAD.pack(ANSWER_TO[Sdo.BLOCK_UPLOAD] | Block.SIZE_GIVEN | crc, index, sub)
        self._send(head + len(value).to_bytes(4, "little"))

    def _block_download(self, command: int, index: int, sub: int, data: bytes) -> None:
        if goes_on(command):
            raise Aborted(Abort.COMMAND)
        size = int.from_bytes(data[4:8], "little") if command & Block.SIZE_GIVEN else None
        self._check_length(size or 0)
        crc = command & Block.CRC
        self._begin(BlockDownload(index, sub, True, bytearray(), size, has_crc=crc > 0))
        head = HEAD.pack(ANSWER_TO[Sdo.BLOCK_DOWNLOAD] | crc, index, sub)
        self._send(head + Block.DOWNLOAD_N.to_bytes(4, "little"))

    def _block(self) -> BlockTransfer | None:
        """The block transfer under way; one whose client has disappeared ends here."""
        transfer = self._transfer
        if isinstance(transfer, BlockTransfer) and self._clock_s() - transfer.last_used_s >= PARAMS.idle_s:
            self.reset()
        return self._transfer if isinstance(self._transfer, BlockTransfer) else None

    def _go_on(self, block: BlockTransfer, data: bytes) -> bool:
        """Answer a frame of a block transfer; False: this is another request, and to be answered."""
        answers = block.take(data)
        if answers is None:
            return block.moved
        block.moved, block.last_used_s = True, self._clock_s()
        self._check_length(len(block.data))
        if block.done:
            if block.writes:
                self._objects.write(block.index, block.sub, bytes(block.data))
                self._repeated = (data, answers[0])
            self._transfer = None
        if answers:
            self._send_block(answers)
        return True

    def _read(self, index: int, sub: int) -> bytes:
        value = self._objects.read(index, sub)
        if not value:
            raise Aborted(Abort.NO_DATA)
        return value

    def _answer_upload(self, index: int, sub: int, value: bytes) -> None:
        if len(value) <= 4:
            self._send(expedited(ANSWER_TO[Sdo.UPLOAD], index, sub, value))
            return
        self._begin(Transfer(index, sub, False, bytearray(value), len(value)))
        head = HEAD.pack(ANSWER_TO[Sdo.UPLOAD] | SIZE_GIVEN, index, sub)
        self._send(head + len(value).to_bytes(4, "little"))

    def _download(self, command: int, index: int, sub: int, data: bytes) -> None:
        if command & EXPEDITED:
            size = 4 - (command >> 2 & 3) if command & SIZE_GIVEN else size_of(index, sub)
            self._write_once(index, sub, data, size)
        else:
            size = int.from_bytes(data[4:8], "little")
            self._check_length(size if command & SIZE_GIVEN else 0)
            announced = size if command & SIZE_GIVEN else None
            self._begin(Transfer(index, sub, True, bytearray(), announced))
        self._send(HEAD.pack(ANSWER_TO[Sdo.DOWNLOAD], index, sub) + bytes(4))

    def _write_once(self, index: int, sub: int, data: bytes, size: int) -> None:
        """Write a short value, but not again where the request is a repetition."""
        now_s = self._clock_s()
        ago_s = now_s - self._written.pop(data, -math.inf)
        if any(data[4 + size :]):
            repeats = ago_s < PARAMS.repeat_s
        else:  # no client waits for less than a quarter of the time after which it counts as gone
            repeats = data == self._newest and PARAMS.idle_s / 4 < ago_s < PARAMS.idle_s
        if not repeats:
            self._objects.write(index, sub, data[4 : 4 + size])
        self._written[data] = now_s
        if len(self._written) > PARAMS.control_n:
            del self._written[next(iter(self._written))]

    def _begin(self, transfer: Transfer) -> None:
        other, transfer.last_used_s = self._transfer, self._clock_s()
        if other is not None and transfer.last_used_s - other.last_used_s < PARAMS.idle_s:
            asked = (other.index, other.sub, other.writes)
            if other.moved or asked != (transfer.index, transfer.sub, transfer.writes):
                raise Aborted(Abort.NOT_NOW)
        self._transfer, self._repeated = transfer, _NO_REPEAT

    def _current(self, command: int, writes: bool) -> Transfer:
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
        part = bytes(transfer.data[:SEGMENT])
        del transfer.data[:SEGMENT]
        head = ANSWER_TO[Sdo.UPLOAD_SEGMENT] | command & TOGGLE
        if not transfer.data:
            head |= LAST
            self._transfer = None
        self._answer_segment(data, pack_segment(head, part))

    def _download_segment(self, command: int, index: int, sub: int, data: bytes) -> None:
        transfer = self._current(command, writes=True)
        transfer.data += segment_data(data)
        size = len(transfer.data)
        self._check_length(size)
        last = bool(command & LAST)
        if transfer.size is not None and (size > transfer.size or (last and size < transfer.size)):
            raise Aborted(Abort.LENGTH)
        if last:
            self._objects.write(transfer.index, transfer.sub, bytes(transfer.data))
            self._transfer = None
        self._answer_segment(
            data, bytes((ANSWER_TO[Sdo.DOWNLOAD_SEGMENT] | command & TOGGLE,)) + bytes(SEGMENT)
        )

    def _answer_segment(self, segment: bytes, answer: bytes) -> None:
        self._repeated = (segment, answer)
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
