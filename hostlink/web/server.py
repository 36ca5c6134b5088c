"""Serves a page and keeps its viewers fed; a thread of its own with an event loop of its own.

    make(wants) --30 Hz, once for all who want the same--> slot of each viewer --> its socket
                                                                        <-- "got n", commands

Rules
- Nothing is made while nobody watches; `on_wants` is told what viewers want together when that changes.
- A viewer says what it got; two packets at most are under way to it. What it is too slow for it never gets:
  the next one is the newest. So a viewer costs two packets of memory, whatever it does.
- A viewer that acknowledges nothing, talks without end or has too many commands open is cut off; connections
  that are no viewer's pass a gate (`connections.py`). All numbers are `WebLimits`.
- Files come from memory, from a fixed table: no path reaches the file system.
- Names that do not belong to this server (DNS rebinding) and pages of others (`Origin`) are refused.
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
from hostlink.web.listen import Listen, WebError
from hostlink.web.packet import plain
from hostlink.web.viewer import Viewer, parse_message, wishes_in

if TYPE_CHECKING:
    from aiohttp import web

    from hostlink.web.connections import Gate

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

#: Runs a command for a viewer, with what it sent; returns what to tell it.
Command = Callable[[Mapping[str, Any]], str]


class CommandRefused(Exception):
    """A command that cannot be done now; the words go to the viewer."""


def shared_files() -> dict[str, bytes]:
    """What every page uses, by name."""
    return _folder("hostlink.web")


def _folder(package: str) -> dict[str, bytes]:
    return {item.name: item.read_bytes() for item in (files(package) / "static").iterdir() if item.is_file()}


class PageServer:
    """One page with its viewers.

    listen    where
    package   whose `static` folder holds the page: index.html and what it needs beside the shared files
    make      (wants) -> packet, or None: nothing new. Called in the server's thread, for each set of wishes
              once a tick
    hello     what a viewer is told first, JSON-able
    commands  by name; called in a worker thread, so they may wait
    on_wants  told of all viewers' wishes together when they change; None: nobody watches
    wishes    names that a viewer may want
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
        self._gate: Gate | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._stop: asyncio.Event | None = None
        self._watched: asyncio.Event | None = None

    @property
    def url(self) -> str:
        """For a browser; the token stands behind the #, which browsers keep to themselves."""
        where = Listen(self.listen.host, self.port)
        return f"http://{where}/" + (f"#token={self.listen.token}" if self.listen.token else "")

    @property
    def viewers_n(self) -> int:
        return len(self._viewers)

    @property
    def connections_n(self) -> int:
        """Connections that are not a viewer's."""
        return len(self._gate) if self._gate is not None else 0

    def start(self) -> None:
        """Serve, in a thread. Raises WebError: no aiohttp, or the address cannot be bound."""
        try:
            import hostlink.web.connections  # noqa: F401
        except ImportError as error:
            raise WebError(f"view: {error}; install voronoi-touch[view]") from error
        started: Future[None] = Future()

        def serve() -> None:
            try:
                asyncio.run(self._serve(started))
            except BaseException as error:
                if started.done():
                    raise
                started.set_exception(error)  # start-up failed: the starter's to know

        self._thread = threading.Thread(target=serve, name="view", daemon=True)
        self._thread.start()
        try:
            started.result()
        except OSError as error:
            self._thread.join()
            why = error.strerror or error
            raise WebError(
                f"view {self.listen}: cannot be served there: {why}; give another HOST:PORT"
            ) from None

    def close(self) -> None:
        """Say goodbye to all viewers and end the thread."""
        if self._loop is not None and self._stop is not None and self._thread is not None:
            if self._thread.is_alive():
                self._loop.call_soon_threadsafe(self._stop.set)
            self._thread.join(JOIN_S)

    # ---- the server's thread ------------------------------------------------------------------------

    async def _serve(self, started: Future[None]) -> None:
        from aiohttp import web

        from hostlink.web.connections import Gate, make_server

        self._loop = asyncio.get_running_loop()
        self._loop.set_exception_handler(self._on_loop_exception)
        self._stop, self._watched = asyncio.Event(), asyncio.Event()
        self._gate = Gate(self.limits)
        runner = make_server(self._answer, self._gate, self._nonsense, self.limits)
        await runner.setup()
        try:
            site = web.TCPSite(runner, self.listen.host, self.listen.port)
            await site.start()
            self.port = runner.addresses[0][1]
            pump = asyncio.create_task(self._pump())
            started.set_result(None)
            await self._stop.wait()
            pump.cancel()
            goodbyes = [v.socket.close(code=_GOING_AWAY, message=b"the program ended") for v in self._viewers]
            await asyncio.gather(*goodbyes, return_exceptions=True)
        finally:
            await runner.cleanup()
            self._tell_wants()

    def _on_loop_exception(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """What asyncio would print once for each connection."""
        self._failures.write(f"view: {context['message']}", context.get("exception"), logging.ERROR)

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        """A file or the socket; only by a name of this server's own, and for no page of another site."""
        from aiohttp import web

        origin = request.headers.get("Origin")
        if self.listen.loopback and _host(request.host) not in ("localhost", "127.0.0.1", "::1"):
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

        assert self._gate is not None
        socket = web.WebSocketResponse(
            compress=False, max_msg_size=self.limits.message_bytes, timeout=1.0, autoping=False
        )
        if not socket.can_prepare(request):
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
            self._viewers.add(viewer)  # before the next wait: who comes at the same time finds it taken
            self._gate.leave(viewer.transport)
            await self._attend(viewer)
        return socket

    async def _admit(self, viewer: Viewer) -> bool:
        """Read the first message, {"token": ..., "want": [...]}; whether it may look.

        Raises ValueError: it says something else
        """
        try:
            said = parse_message(await asyncio.wait_for(viewer.socket.receive_str(), self.limits.patience_s))
        except (TypeError, TimeoutError):  # binary, or nothing
            return False
        token = said.get("token") or ""
        if not isinstance(token, str):
            return False
        expected = self.listen.token
        viewer.wants = wishes_in(said, self._wishes)
        viewer.may_command = bool(expected) and compare_digest(token.encode(), expected.encode())
        if token and not viewer.may_command:
            await asyncio.sleep(self.limits.wrong_token_s)
        return viewer.may_command or (not token and self.listen.loopback)

    async def _attend(self, viewer: Viewer) -> None:
        """Greet a viewer, feed it and hear it, until it leaves."""
        from aiohttp import WSMsgType

        assert self._watched is not None
        feeder: asyncio.Task[None] | None = None
        try:
            names = sorted(self._commands) if viewer.may_command else []
            await viewer.socket.send_str(json.dumps({"hello": plain(self._hello), "may": names}))
            feeder = asyncio.create_task(self._feed(viewer))
            self._watched.set()
            async for message in viewer.socket:
                if viewer.talks_too_much(time.monotonic(), self.limits):
                    self._drop(viewer, "more messages than it may send")
                elif message.type is WSMsgType.PING:
                    await viewer.socket.pong(message.data)
                elif message.type is WSMsgType.TEXT and not self._hear(viewer, message.data):
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

    def _hear(self, viewer: Viewer, text: str) -> bool:
        """One message of a viewer. False: it makes no sense, and the viewer has to go."""
        try:
            said = parse_message(text)
            if "got" in said:
                viewer.acknowledge(said["got"], time.monotonic())
            if "want" in said:
                viewer.wants = wishes_in(said, self._wishes)
            name = said.get("do", "")
            if not isinstance(name, str):
                raise ValueError("'do' is not the name of a command")
        except ValueError as error:
            self._nonsense.write(f"view: a viewer's message {text[:80]!a}: {error}")
            return False
        if name and len(viewer.doing) >= self.limits.commands_n:
            self._drop(viewer, f"more than {self.limits.commands_n} commands without reading the answers")
        elif name:  # beside the reading: a command may take longer than our patience
            task = asyncio.create_task(self._do(viewer, name, said))
            viewer.doing.add(task)
            task.add_done_callback(viewer.doing.discard)
        return True

    async def _do(self, viewer: Viewer, name: str, said: Mapping[str, Any]) -> None:
        """Run a command if the viewer may, and tell it what came of it."""
        ok, command = False, self._commands.get(name)
        if command is None:
            words = f"no command {name!r:.40}"
        elif not viewer.may_command:
            words = "read-only: open the page with its token"
        else:
            try:
                words, ok = await asyncio.to_thread(command, said), True
            except CommandRefused as error:
                words = str(error)
            except Exception as error:  # noqa: BLE001  (logged, and the page goes on)
                self._failures.write(f"view: command {name} failed", error, logging.ERROR)
                words = f"{name} failed; see the program's log"
        with suppress(ConnectionError):  # it may have left meanwhile
            await viewer.socket.send_str(json.dumps({"did": name[:40], "ok": ok, "words": words}))

    async def _pump(self) -> None:
        """Packets for whoever is ready, at the page's rate; asleep while nobody watches."""
        assert self._watched is not None
        due_s = time.monotonic()
        while True:
            await self._watched.wait()
            self._tell_wants()
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

    async def _feed(self, viewer: Viewer) -> None:
        """Send what lies in the slot; waits here for a slow socket, and nowhere else."""
        while True:
            await viewer.filled.wait()
            viewer.filled.clear()
            if viewer.slot is not None:
                packet, viewer.slot = viewer.slot, None
                if viewer.sent_n == viewer.got_n:
                    viewer.progress_s = time.monotonic()  # patience begins with what has to be acknowledged
                viewer.sent_n += 1
                self.sent_n += 1
                try:
                    await viewer.socket.send_bytes(packet)
                except ConnectionError:
                    return

    def _tell_wants(self) -> None:
        """What all viewers want together, where that has changed; at most once a tick."""
        wants: frozenset[str] | None = None
        for viewer in self._viewers:
            wants = viewer.wants | (wants or frozenset())
        if wants is None and self._watched is not None:
            self._watched.clear()
        if wants != self._wanted:
            self._wanted = wants
            self._on_wants(wants)


def _host(host: str) -> str:
    """Without its port; "" where it is none."""
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def _place(origin: str) -> str:
    """Host and port of an origin; "" where it is none."""
    try:
        return urlsplit(origin).netloc
    except ValueError:
        return ""
