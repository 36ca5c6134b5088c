"""The server under both live pages: what viewers cost it, and what becomes of those that never read."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import socket
import threading
import tracemalloc
from collections.abc import Callable, Iterator

import aiohttp
import pytest

import hostlink.web.server
from hostlink.web import PageServer, parse_listen
from hostlink.web.server import VIEWERS_MAX

SOON_S = 20.0
PACKET = bytes(100_000)  # as large as one with a camera's image


class Served:
    """A page without a loop behind it."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self.server = PageServer(
            parse_listen("127.0.0.1:0"), "hostlink.view", self._make, {}, wishes=("image",)
        )

    def _make(self, wants: frozenset[str]) -> bytes:
        self._told()
        return PACKET

    def _told(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait until something holds; looked at with every packet, and otherwise now and then."""
        with self._changed:
            for _ in range(round(SOON_S / 0.02)):
                if condition():
                    return
                self._changed.wait(0.02)
        raise AssertionError(f"never: {what}")

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server.port}/live"


@pytest.fixture
def served() -> Iterator[Served]:
    running = Served()
    running.server.start()
    yield running
    running.server.close()


def never_reads(served: Served) -> socket.socket:
    """A viewer that asks for everything and reads nothing."""
    raw = socket.create_connection(("127.0.0.1", served.server.port))
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    raw.sendall(
        f"GET /live HTTP/1.1\r\nHost: 127.0.0.1:{served.server.port}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        "Sec-WebSocket-Version: 13\r\n\r\n".encode()
    )
    text = b'{"want": ["image"]}'
    raw.sendall(bytes([0x81, 0x80 | len(text), 0, 0, 0, 0]) + text)  # masked with zeros
    return raw


def read_all(raw: socket.socket) -> None:
    """To the end, however it comes."""
    with contextlib.suppress(ConnectionResetError):
        while raw.recv(1 << 16):
            pass


async def visit(session: aiohttp.ClientSession, url: str, packets_n: int) -> int:
    """Come, look at some packets, go; how many were seen."""
    async with session.ws_connect(url) as connection:
        await connection.send_json({"want": ["image"]})
        got_n = 0
        async for message in connection:
            if message.type is aiohttp.WSMsgType.BINARY:
                got_n += 1
                await connection.send_json({"got": got_n})
                if got_n == packets_n:
                    break
        return got_n


def test_a_viewer_that_never_reads_is_cut_off(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hostlink.web.server, "PATIENCE_S", 0.3)
    server = served.server
    with never_reads(served) as raw:
        served.until(lambda: server.viewers_n == 1, "it is there")
        sent_n = server.sent_n
        served.until(lambda: server.cut_off_n == 1, "it is cut off")
        assert server.sent_n - sent_n <= 2, "no more than two packets were under way to it"
        served.until(lambda: server.viewers_n == 0, "it is forgotten")
        raw.settimeout(SOON_S)
        read_all(raw)


def test_a_hundred_viewers_come_and_go(served: Served) -> None:
    server = served.server

    async def wave(viewers_n: int) -> list[int]:
        async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(limit=0)) as session:
            return await asyncio.gather(*(visit(session, served.url, 3) for _ in range(viewers_n)))

    asyncio.run(wave(VIEWERS_MAX))  # what is made once, is made
    served.until(lambda: server.viewers_n == 0, "all have left")
    with never_reads(served):
        served.until(lambda: server.viewers_n == 1, "one that never reads is there")
        tracemalloc.start()
        try:
            gc.collect()
            before, _ = tracemalloc.get_traced_memory()
            seen: list[int] = []
            for _ in range(10):
                seen += asyncio.run(wave(10))
            served.until(lambda: server.viewers_n <= 1, "all have left but one")
            gc.collect()
            after, _ = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
    assert seen.count(3) == 100
    assert after - before < 500_000, "memory did not come back"
    served.until(lambda: server.viewers_n == 0, "the last one has left")
