"""Stands before the SDK's Foxglove server, which asks nobody who they are.

    viewer --> FrontDoor, at --listen --(request checked)--> the SDK's server, at an address that nobody knows

Rules
- The SDK's server is at one of 16 million addresses of this machine (127.0.0.0/8), and at any port: a web
  page would have to guess both. So the front door is the only way in.
- A browser names the page that connects (`Origin`), and the host that it believes to reach (`Host`). Where
  viewers may give commands, only the pages that the user named may connect, and only by a name of this
  machine. A program that is no browser names no page.
- After its request a connection is bytes in both directions, which nobody reads here.
"""

from __future__ import annotations

import asyncio
import logging
import random
import sys
import threading
from base64 import b64encode
from collections.abc import Collection
from contextlib import suppress
from hashlib import sha1

from hostlink.errors import UsageError
from hostlink.web import Listen
from hostlink.web.limits import SparseLog, WebLimits
from hostlink.web.listen import is_own_host

__all__ = ["FrontDoor", "Refusal", "check_request", "hidden_address", "normal_origin"]

log = logging.getLogger(__name__)

SUBPROTOCOL, OLDER = "foxglove.sdk.v1", "foxglove.websocket.v1"
#: Lichtblick's release 1.21 offers the older one alone, and 1.26 both.
TOO_OLD = (
    f"this viewer knows {OLDER} alone, the bridge needs {SUBPROTOCOL}: update it (Lichtblick 1.26 has it)"
)
_ACCEPT = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"  # RFC 6455, 1.3
_CHUNK = 1 << 16
_END = b"\r\n\r\n"


class Refusal(Exception):
    """A request that is not passed on; the message goes to the viewer and to the log.

    status  of HTTP
    key     of a viewer that gets it by a websocket of the older protocol; "": by HTTP
    """

    def __init__(self, status: str, message: str, key: str = "") -> None:
        super().__init__(message)
        self.status, self.key = status, key


def hidden_address() -> str:
    """Where the SDK's server listens: where no web page finds it, if the system has such a place."""
    if not sys.platform.startswith("linux"):  # others give 127.0.0.1 alone to a program
        return "127.0.0.1"
    pick = random.SystemRandom().randrange
    return f"127.{pick(1, 255)}.{pick(256)}.{pick(1, 255)}"


def normal_origin(text: str) -> str:
    """A page's origin as browsers write it. Raises UsageError: none, as of a whole address."""
    scheme, mark, place = text.lower().rstrip("/").partition("://")
    if not (scheme.isalnum() and mark) or "/" in place or not (place or scheme == "file"):
        raise UsageError(
            f"--origin {text}: give scheme and host of a viewer's page, e.g. http://localhost:8080"
        )
    return f"{scheme}://{place}"


def check_request(head: bytes, origins: Collection[str] | None) -> None:
    """Raises Refusal: a viewer's request, with the empty line at its end, is not to be passed on.

    origins  pages that may connect, since viewers may give commands; None: any page, since it can only look
    """
    first, *lines = head.decode("latin-1").removesuffix("\r\n\r\n").split("\r\n")
    fields: dict[str, list[str]] = {}
    for line in lines:
        name, colon, value = line.partition(":")
        if not colon or name != name.strip() or not name:
            raise Refusal("400 Bad Request", "a request that is not HTTP")
        fields.setdefault(name.lower(), []).append(value.strip())
    if not first.startswith("GET ") or [v.lower() for v in fields.get("upgrade", ())] != ["websocket"]:
        raise Refusal(
            "426 Upgrade Required", "this address is for viewers: Foxglove, Lichtblick, PlotJuggler"
        )
    if any(len(fields.get(name, ())) > 1 for name in ("origin", "host", "sec-websocket-key")):
        raise Refusal("400 Bad Request", "a request that names two pages or two hosts")
    host, origin = (fields.get(name, [""])[0].lower() for name in ("host", "origin"))
    if origins is not None:
        if not is_own_host(host):
            raise Refusal(
                "403 Forbidden", f"host {host[:80]!a} is not this machine; give ws://127.0.0.1 and the port"
            )
        if origin and origin.rstrip("/") not in origins:
            raise Refusal(
                "403 Forbidden",
                f"a page of {origin[:80]!a} may not give commands; if it is your viewer's, start the bridge "
                "with --origin and that name",
            )
    offered = {
        name.strip() for value in fields.get("sec-websocket-protocol", ()) for name in value.split(",")
    }
    if SUBPROTOCOL not in offered:
        if OLDER not in offered:
            raise Refusal("400 Bad Request", f"no viewer: it does not offer the protocol {SUBPROTOCOL}")
        raise Refusal("400 Bad Request", TOO_OLD, fields.get("sec-websocket-key", [""])[0])


class FrontDoor:
    """Serves viewers in a thread of its own.

    inner    host and port of the SDK's server
    origins  as of `check_request`
    Raises   OSError: the address is taken, or not of this machine
    """

    def __init__(self, listen: Listen, inner: tuple[str, int], origins: Collection[str] | None) -> None:
        from hostlink.web.connections import ConnectionLimit  # it imports aiohttp

        self._inner, self._origins = inner, origins
        self._limits = WebLimits()
        self._waiting = ConnectionLimit(self._limits)
        self._refused = SparseLog(log, self._limits.log_s)
        self._passed: set[asyncio.Task[None] | None] = set()
        self._loop = asyncio.new_event_loop()
        self._loop.set_exception_handler(
            lambda _, context: self._refused.write(f"viewer: {context['message']}")
        )
        self._thread = threading.Thread(target=self._loop.run_forever, name="viewers", daemon=True)
        self._thread.start()
        starting = asyncio.start_server(
            self._welcome, listen.host, listen.port, limit=self._limits.header_bytes * 2
        )
        try:
            self._server = asyncio.run_coroutine_threadsafe(starting, self._loop).result()
        except OSError:
            self._end()
            raise
        self.port: int = self._server.sockets[0].getsockname()[1]

    def close(self) -> None:
        """End all connections, and the thread."""
        if self._loop.is_closed():
            return
        asyncio.run_coroutine_threadsafe(self._leave(), self._loop).result()
        self._end()

    def _end(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _leave(self) -> None:
        self._server.close()
        tasks = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _welcome(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._waiting.enter(writer.transport)
        try:
            head = await reader.readuntil(_END)
            try:
                check_request(head, self._origins)
                if len(self._passed) >= self._limits.connections_n:
                    raise Refusal(
                        "503 Service Unavailable", f"{len(self._passed)} viewers are connected already"
                    )
            except Refusal as refusal:
                self._refused.write(f"a viewer was refused: {refusal}")
                writer.write(_answer(refusal))
                await writer.drain()
                return
            self._waiting.leave(writer.transport)
            self._passed.add(asyncio.current_task())
            await self._pass_on(head, reader, writer)
        except (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass  # it has left, or its request does not end
        finally:
            self._passed.discard(asyncio.current_task())
            self._waiting.leave(writer.transport)
            writer.close()

    async def _pass_on(self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Until one of both ends."""
        from_server, to_server = await asyncio.open_connection(*self._inner)
        to_server.write(head)
        both = [
            asyncio.create_task(_copy(reader, to_server)),
            asyncio.create_task(_copy(from_server, writer)),
        ]
        try:
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in both:
                task.cancel()
            to_server.close()


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Until it ends; no faster than it is taken."""
    with suppress(OSError):
        while data := await reader.read(_CHUNK):
            writer.write(data)
            await writer.drain()


def _answer(refusal: Refusal) -> bytes:
    """Answer the viewer. One that knows the older protocol shows the message, if it comes by a websocket."""
    text = str(refusal).encode()
    if not refusal.key:
        head = f"HTTP/1.1 {refusal.status}\r\nContent-Type: text/plain\r\nContent-Length: {len(text)}\r\n"
        return head.encode() + b"Connection: close" + _END + text
    accept = b64encode(sha1(refusal.key.encode("latin-1") + _ACCEPT).digest())
    head = "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    status = b'{"op":"status","level":2,"message":"%s"}' % text
    return (
        head.encode() + f"Sec-WebSocket-Protocol: {OLDER}\r\nSec-WebSocket-Accept: ".encode() + accept + _END
        + b"\x81\x7e" + len(status).to_bytes(2, "big") + status  # a text message of 126 bytes or more
        + b"\x88\x02" + (1002).to_bytes(2, "big")  # the end: a protocol error
    )  # fmt: skip
