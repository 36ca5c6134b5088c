"""The live page of the fingertip, in the second process: takes data from the loop, makes packets for viewers.

Charts show every sample, not only those whose picture was drawn. Without a new result packets are still sent:
with the camera's image, to aim and to focus before pins are found, and with the faults.
"""

import time
from collections import deque
from collections.abc import Callable, Mapping
from math import nan
from typing import Any

import numpy as np

from edge.errors import InputError
from edge.types import Frame, Rest, Result
from edge.view.scene import CHART, Arrays, camera, hello, touch
from edge.worker.messages import Show
from edge.worker.params import PARAMS
from hostlink.web import Listen, PageServer, WebError, pack_packet
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
        self._recent: deque[tuple[float, ...]] = deque(maxlen=PARAMS.recent_n)
        self._rows: deque[tuple[float, ...]] = deque(maxlen=PARAMS.recent_n)
        self._rows_n = 0
        self._made: dict[frozenset[str], tuple[int, float]] = {}  # request: results seen, when
        self._counted = (time.monotonic(), 0)
        self._rate_hz = nan
        self.server = PageServer(
            listen,
            "edge.view",
            self._make,
            hello(source, serial),
            commands,
            self._on_wants,
            ("image", "surface", "cells"),
        )

    def start(self) -> None:
        """Serve the page. Raises InputError."""
        try:
            self.server.start()
        except WebError as error:
            raise InputError(str(error)) from None

    def close(self) -> None:
        self.server.close()

    # ---- the main thread ----------------------------------------------------------------------------

    def show(self, show: Show) -> None:
        self._rest = show.rest or self._rest
        self._frame = show.frame or self._frame
        if show.result is not None and show.state is not None:
            self._latest = (show.result, show.state)
        self._about = show.about
        self._recent.extend(show.rows)
        self._last_s = show.last_s
        self._seen_n = show.seen_n

    # ---- the server's thread ------------------------------------------------------------------------

    def _on_wants(self, wants: frozenset[str] | None) -> None:
        if wants is None:
            self._recent.clear()
            self._rows.clear()
            self._made.clear()
        self._notify_wants(wants)

    def _make(self, wants: frozenset[str]) -> bytes | None:
        now_s = time.monotonic()
        seen_n, last_s = self._made.get(wants, (-1, 0.0))
        if not self._about or (self._seen_n == seen_n and now_s - last_s < PARAMS.report_s):
            return None
        self._made[wants] = (self._seen_n, now_s)
        self._take_rows(now_s)
        frame, latest, rest = self._frame, self._latest, self._rest
        header: dict[str, Any] = {"now_s": now_s, "rate_hz": self._rate_hz}
        arrays: Arrays = {}
        if latest is not None and rest is not None:
            result, state = latest
            # Show frames without a result too (a tare, a tip that went dark).
            if frame is None or frame.capture_ns - result.frame.capture_ns < PARAMS.recent_s * 1e9:
                frame = result.frame
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
        header |= {"rows_n": self._rows_n, "viewers_n": self.server.viewers_n}
        if self.recording is not None:
            header["recording"] = self.recording
        return pack_packet(header, arrays | self._chart(now_s))

    def _take_rows(self, now_s: float) -> None:
        """Add the samples since the last packet to the rows of the charts."""
        while self._recent:
            self._rows.append(self._recent.popleft())
            self._rows_n += 1
        since_s, since_n = self._counted
        if now_s - since_s >= PARAMS.recent_s:
            self._rate_hz = (self._seen_n - since_n) / (now_s - since_s)
            self._counted = (now_s, self._seen_n)

    def _chart(self, now_s: float) -> Arrays:
        """The last rows: overlapping packets, so that a viewer that missed one has no gap."""
        recent = [row for row in self._rows if now_s - row[0] < PARAMS.recent_s]
        rows = np.array(recent).reshape(-1, len(CHART))
        rows[:, 0] -= now_s  # small numbers: float32 holds them to the microsecond
        return {"rows": ("f4", rows.astype("<f4").tobytes())}
