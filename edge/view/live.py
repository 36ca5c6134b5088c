"""The app's live page: what the loop leaves here, what viewers get of it, and what they may do.

    loop thread     watch(result, state): keeps references, if anybody watches
    server thread   make(wants): the newest of them as a packet
    worker thread   tare, record: posted to the loop, or done beside it

Rules
- The loop waits for nothing here and copies nothing: frames and results are immutable, so a reference is
  enough.
- Charts show every sample, not only those whose picture was drawn: `recent` holds what came since the last
  packet, and is bounded.
- Without a new result there are packets still, `BEAT_HZ` a second: with the camera's image if there is one
  (to aim and to focus before pins are found), and with the faults.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from datetime import datetime
from math import nan
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from edge.app import App
from edge.errors import EdgeError, UsageError
from edge.pipeline import Result
from edge.recording import TOPICS, Recorder
from edge.types import Feature, Features
from edge.view.scene import CHART, Arrays, camera, hello, touch
from hostlink.web import Listen, PageServer, Refused, WebError, pack_packet
from hostlink.wire import FAULTS, State

__all__ = ["View"]

T = TypeVar("T")

#: What the page shows of its own accord; the surface is computed only for a viewer that asks for it.
SHOWN = frozenset({Feature.DISPLACEMENT, Feature.CONTACTS, Feature.SHEAR, Feature.TORSION})
RECENT = 256  # samples between two packets: 8 at 240 frames/s; a viewer that was slow loses the older ones
BEAT_HZ = 4.0
STALE_S = 0.5  # without a result for this long, the camera's image stands alone
OVERLAP_S = 0.3  # charts' rows are sent this long
RATE_S = 0.5  # the rate is counted over this time
LOOP_S = 2.0  # a command runs between two frames; a loop that is busy for longer is in trouble
#: Numbers beside the picture; fields of the state frame.
VALUES = (
    "displacement_mm",
    "displacement_sigma_mm",
    "force_n",
    "shear_x_mm",
    "shear_y_mm",
    "shear_sigma_mm",
    "torsion_deg",
    "tilt_x_deg",
    "tilt_y_deg",
    "slip_probability",
    "contact_n",
    "latency_us",
)
_MEANING = {fault.code: fault.meaning for fault in FAULTS}


class View:
    """The live page of an app.

    recordings  folder for what the record button makes
    tip         about the tip, for these recordings
    """

    def __init__(
        self,
        app: App,
        listen: Listen,
        recordings: Path = Path("."),
        tip: Mapping[str, str] | None = None,
    ) -> None:
        self._app = app
        self._recordings = recordings
        self._tip = dict(tip or {})
        self._watched = False
        self._latest: tuple[Result, State] | None = None
        self._seen_n = 0
        self._recent: deque[tuple[float, State, Features | None]] = deque(maxlen=RECENT)
        self._rows: deque[tuple[float, ...]] = deque(maxlen=RECENT)
        self._rows_n = 0
        self._last_s = time.monotonic()
        self._made: dict[frozenset[str], tuple[int, float]] = {}  # wishes: results seen, when
        self._counted = (time.monotonic(), 0)
        self._rate_hz = nan
        self._recording = threading.Lock()
        self._own: Recorder | None = None
        self.server = PageServer(
            listen,
            "edge.view",
            self._make,
            hello(app.source.name, self._tip.get("serial", "")),
            {"tare": self._tare, "record": self._record},
            self._on_wants,
            ("image", "surface"),
        )

    def start(self) -> None:
        """Serve the page. Raises UsageError."""
        try:
            self.server.start()
        except WebError as error:
            raise UsageError(str(error)) from None

    def close(self) -> None:
        """End the page, and a recording that it began."""
        self.server.close()
        with self._recording:
            if self._own is not None:
                if self._app.recorder is self._own:  # the loop has ended, or ends without it
                    self._app.set_recorder(None)
                self._own.close()
                self._own = None

    # ---- the loop's thread --------------------------------------------------------------------------

    def watch(self, result: Result, state: State) -> None:
        """Take note of a result; a watcher of the app."""
        self._latest = (result, state)
        self._seen_n += 1
        if self._watched:
            self._recent.append((time.monotonic(), state, result.features))

    # ---- the server's thread ------------------------------------------------------------------------

    def _on_wants(self, wants: frozenset[str] | None) -> None:
        """Have computed what is looked at, and no more."""
        self._watched = wants is not None
        shown = frozenset[Feature]()
        if wants is None:
            self._recent.clear()
            self._rows.clear()
            self._made.clear()
        else:
            shown = SHOWN | ({Feature.SURFACE} if "surface" in wants else shown)
        self._app.post(lambda: self._app.set_shown(shown))

    def _make(self, wants: frozenset[str]) -> bytes | None:
        now_s = time.monotonic()
        seen_n, last_s = self._made.get(wants, (-1, 0.0))
        if self._seen_n == seen_n and now_s - last_s < 1 / BEAT_HZ:
            return None
        self._made[wants] = (self._seen_n, now_s)
        self._take_rows(now_s)
        frame, latest, pipeline = self._app.frame, self._latest, self._app.pipeline
        header: dict[str, Any] = {"now_s": now_s, "rate_hz": self._rate_hz}
        arrays: Arrays = {}
        if latest is not None and pipeline is not None:
            result, state = latest
            # A frame that came in and gave no result (a tare, a tip that went dark) is worth seeing.
            if frame is None or frame.capture_ns - result.frame.capture_ns < STALE_S * 1e9:
                frame = result.frame
            if len(result.tracks.seen) == len(pipeline.rest):  # not from before a tare of another tip
                part, arrays = touch(result, pipeline.rest, "surface" in wants)
                header |= part
            header["values"] = {name: getattr(state, name) for name in VALUES}
        header["age_s"] = now_s - self._last_s
        if frame is not None and "image" in wants:
            part, picture = camera(frame)
            header |= part
            arrays |= picture
        return pack_packet(header | self._about(), arrays | self._chart(now_s))

    def _take_rows(self, now_s: float) -> None:
        """Samples since the last packet become rows of the charts."""
        while self._recent:
            at_s, state, features = self._recent.popleft()
            self._rows.append(_row(at_s, state, features))
            self._rows_n += 1
        if self._rows:
            self._last_s = self._rows[-1][0]
        since_s, since_n = self._counted
        if now_s - since_s >= RATE_S:
            self._rate_hz = (self._seen_n - since_n) / (now_s - since_s)
            self._counted = (now_s, self._seen_n)

    def _chart(self, now_s: float) -> Arrays:
        """The last rows; viewers that got a packet less find what they missed, and skip what they have."""
        rows = np.array([row for row in self._rows if now_s - row[0] < OVERLAP_S]).reshape(-1, len(CHART))
        rows[:, 0] -= now_s  # small numbers: float32 holds them to the microsecond
        return {"rows": ("f4", rows.astype("<f4").tobytes())}

    def _about(self) -> dict[str, Any]:
        """What does not come from a frame."""
        app, recorder = self._app, self._app.recorder
        about: dict[str, Any] = {
            "rows_n": self._rows_n,
            "faults": [[_MEANING[code], words] for code, words in app.health.active.items()],
            "taring": app.taring,
            "tares_n": app.tares_n,
            "calibrated": app.calibration is not None,
            "dropped_n": app.source.dropped_n,
            "viewers_n": self.server.viewers_n,
        }
        if recorder is not None:
            about["recording"] = {
                "file": recorder.path.name,
                "frames_n": recorder.written_n[TOPICS["frame"].name],
                "dropped_n": recorder.dropped_n,
                "fault": recorder.fault,
            }
        return about

    # ---- worker threads -----------------------------------------------------------------------------

    def _in_loop(self, command: Callable[[], T]) -> T:
        """Have the loop do it between two frames. Raises Refused: it does not come to it."""
        future = self._app.post(command)
        try:
            return future.result(LOOP_S)
        except TimeoutError:
            future.cancel()
            raise Refused("the loop does not answer; nothing was done") from None

    def _tare(self, said: Mapping[str, Any]) -> str:
        if self._app.touched and not said.get("force"):
            raise Refused("something touches the tip; let go, or force the tare")
        self._in_loop(self._app.begin_tare)
        return "taking a new rest frame"

    def _record(self, said: Mapping[str, Any]) -> str:
        with self._recording:
            return self._end_recording() if self._app.recorder is not None else self._begin_recording()

    def _begin_recording(self) -> str:
        app = self._app
        name = f"{self._tip.get('serial', 'tip')}-{datetime.now():%Y%m%d-%H%M%S}.mcap"
        try:
            self._recordings.mkdir(parents=True, exist_ok=True)
            recorder = Recorder(self._recordings / name, tip=self._tip, rate_hz=app.source.rate_hz)
        except EdgeError as error:
            raise Refused(str(error)) from None
        except OSError as error:
            raise Refused(f"{self._recordings}: {error.strerror}; give another folder") from None
        if app.calibration is not None:
            recorder.attach("calibration.json", app.calibration.encoded)
        try:
            self._in_loop(lambda: app.set_recorder(recorder))
        except Refused:
            recorder.close()
            raise
        self._own = recorder
        return f"recording {name}"

    def _end_recording(self) -> str:
        recorder = self._in_loop(lambda: self._app.set_recorder(None))
        self._own = None
        if recorder is None:
            return "the recording had ended"
        recorder.close()
        frames_n = recorder.written_n[TOPICS["frame"].name]
        if recorder.fault:
            raise Refused(f"{recorder.path.name}: {frames_n} frames, then {recorder.fault}")
        lost = f", {recorder.dropped_n} messages lost" if recorder.dropped_n else ""
        return f"{recorder.path.name}: {frames_n} frames{lost}"


def _row(at_s: float, state: State, features: Features | None) -> tuple[float, ...]:
    """One sample in the order of CHART."""
    shear = None if features is None else features.shear_px
    volume = None if features is None else features.volume_px2
    return (
        at_s,
        state.displacement_mm,
        state.shear_x_mm,
        state.shear_y_mm,
        state.torsion_deg,
        state.force_n,
        state.latency_us / 1e3,
        nan if volume is None else volume,
        *((nan, nan) if shear is None else shear.tolist()),
    )
