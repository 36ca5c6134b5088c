"""What the monitor shows: arrows, lines, tables, rates."""

from __future__ import annotations

import time
from math import nan

import can
import pytest
from rich.console import Console

import hostlink
from hostlink.monitor import Board, Row, arrow, line, table
from hostlink.wire import Contact, State, Status, pack_state


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


def row(state: State | None) -> Row:
    return Row(2, state, 240.0, 0.0042, 1000, 3, 2, 1, "too much")


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


def test_table_shows_every_row() -> None:
    console = Console(width=160, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    console.print(table([row(STATE), row(None)], "can:can0"))
    text = console.export_text()
    for part in ("can:can0", "1.500", "0.500", "↘", "(+2.0,-1.0)", "240", "too much"):
        assert part in text


def test_board_counts_between_looks(request: pytest.FixtureRequest) -> None:
    channel = request.node.name
    with can.Bus(interface="virtual", channel=channel) as bus, hostlink.connect(f"virtual:{channel}") as hand:
        board = Board(hand)
        assert board.look() == []
        heard: list[hostlink.Sample] = []
        hand.on_sample(heard.append)
        for k in (0, 1, 3):
            data = pack_state(State(sample=k, status=Status.OVERLOAD | Status.TOUCHED), k)
            bus.send(can.Message(arbitration_id=0x184, data=data, is_fd=True, is_extended_id=False))
        end = time.monotonic() + 5
        while len(heard) < 3:
            assert time.monotonic() < end
        (first,) = board.look()
        assert (first.finger, first.received_n, first.lost_n) == (4, 3, 1)
        assert first.rate_hz > 0
        assert "let go" not in first.words
        assert "beyond what it stands" in first.words
        assert "touches" not in first.words
        (second,) = board.look()
        assert second.rate_hz == 0
