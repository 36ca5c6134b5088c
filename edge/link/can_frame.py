"""A CAN frame as the link has it: what a node sends, and what it listens to."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["CanFrame"]


class CanFrame(NamedTuple):
    """A data frame with an 11-bit identifier.

    data  up to 8 bytes; with fd up to 64, in a length that CAN FD has
    fd    CAN FD, the data at the second bit rate
    """

    can_id: int
    data: bytes
    fd: bool = False
