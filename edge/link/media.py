"""Opens buses and lines: each kind is a module of its own, loaded when the first of it is opened, for their
libraries take a part of the start and of the memory.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from edge.link.medium import Medium, MediumError, MediumFull
from hostlink.wire.address import Address
from hostlink.wire.open_errors import cannot_open

__all__ = ["Medium", "MediumError", "MediumFull", "open_bus", "open_line"]


def open_bus(address: Address, wanted: Sequence[int]) -> Callable[[], Medium]:
    """A function that opens the bus of an address, again and again. It raises MediumError.

    wanted  identifiers of the messages that must be received; others may be
    """

    def open_it() -> Medium:
        if address.interface == "socketcan":
            from edge.link.socketcan import open_socket

            return open_socket(address.channel, address.fd, wanted)
        from edge.link.python_can import open_python_can

        return open_python_can(address)

    return _opener(address, open_it)


def open_line(address: Address) -> Callable[[], Medium]:
    """A function that opens the serial port of an address, again and again. It raises MediumError."""

    def open_it() -> Medium:
        from edge.link.serial_line import open_port

        return open_port(address)

    return _opener(address, open_it)


def _opener(address: Address, open_it: Callable[[], Medium]) -> Callable[[], Medium]:
    """The same, with one line for the user, whatever a driver raises."""

    def opener() -> Medium:
        try:
            return open_it()
        except Exception as error:
            raise MediumError(cannot_open(address, error)) from error

    return opener
