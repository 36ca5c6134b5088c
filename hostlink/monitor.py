"""What a person wants to see of a connection: one row a finger, as a table or as plain lines.

`Board` keeps the counts between two looks; `look` gives rows of plain values, `table` and `line` show them.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, hypot, isnan, nan, tau
from typing import TYPE_CHECKING

from hostlink.client import Connection
from hostlink.wire import STATUS, State, Status

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["Board", "Row", "arrow", "line", "table"]

ARROWS = "→↘↓↙←↖↑↗"  # y points down in the tip's frame, as in the camera's image
ARROW_MIN_MM = 0.02  # below a tenth of a pixel's motion a direction is noise
COLUMNS = ("finger", "depth mm", "shear mm", " ", "force N", "Hz", "age ms", "lost", "late", "bad")
NMT = {0: "boot", 4: "stopped", 5: "", 127: "pre-op"}


@dataclass(frozen=True, slots=True)
class Row:
    """One finger at one look.

    state    newest sample, or None: none within the last second
    rate_hz  samples a second since the look before
    words    what is wrong, in words; empty: nothing
    """

    finger: int
    state: State | None
    rate_hz: float
    age_s: float
    received_n: int
    lost_n: int
    late_n: int
    corrupt_n: int
    words: str


class Board:
    """Looks at a connection from time to time."""

    STALE_S = 1.0

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._counts: dict[int, int] = {}
        self._looked_s = time.monotonic()

    def look(self) -> list[Row]:
        """A row for each finger heard so far. Raises VersionMismatch."""
        now_s = time.monotonic()
        passed_s, self._looked_s = max(now_s - self._looked_s, 1e-3), now_s
        rows = []
        for node, finger in sorted(self._connection.fingers.items()):
            sample, s = finger.latest(self.STALE_S), finger.statistics
            fresh_n = s.received_n - self._counts.get(node, 0)
            self._counts[node] = s.received_n
            rows.append(
                Row(
                    finger=node,
                    state=sample.state if sample else None,
                    rate_hz=fresh_n / passed_s,
                    age_s=sample.age_s if sample else nan,
                    received_n=s.received_n,
                    lost_n=s.lost_n,
                    late_n=s.late_n,
                    corrupt_n=s.corrupt_n,
                    words=_words(sample.state if sample else None, finger.state_nmt, self._connection.up),
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


def line(row: Row) -> str:
    """A row as one plain line, `name=value`."""
    s = row.state
    if s is None:
        return (
            f"finger={row.finger} no samples lost={row.lost_n} corrupt={row.corrupt_n} {row.words}".rstrip()
        )
    return (
        f"finger={row.finger} displacement={_number(s.displacement_mm, 3)}mm "
        f"shear={_number(s.shear_x_mm, 3)},{_number(s.shear_y_mm, 3)}mm "
        f"force={_number(s.force_n, 2)}N contacts={s.contact_n} rate={row.rate_hz:.0f}Hz "
        f"age={row.age_s * 1e3:.1f}ms received={row.received_n} lost={row.lost_n} late={row.late_n} "
        f"corrupt={row.corrupt_n} {row.words}"
    ).rstrip()


def table(rows: Sequence[Row], title: str) -> Table:
    """The rows as a table for a terminal."""
    from rich import box
    from rich.table import Table

    t = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for name in COLUMNS:
        t.add_column(name, justify="right", no_wrap=True)
    t.add_column("contacts", overflow="fold")
    t.add_column("state", overflow="fold")
    for row in rows:
        s = row.state
        values = ["-"] * 4 if s is None else _cells(s)
        t.add_row(
            str(row.finger),
            *values,
            f"{row.rate_hz:.0f}",
            _number(row.age_s * 1e3, 1),
            str(row.lost_n),
            str(row.late_n),
            str(row.corrupt_n),
            "-" if s is None else _places(s),
            row.words,
        )
    return t


def _cells(s: State) -> list[str]:
    return [
        _number(s.displacement_mm, 3),
        _number(hypot(s.shear_x_mm, s.shear_y_mm), 3),
        arrow(s.shear_x_mm, s.shear_y_mm),
        _number(s.force_n, 2),
    ]


def _places(s: State) -> str:
    places = " ".join(f"({c.x_mm:+.1f},{c.y_mm:+.1f})" for c in s.contacts)
    return f"{s.contact_n} {places}".rstrip()


def _number(value: float, digits: int) -> str:
    return "-" if isnan(value) else f"{value:.{digits}f}"


def _words(state: State | None, nmt: int | None, up: bool) -> str:
    """What the status bits, the node's state and the link say, in words."""
    words = [] if up else ["link down"]
    if nmt is not None and NMT.get(nmt, ""):
        words.append(NMT[nmt])
    if state is not None:
        words += [s.meaning for s in STATUS if s.bit in state.status and s.bit is not Status.TOUCHED]
    return "; ".join(words)
