"""The server under both live pages: cost of viewers, and limits for other clients."""

import asyncio
import contextlib
import gc
import json
import logging
import random
import socket
import threading
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from hostlink.web import PageServer, WebError, find_token, parse_listen
from hostlink.web.limits import SparseLog, WebLimits
from tests.support.memory import bounded_memory
from tests.support.refusals import one_line
from tests.support.seeds import SEED
from tests.support.waiting import SOON_S, until

PACKET = bytes(100_000)  # as large as one with a camera's image
TOKEN = "a-token-for-tests"
LIMITS = WebLimits()


async def look(url: str, packets_n: int = 2) -> int:
    """A viewer connects and reads some packets; returns how many."""
    async with (
        asyncio.timeout(SOON_S),
        aiohttp.ClientSession() as session,
        session.ws_connect(url, max_msg_size=0) as connection,
    ):
        await connection.send_json({"want": ["image"]})
        got_n = 0
        async for message in connection:
            if message.type is aiohttp.WSMsgType.BINARY:
                got_n += 1
                await connection.send_json({"got": got_n})
            if got_n == packets_n:
                break
        return got_n


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


class Served:
    """A page without a loop behind it."""

    def __init__(self, limits: WebLimits = LIMITS, token: str | None = None, packet: bytes = PACKET) -> None:
        self.wanted: list[frozenset[str] | None] = []
        self.server = PageServer(
            parse_listen("127.0.0.1:0", token), "hostlink.view", lambda wants: packet, {},
            {"tare": lambda fields: "taken"}, self.wanted.append, ("image",), limits,
        )  # fmt: skip

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server.port}/live"

    def connect(self) -> socket.socket:
        raw = socket.create_connection(("127.0.0.1", self.server.port))
        raw.settimeout(SOON_S)
        return raw

    def get(self, **headers: str) -> int:
        """The status that a request for the page gets."""
        lines = {"Host": f"127.0.0.1:{self.server.port}", "Connection": "close", **headers}
        text = "".join(f"{name}: {value}\r\n" for name, value in lines.items())
        with self.connect() as raw:
            raw.sendall(f"GET / HTTP/1.1\r\n{text}\r\n".encode("latin-1"))
            return int(read_all(raw).split(b" ", 2)[1])


@contextlib.contextmanager
def serving(**options: Any) -> Iterator[Served]:
    running = Served(**options)
    running.server.start()
    try:
        yield running
    finally:
        running.server.close()


@pytest.fixture
def served() -> Iterator[Served]:
    with serving() as running:
        yield running


def never_reads(served: Served) -> socket.socket:
    """A viewer that requests everything and reads nothing."""
    raw = socket.socket()
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    raw.settimeout(SOON_S)
    raw.connect(("127.0.0.1", served.server.port))
    raw.sendall(upgrade_request(served.server.port))
    raw.sendall(message_frame('{"want": ["image", "money"]}'))
    return raw


def read_all(raw: socket.socket) -> bytes:
    """Read to the end of the connection."""
    got = bytearray()
    with contextlib.suppress(ConnectionResetError):
        while data := raw.recv(1 << 16):
            got += data
    return bytes(got)


@pytest.mark.parametrize("talks", [False, True])
def test_a_viewer_that_acknowledges_nothing_is_disconnected(talks: bool) -> None:
    """Messages are no sign of life: only acknowledged packets count."""
    with serving(limits=WebLimits(patience_s=0.3)) as served:
        server = served.server
        with never_reads(served) as raw:
            with contextlib.suppress(ConnectionError):
                while talks and server.cut_off_n == 0:
                    raw.sendall(message_frame('{"want": ["image"]}'))
                    threading.Event().wait(0.02)
            until(lambda: server.cut_off_n == 1, "it is cut off")
            assert server.sent_n <= 2, "no more than two packets were under way to it"
            until(lambda: server.viewers_n == 0, "it is forgotten")
            read_all(raw)
        until(lambda: served.wanted == [frozenset({"image"}), None], "nothing is made any more")


def test_a_viewer_that_reads_no_answers_is_disconnected() -> None:
    """Answers wait for their reader: a viewer may have a few of them open, not millions."""
    limits = WebLimits(patience_s=SOON_S, messages_per_s=1 << 30)
    with serving(limits=limits, packet=bytes(4)) as served, never_reads(served) as raw:
        until(lambda: served.server.viewers_n == 1, "it is there")
        ask = message_frame(json.dumps({"do": "x" * 100})) * 1000
        gc.collect()
        with bounded_memory(8_000_000), contextlib.suppress(ConnectionError):  # more: answers piled up
            while served.server.cut_off_n == 0:
                raw.sendall(ask)
        assert served.server.cut_off_n == 1


@pytest.mark.parametrize(("text", "opcode"), [('{"want": []}', 1), ("", 9)], ids=["messages", "pings"])
def test_a_viewer_that_sends_endlessly_is_disconnected(text: str, opcode: int) -> None:
    """Long before it would be cut off for what it does not read."""
    with serving(limits=WebLimits(patience_s=2 * SOON_S)) as served, never_reads(served) as raw:
        raw.sendall(message_frame("hello", opcode=9))
        got = b""
        while b"\x8a\x05hello" not in got:
            got += raw.recv(1 << 16)
        with contextlib.suppress(ConnectionError):
            raw.sendall(message_frame(text, opcode=opcode) * (3 * LIMITS.messages_per_s))
        until(lambda: served.server.cut_off_n == 1, "it is cut off")


def test_a_hundred_viewers_come_and_go(served: Served) -> None:
    server = served.server

    async def wave(viewers_n: int) -> list[int]:
        return await asyncio.gather(*(look(served.url, 3) for _ in range(viewers_n)))

    asyncio.run(wave(LIMITS.viewers_n))  # everything that is made once is made
    until(lambda: server.viewers_n == 0, "all have left")
    with never_reads(served):
        until(lambda: server.viewers_n == 1, "one that never reads is there")
        tracemalloc.start()
        try:
            gc.collect()
            before, _ = tracemalloc.get_traced_memory()
            seen: list[int] = []
            for _ in range(10):
                seen += asyncio.run(wave(10))
            until(lambda: server.viewers_n <= 1, "all have left but one")

            def kept_bytes() -> int:
                """Connections that are just closing hold a packet, without being viewers any more."""
                gc.collect()
                return tracemalloc.get_traced_memory()[0] - before

            until(lambda: kept_bytes() < 500_000, "memory comes back")
        finally:
            tracemalloc.stop()
    assert seen.count(3) == 100
    until(lambda: server.viewers_n == 0, "the last one has left")


@pytest.mark.parametrize("fields", ["", "G", "GET / HTTP/1.1\r\nHost: ", "an upgrade"])
def test_half_open_requests_do_not_block_others(
    served: Served, fields: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Many times more than there are places for: a viewer is still admitted.

    Only a viewer that has sent its first message takes a place, too.
    """
    upgrade = fields == "an upgrade"
    sent = upgrade_request(served.server.port) if upgrade else fields.encode()
    with contextlib.ExitStack() as stack:
        for _ in range(2 * LIMITS.viewers_n if upgrade else 5 * LIMITS.connections_n):
            raw = stack.enter_context(served.connect())
            raw.sendall(sent)
            assert not upgrade or raw.recv(4096).startswith(b"HTTP/1.1 101")
        assert asyncio.run(look(served.url)) == 2
        assert served.server.connections_n <= LIMITS.connections_n
    assert sum(len(record.getMessage()) for record in caplog.records) < 10_000


def test_more_viewers_than_may_watch_are_refused() -> None:
    with serving(limits=WebLimits(patience_s=SOON_S)) as served, contextlib.ExitStack() as stack:
        for _ in range(LIMITS.viewers_n):
            stack.enter_context(never_reads(served))
        until(lambda: served.server.viewers_n == LIMITS.viewers_n, "all are let in")
        assert asyncio.run(close_code(served.url, '{"want": []}')) == 1013


def test_a_request_that_takes_too_long_is_closed_and_a_viewer_stays() -> None:
    with serving(limits=WebLimits(request_s=1.0)) as served:
        with served.connect() as raw:
            raw.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ")
            assert read_all(raw) == b""
            until(lambda: served.server.connections_n == 0, "it is forgotten")
        assert asyncio.run(look(served.url, 40)) == 40


async def close_code(url: str, *texts: str) -> int | None:
    """Why the server disconnects a viewer that says this."""
    async with (
        asyncio.timeout(SOON_S),
        aiohttp.ClientSession() as session,
        session.ws_connect(url) as connection,
    ):
        for text in texts:
            await connection.send_str(text)
        async for _ in connection:
            pass
        return connection.close_code


HOSTS = ["[::1", "[", "::1]:80", "evil.example", "127.0.0.1.evil", "", "a\x80b", "[v1.x]"]
ORIGINS = ["http://[", "http://evil.example", "null", "", "http://[::1", "//"]


@pytest.mark.parametrize(
    ("header", "text"), [*(("Host", text) for text in HOSTS), *(("Origin", text) for text in ORIGINS)]
)
def test_a_host_or_an_origin_that_is_not_ours_is_refused(served: Served, header: str, text: str) -> None:
    assert served.get(**{header: text}) == 403


def test_our_own_page_is_let_in(served: Served) -> None:
    assert served.get(Origin=f"http://127.0.0.1:{served.server.port}") == 200
    assert served.get() == 200


NONSENSE = [
    "[" * 2000, '{"a":' * 600, '{"got": 1e400}', '{"got": -1}', '{"got": NaN}', '{"do": ["tare"]}', "null",
    "", "{", '{"do": "tare", "x": Infinity}', '{"got": ' + "1" * 4000 + "}", '{"got": "\\ud800"}',
]  # fmt: skip


@pytest.mark.parametrize("text", NONSENSE, ids=lambda text: text[:16])
def test_an_invalid_message_disconnects_only_its_viewer(
    served: Served, text: str, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.DEBUG):
        if not text.startswith(('{"got"', '{"do": [')) or "1e400" in text or "NaN" in text:
            assert asyncio.run(close_code(served.url, text)) == 4401
        assert asyncio.run(close_code(served.url, '{"want": []}', text)) == 1008
    assert all(record.exc_info is None for record in caplog.records)
    assert asyncio.run(look(served.url)) == 2


@pytest.mark.parametrize("token", ["\\ud800", "x" * 3000, "wrong"])
def test_any_wrong_token_is_refused(token: str) -> None:
    with serving(limits=WebLimits(wrong_token_s=0.0), token=TOKEN) as served:
        assert asyncio.run(close_code(served.url, f'{{"token": "{token}"}}')) == 4401


@pytest.mark.generative
def test_random_requests_and_messages_get_an_answer_and_leave_no_trace(
    served: Served, caplog: pytest.LogCaptureFixture
) -> None:
    """Requests and messages changed at random: each is answered or closed, none is an error (500)."""
    dice = random.Random(14 + SEED)
    here = f"127.0.0.1:{served.server.port}"
    seeds = [
        f"GET / HTTP/1.1\r\nHost: {here}\r\nOrigin: http://{here}\r\nConnection: close\r\n\r\n",
        f"POST /kit.js HTTP/1.1\r\nHost: {here}\r\nContent-Length: 5\r\nConnection: close\r\n\r\nhello",
        upgrade_request(served.server.port).decode(),
    ]
    bits = [*(bytes([byte]) for byte in b"[]:%\x00\xff "), b"\r\n", b"/../", b"chunked", b"9" * 20, b"/" * 50]
    messages = [*NONSENSE, '{"want": ["image"]}', '{"do": "tare"}', '{"got": 1}']
    whole = seeds[2].encode()
    foreign = [whole.replace(b": " + at, b": \xff" + at) for at in (b"websocket", b"Upgrade", b"d", b"13")]
    for n in range(300):
        data = bytearray(foreign[n] if n < len(foreign) else dice.choice(seeds).encode())
        for _ in range(dice.randrange(4) if n >= len(foreign) else 0):
            at = dice.randrange(len(data))
            data[at : at + dice.randrange(3)] = dice.choice(bits)
        with served.connect() as raw, contextlib.suppress(OSError):
            raw.sendall(data)
            for _ in range(dice.randrange(4)):
                raw.sendall(message_frame(dice.choice(messages), dice.choice([1, 1, 1, 2, 9, 0])))
            raw.shutdown(socket.SHUT_WR)
            answer = read_all(raw)
            assert not answer.startswith(b"HTTP/1.1 5"), bytes(data)
    assert all(record.exc_info is None for record in caplog.records), caplog.text
    assert len(caplog.records) < 10, "the log is not theirs to fill"
    assert asyncio.run(look(served.url)) == 2


def test_a_sparse_log_counts_skipped_lines(caplog: pytest.LogCaptureFixture) -> None:
    log = SparseLog(logging.getLogger("test"), 3600.0)
    for n in range(5):
        log.write(f"line {n}")
    assert [record.getMessage() for record in caplog.records] == ["line 0"]
    log._next_s = 0.0
    log.write("line 5")
    assert caplog.records[-1].getMessage() == "line 5 (4 more like this were not logged)"


def test_a_token_comes_from_the_option_the_file_or_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A command line is seen by all users of a machine."""
    path, empty, binary = (tmp_path / name for name in ("token", "empty", "binary"))
    path.write_text("from-the-file\nmore\n")
    empty.write_text("\n")
    binary.write_bytes(b"\xff\xfe\xff")
    assert find_token(None, None, "--token-file") is None
    assert find_token(None, path, "--token-file") == "from-the-file"
    monkeypatch.setenv("VORONOI_TOUCH_VIEW_TOKEN", "from-the-environment")
    assert find_token(None, None, "--token-file") == "from-the-environment"
    assert find_token("given", None, "--token-file") == "given"
    for given, file, stated in (
        ("given", path, "given twice"),
        (None, binary, f"--token-file {binary}: not text; give a file whose first line"),
        (None, tmp_path / "none", "No such file"),
        (None, empty, "its first line is empty"),
    ):
        assert stated in one_line(WebError, find_token, given, file, "--token-file")
