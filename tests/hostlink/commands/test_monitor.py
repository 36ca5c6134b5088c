"""The monitor's output: arrows, lines, tables, rates."""

from __future__ import annotations

from dataclasses import replace
from math import nan

import can
import pytest
from rich.console import Console

import hostlink
from hostlink.commands.monitor import Board, FingerRow, arrow, line, screen
from hostlink.wire import Contact, State, Status, pack_state
from hostlink.wire.e2e import protect_p5
from tests.support.waiting import until


@pytest.mark.parametrize(
    ("x", "y", "shown"),
    [
        (1, 0, "→"),
        (1, 1, "↘"),
        (0, 1, "↓"),
        (-1, 1, "↙"),
        (-1, 0, "←"),
        (-1, -1, "↖"),
        (0, -1, "↑"),
        (1, -1, "↗"),
    ],
)
def test_arrow_points_as_the_image_does(x: float, y: float, shown: str) -> None:
    assert arrow(x, y) == shown


def test_no_shear_has_no_direction() -> None:
    assert arrow(0.001, 0.001) == "·"
    assert arrow(nan, 1.0) == " "


STATE = State(
    displacement_mm=1.5,
    shear_x_mm=0.3,
    shear_y_mm=0.4,
    contact_n=1,
    contacts=(Contact(2.0, -1.0, 1.5),),
    status=Status.TOUCHED | Status.OVERLOAD,
)


def row(state: State | None) -> FingerRow:
    return FingerRow(2, state, 240.0, 0.0042, 1000, 3, 2, 1, "too much")


def test_line_is_complete() -> None:
    text = line(row(STATE))
    for part in (
        "finger=2",
        "displacement=1.500mm",
        "shear=0.300,0.400mm",
        "force=-N",
        "contacts=1",
        "rate=240Hz",
    ):
        assert part in text
    for part in ("age=4.2ms", "received=1000", "lost=3", "late=2", "corrupt=1", "too much"):
        assert part in text
    assert "no samples" in line(row(None))


def shown(rows: list[FingerRow]) -> str:
    console = Console(width=80, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    console.print(screen(rows, "can:can0"))
    return str(console.export_text())


def test_the_table_fits_80_columns() -> None:
    wide = replace(
        STATE, displacement_mm=-12.345, force_n=123.45, contacts=(Contact(-12.5, -11.5),), contact_n=14
    )
    text = shown([row(STATE), row(None), FingerRow(127, wide, 1000.0, 0.9999, 10**7, 12345, 1234, 123, "")])
    for part in ("can:can0", "1.500", "0.500", "↘", "(+2.0,-1.0)", "240", "finger 2: too much"):
        assert part in text
    for part in ("-12.345", "123.45", "14 (-12.5,-11.5)", "12345", "1234", "999.9", "contacts"):
        assert part in text
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= 80


def test_silence_is_reported() -> None:
    assert shown([]).splitlines() == ["can:can0", "nothing received yet"]


def test_problems_of_a_finger_are_listed_below_the_table(request: pytest.FixtureRequest) -> None:
    """Another version, and two senders with one number, beside a finger in order."""
    channel = request.node.name
    with can.Bus(interface="virtual", channel=channel) as bus, hostlink.connect(f"virtual:{channel}") as hand:
        received: list[hostlink.Sample] = []
        hand.on_sample(received.append)

        def send(node: int, data: bytes) -> None:
            bus.send(can.Message(arbitration_id=0x180 + node, data=data, is_fd=True, is_extended_id=False))

        for k in range(20):
            foreign = bytearray(pack_state(State(sample=k), k))
            foreign[3] = 9
            protect_p5(foreign, k, 0xBEEF)
            send(2, bytes(foreign))
            for start in (0, 5000):
                send(3, pack_state(State(sample=start + k, capture_time_us=(start + k) * 4000), k))
            send(1, pack_state(State(sample=k), k))
        until(lambda: any(s.finger == 1 and s.state.sample == 19 for s in received), "the last one")
        text = " ".join(shown(Board(hand).rows()).split())
    assert "finger 2: finger 2 speaks wire version 9" in text
    assert "finger 3: two senders use this number; give each fingertip its own (?node=)" in text
    assert "finger 1:" not in text


def test_board_counts_between_updates(request: pytest.FixtureRequest) -> None:
    channel = request.node.name
    with can.Bus(interface="virtual", channel=channel) as bus, hostlink.connect(f"virtual:{channel}") as hand:
        board = Board(hand)
        assert board.rows() == []
        received: list[hostlink.Sample] = []
        hand.on_sample(received.append)
        for k in (0, 1, 3):
            data = pack_state(State(sample=k, status=Status.OVERLOAD | Status.TOUCHED), k)
            bus.send(can.Message(arbitration_id=0x184, data=data, is_fd=True, is_extended_id=False))
        until(lambda: len(received) == 3, "all three")
        (first,) = board.rows()
        assert (first.finger, first.received_n, first.lost_n) == (4, 3, 1)
        assert first.rate_hz > 0
        assert "let go" not in first.problem
        assert "beyond its limit" in first.problem
        assert "touches" not in first.problem
        (second,) = board.rows()
        assert second.rate_hz == 0
