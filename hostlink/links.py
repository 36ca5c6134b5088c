"""Open links on the host: a thread that reads, and reopens the medium when it fails.

Rules
- Received data go to one callable, from the link's thread, with their arrival on the monotonic clock: the
  kernel's time stamp if there is one, however old. A host that was stopped must not take for new what waited.
- Other drivers' stamps are of an adapter's clock, which drifts: there the arrival is the moment of reading.
- A medium that fails is closed and reopened every RETRY_S until it is back or the link is closed.
- python-can and pyserial are imported when a link is opened, not before.
"""

from __future__ import annotations

import logging
import os
import socket
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from hostlink.can_bus import open_can_bus
from hostlink.errors import ConnectError, LinkDown
from hostlink.wire.address import Address
from hostlink.wire.open_errors import cannot_open, is_junk, message_of
from hostlink.wire.port_lock import PortLock

__all__ = ["CanLink", "Link", "SerialLink", "open_link"]

log = logging.getLogger(__name__)

RETRY_S = 0.1
READ_S = 0.1  # how soon the thread notices that the link is to be closed
WRITE_S = 0.2
READ_CHUNK = 4096
SOCKETS = frozenset({"socketcan", "udp_multicast"})
SYSTEM_CLOCK = SOCKETS | {"virtual"}  # interfaces whose stamps are times of this system
RECEIVE_BUFFER = 8 << 20  # bytes; a frame takes about 1 kB of it: 6 s of five fingers at 250 Hz
SO_RCVBUFFORCE = 33  # linux/asm-generic/socket.h; Python does not name it
STEP_S = 0.1  # the system's clock is set, not slewed, by more than that (chrony, ntpd, timesyncd)


class Arrival:
    """When received data arrived, on the monotonic clock.

    trusted  whether stamps are times of the system's clock
    """

    def __init__(self, trusted: bool) -> None:
        self._trusted = trusted
        self._ahead_s: float | None = None  # the system's clock before the monotonic one, at the data before

    def time_s(self, data: Any) -> float:
        """Arrival of data that were just read."""
        wall_s, now_s = time.time(), time.monotonic()
        before_s, self._ahead_s = self._ahead_s, wall_s - now_s
        stamp_s = getattr(data, "timestamp", 0.0)
        was_set = before_s is not None and abs(self._ahead_s - before_s) > STEP_S
        if not self._trusted or was_set or not 0.0 < stamp_s <= wall_s:
            return now_s
        return now_s - (wall_s - stamp_s)


class Link(ABC):
    """One open medium and its thread; base of CAN and serial.

    on_data       called with (data, arrival s) from the link's thread
    unforeseen_n  unexpected exceptions; the first of each kind is logged
    """

    def __init__(self, address: Address, on_data: Callable[[Any, float], None]) -> None:
        self.address = address
        self.reconnects = 0
        self.unforeseen_n = 0
        self._unforeseen: set[tuple[type[Exception], int]] = set()
        self._on_data = on_data
        self._arrival = Arrival(trusted=address.interface in SYSTEM_CLOCK)
        self._medium: Any = self._open()
        self._writing = threading.Lock()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"hostlink {address}", daemon=True)
        self._thread.start()

    @property
    def up(self) -> bool:
        return self._medium is not None

    def close(self) -> None:
        """Stop reading and close the medium."""
        self._closing.set()
        if self._thread is not threading.current_thread():
            self._thread.join()

    def write(self, item: Any) -> None:
        """Send. Raises LinkDown."""
        with self._writing:
            medium = self._medium
            if medium is None:
                raise LinkDown(f"{self.address}: the link is down")
            try:
                self._write(medium, item)
            except _broken() as error:
                raise LinkDown(f"{self.address}: {message_of(error)}") from error

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                self._read_or_reopen()
            except Exception as error:  # noqa: BLE001 - whatever it is: reading must go on
                self._note(error)
        self._close_medium()

    def _read_or_reopen(self) -> None:
        """Read once, or reopen the medium."""
        medium = self._medium
        if medium is None:
            try:
                self._reopen()
            except Exception:
                self._closing.wait(RETRY_S)
                raise
            return
        try:
            data = self._read(medium)
        except Exception as error:
            log.warning("%s: %s", self.address, message_of(error))
            self._close_medium()
            if not isinstance(error, _broken()):
                raise
            return
        if data is not None:
            self._on_data(data, self._arrival.time_s(data))

    def _note(self, error: Exception) -> None:
        """Count an unexpected error, and log each kind once."""
        self.unforeseen_n += 1
        trace = error.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        kind = (type(error), trace.tb_lineno if trace else 0)
        if kind not in self._unforeseen:
            self._unforeseen.add(kind)
            log.error("%s: unforeseen; the link goes on", self.address, exc_info=error)

    def _reopen(self) -> None:
        try:
            self._medium = self._open()
            self.reconnects += 1
        except ConnectError:
            self._closing.wait(RETRY_S)

    def _close_medium(self) -> None:
        with self._writing:
            medium, self._medium = self._medium, None
            if medium is not None:
                with suppress(Exception):  # it is abandoned in any case
                    self._close(medium)

    # Implemented by the kind of medium:

    @abstractmethod
    def _open(self) -> Any:
        """Open it. Raises ConnectError."""

    @abstractmethod
    def _read(self, medium: Any) -> Any:
        """Received data; None: nothing within READ_S."""

    @abstractmethod
    def _write(self, medium: Any, item: Any) -> None:
        """Send one item."""

    @abstractmethod
    def _close(self, medium: Any) -> None:
        """Close it."""


class CanLink(Link):
    """A bus through python-can; messages are can.Message."""

    _port_lock: PortLock | None = None  # of a serial-line adapter

    def _open(self) -> Any:
        try:
            bus, self._port_lock = open_can_bus(self.address)
        except _broken() as error:
            raise ConnectError(f"{self.address}: {cannot_open(self.address, error)}") from error
        if self.address.interface in SOCKETS:
            _widen(bus.fileno())
        return bus

    def _read(self, medium: Any) -> Any:
        try:
            message = medium.recv(READ_S)
        except Exception as error:
            if is_junk(error):
                return None
            raise
        return None if message is None or message.is_error_frame or message.is_remote_frame else message

    def _write(self, medium: Any, item: Any) -> None:
        medium.send(item, timeout=WRITE_S)

    def _close(self, medium: Any) -> None:
        lock, self._port_lock = self._port_lock, None
        try:
            medium.shutdown()
        finally:
            if lock is not None:
                lock.close()

    def send(self, can_id: int, data: bytes) -> None:
        """Send a classic message with an 11-bit identifier. Raises LinkDown."""
        import can

        self.write(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))


class SerialLink(Link):
    """A serial line through pyserial; data are bytes."""

    def _open(self) -> Any:
        import serial

        try:
            port = serial.serial_for_url(
                self.address.channel,
                baudrate=self.address.baud,
                timeout=READ_S,
                write_timeout=WRITE_S,
                exclusive=True,  # two readers would steal each other's bytes
            )
        except _broken() as error:
            raise ConnectError(f"{self.address}: {cannot_open(self.address, error)}") from error
        # FTDI adapters otherwise hold bytes back for 16 ms. Other ports do not have this mode (the driver
        # refuses, or pyserial's class lacks it) and do not need it; a broken port fails at the first read.
        with suppress(*_broken(), NotImplementedError):
            port.set_low_latency_mode(True)
        return port

    def _read(self, medium: Any) -> bytes | None:
        first = medium.read(1)
        return bytes(first + medium.read(min(medium.in_waiting, READ_CHUNK))) if first else None

    def _write(self, medium: Any, item: bytes) -> None:
        medium.write(item)

    def _close(self, medium: Any) -> None:
        medium.close()


def open_link(address: Address, on_data: Callable[[Any, float], None]) -> Link:
    """The link at an address. Raises ConnectError: nothing there, or not usable as a link."""
    if address.scheme == "memory":
        raise ConnectError("memory: has no other end; use can:, slcan:, virtual:, udp: or serial:")
    return CanLink(address, on_data) if address.is_can else SerialLink(address, on_data)


def _widen(number: int) -> None:
    """Ask for a larger receive buffer: a host that is delayed for half a second must not lose samples."""
    with socket.socket(fileno=os.dup(number)) as same:
        for option in (SO_RCVBUFFORCE, socket.SO_RCVBUF):  # the first needs CAP_NET_ADMIN, but has no limit
            with suppress(OSError):
                same.setsockopt(socket.SOL_SOCKET, option, RECEIVE_BUFFER)
                return


def _broken() -> tuple[type[BaseException], ...]:
    """All errors with which python-can and pyserial report a lost medium."""
    import can

    # serial.SerialException is an OSError; the last three are python-can without a driver's own library.
    return (can.CanError, OSError, ValueError, TypeError, ImportError, AttributeError, NameError)
