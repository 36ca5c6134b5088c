"""A CAN interface of the kernel, by its sockets alone: python-can would take 14 MB and a tenth of the start.

The kernel passes on only what is wanted: other fingers' samples would wake the reader a thousand times a
second.
"""

import select
import socket
import struct
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from socket import CAN_EFF_FLAG, CAN_ERR_FLAG, CAN_RTR_FLAG, CAN_SFF_MASK

from edge.link import medium
from edge.link.medium import FULL, CanFrame, Medium, MediumFull, is_off_after

INTERFACES = Path("/sys/class/net")

# linux/can.h, linux/can/raw.h
_CLASSIC, _FD = struct.Struct("=IBxxx8s"), struct.Struct("=IBBxx64s")  # can_frame, canfd_frame
_FILTER = struct.Struct("=II")
_FD_FLAGS = 0x01 | 0x04  # CANFD_BRS, CANFD_FDF
CAN_RAW_ERR_FILTER = 2  # not in the type checker's `socket`


class SocketCanMedium(Medium):
    """An open interface.

    bus       a raw CAN socket that does not block
    carrier   file that holds 1 while the controller is on the bus. If it is off, the kernel accepts frames
              and discards them: a write proves nothing
    """

    instant = True

    def __init__(self, bus: socket.socket, carrier: Path) -> None:
        self._bus, self._carrier = bus, carrier
        self.bus_off = False  # it is read for each frame, and sooner than the class's own

    def write(self, item: CanFrame) -> None:
        if self.bus_off:
            raise MediumFull("bus-off")
        data = item.data
        if item.fd:
            frame = _FD.pack(item.can_id, len(data), _FD_FLAGS, data)
        else:
            frame = _CLASSIC.pack(item.can_id, len(data), data)
        try:
            self._bus.send(frame)
        except OSError as error:
            if error.errno in FULL:
                raise MediumFull(str(error)) from error
            raise

    def read(self, timeout_s: float) -> CanFrame | None:
        ready = select.select([self._bus], (), (), timeout_s)[0]
        try:
            frame = self._bus.recv(_FD.size) if ready else b""
        except BlockingIOError:  # the reader was woken by an error that a writer got
            return None
        found = self._take(frame) if ready else None
        if self.bus_off:  # also if the restart's message was missed
            with suppress(OSError):  # an interface that is down raises an error
                self.bus_off = self._carrier.read_text().strip() != "1"
        return found

    def close(self) -> None:
        self._bus.close()

    def _take(self, frame: bytes) -> CanFrame | None:
        """The frame, if it is one that a node may listen to."""
        if len(frame) not in (_CLASSIC.size, _FD.size):
            raise ValueError(f"{len(frame)} bytes are no CAN frame")
        can_id, length = struct.unpack_from("=IB", frame)
        if can_id & CAN_ERR_FLAG:
            self.bus_off = is_off_after(can_id, self.bus_off)
            return None
        if can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG):
            return None
        return CanFrame(can_id, frame[8 : 8 + length], len(frame) == _FD.size)


def open_socket(interface: str, fd: bool, wanted: Sequence[int]) -> SocketCanMedium:
    """Open an interface of the kernel.

    fd      send and receive CAN FD frames too
    wanted  identifiers to be received
    Raises  OSError: no such interface, no CAN in this kernel
    """
    bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    try:
        mask = CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG
        filters = b"".join(_FILTER.pack(can_id, mask) for can_id in wanted)
        bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, filters)
        off_or_back = medium.CAN_ERR_BUSOFF | medium.CAN_ERR_RESTARTED
        bus.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, off_or_back)
        if fd:
            bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        # An interface that goes down reports it once, to the reader or to a writer: a reader that was woken
        # for it after the writer got it would wait for ever.
        bus.setblocking(False)
        bus.bind((interface,))
    except BaseException:
        bus.close()
        raise
    return SocketCanMedium(bus, INTERFACES / interface / "carrier")
