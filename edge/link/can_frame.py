"""A CAN frame as the link has it: what a node sends, and what it listens to."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["CanFrame", "is_off_after"]

# Class bits in the identifier of an error frame: linux/can/error.h.
CAN_ERR_BUSOFF, CAN_ERR_RESTARTED = 0x40, 0x100


class CanFrame(NamedTuple):
    """A data frame with an 11-bit identifier.

    data  up to 8 bytes; with fd up to 64, in a length that CAN FD has
    fd    CAN FD, the data at the second bit rate
    """

    can_id: int
    data: bytes
    fd: bool = False


def is_off_after(error_id: int, before: bool) -> bool:
    """Whether the controller is off the bus after an error frame of this identifier; it was `before`."""
    if error_id & CAN_ERR_BUSOFF:
        return True
    return before and not error_id & CAN_ERR_RESTARTED
