"""A connection's live page: every finger's newest sample, and the samples since the last packet.

    link thread     callback: keeps the sample
    server thread   make: one packet for all fingers
    worker thread   tare: sends the command to the finger and waits for its answer

Rules
- Only values of the sensor are shown: places are mm of the tip's frame, unknown values are dashes.
- Latency here is from capture to arrival at this host, on the mapped clock.
"""

from __future__ import annotations

import time
from array import array
from collections import deque
from collections.abc import Mapping
from dataclasses import asdict
from operator import attrgetter
from typing import Any

from hostlink.client import Connection, Sample
from hostlink.commands.monitor import Board, FingerRow
from hostlink.errors import LinkError, VersionMismatch
from hostlink.web import CommandRefused, Listen, PageServer, pack_packet
from hostlink.wire.fields import FIELDS
from hostlink.wire.shown import live_charts, live_fields

__all__ = ["HandView"]

CHART = ("time_s", *live_fields(FIELDS), "latency_ms")
_charted = attrgetter(*live_fields(FIELDS))
RECENT = 256  # samples of a finger between two packets; normally 8, at 30 packets a second
OVERLAP_S = 0.3  # rows are sent this long: a viewer that missed a packet has no gap
UPDATE_S = 0.5  # rates and counts over less are noise


#: This holds without a hand's file.
_FIVE = dict(enumerate(("thumb", "index", "middle", "ring", "little"), 1))


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
        self._series: dict[int, deque[tuple[float, ...]]] = {}
        self._counts: dict[int, int] = {}
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
            self._series.setdefault(sample.finger, deque(maxlen=RECENT)).append(row)
            self._counts[sample.finger] = self._counts.get(sample.finger, 0) + 1

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
        counted = self._counts.get(
            node, 0
        )  # read before the series: a row may be sent twice, but none is lost
        recent = array("f")
        for values in list(self._series.get(node, ())):
            if now_s - values[0] < OVERLAP_S:
                recent.extend((values[0] - now_s, *values[1:]))
        finger = self._connection.fingers[node]
        try:
            sample = finger.latest(Board.STALE_S)
        except VersionMismatch:
            sample = None
        return {
            "node": node,
            "rows_n": counted,
            "state": asdict(sample.state) if sample else None,
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
            self._connection.fingers[node].tare(bool(fields.get("force")))
        except LinkError as error:
            raise CommandRefused(f"finger {node}: {error}") from None
        return f"finger {node}: the new rest frame is in use"
