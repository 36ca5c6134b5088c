"""Open links on the host: a thread that reads, and reopens the medium when it fails.

Rules
- Received data go to one callable, from the link's thread, with their arrival on the monotonic clock: the
  kernel's time stamp if there is one, however old. A host that was stopped must not take for new what waited.
- Other drivers' stamps are of an adapter's clock, which drifts: there the arrival is the moment of reading.
- A medium that fails, in whatever way, is closed and reopened every RETRY_S until it is back or the link is
  closed. Nothing that is raised ends the thread (`hostlink.link_guard`).
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
from hostlink.errors import ConnectError, LinkDown, UsageError
from hostlink.link_guard import LinkGuard
from hostlink.wire.address import Address
from hostlink.wire.open_errors import cannot_open, message_of

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

    on_data  called with (data, arrival s) from the link's thread
    guard    counts unexpected exceptions
    """

    def __init__(self, address: Address, on_data: Callable[[Any, float], None]) -> None:
        self.address = address
        self.reconnects = 0
        self.guard = LinkGuard(str(address))
        self._on_data = on_data
        self._arrival = Arrival(trusted=address.interface in SYSTEM_CLOCK)
        self._medium: Any = self._open_or_say_why()
        self._failed: Any = None  # the medium at which a write failed as nobody foresaw
        self._writing = threading.Lock()
        self._closing = threading.Event()
        loop = (self._read_or_reopen, self._closing.is_set, self._recover, self._close_medium)
        self._thread = threading.Thread(
            target=self.guard.run, args=loop, name=f"hostlink {address}", daemon=True
        )
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
            except Exception as error:
                if not isinstance(error, _broken()):
                    self.guard.note(error)
                    self._failed = medium
                raise LinkDown(f"{self.address}: {message_of(error)}") from error

    def may_wait(self) -> None:
        """Raises UsageError in the link's own thread: what it waits for would never come."""
        if self._thread is threading.current_thread():
            raise UsageError(
                f"{self.address}: a callback cannot wait for the finger, for it runs in the thread that "
                "receives; ask from another thread, or loop over `samples()` instead"
            )

    def _read_or_reopen(self) -> None:
        """Read once, or reopen the medium."""
        medium = self._medium
        if medium is None:
            self._reopen()
            return
        try:
            if medium is self._failed:
                raise OSError("a write has failed")
            data = self._read(medium)
        except _broken() as error:
            log.warning("%s: %s", self.address, message_of(error))
            self._recover()
            return
        if data is not None:
            self.guard.call(self._on_data, data, self._arrival.time_s(data))

    def _recover(self) -> None:
        """Lose the medium; one that opens and fails at once must not be reopened without a pause."""
        self._close_medium()
        self._closing.wait(RETRY_S)

    def _open_or_say_why(self) -> Any:
        """Open the medium. Raises ConnectError, whatever its driver raises."""
        try:
            return self._open()
        except Exception as error:
            raise ConnectError(f"{self.address}: {cannot_open(self.address, error)}") from error

    def _reopen(self) -> None:
        try:
            self._medium = self._open_or_say_why()
            self.reconnects += 1
        except ConnectError:
            self._closing.wait(RETRY_S)

    def _close_medium(self) -> None:
        """Close the medium, if one is open."""
        with self._writing:
            medium, self._medium = self._medium, None
            if medium is not None:
                with suppress(Exception):  # it is abandoned in any case
                    self._close(medium)

    # Implemented by the kind of medium:

    @abstractmethod
    def _open(self) -> Any:
        """Open it. Raises whatever its driver raises."""

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

    def _open(self) -> Any:
        bus = open_can_bus(self.address)
        if self.address.interface in SOCKETS:
            _widen(bus.fileno())
        return bus

    def _read(self, medium: Any) -> Any:
        message = medium.recv(READ_S)
        return None if message is None or message.is_error_frame or message.is_remote_frame else message

    def _write(self, medium: Any, item: Any) -> None:
        medium.send(item, timeout=WRITE_S)

    def _close(self, medium: Any) -> None:
        medium.shutdown()

    def send(self, can_id: int, data: bytes) -> None:
        """Send a classic message with an 11-bit identifier. Raises LinkDown."""
        import can

        self.write(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))


class SerialLink(Link):
    """A serial line through pyserial; data are bytes."""

    def _open(self) -> Any:
        import serial

        port = serial.serial_for_url(
            self.address.channel,
            baudrate=self.address.baud,
            timeout=READ_S,
            write_timeout=WRITE_S,
            exclusive=True,  # two readers would steal each other's bytes
        )
        # FTDI adapters otherwise hold bytes back for 16 ms. Other ports do not have this mode (the driver
        # refuses, or pyserial's class lacks it) and do not need it; a broken port fails at the first read.
        with suppress(Exception):
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


def _broken() -> tuple[type[Exception], ...]:
    """All errors with which python-can and pyserial report a lost medium."""
    import can

    # serial.SerialException is an OSError; ValueError and TypeError are of closed handles.
    return (can.CanError, OSError, ValueError, TypeError)
