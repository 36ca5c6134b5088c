"""The host page's packets: samples of each finger, and viewers' commands."""

import os
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import numpy as np
import pytest

import hostlink
from hostlink.commands.monitor import HEAD_N, Board
from hostlink.hand_file import HandFile, Mount
from hostlink.view import HandView, hand
from hostlink.web import pack_packet, parse_listen
from hostlink.wire import Contact, State
from tests.edge.worker.test_page import Viewer, unpack, watch
from tests.hostlink.commands.test_monitor import shown
from tests.support.bus import open_wire
from tests.support.fingers import Fingers, state
from tests.support.waiting import SOON_S, until

BUS = f"udp:239.0.0.8?port={23_000 + os.getpid() % 20_000}"
TOKEN = "a-token-for-tests"
LISTEN = parse_listen("127.0.0.1:0", TOKEN)


def sample(n: int, k: int) -> State:
    contacts = (Contact(1.0, -2.0, 0.5),)
    return state(k, displacement_mm=n + k % 200 / 100, shear_x_mm=0.25, contact_n=1, contacts=contacts)


@pytest.fixture
def fingers() -> Iterator[Fingers]:
    with Fingers(BUS, (1, 4), sample) as made:
        yield made


@pytest.fixture
def view(fingers: Fingers) -> Iterator[HandView]:
    """The page of a connection to both fingers."""
    with hostlink.connect(BUS) as connection, closing(HandView(connection, LISTEN)) as made:
        made.start()
        until(lambda: len(connection.fingers) == 2, "both fingers are heard")
        yield made


def test_every_sample_of_every_finger(view: HandView, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hand, "OVERLAP_S", SOON_S)  # a packet may be arbitrarily late
    monkeypatch.setattr(hand, "RECENT", 1 << 20)
    monkeypatch.setattr(hand, "SLOT_S", 0.0)
    monkeypatch.setattr(Board, "STALE_S", SOON_S)

    async def look(viewer: Viewer) -> list[dict[str, Any]]:
        taken = [await viewer.packet()]
        while sum(f["rows_n"] >= 50 for f in taken[-1]["fingers"]) < 2:
            taken.append(await viewer.packet())
        return taken

    taken = watch(view.server.url, look)
    for number in (1, 4):
        depths: list[float] = []
        for packet in taken:
            for finger in packet["fingers"]:
                if finger["node"] == number:
                    rows = packet["arrays"][f"rows{number}"].reshape(-1, len(hand.CHART))
                    first = finger["rows_n"] - len(rows)
                    assert first <= len(depths), "rows were skipped"
                    depths += rows[len(depths) - first :, 1].tolist()
        counted = np.round(100 * (np.array(depths) - number))
        assert len(counted) >= 50
        assert (np.diff(counted) % 200 == 1).all()
    shown = taken[-1]["fingers"][0]["state"]
    assert shown["shear_x_mm"] == pytest.approx(0.25, abs=0.002)
    assert shown["shear_y_mm"] is None
    assert shown["contacts"] == [{"x_mm": 1.0, "y_mm": -2.0, "depth_mm": 0.5}]


def test_nobody_watching_costs_nothing(view: HandView) -> None:
    until(lambda: min(s.received_n for s in view._connection.statistics.values()) > 20, "samples")
    assert not view._series
    assert view.server.sent_n == 0


def test_twenty_fingers_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that arrives is counted, what is missing is shown, and one redraw has every finger by its name."""
    monkeypatch.setattr(Board, "STALE_S", SOON_S)
    names = {n: f"{side}_{n}" for n, side in enumerate(("left", "right_middle") * 10, 1)}
    mounts = tuple(Mount(name, n, (0.0, 0.0, 0.0)) for n, name in names.items())
    kept = [k for k in range(250) if k not in (100, 101)]
    with open_wire("twenty", HandFile(mounts=mounts)) as wire, closing(HandView(wire.hand, LISTEN)) as view:
        view._on_wants(frozenset())
        for k in kept:
            for n in names:
                wire.send_state(n, sample(n % 5, k))
        until(lambda: sum(s.received_n for s in wire.hand.statistics.values()) == 20 * len(kept), "all")
        packet = unpack(view._make(frozenset()) or b"")
        lines = shown(Board(wire.hand).rows()).splitlines()
    assert [(f["node"], f["lost_n"]) for f in packet["fingers"]] == [(n, 2) for n in names]
    for finger in packet["fingers"]:
        assert finger["state"]["displacement_mm"] == pytest.approx(finger["node"] % 5 + 0.49, abs=0.001)
    assert [line.split()[0] for line in lines[HEAD_N:]] == list(names.values())
    assert len(lines) == 24


def test_a_chart_keeps_peaks_of_a_fast_finger() -> None:
    rows = hand._Rows()
    for k in range(1000):
        rows.add((k / 1000, {500: 9.0, 505: -9.0}.get(k, 1.0)))
    time_s, values = np.array(rows.since(0.2, 1.0)).reshape(-1, 2).T
    assert rows.counted_n <= 2 / hand.SLOT_S + 2
    assert (values.min(), values.max()) == (-9.0, 9.0)
    assert (np.diff(time_s) > 0).all()
    assert (time_s > -0.8).all()
    assert (time_s < 0).all()


def test_tare_needs_the_token(view: HandView, fingers: Fingers) -> None:
    async def ask(viewer: Viewer) -> Any:
        return viewer.hello["may"], await viewer.do("tare", finger=4)

    may, answer = watch(view.server.url, ask)
    assert (may, answer["ok"]) == ([], False)
    assert fingers.applications[4].tares == []
    may, answer = watch(view.server.url, ask, TOKEN)
    assert (may, answer["ok"]) == (["tare"], True)
    assert fingers.applications[4].tares == [False]
    fingers.applications[4].touched = True
    _, answer = watch(view.server.url, ask, TOKEN)
    assert not answer["ok"]
    assert answer["message"].startswith("finger 4: ")


def test_packets_keep_numbers_in_their_places() -> None:
    arrays = {"a": ("u1", b"abc"), "b": ("f4", np.arange(3, dtype="<f4").tobytes())}
    packet = unpack(pack_packet({"x": float("nan"), "list": (1, float("inf")), "ä": "ü"}, arrays))
    assert packet["x"] is None
    assert packet["list"] == [1, None]
    assert packet["ä"] == "ü"
    assert bytes(packet["arrays"]["a"].tolist()) == b"abc"
    assert packet["arrays"]["b"].tolist() == [0, 1, 2]
