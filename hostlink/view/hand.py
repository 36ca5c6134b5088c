"""A connection's live page: every finger's newest sample, and the samples since the last packet.

    link thread     callback: keeps the sample
    server thread   make: one packet for all fingers
    worker thread   tare: sends the command to the finger and waits for its answer

Rules
- Only values of the sensor are shown: places are mm of the tip's frame, unknown values are dashes.
- Latency here is from capture to arrival at this host, on the mapped clock.
- A chart has a point or two for each of its pixels, whatever the fingers' rate: of samples within SLOT_S
  their least and their greatest values, so that no peak is lost.
"""

from __future__ import annotations

import time
from array import array
from collections import deque
from collections.abc import Mapping
from operator import attrgetter
from typing import Any

from hostlink.client import Connection, Sample
from hostlink.commands.monitor import Board, FingerRow
from hostlink.errors import LinkError, VersionMismatch
from hostlink.web import CommandRefused, Listen, PageServer, pack_packet
from hostlink.wire import RestFrameState, State
from hostlink.wire.fields import FIELDS
from hostlink.wire.objects import REST_FRAME_REASONS
from hostlink.wire.shown import live_charts, live_fields

__all__ = ["HandView"]

CHART = ("time_s", *live_fields(FIELDS), "latency_ms")
#: The picture of a tip and the numbers below it are made of these.
STATE = (
    *("displacement_mm", "shear_x_mm", "shear_y_mm", "orientation_deg"),
    *("force_n", "force_x_n", "force_y_n"),
)
_charted = attrgetter(*live_fields(FIELDS))
SLOT_S = 1 / 60  # a pixel of a chart of 10 s that is 600 wide
RECENT = 256  # rows of a finger between two packets; normally 4, at 30 packets a second
OVERLAP_S = 0.3  # rows are sent this long: a viewer that missed a packet has no gap
UPDATE_S = 0.5  # rates and counts over less are noise


#: This holds without a hand's file.
_FIVE = dict(enumerate(("thumb", "index", "middle", "ring", "little"), 1))


def _shown(state: State) -> dict[str, Any]:
    return {
        **{name: getattr(state, name) for name in STATE},
        "contacts": [contact._asdict() for contact in state.contacts],
    }


class _Rows:
    """The newest rows of a finger's charts.

    counted_n  rows so far
    """

    def __init__(self) -> None:
        self.counted_n = 0
        self._done: deque[tuple[float, ...]] = deque(maxlen=RECENT)
        self._low: list[float] = []  # of the slot that is not over; the first is the time
        self._high: list[float] = []

    def add(self, row: tuple[float, ...]) -> None:
        if self._low and row[0] - self._low[0] < SLOT_S:
            self._high = list(map(max, self._high or self._low, row))
            self._low = list(map(min, self._low, row))
            return
        for done in (self._low, self._high):
            if done:
                self._done.append(tuple(done))
                self.counted_n += 1
        self._low, self._high = list(row), []

    def since(self, time_s: float, now_s: float) -> array[float]:
        """The rows that are not older, one behind the other; their times relative to now."""
        recent = array("f")
        for at_s, *values in list(self._done):
            if at_s > time_s:
                recent.extend((at_s - now_s, *values))
        return recent


class HandView:
    """The live page of a connection."""

    def __init__(self, connection: Connection, listen: Listen) -> None:
        hand = connection.hand
        names = {mount.node: mount.name for mount in hand.mounts} or _FIVE
        self._connection = connection
        self._board = Board(connection)
        self._updated_s = 0.0
        self._rows: dict[int, FingerRow] = {}
        self._mismatch = ""
        self._watched = False
        self._series: dict[int, _Rows] = {}
        self._remove = connection.on_sample(self._keep)
        hello = {
            "address": str(connection.address),
            "chart": CHART,
            "charts": live_charts(FIELDS),
            "hand": list(names),
            "names": names,
            "left": hand.left,
        }
        self.server = PageServer(
            listen, "hostlink.view", self._make, hello, {"tare": self._tare}, self._on_wants
        )

    def start(self) -> None:
        """Serve the page. Raises WebError."""
        self.server.start()

    def close(self) -> None:
        self.server.close()
        self._remove()

    # ---- the link's thread --------------------------------------------------------------------------

    def _keep(self, sample: Sample) -> None:
        if self._watched:
            latency_ms = (sample.arrival_s - sample.host_time_s) * 1e3
            row = (sample.arrival_s, *_charted(sample.state), latency_ms)
            if sample.finger not in self._series:
                self._series[sample.finger] = _Rows()
            self._series[sample.finger].add(row)

    # ---- the server's thread ------------------------------------------------------------------------

    def _on_wants(self, wants: frozenset[str] | None) -> None:
        self._watched = wants is not None

    def _make(self, wants: frozenset[str]) -> bytes | None:
        now_s = time.monotonic()
        if now_s - self._updated_s >= UPDATE_S:
            self._updated_s = now_s
            self._update()
        newest = [f.newest for f in self._connection.fingers.values() if f.newest is not None]
        header: dict[str, Any] = {
            "now_s": now_s,
            "age_s": min((sample.age_s for sample in newest), default=0.0),
            "rate_hz": sum(row.rate_hz for row in self._rows.values()),
            "faults": [] if self._connection.up else ["the link is down; it comes back by itself"],
            "fingers": [],
        }
        if self._mismatch:
            header["faults"].append(self._mismatch)
        arrays: dict[str, tuple[str, bytes]] = {}
        for node, row in sorted(self._rows.items()):
            finger, recent = self._finger(node, row, now_s)
            header["fingers"].append(finger)
            arrays[f"rows{node}"] = ("f4", recent.tobytes())
        return pack_packet(header, arrays)

    def _update(self) -> None:
        try:
            self._rows = {row.finger: row for row in self._board.rows()}
            self._mismatch = ""
        except VersionMismatch as error:
            self._mismatch = str(error)

    def _finger(self, node: int, row: FingerRow, now_s: float) -> tuple[dict[str, Any], array[float]]:
        """A packet's data on one finger, and its rows of the charts."""
        rows = self._series.get(node) or _Rows()
        counted_n = rows.counted_n  # read before the rows: one may be sent twice, but none is lost
        recent = rows.since(now_s - OVERLAP_S, now_s)
        finger = self._connection.fingers[node]
        try:
            sample = finger.latest(Board.STALE_S)
        except VersionMismatch:
            sample = None
        return {
            "node": node,
            "rows_n": counted_n,
            "state": _shown(sample.state) if sample else None,
            "rate_hz": row.rate_hz,
            "lost_n": row.lost_n,
            "corrupt_n": row.corrupt_n,
            "message": row.problem,
        }, recent

    # ---- worker threads -----------------------------------------------------------------------------

    def _tare(self, fields: Mapping[str, Any]) -> str:
        node = fields.get("finger")
        if type(node) is not int or node not in self._connection.fingers:
            raise CommandRefused("no such finger was heard")
        try:
            outcome = self._connection.fingers[node].tare(force=fields.get("force") is True)
        except LinkError as error:
            raise CommandRefused(f"finger {node}: {error}") from None
        if outcome.state is RestFrameState.FORCED:
            why = outcome.message or REST_FRAME_REASONS[outcome.reason]
            return f"finger {node}: rest frame forced: {why}"
        return f"finger {node}: the new rest frame is in use"
