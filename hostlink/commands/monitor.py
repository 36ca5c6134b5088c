"""The state of a connection for display: one row a finger, as a table or as plain lines.

`Board` keeps the counts between two updates; `rows` gives plain values, `screen` and `line` show them.
The table fits a terminal of 80 columns, beside long names without the contacts' places, and 20 fingers fit
24 lines. The problems of a finger are on a line below the table; where that has no room, the title says how
many have some.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, hypot, isnan, nan, tau
from typing import TYPE_CHECKING

from hostlink.client import Connection, Finger
from hostlink.topics import status_text
from hostlink.wire import State
from hostlink.wire.nmt import NmtState

if TYPE_CHECKING:
    from rich.console import Console, Group
    from rich.table import Table

__all__ = ["Board", "FingerRow", "arrow", "line", "screen"]

ARROWS = "→↘↓↙←↖↑↗"  # y points down in the tip's frame, as in the camera's image
ARROW_MIN_MM = 0.02  # below a tenth of a pixel's motion a direction is noise
COLUMNS = (
    "finger",
    "depth\nmm",
    "shear\nmm",
    "force\nN",
    "rate\nHz",
    "age\nms",
    "lost",
    "late",
    "bad",
    "contacts, place\nof the first, mm",
)
WITHOUT_NAME = 67  # columns of the table beside the names, with the longest values
HEAD_N = 4  # lines of the table above the first finger
NMT: dict[int | None, str] = {
    NmtState.BOOT_UP: "starting",
    NmtState.STOPPED: "stopped",
    NmtState.PRE_OPERATIONAL: "not started (pre-operational)",
}


@dataclass(frozen=True, slots=True)
class FingerRow:
    """One finger at one update.

    state    newest sample, or None: none within the last second
    rate_hz  samples a second since the last update
    problem  its problems as text; empty: none
    name     in the hand's file; "": it has none
    """

    finger: int
    state: State | None
    rate_hz: float
    age_s: float
    received_n: int
    lost_n: int
    late_n: int
    corrupt_n: int
    problem: str
    name: str = ""


class Board:
    """Reads a connection from time to time."""

    STALE_S = 1.0

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._counts: dict[int, int] = {}
        self._updated_s = time.monotonic()

    def rows(self) -> list[FingerRow]:
        """A row for each finger received so far, and for each node with a heartbeat alone."""
        now_s = time.monotonic()
        passed_s, self._updated_s = max(now_s - self._updated_s, 1e-3), now_s
        rows = []
        named = {mount.node: mount.name for mount in self._connection.hand.mounts}
        received = {**self._connection.silent_nodes, **self._connection.fingers}
        for node, finger in sorted(received.items()):
            sample = None if finger.mismatch is not None else finger.latest(self.STALE_S)
            s = finger.statistics
            fresh_n = s.received_n - self._counts.get(node, 0)
            self._counts[node] = s.received_n
            rows.append(
                FingerRow(
                    finger=node,
                    name=named.get(node, ""),
                    state=sample.state if sample else None,
                    rate_hz=fresh_n / passed_s,
                    age_s=sample.age_s if sample else nan,
                    received_n=s.received_n,
                    lost_n=s.lost_n,
                    late_n=s.late_n,
                    corrupt_n=s.corrupt_n,
                    problem=_problem(finger, sample.state if sample else None, self._connection.up),
                )
            )
        return rows


def arrow(x_mm: float, y_mm: float) -> str:
    """Direction of a shear as one character; a dot when there is next to none, blank when unknown."""
    if isnan(x_mm) or isnan(y_mm):
        return " "
    if hypot(x_mm, y_mm) < ARROW_MIN_MM:
        return "·"
    return ARROWS[round(atan2(y_mm, x_mm) / (tau / 8)) % 8]


def line(row: FingerRow) -> str:
    """A row as one plain line, `name=value`."""
    s, finger = row.state, f"finger={row.finger}" + (f" name={row.name}" if row.name else "")
    if s is None:
        return f"{finger} no samples lost={row.lost_n} corrupt={row.corrupt_n} {row.problem}".rstrip()
    return (
        f"{finger} displacement={_number(s.displacement_mm, 3)}mm "
        f"shear={_number(s.shear_x_mm, 3)},{_number(s.shear_y_mm, 3)}mm "
        f"force={_number(s.force_n, 2)}N contacts={s.contact_n} rate={row.rate_hz:.0f}Hz "
        f"age={row.age_s * 1e3:.1f}ms received={row.received_n} lost={row.lost_n} late={row.late_n} "
        f"corrupt={row.corrupt_n} {row.problem}"
    ).rstrip()


def screen(rows: Sequence[FingerRow], title: str, console: Console) -> Group:
    """All that is shown on a terminal: the table, and the problems."""
    from rich.console import Group
    from rich.text import Text

    if not rows:
        return Group(Text(title), Text("nothing received yet"))
    problems = [Text(f"finger {row.name or row.finger}: {row.problem}") for row in rows if row.problem]
    if len(problems) > console.height - HEAD_N - len(rows):
        title += f"  ({len(problems)} with problems: --plain lists them)"
        problems = []
    heading = Text(title, no_wrap=True, overflow="ellipsis")
    return Group(heading, _table(rows, console.width), *problems)


def _table(rows: Sequence[FingerRow], width: int) -> Table:
    from rich import box
    from rich.table import Table

    names = [row.name or str(row.finger) for row in rows]
    with_places = max(map(len, names)) + WITHOUT_NAME <= width
    t = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
    for column in COLUMNS if with_places else (*COLUMNS[:-1], "contacts"):
        t.add_column(column, justify="right", no_wrap=True)
    for name, row in zip(names, rows, strict=True):
        s = row.state
        t.add_row(
            name,
            *(["-"] * 3 if s is None else _cells(s)),
            f"{row.rate_hz:.0f}",
            _number(row.age_s * 1e3, 1),
            str(row.lost_n),
            str(row.late_n),
            str(row.corrupt_n),
            "-" if s is None else _places(s) if with_places else str(s.contact_n),
        )
    return t


def _cells(s: State) -> list[str]:
    return [
        _number(s.displacement_mm, 3),
        f"{_number(hypot(s.shear_x_mm, s.shear_y_mm), 3)} {arrow(s.shear_x_mm, s.shear_y_mm)}".rstrip(),
        _number(s.force_n, 2),
    ]


def _places(s: State) -> str:
    """Number of contacts, and place of the strongest."""
    first = f" ({s.contacts[0].x_mm:+.1f},{s.contacts[0].y_mm:+.1f})" if s.contacts else ""
    return f"{s.contact_n}{first}"


def _number(value: float, digits: int) -> str:
    return "-" if isnan(value) else f"{value:.{digits}f}"


def _problem(finger: Finger, state: State | None, up: bool) -> str:
    """The problems shown by the status bits, the node's state and the link, as text."""
    problems = [] if up else ["link down"]
    if finger.mismatch is not None:
        problems.append(str(finger.mismatch))
    if finger.second_sender:
        problems.append("two senders use this number; give each fingertip its own (?node=)")
    if finger.state_nmt in NMT:
        problems.append(NMT[finger.state_nmt])
    elif finger.state_nmt is not None and finger.newest is None and finger.mismatch is None:
        problems.append("a heartbeat alone: perhaps no fingertip")
    if state is not None:
        problems.append(status_text(state.status))
    return "; ".join(filter(None, problems))
