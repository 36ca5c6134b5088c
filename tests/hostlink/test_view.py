"""The host page's packets: samples of each finger, and viewers' commands."""

import asyncio
import json
import os
import time
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import aiohttp
import numpy as np
import pytest

import hostlink
from hostlink.commands.monitor import Board
from hostlink.view import HandView, hand
from hostlink.web import pack_packet, parse_listen
from hostlink.wire import Contact, State
from tests.edge.worker.test_page import unpack
from tests.support.commands import run_host
from tests.support.fingers import Application, make_node
from tests.support.waiting import SOON_S, until

BUS = f"udp:239.0.0.8?port={23_000 + os.getpid() % 20_000}"
TOKEN = "a-token-for-tests"


class Setup:
    """Two fingers on a bus, and the page of a connection to it."""

    def __init__(self) -> None:
        pairs = {n: make_node(f"{BUS}&node={n}") for n in (1, 4)}
        self.nodes = {n: node for n, (node, _) in pairs.items()}
        self.applications: dict[int, Application] = {n: one for n, (_, one) in pairs.items()}
        self.connection = hostlink.connect(BUS)
        self.view = HandView(self.connection, parse_listen("127.0.0.1:0", TOKEN))
        self.view.start()
        self.sent_n = 0

    def send(self, n: int = 1) -> None:
        """So many samples of each finger."""
        for _ in range(n):
            self.sent_n += 1
            for number, node in self.nodes.items():
                node.send(
                    State(
                        sample=self.sent_n,
                        capture_time_us=time.monotonic_ns() // 1000 - 2000,
                        latency_us=2000.0,
                        displacement_mm=self.sent_n / 100 * number,
                        shear_x_mm=0.25,
                        contact_n=1,
                        contacts=(Contact(1.0, -2.0, 0.5),),
                    )
                )
            time.sleep(0.002)  # like a finger: one sample a frame

    def close(self) -> None:
        self.view.close()
        self.connection.close()
        for node in self.nodes.values():
            node.close()


@pytest.fixture
def setup() -> Iterator[Setup]:
    made = Setup()
    made.send()
    until(lambda: len(made.connection.fingers) == 2, "both fingers are heard")
    yield made
    made.close()


def watch(setup: Setup, token: str, then: Callable[[Any, dict[str, Any]], Awaitable[Any]]) -> Any:
    async def run() -> Any:
        url = f"http://127.0.0.1:{setup.view.server.port}/live"
        async with (
            asyncio.timeout(SOON_S),
            aiohttp.ClientSession() as session,
            session.ws_connect(url) as socket,
        ):
            await socket.send_json({"token": token, "want": []})
            return await then(socket, await socket.receive_json())

    return asyncio.run(run())


async def packets(socket: Any, enough: Callable[[dict[str, Any]], object]) -> list[dict[str, Any]]:
    taken: list[dict[str, Any]] = []
    while not taken or not enough(taken[-1]):
        message = await socket.receive()
        if message.type is aiohttp.WSMsgType.BINARY:
            taken.append(unpack(message.data))
            await socket.send_json({"got": len(taken)})
    return taken


def test_every_sample_of_every_finger(setup: Setup, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hand, "OVERLAP_S", SOON_S)  # a packet may be arbitrarily late
    monkeypatch.setattr(Board, "STALE_S", SOON_S)

    async def look(socket: Any, hello: dict[str, Any]) -> list[dict[str, Any]]:
        await packets(socket, lambda p: len(p["fingers"]) == 2)
        await asyncio.to_thread(setup.send, 50)
        return await packets(socket, lambda p: all(f["rows_n"] >= 50 for f in p["fingers"]))

    taken = watch(setup, "", look)
    for number in (1, 4):
        seen_n, depths = 0, []
        for packet in taken:
            finger = next(f for f in packet["fingers"] if f["node"] == number)
            rows = packet["arrays"][f"rows{number}"].reshape(-1, len(hand.CHART))
            first = finger["rows_n"] - len(rows)
            assert first <= seen_n, "rows were skipped"
            depths += rows[seen_n - first :, 1].tolist()
            seen_n = finger["rows_n"]
        expected = [k / 100 * number for k in range(2, 52)]
        assert np.allclose(depths[-50:], expected, atol=0.002)
    state = taken[-1]["fingers"][0]["state"]
    assert state["shear_x_mm"] == pytest.approx(0.25, abs=0.002)
    assert state["shear_y_mm"] is None
    assert state["contacts"] == [{"x_mm": 1.0, "y_mm": -2.0, "depth_mm": 0.5}]


def test_nobody_watching_costs_nothing(setup: Setup) -> None:
    setup.send(20)
    assert not setup.view._series
    assert setup.view.server.sent_n == 0


def test_tare_needs_the_token(setup: Setup) -> None:
    async def ask(socket: Any, hello: dict[str, Any]) -> Any:
        await socket.send_json({"do": "tare", "finger": 4})
        while True:
            message = await socket.receive()
            if message.type is aiohttp.WSMsgType.TEXT:
                return hello["may"], json.loads(message.data)

    may, answer = watch(setup, "", ask)
    assert (may, answer["ok"]) == ([], False)
    assert setup.applications[4].tares == []
    may, answer = watch(setup, TOKEN, ask)
    assert (may, answer["ok"]) == (["tare"], True)
    assert setup.applications[4].tares == [False]
    setup.applications[4].touched = True
    _, answer = watch(setup, TOKEN, ask)
    assert not answer["ok"]
    assert answer["message"].startswith("finger 4: ")


def test_packets_keep_numbers_in_their_places() -> None:
    arrays = {"a": ("u1", b"abc"), "b": ("f4", np.arange(3, dtype="<f4").tobytes())}
    packet = unpack(pack_packet({"x": float("nan"), "list": (1, float("inf")), "ä": "ü"}, arrays))
    assert packet["x"] is None
    assert packet["list"] == [1, None]
    assert packet["ä"] == "ü"
    assert packet["arrays"]["a"].tobytes() == b"abc"
    assert packet["arrays"]["b"].tolist() == [0, 1, 2]


def test_the_command() -> None:
    done = run_host("view", BUS, "--listen", "127.0.0.1:0", "--seconds", "0.2")
    assert done.code == 0
    assert "live page: http://127.0.0.1:" in done.err
