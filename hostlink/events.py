"""The events of a decoder: samples, and all other messages of a fingertip.

`node` is the sender's node number; `arrival_s` is the time of arrival, on the clock of the caller of
`receive`: `time.monotonic()` on a live link, wall clock in a recording. NaN: not given.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import NamedTuple

from hostlink.wire.detail import Detail
from hostlink.wire.serial import ObjectReply
from hostlink.wire.state import State

__all__ = [
    "DetailFrame",
    "Emergency",
    "Event",
    "Heartbeat",
    "ObjectAnswer",
    "Sample",
    "SdoFrame",
    "SecondSender",
]


class Sample(NamedTuple):
    """One sample of one finger, live or from a recording.

    finger        node number
    state         the values; fields: `hostlink.wire.fields`
    host_time_s   when the image was taken, on the clock of `arrival_s`; NaN where that is NaN
    host_error_s  bound of that time's error: see `hostlink.order_and_time`
    arrival_s     time of arrival
    lost_n        samples lost between the one before and this
    """

    finger: int
    state: State
    host_time_s: float
    host_error_s: float
    arrival_s: float
    lost_n: int = 0

    @property
    def node(self) -> int:
        """The finger's number, under the name that the other events use."""
        return self.finger

    @property
    def age_s(self) -> float:
        """Time since the image was taken; of a live sample only."""
        return time.monotonic() - self.host_time_s


@dataclass(frozen=True, slots=True)
class DetailFrame:
    """Every pin's motion of one sample."""

    node: int
    detail: Detail
    arrival_s: float


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """CiA 301 NMT state: 0 boot-up, 4 stopped, 5 operational, 127 pre-operational."""

    node: int
    state: int
    arrival_s: float


@dataclass(frozen=True, slots=True)
class Emergency:
    """A fault appeared (fault: its code in `wire.FAULTS`), or all have cleared (emcy == fault == 0)."""

    node: int
    emcy: int
    register: int
    fault: int
    status: int
    arrival_s: float


@dataclass(frozen=True, slots=True)
class SdoFrame:
    """A message from a node's SDO server, or of another host to it.

    request  it is another host's
    """

    node: int
    data: bytes
    arrival_s: float
    request: bool = False


@dataclass(frozen=True, slots=True)
class ObjectAnswer:
    """Serial: the reply to the request with the same counter."""

    node: int
    counter: int
    reply: ObjectReply
    arrival_s: float


@dataclass(frozen=True, slots=True)
class SecondSender:
    """Two senders use this node number: samples of both arrive, and count as lost or old. Sent once."""

    node: int
    arrival_s: float


Event = Sample | DetailFrame | Heartbeat | Emergency | SdoFrame | ObjectAnswer | SecondSender
