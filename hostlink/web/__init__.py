"""Pages in a browser: a small server for a live page, independent of fingers and cameras.

    server = PageServer(listen, files, make=..., commands=..., hello=...)
    server.start(); print(server.url); ...; server.close()

The live pages of the edge and of the host are both this server with their own files, packets and commands;
`static/` holds what their pages share (connection, charts, style). This package imports only itself and
aiohttp, and aiohttp only when a server starts. The server, and asyncio with it, is imported when one of its
names is used: a finger that shows no page needs the rules of its address alone.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from hostlink.web.listen import TOKEN_VARIABLE, Listen, WebError, find_token, parse_listen

if TYPE_CHECKING:
    from hostlink.web.packet import pack_packet, plain, unpack_packet
    from hostlink.web.server import CommandRefused, PageServer, shared_files

__all__ = [
    "TOKEN_VARIABLE",
    "CommandRefused",
    "Listen",
    "PageServer",
    "WebError",
    "find_token",
    "pack_packet",
    "parse_listen",
    "plain",
    "shared_files",
    "unpack_packet",
]

if not TYPE_CHECKING:  # or a type checker would take any name for one of ours

    def __getattr__(name: str) -> object:
        """A name of the server or of its packets."""
        if name in ("CommandRefused", "PageServer", "shared_files"):
            return getattr(import_module("hostlink.web.server"), name)
        if name in ("pack_packet", "plain", "unpack_packet"):
            return getattr(import_module("hostlink.web.packet"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
