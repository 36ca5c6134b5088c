"""What a link talks over: an open bus or line, the CAN frame, and how they are opened.

A failure means one of two things: MediumFull (drop, go on), or any other (reopen). Each kind of medium is a
module of its own, loaded when the first of it is opened: their libraries take a part of the start and memory.
"""

import errno
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

from hostlink.wire.address import Address
from hostlink.wire.open_errors import cannot_open

FULL = frozenset({errno.ENOBUFS, errno.EAGAIN, errno.EWOULDBLOCK})
# Class bits in the identifier of an error frame: linux/can/error.h.
CAN_ERR_BUSOFF, CAN_ERR_RESTARTED = 0x40, 0x100


class MediumError(Exception):
    """The medium failed and must be reopened."""


class MediumFull(Exception):
    """The medium accepts nothing now; it may in a moment."""


class CanFrame(NamedTuple):
    """A data frame with an 11-bit identifier."""

    can_id: int
    data: bytes  # up to 8 bytes; with fd up to 64, in a length that CAN FD has
    fd: bool = False  # CAN FD, the data at the second bit rate


def is_off_after(error_id: int, before: bool) -> bool:
    """Whether the controller is off the bus after an error frame of this identifier; it was `before`."""
    return bool(error_id & CAN_ERR_BUSOFF) or (before and not error_id & CAN_ERR_RESTARTED)


class Medium(Protocol):
    """An open bus or line. What it carries: `CanFrame` on a bus, bytes on a line."""

    instant: bool  # whether a write always returns at once
    bus_off: bool

    def write(self, item: Any) -> None:
        """Raises MediumFull, MediumError."""
        ...

    def read(self, timeout_s: float) -> Any:
        """What came in, or None. Raises MediumError."""
        ...

    def close(self) -> None: ...


def opener(address: Address, wanted: Sequence[int] = ()) -> Callable[[], Medium]:
    """A function that opens the bus or serial port of an address, again and again. Whatever a driver raises,
    it raises MediumError with one line for the user.

    wanted  identifiers of the messages that must be received on a bus; others may be
    """

    def open_it() -> Medium:
        try:
            if not address.is_can:
                from edge.link.serial_line import open_port

                return open_port(address)
            if address.interface == "socketcan":
                from edge.link.socketcan import open_socket

                return open_socket(address.channel, address.fd, wanted)
            from edge.link.python_can import open_python_can

            return open_python_can(address)
        except Exception as error:
            raise MediumError(cannot_open(address, error)) from error

    return open_it
