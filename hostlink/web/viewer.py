"""One viewer of a page, and its messages.

    {"token": "...", "want": ["image"]}   first of all
    {"got": 17}                           so many packets have arrived
    {"want": []}                          from now on
    {"do": "tare", "force": true}         a command, with what it takes

Any other message raises `ValueError`; the viewer is disconnected.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NoReturn

from hostlink.web.limits import WebLimits

if TYPE_CHECKING:
    from aiohttp import web

__all__ = ["Viewer", "parse_message", "wishes_in"]


@dataclass(eq=False)
class Viewer:
    """wants       names of what it requests
    slot        the packet to be sent next; None: taken
    filled      set when there is one
    sent_n      packets sent, of which `got_n` are acknowledged
    progress_s  monotonic time of the last new acknowledgement
    doing       commands that are not answered yet
    """

    socket: web.WebSocketResponse
    transport: asyncio.Transport
    progress_s: float
    may_command: bool = False
    wants: frozenset[str] = frozenset()
    slot: bytes | None = None
    filled: asyncio.Event = field(default_factory=asyncio.Event)
    sent_n: int = 0
    got_n: int = 0
    doing: set[asyncio.Task[None]] = field(default_factory=set)
    _second: int = 0
    _in_second_n: int = 0

    def is_ready(self, limits: WebLimits) -> bool:
        """Whether it can take the next packet."""
        return self.slot is None and self.sent_n - self.got_n < limits.packets_n

    def is_stuck(self, now_s: float, limits: WebLimits) -> bool:
        """It has not acknowledged anything for too long."""
        return self.sent_n > self.got_n and now_s - self.progress_s > limits.patience_s

    def talks_too_much(self, now_s: float, limits: WebLimits) -> bool:
        """Count a message; True: more than allowed."""
        if int(now_s) != self._second:
            self._second, self._in_second_n = int(now_s), 0
        self._in_second_n += 1
        return self._in_second_n > limits.messages_per_s

    def acknowledge(self, got: object, now_s: float) -> None:
        """Note that it has received so many packets. Raises ValueError: no such number."""
        if type(got) is not int or not 0 <= got <= self.sent_n:
            raise ValueError("'got' is not a number of packets that were sent")
        if got > self.got_n:
            self.got_n, self.progress_s = got, now_s


def parse_message(text: str) -> Mapping[str, Any]:
    """A viewer's message. Raises ValueError: not a JSON object, nested too deeply, NaN or infinity in it."""
    try:
        fields = json.loads(text, parse_constant=_refuse, parse_float=_finite)
    except RecursionError:
        raise ValueError("nested too deeply") from None
    if not isinstance(fields, dict):
        raise ValueError("not an object")
    return fields


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is not a number")


def _finite(text: str) -> float:
    value = float(text)
    if value - value != 0.0:
        _refuse(text)
    return value


def wishes_in(fields: Mapping[str, Any], known: frozenset[str]) -> frozenset[str]:
    """The names that a viewer requests, of those known. Raises ValueError: not a list of names."""
    wanted = fields.get("want", [])
    if not isinstance(wanted, list) or not all(isinstance(name, str) for name in wanted):
        raise ValueError("'want' is not a list of names")
    return known.intersection(wanted)
