"""Connections to a page's server before they are a viewer's: limited in number, duration and log lines.

    accept --> ConnectionLimit.enter --(becomes a viewer's)--> ConnectionLimit.leave
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

__all__ = ["ConnectionLimit", "make_server"]


class ConnectionLimit:
    """Bounds the number and the life of connections that are not a viewer's.

    A client that opens thousands of them and sends nothing (or a byte a second) only displaces its own: the
    oldest is closed, and a browser's request is done long before it is the oldest.
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
    """One connection, counted by the limit; a client's errors are logged in one line without traceback."""

    __slots__ = ("_limit", "_refused")

    def __init__(
        self, limit: ConnectionLimit, refused: SparseLog, manager: web.Server, **options: Any
    ) -> None:
        super().__init__(manager, **options)
        self._limit = limit
        self._refused = refused

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._limit.enter(transport)
        super().connection_made(transport)

    def connection_lost(self, exc: BaseException | None) -> None:
        self._limit.leave(self.transport)
        super().connection_lost(exc)

    def log_exception(self, *args: Any, **kw: Any) -> None:
        error = kw.get("exc_info")
        if isinstance(error, asyncio.InvalidStateError):
            return  # aiohttp's own: the server closes while a request ends
        if isinstance(error, HttpProcessingError | asyncio.CancelledError | ConnectionError):
            self._refused.write("view: a request that is not HTTP was refused")
        else:
            known = error if isinstance(error, BaseException) else None
            self._refused.write("view: a request failed", known, logging.ERROR)


class _Server(web.Server):
    """aiohttp's low-level server, with a limit on its connections."""

    def __init__(
        self,
        handler: Callable[[web.BaseRequest], Awaitable[web.StreamResponse]],
        limit: ConnectionLimit,
        refused: SparseLog,
        options: dict[str, Any],
    ) -> None:
        super().__init__(handler)
        self._limit, self._refused, self._options = limit, refused, options

    def __call__(self) -> web.RequestHandler:
        return _Connection(self._limit, self._refused, self, loop=asyncio.get_running_loop(), **self._options)


def make_server(
    handler: Callable[[web.BaseRequest], Awaitable[web.StreamResponse]],
    limit: ConnectionLimit,
    refused: SparseLog,
    limits: WebLimits,
) -> web.ServerRunner:
    """A server with limited connections; refused requests are logged to `refused`."""
    options = {
        "access_log": None,
        "keepalive_timeout": limits.request_s,
        "lingering_time": 1.0,
        "max_line_size": limits.header_bytes,
        "max_field_size": limits.header_bytes,
        "max_headers": limits.headers_n,
    }
    # Do not wait at the end: viewers were notified, and their sockets are closed.
    return web.ServerRunner(_Server(handler, limit, refused, options), shutdown_timeout=0.5)
