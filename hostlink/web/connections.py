"""Connections to a page's server before they are a viewer's: few, short-lived, and quiet in the log.

    accept --> Gate.enter --(becomes a viewer's)--> Gate.leave
                   |--(too long, or too many: the oldest)--> closed

Imports aiohttp: loaded when a server starts.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Any

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

from hostlink.web.limits import SparseLog, WebLimits

__all__ = ["Gate", "make_server"]


class Gate:
    """Bounds the number and the life of connections that are not a viewer's.

    A stranger who opens thousands of them and says nothing (or a byte a second) only pushes out his own: the
    oldest gives way, and a browser's request is done long before it is the oldest.
    """

    def __init__(self, limits: WebLimits) -> None:
        self._limits = limits
        self._waiting: dict[asyncio.BaseTransport, asyncio.TimerHandle] = {}  # oldest first
        self.closed_n = 0

    def __len__(self) -> int:
        return len(self._waiting)

    def enter(self, transport: asyncio.BaseTransport) -> None:
        """A new connection."""
        if len(self._waiting) >= self._limits.connections_n:
            self._close(next(iter(self._waiting)))
        loop = asyncio.get_running_loop()
        self._waiting[transport] = loop.call_later(self._limits.request_s, self._close, transport)

    def leave(self, transport: asyncio.BaseTransport | None) -> None:
        """It has become a viewer's, or has ended."""
        timer = self._waiting.pop(transport, None) if transport is not None else None
        if timer is not None:
            timer.cancel()

    def _close(self, transport: asyncio.BaseTransport) -> None:
        self.leave(transport)
        self.closed_n += 1
        assert isinstance(transport, asyncio.Transport)
        transport.abort()


class _Connection(web.RequestHandler):
    """One connection, known to the gate; what a stranger gets wrong is a line without traceback."""

    __slots__ = ("_gate", "_refused")

    def __init__(self, gate: Gate, refused: SparseLog, manager: web.Server, **options: Any) -> None:
        super().__init__(manager, **options)
        self._gate = gate
        self._refused = refused

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._gate.enter(transport)
        super().connection_made(transport)

    def connection_lost(self, exc: BaseException | None) -> None:
        self._gate.leave(self.transport)
        super().connection_lost(exc)

    def log_exception(self, *args: Any, **kw: Any) -> None:
        error = kw.get("exc_info")
        if isinstance(error, HttpProcessingError | asyncio.CancelledError | ConnectionError):
            self._refused.write("view: a request that is not HTTP was refused")
        else:
            known = error if isinstance(error, BaseException) else None
            self._refused.write("view: a request failed", known, logging.ERROR)


class _Server(web.Server):
    """aiohttp's low-level server, with a gate before it."""

    def __init__(
        self,
        handler: Callable[[web.BaseRequest], Awaitable[web.StreamResponse]],
        gate: Gate,
        refused: SparseLog,
        options: dict[str, Any],
    ) -> None:
        super().__init__(handler)
        self._gate, self._refused, self._options = gate, refused, options

    def __call__(self) -> web.RequestHandler:
        return _Connection(self._gate, self._refused, self, loop=asyncio.get_running_loop(), **self._options)


def make_server(
    handler: Callable[[web.BaseRequest], Awaitable[web.StreamResponse]],
    gate: Gate,
    refused: SparseLog,
    limits: WebLimits,
) -> web.ServerRunner:
    """A server whose connections pass the gate; complaints about requests go to `refused`."""
    options = {
        "access_log": None,
        "keepalive_timeout": limits.request_s,
        "lingering_time": 1.0,
        "max_line_size": limits.header_bytes,
        "max_field_size": limits.header_bytes,
        "max_headers": limits.headers_n,
    }
    # Nobody is waited for at the end: viewers were told, and their sockets are cut.
    return web.ServerRunner(_Server(handler, gate, refused, options), shutdown_timeout=0.5)
