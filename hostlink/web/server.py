"""Serves a page and sends packets to its viewers; its own thread with its own event loop.

    make(wants) --30 Hz, once for all who want the same--> slot of each viewer --> its socket
                                                                        <-- "got n", commands

Rules
- Nothing is made while nobody watches; `on_wants` is called when the combined requests of the viewers change.
- A viewer acknowledges packets; at most two are under way to it. A slow viewer skips packets: the next one is
  always the newest. So a viewer costs two packets of memory at most.
- A viewer that acknowledges nothing, sends too many messages or has too many commands open is disconnected;
  connections that are not a viewer's are limited (`connections.py`). All numbers are `WebLimits`.
- Files come from memory, from a fixed table: no path reaches the file system.
- Other host names than this server's (DNS rebinding) and pages of other sites (`Origin`) are refused.
"""

from __future__ import annotations

import asyncio
import json
import logging
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from hmac import compare_digest
from importlib.resources import files
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from hostlink.web.limits import SparseLog, WebLimits
from hostlink.web.listen import Listen, WebError, is_own_host
from hostlink.web.packet import plain
from hostlink.web.viewer import Viewer, parse_message, wishes_in

if TYPE_CHECKING:
    from aiohttp import web

    from hostlink.web.connections import ConnectionLimit

__all__ = ["CommandRefused", "PageServer", "shared_files"]

log = logging.getLogger(__name__)

JOIN_S = 5.0  # longest wait for the server's thread at the end

_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
#: Close codes of the WebSocket protocol (RFC 6455), and one of our own that the page knows.
_GOING_AWAY, _POLICY, _TRY_LATER, _DENIED = 1001, 1008, 1013, 4401

#: Runs a command for a viewer, with its arguments; returns the answer.
Command = Callable[[Mapping[str, Any]], str]


class CommandRefused(Exception):
    """A command that cannot be done now; the message goes to the viewer."""


def shared_files() -> dict[str, bytes]:
    """Files that every page uses, by name."""
    return _folder("hostlink.web")


def _folder(package: str) -> dict[str, bytes]:
    return {item.name: item.read_bytes() for item in (files(package) / "static").iterdir() if item.is_file()}


class PageServer:
    """One page with its viewers.

    listen    where
    package   whose `static` folder holds the page: index.html and what it needs beside the shared files
    make      (wants) -> packet, or None: nothing new. Called in the server's thread, for each set of wishes
              once a tick
    hello     the first message to a viewer, JSON-able
    commands  by name; called in a worker thread, so they may wait
    on_wants  called with all viewers' requests together when they change; None: nobody watches
    wishes    names that a viewer may request
    """

    def __init__(
        self,
        listen: Listen,
        package: str,
        make: Callable[[frozenset[str]], bytes | None],
        hello: Mapping[str, Any],
        commands: Mapping[str, Command] | None = None,
        on_wants: Callable[[frozenset[str] | None], None] | None = None,
        wishes: Iterable[str] = (),
        limits: WebLimits | None = None,
    ) -> None:
        self.listen = listen
        self.port = listen.port
        self.limits = limits or WebLimits()
        self.sent_n = 0
        self.cut_off_n = 0
        self._files = shared_files() | _folder(package)
        self._make = make
        self._hello = dict(hello)
        self._commands = dict(commands or {})
        self._on_wants = on_wants or (lambda wants: None)
        self._wishes = frozenset(wishes)
        self._wanted: frozenset[str] | None = None
        self._viewers: set[Viewer] = set()
        self._nonsense = SparseLog(log, self.limits.log_s)
        self._failures = SparseLog(log, self.limits.log_s)
        self._limit: ConnectionLimit | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._stop: asyncio.Event | None = None
        self._watched: asyncio.Event | None = None

    @property
    def url(self) -> str:
        """Address for a browser; the token is behind the #, which browsers do not send."""
        where = Listen(self.listen.host, self.port)
        return f"http://{where}/" + (f"#token={self.listen.token}" if self.listen.token else "")

    @property
    def viewers_n(self) -> int:
        return len(self._viewers)

    @property
    def connections_n(self) -> int:
        """Connections that are not a viewer's."""
        return len(self._limit) if self._limit is not None else 0

    def start(self) -> None:
        """Serve, in a thread. Raises WebError: no aiohttp, or the address cannot be bound."""
        try:
            import hostlink.web.connections  # noqa: F401
        except ImportError as error:
            raise WebError(f"view: {error}; install voronoi-touch[view] or -e .[view]") from error
        started: Future[None] = Future()

        def serve() -> None:
            try:
                asyncio.run(self._serve(started))
            except BaseException as error:
                if started.done():
                    raise
                started.set_exception(error)  # start-up failed: raised in `start`

        self._thread = threading.Thread(target=serve, name="view", daemon=True)
        self._thread.start()
        try:
            started.result()
        except OSError as error:
            self._thread.join()
            why = error.strerror or error
            raise WebError(f"{self.listen}: cannot be served there: {why}; give another HOST:PORT") from None

    def close(self) -> None:
        """Disconnect all viewers and end the thread."""
        if self._loop is not None and self._stop is not None and self._thread is not None:
            if self._thread.is_alive():
                self._loop.call_soon_threadsafe(self._stop.set)
            self._thread.join(JOIN_S)

    # ---- the server's thread ------------------------------------------------------------------------

    async def _serve(self, started: Future[None]) -> None:
        from aiohttp import web

        from hostlink.web.connections import ConnectionLimit, make_server

        self._loop = asyncio.get_running_loop()
        self._loop.set_exception_handler(self._on_loop_exception)
        self._stop, self._watched = asyncio.Event(), asyncio.Event()
        self._limit = ConnectionLimit(self.limits)
        runner = make_server(self._answer, self._limit, self._nonsense, self.limits)
        await runner.setup()
        try:
            site = web.TCPSite(runner, self.listen.host, self.listen.port)
            await site.start()
            self.port = runner.addresses[0][1]
            pump = asyncio.create_task(self._pump())
            started.set_result(None)
            await self._stop.wait()
            pump.cancel()
            closing = [v.socket.close(code=_GOING_AWAY, message=b"the program ended") for v in self._viewers]
            await asyncio.gather(*closing, return_exceptions=True)
        finally:
            await runner.cleanup()
            self._notify_wants()

    def _on_loop_exception(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Log, at a limited rate, what asyncio would print for each connection."""
        self._failures.write(f"view: {context['message']}", context.get("exception"), logging.ERROR)

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        """A file or the socket; only by a name of this server's own, and for no page of another site."""
        from aiohttp import web

        origin = request.headers.get("Origin")
        if self.listen.loopback and not is_own_host(request.host):
            return web.Response(status=403, text="this page is served to this machine only")
        if origin is not None and _place(origin) != request.host:
            return web.Response(status=403, text="this is not your page")
        if request.method not in ("GET", "HEAD"):
            return web.Response(status=405, text="GET only", headers={"Allow": "GET, HEAD"})
        if request.path == "/live":
            return await self._live(request)
        return self._file(request.path)

    def _file(self, path: str) -> web.Response:
        from aiohttp import web

        name = path.removeprefix("/") or "index.html"
        if name not in self._files:
            return web.Response(status=404, text="no such page")
        kind = _TYPES[name[name.rindex(".") :]]
        return web.Response(body=self._files[name], content_type=kind, charset="utf-8", headers=_HEADERS)

    async def _live(self, request: web.BaseRequest) -> web.StreamResponse:
        from aiohttp import web

        assert self._limit is not None
        socket = web.WebSocketResponse(
            compress=False, max_msg_size=self.limits.message_bytes, timeout=1.0, autoping=False
        )
        ascii_only = all(value.isascii() for value in request.headers.values())  # others aiohttp cannot quote
        if not ascii_only or not socket.can_prepare(request):
            return web.Response(status=400, text="this address is for the page's own connection")
        await socket.prepare(request)
        assert isinstance(request.transport, asyncio.Transport)
        viewer = Viewer(socket, request.transport, time.monotonic())
        try:
            admitted = await self._admit(viewer)
        except ValueError:
            admitted = False
        if not admitted:
            await socket.close(code=_DENIED, message=b"the token is missing or wrong")
        elif self.viewers_n >= self.limits.viewers_n:
            await socket.close(
                code=_TRY_LATER, message=f"{self.viewers_n} viewers are watching already".encode()
            )
        else:
            self._viewers.add(
                viewer
            )  # before the next await: a viewer that comes at the same time finds the place taken
            self._limit.leave(viewer.transport)
            await self._attend(viewer)
        return socket

    async def _admit(self, viewer: Viewer) -> bool:
        """Read the first message, {"token": ..., "want": [...]}; whether it may watch.

        Raises ValueError: any other message
        """
        try:
            fields = parse_message(
                await asyncio.wait_for(viewer.socket.receive_str(), self.limits.patience_s)
            )
        except (TypeError, TimeoutError):  # binary, or nothing
            return False
        token = fields.get("token") or ""
        if not isinstance(token, str):
            return False
        expected = self.listen.token
        viewer.wants = wishes_in(fields, self._wishes)
        viewer.may_command = bool(expected) and compare_digest(token.encode(), expected.encode())
        if token and not viewer.may_command:
            await asyncio.sleep(self.limits.wrong_token_s)
        return viewer.may_command or (not token and self.listen.loopback)

    async def _attend(self, viewer: Viewer) -> None:
        """Serve a viewer until it leaves: greeting, packets, messages."""
        from aiohttp import WSMsgType

        assert self._watched is not None
        feeder: asyncio.Task[None] | None = None
        try:
            names = sorted(self._commands) if viewer.may_command else []
            await viewer.socket.send_str(json.dumps({"hello": plain(self._hello), "may": names}))
            feeder = asyncio.create_task(self._send_packets(viewer))
            self._watched.set()
            async for message in viewer.socket:
                if viewer.talks_too_much(time.monotonic(), self.limits):
                    self._drop(viewer, "more messages than it may send")
                elif message.type is WSMsgType.PING:
                    await viewer.socket.pong(message.data)
                elif message.type is WSMsgType.TEXT and not self._handle_message(viewer, message.data):
                    await viewer.socket.close(code=_POLICY, message=b"not understood")
        except ConnectionError:
            pass  # it has left
        finally:
            if feeder is not None:
                feeder.cancel()
            self._viewers.discard(viewer)

    def _drop(self, viewer: Viewer, why: str) -> None:
        """End a viewer's connection without waiting for it."""
        if viewer in self._viewers:
            self.cut_off_n += 1
            self._viewers.discard(viewer)
            self._nonsense.write(f"view: a viewer was cut off: {why}", level=logging.INFO)
        viewer.transport.abort()

    def _handle_message(self, viewer: Viewer, text: str) -> bool:
        """Handle one message of a viewer. False: it is invalid, and the viewer is disconnected."""
        try:
            fields = parse_message(text)
            if "got" in fields:
                viewer.acknowledge(fields["got"], time.monotonic())
            if "want" in fields:
                viewer.wants = wishes_in(fields, self._wishes)
            name = fields.get("do", "")
            if not isinstance(name, str):
                raise ValueError("'do' is not the name of a command")
        except ValueError as error:
            self._nonsense.write(f"view: a viewer's message {text[:80]!a}: {error}")
            return False
        if name and len(viewer.doing) >= self.limits.commands_n:
            self._drop(viewer, f"more than {self.limits.commands_n} commands without reading the answers")
        elif name:  # not awaited: a command may take longer than `patience_s`
            task = asyncio.create_task(self._do(viewer, name, fields))
            viewer.doing.add(task)
            task.add_done_callback(viewer.doing.discard)
        return True

    async def _do(self, viewer: Viewer, name: str, fields: Mapping[str, Any]) -> None:
        """Run a command if the viewer may, and send it the outcome."""
        ok, command = False, self._commands.get(name)
        if command is None:
            message = f"no command {name!r:.40}"
        elif not viewer.may_command:
            message = "read-only: open the page with its token"
        else:
            try:
                message, ok = await asyncio.to_thread(command, fields), True
            except CommandRefused as error:
                message = str(error)
            except Exception as error:  # noqa: BLE001  (logged, and the page goes on)
                self._failures.write(f"view: command {name} failed", error, logging.ERROR)
                message = f"{name} failed; see the program's log"
        with suppress(ConnectionError):  # it may have left meanwhile
            await viewer.socket.send_str(json.dumps({"did": name[:40], "ok": ok, "message": message}))

    async def _pump(self) -> None:
        """Send packets to viewers that are ready, at the page's rate; asleep while nobody watches."""
        assert self._watched is not None
        due_s = time.monotonic()
        while True:
            await self._watched.wait()
            self._notify_wants()
            due_s = max(due_s + 1 / self.limits.rate_hz, time.monotonic())
            await asyncio.sleep(due_s - time.monotonic())
            made: dict[frozenset[str], bytes | None] = {}
            now_s = time.monotonic()
            for viewer in list(self._viewers):
                if viewer.is_stuck(now_s, self.limits):
                    self._drop(viewer, f"no acknowledgement for {self.limits.patience_s:g} s")
                elif viewer.is_ready(self.limits):
                    if viewer.wants not in made:
                        made[viewer.wants] = self._packet(viewer.wants)
                    viewer.slot = made[viewer.wants]
                    if viewer.slot is not None:
                        viewer.filled.set()

    def _packet(self, wants: frozenset[str]) -> bytes | None:
        try:
            return self._make(wants)
        except Exception as error:  # noqa: BLE001  (must not end the page for everybody)
            self._failures.write("view: a picture cannot be made", error, logging.ERROR)
            return None

    async def _send_packets(self, viewer: Viewer) -> None:
        """Send the packet in the slot; the only place that waits for a slow socket."""
        while True:
            await viewer.filled.wait()
            viewer.filled.clear()
            if viewer.slot is not None:
                packet, viewer.slot = viewer.slot, None
                if viewer.sent_n == viewer.got_n:
                    viewer.progress_s = time.monotonic()  # the time limit begins with a packet to acknowledge
                viewer.sent_n += 1
                self.sent_n += 1
                try:
                    await viewer.socket.send_bytes(packet)
                except ConnectionError:
                    return

    def _notify_wants(self) -> None:
        """Report what all viewers request together, if it changed; at most once a tick."""
        wants: frozenset[str] | None = None
        for viewer in self._viewers:
            wants = viewer.wants | (wants or frozenset())
        if wants is None and self._watched is not None:
            self._watched.clear()
        if wants != self._wanted:
            self._wanted = wants
            self._on_wants(wants)


def _place(origin: str) -> str:
    """Host and port of an origin; "" if it is not valid."""
    try:
        return urlsplit(origin).netloc
    except ValueError:
        return ""
