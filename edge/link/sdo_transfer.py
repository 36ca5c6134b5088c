"""The transfer of a value that takes an SDO server several frames: in segments, or in blocks of them.

In a block transfer (CiA 301, 7.2.4.3.9 to 7.2.4.3.16) up to 127 numbered segments, a sub-block, have one
acknowledgement, and what it does not cover is sent again. Our sub-blocks of a download are shorter: then the
first byte of no segment is that of another request.
"""

from abc import ABC, abstractmethod
from binascii import crc_hqx  # CiA 301's: polynomial 0x1021, begun with 0
from collections.abc import Sequence
from dataclasses import dataclass

from edge.link.object_server import Aborted
from hostlink.wire import Abort
from hostlink.wire.sdo import (
    ANSWER_TO,
    LAST,
    SEGMENT,
    SEGMENTS,
    SPECIFIER,
    TOGGLE,
    Block,
    Sdo,
    goes_on,
    pack_segment,
    segment_data,
)  # fmt: skip


@dataclass(slots=True)
class Transfer(ABC):
    """A value being transferred, which knows itself what its client's frames ask for."""

    index: int
    sub: int
    writes: bool  # the client writes (download); else it reads
    data: bytearray  # received so far, or still to be sent
    size: int | None = None  # announced; None: it was not
    moved: bool = False  # a segment was transferred
    done: bool = False  # nothing is left to do but to write what was received
    last_used_s: float = 0.0

    @abstractmethod
    def take(self, frame: bytes) -> Sequence[bytes] | None:
        """The answers to a frame; None: it is not of this transfer. Raises Aborted."""


@dataclass(slots=True)
class SegmentTransfer(Transfer):
    """Each segment has its answer, in both directions."""

    toggle: int = 0

    def take(self, frame: bytes) -> Sequence[bytes] | None:
        command, specifier = frame[0], frame[0] & SPECIFIER
        if specifier not in SEGMENTS:
            return None
        own = Sdo.DOWNLOAD_SEGMENT if self.writes else Sdo.UPLOAD_SEGMENT
        if specifier != own or command & TOGGLE != self.toggle:
            raise Aborted(Abort.TOGGLE)
        self.toggle ^= TOGGLE
        head = ANSWER_TO[specifier] | command & TOGGLE
        if not self.writes:
            part = bytes(self.data[:SEGMENT])
            del self.data[:SEGMENT]
            self.done = not self.data
            return (pack_segment(head | (LAST if self.done else 0), part),)
        self.data += segment_data(frame)
        self.done = command & LAST > 0
        size = len(self.data)
        if self.size is not None and (size > self.size or (self.done and size < self.size)):
            raise Aborted(Abort.LENGTH)
        return (bytes((head,)) + bytes(SEGMENT),)


@dataclass(slots=True)
class BlockTransfer(Transfer, ABC):
    """The state common to both directions."""

    has_crc: bool = False  # the client knows the CRC
    n: int = 0  # segments of this sub-block that were sent, or received in order


@dataclass(slots=True)
class BlockUpload(BlockTransfer):
    """The client reads. Segments that are not acknowledged stay in `data`."""

    n_max: int = 0  # segments in the next sub-block, as the client wants
    end: bytes = b""

    def __post_init__(self) -> None:
        self._check_n_max()
        command = ANSWER_TO[Sdo.BLOCK_UPLOAD] | Block.END | -len(self.data) % SEGMENT << 2
        crc = crc_hqx(self.data, 0) if self.has_crc else 0
        self.end = bytes((command, *crc.to_bytes(2, "little"))) + bytes(5)

    def take(self, frame: bytes) -> Sequence[bytes] | None:
        subcommand = frame[0] ^ Sdo.BLOCK_UPLOAD
        if subcommand == Block.END and self.n == len(self.data) == 0:
            self.done = True
            return ()
        if subcommand == Block.RECEIVED:
            received_n, self.n_max = frame[1:3]
            if received_n > self.n:
                raise Aborted(Abort.SEQUENCE)
            self._check_n_max()
            del self.data[: received_n * SEGMENT]
        elif subcommand != Block.START:
            return None
        places = range(0, min(len(self.data), self.n_max * SEGMENT), SEGMENT)
        self.n = len(places)
        return [self._segment(number, at) for number, at in enumerate(places, 1)] or [self.end]

    def _segment(self, number: int, at: int) -> bytes:
        last = Block.LAST if at + SEGMENT >= len(self.data) else 0
        return bytes((last | number,)) + self.data[at : at + SEGMENT].ljust(SEGMENT, b"\0")

    def _check_n_max(self) -> None:
        if not 1 <= self.n_max <= Block.N_MAX:
            raise Aborted(Abort.BLOCK_SIZE)


@dataclass(slots=True)
class BlockDownload(BlockTransfer):
    """The client writes."""

    whole: bool = False  # all segments have come

    def take(self, frame: bytes) -> Sequence[bytes] | None:
        command, number = frame[0], frame[0] & ~Block.LAST
        if command & SPECIFIER == Sdo.BLOCK_DOWNLOAD and goes_on(command):
            self._end(command >> 2 & 7, int.from_bytes(frame[1:3], "little"))
            return (bytes((ANSWER_TO[Sdo.BLOCK_DOWNLOAD] | Block.END,)) + bytes(SEGMENT),)
        if number > Block.DOWNLOAD_N or self.whole:
            return None
        if number == 0:
            raise Aborted(Abort.SEQUENCE)
        if number == self.n + 1:
            self.n = number
            self.data += frame[1:]
        if number < Block.DOWNLOAD_N and not command & Block.LAST:
            return ()
        self.whole = command & Block.LAST > 0 and number == self.n
        received_n, self.n = self.n, 0
        head = ANSWER_TO[Sdo.BLOCK_DOWNLOAD] | Block.RECEIVED
        return (bytes((head, received_n, Block.DOWNLOAD_N)) + bytes(5),)

    def _end(self, unused_n: int, crc: int) -> None:
        if not self.whole:
            raise Aborted(Abort.COMMAND)
        del self.data[len(self.data) - unused_n :]
        if self.has_crc and crc != crc_hqx(self.data, 0):
            raise Aborted(Abort.CRC)
        if self.size not in (None, len(self.data)):
            raise Aborted(Abort.LENGTH)
        self.done = True
