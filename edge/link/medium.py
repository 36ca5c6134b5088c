"""The medium of a link: an open bus or line; and the CAN frame.

A failure means one of two things: MediumFull (drop, go on), or any other (reopen).
"""

import errno
from abc import ABC, abstractmethod
from typing import Any

from edge.types import per_frame

FULL = frozenset({errno.ENOBUFS, errno.EAGAIN, errno.EWOULDBLOCK})
# Class bits in the identifier of an error frame: linux/can/error.h.
CAN_ERR_BUSOFF, CAN_ERR_RESTARTED = 0x40, 0x100


class MediumError(Exception):
    """The medium failed and must be reopened."""


class MediumFull(Exception):
    """The medium accepts nothing now; it may in a moment."""


@per_frame
class CanFrame:
    """A data frame with an 11-bit identifier."""

    can_id: int
    data: bytes  # up to 8 bytes; with fd up to 64, in a length that CAN FD has
    fd: bool = False  # CAN FD, the data at the second bit rate


def is_off_after(error_id: int, before: bool) -> bool:
    """Whether the controller is off the bus after an error frame of this identifier; it was `before`."""
    return bool(error_id & CAN_ERR_BUSOFF) or (before and not error_id & CAN_ERR_RESTARTED)


class Medium(ABC):
    """An open bus or line. What it carries: `CanFrame` on a bus, bytes on a line."""

    instant = False  # whether a write always returns at once
    bus_off = False
    #: Its driver raises these for a medium that is gone: closed, unplugged, with a handle that became None.
    broken: tuple[type[Exception], ...] = (OSError, ValueError, TypeError)

    @abstractmethod
    def write(self, item: Any) -> None:
        """Raises MediumFull, one of `broken`."""

    @abstractmethod
    def read(self, timeout_s: float) -> Any:
        """The item that came in, or None. Raises one of `broken`."""

    @abstractmethod
    def close(self) -> None:
        """Raises one of `broken`."""
