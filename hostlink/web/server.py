"""Serves a page and keeps its viewers fed; a thread of its own with an event loop of its own.

    make(wants) --30 Hz, once for all who want the same--> slot of each viewer --> its socket
                                                                        <-- "got n", commands

Rules
- Nothing is made while nobody watches, and what viewers want together is told once (`on_wants`).
- A viewer says what it got; two packets at most are under way to it. What it is too slow for it never gets:
  the next one is the newest. One that has not answered for `PATIENCE_S` is cut off. So a viewer costs two
  packets of memory, whatever it does.
- More than `VIEWERS_MAX` are sent away with a word, so that the cost of all of them is bounded.
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
from dataclasses import dataclass, field
from hmac import compare_digest
from importlib.resources import files
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from hostlink.web.listen import Listen, WebError
from hostlink.web.packet import plain

if TYPE_CHECKING:
    from aiohttp import web

__all__ = ["RATE_HZ", "VIEWERS_MAX", "PageServer", "Refused", "shared_files"]

log = logging.getLogger(__name__)

RATE_HZ = 30.0
UNDER_WAY = 2  # one being drawn, one on its way: 30 Hz over a line with up to 60 ms there and back
PATIENCE_S = 5.0
VIEWERS_MAX = 16  # 16 viewers cost the server's thread 2 % of a core
MESSAGE_MAX = 4096  # bytes; what viewers say is short
SLOW_TOKEN_S = 0.5  # a wrong token is answered this late: guessing takes for ever

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

#: Runs a command for a viewer, with what it sent; returns what to tell it.
Command = Callable[[Mapping[str, Any]], str]


class Refused(Exception):
    """A command that cannot be done now; the words go to the viewer."""


@dataclass(eq=False)
class _Viewer:
    socket: Any
    transport: asyncio.Transport
    may_command: bool = False
    wants: frozenset[str] = frozenset()
    slot: bytes | None = None
    filled: asyncio.Event = field(default_factory=asyncio.Event)
    sent_n: int = 0
    got_n: int = 0
    heard_s: float = 0.0
    doing: set[asyncio.Task[None]] = field(default_factory=set)

    @property
    def ready(self) -> bool:
        return self.slot is None and self.sent_n - self.got_n < UNDER_WAY


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
    ) -> None:
        self.listen = listen
        self.port = listen.port
        self.sent_n = 0
        self.cut_off_n = 0
        self._files = shared_files() | _folder(package)
        self._make = make
        self._hello = dict(hello)
        self._commands = dict(commands or {})
        self._on_wants = on_wants or (lambda wants: None)
        self._wishes = frozenset(wishes)
        self._told: frozenset[str] | None = None
        self._viewers: set[_Viewer] = set()
        self._places_taken_n = 0
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

    def start(self) -> None:
        """Serve, in a thread. Raises WebError: no aiohttp, or the address cannot be bound."""
        try:
            import aiohttp  # noqa: F401
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
            self._thread.join(PATIENCE_S)

    # ---- the server's thread ------------------------------------------------------------------------

    async def _serve(self, started: Future[None]) -> None:
        from aiohttp import web

        self._loop = asyncio.get_running_loop()
        self._stop, self._watched = asyncio.Event(), asyncio.Event()

        @web.middleware
        async def guard(request: web.Request, handler: Any) -> web.StreamResponse:
            return await self._guard(request, handler)

        app = web.Application(middlewares=[guard])
        app.router.add_get("/live", self._live)
        app.router.add_get("/{name:[a-z_]*(\\.[a-z]+)?}", self._file)
        # Nobody is waited for at the end: viewers were told, and their sockets are cut.
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.5)
        await runner.setup()
        try:
            site = web.TCPSite(runner, self.listen.host, self.listen.port)
            await site.start()
            self.port = runner.addresses[0][1]
            pump = asyncio.create_task(self._pump())
            started.set_result(None)
            await self._stop.wait()
            pump.cancel()
            goodbyes = [v.socket.close(code=1001, message=b"the program ended") for v in self._viewers]
            await asyncio.gather(*goodbyes, return_exceptions=True)
        finally:
            await runner.cleanup()

    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Only by a name of this server's own; and no page of another site may open the socket."""
        from aiohttp import web

        if self.listen.loopback and _host(request.host) not in ("localhost", "127.0.0.1", "::1"):
            raise web.HTTPForbidden(text="this page is served to this machine only")
        origin = request.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc != request.host:
            raise web.HTTPForbidden(text="this is not your page")
        answer: web.StreamResponse = await handler(request)
        return answer

    async def _file(self, request: web.Request) -> web.Response:
        from aiohttp import web

        name = request.match_info["name"] or "index.html"
        if name not in self._files:
            raise web.HTTPNotFound
        kind = _TYPES[name[name.rindex(".") :]]
        return web.Response(body=self._files[name], content_type=kind, charset="utf-8", headers=_HEADERS)

    async def _live(self, request: web.Request) -> web.WebSocketResponse:
        from aiohttp import web

        socket = web.WebSocketResponse(compress=False, max_msg_size=MESSAGE_MAX, timeout=1.0)
        await socket.prepare(request)
        assert isinstance(request.transport, asyncio.Transport)
        if self._places_taken_n >= VIEWERS_MAX:
            await socket.close(code=1013, message=f"{VIEWERS_MAX} viewers are watching already".encode())
            return socket
        self._places_taken_n += 1  # before the first wait: who comes at the same time finds it taken
        viewer = _Viewer(socket, request.transport, heard_s=time.monotonic())
        try:
            if await self._admit(viewer):
                await self._attend(viewer)
            else:
                await socket.close(code=4401, message=b"the token is missing or wrong")
        finally:
            self._places_taken_n -= 1
        return socket

    async def _attend(self, viewer: _Viewer) -> None:
        """Feed a viewer and hear it, until it leaves."""
        self._viewers.add(viewer)
        feeder = asyncio.create_task(self._feed(viewer))
        try:
            self._tell_wants()
            async for message in viewer.socket:
                if message.type is not message.type.TEXT or not await self._hear(viewer, message.data):
                    break
        finally:
            feeder.cancel()
            self._viewers.discard(viewer)
            self._tell_wants()

    async def _admit(self, viewer: _Viewer) -> bool:
        """Read the first message, {"token": ..., "want": [...]}, and answer with the greeting."""
        try:
            said = json.loads(await asyncio.wait_for(viewer.socket.receive_str(), PATIENCE_S))
            token, wants = str(said.get("token") or ""), frozenset(said.get("want", ()))
        except (ValueError, TypeError, AttributeError, TimeoutError):
            return False
        expected = self.listen.token
        viewer.may_command = bool(expected) and compare_digest(token.encode(), expected.encode())
        if token and not viewer.may_command:
            await asyncio.sleep(SLOW_TOKEN_S)
        if not viewer.may_command and (token or not self.listen.loopback):
            return False
        viewer.wants = wants & self._wishes
        names = sorted(self._commands) if viewer.may_command else []
        await viewer.socket.send_str(json.dumps({"hello": plain(self._hello), "may": names}))
        return True

    async def _hear(self, viewer: _Viewer, text: str) -> bool:
        """One message of a viewer. False: it makes no sense, and the viewer has to go."""
        viewer.heard_s = time.monotonic()
        try:
            said = json.loads(text)
            if "got" in said:
                viewer.got_n = min(int(said["got"]), viewer.sent_n)
            if "want" in said:
                viewer.wants = frozenset(said["want"]) & self._wishes
                self._tell_wants()
            if "do" in said:  # beside the reading: a command may take longer than our patience
                task = asyncio.create_task(self._do(viewer, str(said["do"]), said))
                viewer.doing.add(task)
                task.add_done_callback(viewer.doing.discard)
        except (ValueError, TypeError, KeyError) as error:
            log.warning("view: a viewer said %.80r: %s", text, error)
            return False
        return True

    async def _do(self, viewer: _Viewer, name: str, said: Mapping[str, Any]) -> None:
        """Run a command if the viewer may, and tell it what came of it."""
        ok, command = False, self._commands.get(name)
        if command is None:
            words = f"no command {name!r:.40}"
        elif not viewer.may_command:
            words = "read-only: open the page with its token"
        else:
            try:
                words, ok = await asyncio.to_thread(command, said), True
            except Refused as error:
                words = str(error)
            except Exception:
                log.exception("view: command %s", name)
                words = f"{name} failed; see the program's log"
        with suppress(ConnectionError):  # it may have left meanwhile
            await viewer.socket.send_str(json.dumps({"did": name, "ok": ok, "words": words}))

    async def _pump(self) -> None:
        """Packets for whoever is ready, at the page's rate; asleep while nobody watches."""
        assert self._watched is not None
        due_s = time.monotonic()
        while True:
            await self._watched.wait()
            due_s = max(due_s + 1 / RATE_HZ, time.monotonic())
            await asyncio.sleep(due_s - time.monotonic())
            made: dict[frozenset[str], bytes | None] = {}
            for viewer in list(self._viewers):
                if time.monotonic() - viewer.heard_s > PATIENCE_S and viewer.sent_n > viewer.got_n:
                    self.cut_off_n += 1
                    self._viewers.discard(viewer)
                    viewer.transport.abort()
                elif viewer.ready:
                    if viewer.wants not in made:
                        made[viewer.wants] = self._packet(viewer.wants)
                    viewer.slot = made[viewer.wants]
                    if viewer.slot is not None:
                        viewer.filled.set()

    def _packet(self, wants: frozenset[str]) -> bytes | None:
        try:
            return self._make(wants)
        except Exception:  # a picture that cannot be made must not end the page for everybody
            log.exception("view: packet")
            return None

    async def _feed(self, viewer: _Viewer) -> None:
        """Send what lies in the slot; waits here for a slow socket, and nowhere else."""
        while True:
            await viewer.filled.wait()
            viewer.filled.clear()
            if viewer.slot is not None:
                packet, viewer.slot = viewer.slot, None
                viewer.sent_n += 1
                self.sent_n += 1
                try:
                    await viewer.socket.send_bytes(packet)
                except ConnectionError:
                    return

    def _tell_wants(self) -> None:
        assert self._watched is not None
        wants: frozenset[str] | None = None
        for viewer in self._viewers:
            wants = viewer.wants | (wants or frozenset())
        if self._viewers:
            self._watched.set()
        else:
            self._watched.clear()
        if wants != self._told:
            self._told = wants
            self._on_wants(wants)


def _host(host: str) -> str:
    """Without its port."""
    return urlsplit(f"//{host}").hostname or ""
