"""Open buses and lines, and the meaning of their failures: MediumFull (drop, go on), MediumError (reopen).

python-can and pyserial report a dead medium in many ways: their own errors, OSError, ValueError for a closed
file descriptor, TypeError for a handle that became None. All of them are translated here.
"""

from __future__ import annotations

import errno
import logging
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

import can
import serial

from edge.link.params import PARAMS
from hostlink.can_bus import open_can_bus
from hostlink.wire.address import Address
from hostlink.wire.open_errors import cannot_open, is_junk, message_of
from hostlink.wire.port_lock import PortLock

__all__ = ["CanMedium", "Medium", "MediumError", "MediumFull", "SerialMedium", "open_bus", "open_line"]

INSTANT = frozenset({"socketcan", "virtual", "udp_multicast"})  # interfaces whose send(timeout=0) returns
FULL = frozenset({errno.ENOBUFS, errno.EAGAIN, errno.EWOULDBLOCK})
INTERFACES = Path("/sys/class/net")

# Error frames of SocketCAN: class bits in the identifier (linux/can/error.h).
CAN_ERR_BUSOFF = 0x40
CAN_ERR_RESTARTED = 0x100

for _library in ("can", "canopen"):
    # They also log what they raise: that would be a second line on stderr.
    logging.getLogger(_library).addHandler(logging.NullHandler())
    logging.getLogger(_library).propagate = False


class MediumError(Exception):
    """The medium failed and must be reopened."""


class MediumFull(Exception):
    """The medium accepts nothing now; it may in a moment."""


class Medium(Protocol):
    """An open bus or line. What it carries: can.Message on a bus, bytes on a line."""

    instant: bool  # whether a write always returns at once
    bus_off: bool

    def write(self, item: Any) -> None:
        """Raises MediumFull, MediumError."""
        ...

    def read(self, timeout_s: float) -> Any:
        """What came in, or None. Raises MediumError."""
        ...

    def close(self) -> None: ...


_NO_DRIVER = (ImportError, AttributeError, NameError)  # python-can without a driver's own library
_BROKEN = (can.CanError, OSError, ValueError, TypeError)  # serial.SerialException is an OSError


class CanMedium:
    """A python-can bus.

    instant  whether its `send(timeout=0)` returns at once
    carrier  file of a SocketCAN interface that holds 1 while its controller is on the bus. If it is off, the
             kernel accepts frames and discards them: a write proves nothing
    lock     of a serial-line adapter's port
    """

    def __init__(
        self, bus: can.BusABC, instant: bool, carrier: Path | None = None, lock: PortLock | None = None
    ) -> None:
        self.instant = instant
        self.bus_off = False
        self.junk_n = 0  # datagrams that were no frames
        self._bus = bus
        self._carrier = carrier
        self._lock = lock
        self._timeout_s = 0.0 if instant else PARAMS.write_s

    def write(self, item: can.Message) -> None:
        if self.bus_off and self._carrier is not None:
            raise MediumFull("bus-off")
        try:
            self._bus.send(item, timeout=self._timeout_s)
        except _BROKEN as error:
            if _means_full(error):
                raise MediumFull(str(error)) from error
            raise MediumError(message_of(error)) from error
        self.bus_off = False

    def read(self, timeout_s: float) -> can.Message | None:
        try:
            message = self._bus.recv(timeout_s)
        except _BROKEN as error:
            if is_junk(error):
                self.junk_n += 1
                return None
            raise MediumError(message_of(error)) from error
        if message is not None and message.is_error_frame:
            if message.arbitration_id & CAN_ERR_BUSOFF:
                self.bus_off = True
            elif message.arbitration_id & CAN_ERR_RESTARTED:
                self.bus_off = False
            return None
        if self.bus_off and self._carrier is not None:  # also if the restart's message was missed
            with suppress(OSError):  # an interface that is down raises an error
                self.bus_off = self._carrier.read_text().strip() != "1"
        return message

    def close(self) -> None:
        with suppress(*_BROKEN):  # a dead bus fails to close
            self._bus.shutdown()
        if self._lock is not None:
            self._lock.close()


class SerialMedium:
    """A pyserial port."""

    instant = False
    bus_off = False

    def __init__(self, port: Any) -> None:
        self._port = port

    def write(self, item: bytes) -> None:
        try:
            self._port.write(item)
        except serial.SerialTimeoutException as error:
            with suppress(*_BROKEN):
                self._port.reset_output_buffer()  # its contents are old by now
            raise MediumFull(str(error)) from error
        except _BROKEN as error:
            raise MediumError(message_of(error)) from error

    def read(self, timeout_s: float) -> bytes | None:
        try:
            self._port.timeout = timeout_s
            first = self._port.read(1)
            if not first:
                return None
            return bytes(first + self._port.read(min(self._port.in_waiting, PARAMS.chunk_bytes)))
        except _BROKEN as error:
            raise MediumError(message_of(error)) from error

    def close(self) -> None:
        with suppress(*_BROKEN):
            self._port.close()


def open_bus(address: Address) -> Callable[[], CanMedium]:
    """A function that opens the bus of an address, again and again. It raises MediumError."""

    def opener() -> CanMedium:
        try:
            bus, lock = open_can_bus(address)
        except (*_BROKEN, *_NO_DRIVER) as error:
            raise MediumError(cannot_open(address, error)) from error
        carrier = INTERFACES / address.channel / "carrier" if address.interface == "socketcan" else None
        return CanMedium(bus, address.interface in INSTANT, carrier, lock)

    return opener


def open_line(address: Address) -> Callable[[], SerialMedium]:
    """A function that opens the serial port of an address, again and again. It raises MediumError."""

    def opener() -> SerialMedium:
        try:
            port = serial.serial_for_url(
                address.channel,
                baudrate=address.baud,
                write_timeout=PARAMS.write_s,
                exclusive=True,  # two readers would steal each other's bytes
            )
        except _BROKEN as error:
            raise MediumError(cannot_open(address, error)) from error
        return SerialMedium(port)

    return opener


def _means_full(error: BaseException) -> bool:
    number = getattr(error, "error_code", None) or getattr(error.__cause__, "errno", None)
    if number is None:
        # SocketCAN and slcan raise "Transmit buffer full" and a timeout without a number.
        timed_out = isinstance(error.__cause__, TimeoutError | serial.SerialTimeoutException)
        return timed_out or isinstance(error, TimeoutError) or "buffer full" in str(error)
    return number in FULL
