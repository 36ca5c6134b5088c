"""The CAN bus of an address, for the fingertip and for the host alike.

What comes in and is no frame is junk: it is counted and costs nothing but itself. The interface decides
what it is; whatever else a driver raises means that the bus has failed.

    udp_multicast  a datagram that does not unpack. It stands alone: no number of them says anything about
                   the socket
    slcan          a line that is no frame: noise, or a byte was lost. After `JUNK_LINES` in a row the adapter
                   must be opened anew
"""

from __future__ import annotations

import logging
import os
import socket
import sys
from typing import TYPE_CHECKING, Any

from hostlink.wire.address import Address
from hostlink.wire.port_lock import PortLock

if TYPE_CHECKING:
    import can

__all__ = ["OpenBus", "open_can_bus"]

FD_CLOCK_HZ = 80_000_000  # CiA 601-3's recommended CAN FD clock
FD_SAMPLE_POINT = 80.0  # percent, both phases; CiA 601-3
IP_MULTICAST_ALL, IPV6_MULTICAST_ALL = 49, 29  # linux/in.h, linux/in6.h; Python names neither
JUNK_LINES = 100  # 0.1 s of five fingers at 250 Hz
LINE_BYTES = 256  # the longest frame of slcan takes 143


class OpenBus:
    """A python-can bus that drops junk.

    interface  python-can's name of its kind
    lock       of a serial-line adapter's port; closed with the bus
    junk_n     what came in and was no frame
    """

    def __init__(self, bus: can.BusABC, interface: str, lock: PortLock | None = None) -> None:
        self.junk_n = 0
        self._bus: Any = bus
        self._interface = interface
        self._lock = lock
        self._in_row = 0

    def recv(self, timeout: float) -> can.Message | None:
        """A frame; None: none came, or it was junk. Raises whatever the driver raises when the bus fails."""
        try:
            message: can.Message | None = self._bus.recv(timeout)
            if self._interface == "slcan":
                _check_line(message, self._bus._buffer)
        except Exception as error:
            if not _is_junk(self._interface, error):
                raise
            self._count_junk(error)
            return None
        if message is not None:
            self._in_row = 0
        return message

    def _count_junk(self, error: Exception) -> None:
        """Raises OSError: too much in a row."""
        self.junk_n += 1
        if self._interface == "slcan":
            self._bus._buffer.clear()  # python-can keeps what it cannot decode, and fails at it for ever
            self._in_row += 1
            if self._in_row >= JUNK_LINES:
                why = f"{self._in_row} lines in a row are no frames; is its baud rate right?"
                raise OSError(why) from error

    def send(self, message: can.Message, timeout: float) -> None:
        """Raises whatever the driver raises."""
        self._bus.send(message, timeout=timeout)

    def fileno(self) -> int:
        """The bus's file descriptor."""
        return int(self._bus.fileno())

    def shutdown(self) -> None:
        """Close it. Raises whatever the driver raises; the port is free in any case."""
        try:
            self._bus.shutdown()
        finally:
            if self._interface == "slcan":  # python-can leaves it open where the adapter is gone
                self._bus.serialPortOrig.close()
            if self._lock is not None:
                self._lock.close()


def _is_junk(interface: str, error: Exception) -> bool:
    """Whether python-can reports so that something which came in is no frame."""
    cause = error.__cause__
    if interface == "udp_multicast":  # a failed socket has an OSError as its cause, or none
        return type(error).__name__ == "CanOperationError" and not isinstance(cause, OSError | None)
    if interface == "slcan":  # errors of the port are wrapped; those of reading a line are not
        return isinstance(error, ValueError | IndexError) or isinstance(cause, UnicodeDecodeError)
    return False


def _check_line(message: can.Message | None, rest: bytes) -> None:
    """Check what slcan made of a line, for it takes much for a frame. Raises ValueError.

    rest  of the line that is not complete yet
    """
    if message is None:
        if len(rest) > LINE_BYTES:
            raise ValueError("a line without an end")
    elif message.arbitration_id >> (29 if message.is_extended_id else 11):
        raise ValueError("no such identifier")
    elif len(message.data) != message.dlc and not message.is_remote_frame:
        raise ValueError("bytes are missing")


def _hear_own_group_alone(number: int) -> None:
    """Linux else gives a socket whatever another of this machine has joined: two buses would be one."""
    with socket.socket(fileno=os.dup(number)) as same:
        if same.family == socket.AF_INET6:
            same.setsockopt(socket.IPPROTO_IPV6, IPV6_MULTICAST_ALL, 0)
        else:
            same.setsockopt(socket.IPPROTO_IP, IP_MULTICAST_ALL, 0)


def open_can_bus(address: Address) -> OpenBus:
    """The bus of an address.

    Raises  the errors of python-can and its drivers: can.CanError, OSError, ValueError, TypeError; without a
            driver's own library ImportError, AttributeError, NameError
    """
    import can

    # python-can also logs what it raises; without a handler that would be a second line on stderr.
    logging.getLogger("can").addHandler(logging.NullHandler())
    arguments = address.bus_arguments()
    # Locked before anything is sent to the adapter.
    lock = PortLock(address.channel) if address.interface == "slcan" else None
    try:
        timing = address.fd_timing()
        if timing is not None:
            arguments.pop("bitrate", None)
            arguments["timing"] = can.BitTimingFd.from_sample_point(
                f_clock=FD_CLOCK_HZ,
                nom_bitrate=timing[0],
                nom_sample_point=FD_SAMPLE_POINT,
                data_bitrate=timing[1],
                data_sample_point=FD_SAMPLE_POINT,
            )
        bus = can.Bus(**arguments)
        if address.interface == "socketcan":
            # An interface that goes down reports it once, to the reader or to a writer: a reader that was
            # woken for it after the writer got it would wait for ever.
            os.set_blocking(bus.fileno(), False)
        if address.interface == "udp_multicast" and sys.platform == "linux":
            _hear_own_group_alone(bus.fileno())
    except BaseException:
        if lock is not None:
            lock.close()
        raise
    return OpenBus(bus, address.interface, lock)
