"""The live page of the fingertip, in the second process: takes data from the loop, makes packets for viewers.

Charts show every sample, not only those whose picture was drawn. Without a new result packets are still sent:
with the camera's image, to aim and to focus before pins are found, and with the faults.
"""

import time
from collections.abc import Callable, Mapping
from math import nan
from typing import Any

import numpy as np

from edge.types import Frame, Rest, Result
from edge.view.scene import CHART, Arrays, camera, hello, touch
from edge.worker.params import PARAMS
from hostlink.web import Listen, PageServer, pack_packet
from hostlink.wire import FIELDS, State

#: The page has these of a sample: the measured values.
VALUES = tuple(f.name for f in FIELDS if not f.plain)


class LivePage:
    """source, serial  names of camera and tip
    commands        of viewers, by name
    on_wants        called with what all viewers request together when that changes; None: nobody watches
    recording       the state of a recording for viewers, while there is one
    """

    def __init__(
        self,
        listen: Listen,
        source: str,
        serial: str,
        commands: Mapping[str, Callable[[Mapping[str, Any]], str]],
        on_wants: Callable[[frozenset[str] | None], None],
    ) -> None:
        self.recording: dict[str, Any] | None = None
        self._notify_wants = on_wants
        self._latest: tuple[Result, State] | None = None
        self._frame: Frame | None = None
        self._rest: Rest | None = None
        self._about: dict[str, Any] = {}
        self._seen_n = 0
        self._last_s = time.monotonic()
        self._charted: tuple[int, list[tuple[float, ...]]] = (0, [])  # samples so far, the last ones' rows
        self._made: dict[frozenset[str], tuple[int, float]] = {}  # request: results seen, when
        parts = ("image", "surface", "cells")
        first = hello(source, serial)
        self.server = PageServer(listen, "edge.view", self._make, first, commands, self._on_wants, parts)

    # ---- the main thread ----------------------------------------------------------------------------

    def show(
        self,
        now_s: float,
        last_s: float,
        seen_n: int,
        new_rows: list[tuple[float, ...]],
        frame: Frame | None,
        latest: tuple[Result, State] | None,
        rest: Rest | None,
        about: dict[str, Any],
    ) -> None:
        """Take new data since the last call; None: as before.

        last_s    monotonic time of the newest result, the `seen_n`-th
        new_rows  of the charts: one a sample
        frame     the newest image, with or without a result
        """
        self._rest, self._frame = rest or self._rest, frame or self._frame
        self._latest, self._about = latest or self._latest, about
        rows_n, rows = self._charted
        recent = [row for row in (*rows, *new_rows) if now_s - row[0] < PARAMS.recent_s]
        self._charted = (rows_n + len(new_rows), recent)
        self._last_s, self._seen_n = last_s, seen_n

    # ---- the server's thread ------------------------------------------------------------------------

    def _on_wants(self, wants: frozenset[str] | None) -> None:
        if wants is None:
            self._made.clear()
        self._notify_wants(wants)

    def _make(self, wants: frozenset[str]) -> bytes | None:
        now_s = time.monotonic()
        seen_n, last_s = self._made.get(wants, (-1, 0.0))
        if not self._about or (self._seen_n == seen_n and now_s - last_s < PARAMS.report_s):
            return None
        self._made[wants] = (self._seen_n, now_s)
        frame, latest, rest = self._frame, self._latest, self._rest
        rows_n, rows = self._charted
        header: dict[str, Any] = {"now_s": now_s, "rate_hz": _rate_hz(rows)}
        arrays: Arrays = {}
        if latest is not None and rest is not None:
            result, state = latest
            if len(result.tracks.seen) == len(rest):  # not if it is from before a tare of another tip
                part, arrays = touch(result, rest, wants)
                header |= part
            header["values"] = {name: getattr(state, name) for name in VALUES}
        header["age_s"] = now_s - self._last_s
        if frame is not None and "image" in wants:
            part, picture = camera(frame)
            header |= part
            arrays |= picture
        header |= self._about
        header |= {"rows_n": rows_n, "viewers_n": self.server.viewers_n}
        if self.recording is not None:
            header["recording"] = self.recording
        return pack_packet(header, arrays | _chart(rows, now_s))


def _rate_hz(rows: list[tuple[float, ...]]) -> float:
    """Rate of the samples in the charts' rows; NaN: there are no two."""
    passed_s = rows[-1][0] - rows[0][0] if rows else 0.0
    return (len(rows) - 1) / passed_s if passed_s > 0 else nan


def _chart(rows: list[tuple[float, ...]], now_s: float) -> Arrays:
    """The last rows: overlapping packets, so that a viewer that missed one has no gap."""
    shown = np.array([row for row in rows if now_s - row[0] < PARAMS.recent_s]).reshape(-1, len(CHART))
    shown[:, 0] -= now_s  # small numbers: float32 holds them to the microsecond
    return {"rows": ("f4", shown.astype("<f4").tobytes())}
