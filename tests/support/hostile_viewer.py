"""Hostile viewers of a live page, repeatedly; and an honest one.

with HostileViewers(port, seed) as attack:
    ...
attack.counts

python -m tests.support.hostile_viewer URL N SECONDS    N honest ones
"""

import asyncio
import contextlib
import math
import socket
import sys
import threading
import time
from collections import Counter
from random import Random
from types import TracebackType
from typing import Self

import aiohttp

from tests.support.waiting import SOON_S

HALF_OPEN_N = 100  # more than there are places for
PATIENCE_S = 2.0  # longest duration of an attack
PAUSE_S = 0.1
NONSENSE = ("[" * 2000, '{"got": 1e400}', '{"want": [[]]}', '{"do": 5}', "null", '{"a":' * 600)


def upgrade_request(port: int) -> bytes:
    """The request that opens a WebSocket."""
    return (
        f"GET /live HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    ).encode()


def message_frame(text: str, opcode: int = 1) -> bytes:
    """A WebSocket message of a client, masked with zeros; below 64 KiB."""
    data = text.encode()
    length = bytes([0x80 | len(data)]) if len(data) < 126 else b"\xfe" + len(data).to_bytes(2)
    return bytes([0x80 | opcode]) + length + bytes(4) + data


async def look(url: str, packets_n: int = 2, until_s: float = math.inf) -> int:
    """An honest viewer: connects, reads some packets (0: any number) or for some time; returns how many."""
    async with (
        asyncio.timeout(SOON_S if math.isinf(until_s) else None),
        aiohttp.ClientSession() as session,
        session.ws_connect(url, max_msg_size=0) as connection,
    ):
        await connection.send_json({"want": ["image"]})
        got_n = 0
        async for message in connection:
            if message.type is aiohttp.WSMsgType.BINARY:
                got_n += 1
                await connection.send_json({"got": got_n})
            if got_n == packets_n > 0 or time.monotonic() > until_s:
                break
        return got_n


class HostileViewers:
    """Attacks a page from its own thread, from start to end.

    counts  attacks by name
    """

    def __init__(self, port: int, seed: int) -> None:
        self.counts: Counter[str] = Counter()
        self._port, self._random = port, Random(seed)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="hostile viewers", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join(SOON_S)

    def _run(self) -> None:
        attacks = (self._never_reads, self._asks_without_end, self._half_open, self._talks_nonsense)
        while not self._over.wait(PAUSE_S):
            attack = self._random.choice(attacks)
            self.counts[attack.__name__.lstrip("_")] += 1
            with contextlib.suppress(OSError):  # disconnected, as expected
                attack()

    def _connect(self) -> socket.socket:
        raw = socket.socket()
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        raw.settimeout(PATIENCE_S)
        raw.connect(("127.0.0.1", self._port))
        return raw

    def _viewer(self) -> socket.socket:
        raw = self._connect()
        raw.sendall(upgrade_request(self._port) + message_frame('{"want": ["image", "surface"]}'))
        return raw

    def _never_reads(self) -> None:
        with self._viewer():
            self._over.wait(PATIENCE_S)

    def _asks_without_end(self) -> None:
        with self._viewer() as raw:
            for _ in range(1000):
                raw.sendall(message_frame('{"do": "tare"}') * 100)

    def _half_open(self) -> None:
        with contextlib.ExitStack() as stack:
            for _ in range(HALF_OPEN_N):
                raw = stack.enter_context(self._connect())
                raw.sendall(self._random.choice([b"G", upgrade_request(self._port)]))
            self._over.wait(PATIENCE_S / 4)

    def _talks_nonsense(self) -> None:
        with self._viewer() as raw:
            raw.sendall(message_frame(self._random.choice(NONSENSE), self._random.choice([1, 1, 2, 9])))
            while raw.recv(1 << 16):
                pass


async def _look_together(url: str, viewers_n: int, seconds: float) -> None:
    until_s = time.monotonic() + seconds
    await asyncio.gather(*(look(url, 0, until_s) for _ in range(viewers_n)))


if __name__ == "__main__":
    asyncio.run(_look_together(sys.argv[1], int(sys.argv[2]), float(sys.argv[3])))
