"""The monitor's output: arrows, lines, tables, rates."""

from dataclasses import replace
from io import StringIO
from math import nan

import pytest
from rich.console import Console

from hostlink.commands.monitor import Board, FingerRow, arrow, line, screen
from hostlink.wire import Contact, State, Status
from tests.support.bus import Wire
from tests.support.waiting import until


def test_arrow_points_as_the_image_does() -> None:
    around = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
    assert [arrow(x, y) for x, y in around] == list("→↘↓↙←↖↑↗")
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
    shown = "finger=2 displacement=1.500mm shear=0.300,0.400mm force=-N contacts=1 rate=240Hz"
    counted = "age=4.2ms received=1000 lost=3 late=2 corrupt=1"
    for part in (*shown.split(), *counted.split(), "too much"):
        assert part in text
    assert "no samples" in line(row(None))


def shown(rows: list[FingerRow], height: int = 24) -> str:
    console = Console(width=80, height=height, record=True, file=StringIO())
    console.print(screen(rows, "can:can0", console), end="")
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


def test_long_names_and_many_problems_cut_no_number() -> None:
    rows = [replace(row(STATE), name=f"right_middle_finger{n}", age_s=0.1234) for n in range(4)]
    text = shown(rows, height=7)
    assert "…" not in text
    for part in ("can:can0  (4 with problems: --plain lists them)", "1.500", "right_middle_finger3", "123.4"):
        assert part in text
    assert "finger right_middle_finger0: too much" in shown(rows)


def test_problems_of_a_finger_are_listed_below_a_table(wire: Wire, caplog: pytest.LogCaptureFixture) -> None:
    """Another version, and two senders with one number, beside a finger in order."""
    for k in range(20):
        wire.send_foreign(2, k)
        for start in (0, 5000):
            wire.send_state(3, State(sample=start + k, capture_time_us=(start + k) * 4000))
        wire.send_state(1, State(sample=k))
    until(lambda: (s := wire.hand.latest(1, None)) is not None and s.state.sample == 19, "the last one")
    text = " ".join(shown(Board(wire.hand).rows()).split())
    assert "finger 2: finger 2 speaks wire version 9" in text
    assert "finger 3: two senders use this number; give each fingertip its own (?node=)" in text
    assert "finger 1:" not in text
    assert "two senders use number 3; give each fingertip its own" in caplog.text


def test_board_counts_between_updates(wire: Wire) -> None:
    board = Board(wire.hand)
    assert board.rows() == []
    for k in (0, 1, 3):
        wire.send_state(4, State(sample=k, status=Status.OVERLOAD | Status.TOUCHED))
    until(lambda: wire.hand.fingers and wire.hand.statistics[4].received_n == 3, "all three")
    (first,) = board.rows()
    assert (first.finger, first.received_n, first.lost_n) == (4, 3, 1)
    assert first.rate_hz > 0
    assert "let go" not in first.problem
    assert "beyond its limit" in first.problem
    assert "touches" not in first.problem
    (second,) = board.rows()
    assert second.rate_hz == 0
