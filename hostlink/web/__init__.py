"""Pages in a browser: a small server for a live page, independent of fingers and cameras.

    server = PageServer(listen, files, make=..., commands=..., hello=...)
    server.start(); print(server.url); ...; server.close()

The live pages of the edge and of the host are both this server with their own files, packets and commands;
`static/` holds what their pages share (connection, charts, style). This package imports only itself and
aiohttp, and aiohttp only when a server starts.
"""

from __future__ import annotations

from hostlink.web.listen import TOKEN_VARIABLE, Listen, WebError, find_token, parse_listen
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
