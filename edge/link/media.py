"""Open buses and lines, and the meaning of their failures: MediumFull (drop, go on), MediumError (reopen).

Each kind is a module of its own, loaded when the first of it is opened: their libraries take a part of the
start and of the memory.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from hostlink.wire.address import Address
from hostlink.wire.open_errors import cannot_open

__all__ = ["FULL", "Medium", "MediumError", "MediumFull", "open_bus", "open_line"]

FULL = frozenset({errno.ENOBUFS, errno.EAGAIN, errno.EWOULDBLOCK})


class MediumError(Exception):
    """The medium failed and must be reopened."""


class MediumFull(Exception):
    """The medium accepts nothing now; it may in a moment."""


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


def open_bus(address: Address, wanted: Sequence[int]) -> Callable[[], Medium]:
    """A function that opens the bus of an address, again and again. It raises MediumError.

    wanted  identifiers of the messages that must be received; others may be
    """

    def opener() -> Medium:
        if address.interface == "socketcan":
            from edge.link.socketcan import open_socket

            try:
                return open_socket(address.channel, address.fd, wanted)
            except OSError as error:
                raise MediumError(cannot_open(address, error)) from error
        from edge.link.python_can import open_python_can

        return open_python_can(address)

    return opener


def open_line(address: Address) -> Callable[[], Medium]:
    """A function that opens the serial port of an address, again and again. It raises MediumError."""

    def opener() -> Medium:
        from edge.link.serial_line import open_port

        return open_port(address)

    return opener
