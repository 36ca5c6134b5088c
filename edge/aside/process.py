"""The loop's side: starts the second process, feeds it, does what its viewers ask, outlives it.

Rules
- `watch`, `take` and `turn` run in the loop's thread after the sample has left, and wait for nothing.
- A thread of its own hears the second process; what changes the pipeline is posted to the loop.
- The end of the socket is the end of the process. If it ends by itself, a recording counts as broken (what
  was written reads back), and the page is served again at the same address.
"""

from __future__ import annotations

import logging
import pickle
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from math import nan
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from edge import errors
from edge.app import App
from edge.aside.channel import Outbox, pair, receive
from edge.aside.messages import (
    Answer,
    Ask,
    Attach,
    Begin,
    Event,
    Fed,
    Ready,
    Recorded,
    Show,
    Take,
    Wants,
    Watched,
)
from edge.errors import UsageError
from edge.pipeline import Result
from edge.types import Feature, Features, Frame, Rest
from hostlink.web import Listen
from hostlink.wire import FAULTS, State

__all__ = ["Aside"]

log = logging.getLogger(__name__)
T = TypeVar("T")

#: What the page shows of its own accord; the surface is computed only for a viewer that asks for it.
SHOWN = frozenset({Feature.DISPLACEMENT, Feature.CONTACTS, Feature.SHEAR, Feature.TORSION})
#: Memory for what is under way: 70 images of 640x480 with their results, 0.3 s at 240 frames/s. The recorder
#: has 64 MB more for a slow disk; this is for a second process that is not scheduled.
MEMORY_BYTES = 24 << 20
RECENT = 256  # samples between two pictures: 8 at 240 frames/s; who was slow loses the older ones
SHOW_S = 0.9 / 30.0  # the page draws 30 pictures a second; a tenth less, so that frames' times need not fit
BEAT_S = 0.1  # without a new result the rest is told this often
LOOP_S = 2.0  # a command runs between two frames; a loop that is busy for longer is in trouble
START_S = 60.0  # Python, OpenCV and a web server on a slow board
END_S = 2.0  # for a page to say goodbye
DISK_S = 12.0  # for a recording to be written: the recorder gives up after 10
LIVED_S = 5.0  # a process that ended sooner than this would end again
_MEANING = {fault.code: fault.meaning for fault in FAULTS}


class Aside:
    """Viewers and recorder of an app; the app's recorder where there is one (`edge.recorded.Recording`).

    listen      where the live page is served; None: no page
    record      a file to record from the first frame on; None: none
    recordings  folder for what the page's button records
    tip         about the tip, for recordings
    """

    def __init__(
        self,
        app: App,
        listen: Listen | None = None,
        record: Path | None = None,
        recordings: Path = Path("."),
        tip: Mapping[str, str] | None = None,
    ) -> None:
        self._app = app
        self._listen = listen
        self._record = record
        self._recordings = recordings
        self._tip = dict(tip or {})
        self.page = Watched()
        self.process: subprocess.Popen[bytes] | None = None
        self._heard = Recorded()
        self._lost_n = self._lost_told_n = 0
        self._broken: str | None = None
        self._closing = False
        self._sending = threading.Lock()  # the channel may be exchanged for another
        self._outbox: Outbox | None = None
        self._control: socket.socket | None = None
        self._thread: threading.Thread | None = None
        self._started_s = 0.0

        self._watched = False
        self._seen_n = 0
        self._last_s = time.monotonic()
        self._latest: tuple[Result, State] | None = None
        self._rows: deque[tuple[float, ...]] = deque(maxlen=RECENT)
        self._due_s = 0.0
        self._shown: tuple[Frame | None, Result | None, Rest | None] = (None, None, None)

    @property
    def url(self) -> str:
        """For a browser; the token stands behind the #, which browsers keep to themselves."""
        assert self._listen is not None
        return f"http://{self._listen}/" + (f"#token={self._listen.token}" if self._listen.token else "")

    @property
    def port(self) -> int:
        assert self._listen is not None
        return self._listen.port

    def start(self) -> None:
        """Start the process and have the app feed it. Raises UsageError."""
        self._begin(str(self._record or ""))
        self._app.watchers.append(self.watch)
        self._app.turns.append(self.turn)
        if self._record is not None:
            self._feed()

    def close(self) -> None:
        """End page and recording, and wait for what is to be written."""
        self._closing = True
        app = self._app
        if self.watch in app.watchers:
            app.watchers.remove(self.watch)
        if self.turn in app.turns:
            app.turns.remove(self.turn)
        recording = app.recorded.recorder is self
        if recording:
            app.recorded.recorder = None
        with self._sending:
            outbox, self._outbox = self._outbox, None
            if outbox is not None:
                outbox.put(Fed())
                outbox.close()
        if self.process is not None:
            _end(self.process, DISK_S if recording else END_S)
        if self._thread is not None:
            self._thread.join()
        if recording and (self.fault or self.dropped_n):
            log.warning("recording: %s", self.fault or f"{self.dropped_n} messages lost")

    # ---- the loop's thread --------------------------------------------------------------------------

    def watch(self, result: Result, state: State) -> None:
        """Take note of a result; a watcher of the app."""
        self._latest = (result, state)
        self._seen_n += 1
        self._last_s = time.monotonic()
        if self._watched:
            self._rows.append(_row(self._last_s, state, result.features))

    def turn(self) -> None:
        """Show what is new, if anybody watches; after each turn of the loop."""
        if not self._watched:
            return
        now_s = time.monotonic()
        if now_s < self._due_s:
            return
        app = self._app
        frame, (result, state) = app.frame, self._latest or (None, None)
        rest = app.pipeline.rest if app.pipeline else None
        frame_seen, result_seen, rest_seen = self._shown
        idle = frame is frame_seen and result is result_seen and not self._rows
        if idle and now_s < self._due_s - SHOW_S + BEAT_S:
            return
        new = result is not result_seen
        rows = list(self._rows)
        show = Show(
            now_s,
            self._last_s,
            self._seen_n,
            rows,
            None if frame is frame_seen else frame,
            result if new else None,
            state if new else None,
            None if rest is rest_seen else rest,
            self._about(),
        )
        self._due_s = now_s + SHOW_S
        if self._put(show):
            self._shown = (frame, result, rest)
            self._rows.clear()

    def take(self, frame: Frame, result: Result | None, state: State) -> None:
        """Record a turn of the loop."""
        lost_n = self._lost_n - self._lost_told_n
        if not self._put(Take(frame, result, state, lost_n)):
            self._lost_n += 1
            return
        self._lost_told_n += lost_n
        if self._watched:  # it need not be copied again to be seen
            self._shown = (frame, result or self._shown[1], self._shown[2])

    def event(self, level: str, text: str) -> None:
        """Record a line of the log; from any thread."""
        self._put(Event(level, text))

    def _put(self, message: Any) -> bool:
        with self._sending:
            return self._outbox is not None and self._outbox.put(message)

    def _about(self) -> dict[str, Any]:
        """What does not come from a frame."""
        app = self._app
        return {
            "faults": [[_MEANING[code], words] for code, words in app.health.active.items()],
            "taring": app.taring,
            "tares_n": app.tares_n,
            "calibrated": app.calibration is not None,
            "dropped_n": app.source.dropped_n,
        }

    def _feed(self) -> None:
        """Record from the next frame on."""
        calibration = self._app.calibration
        if calibration is not None:
            self._put(Attach("calibration.json", np.frombuffer(calibration.encoded, np.uint8)))
        self._heard = Recorded()
        self._lost_n = self._lost_told_n = 0
        self._broken = None
        self._app.recorded.recorder = self

    def _starve(self) -> None:
        """Record no more."""
        if self._app.recorded.recorder is self:
            self._app.recorded.recorder = None
        self._put(Fed())

    # ---- as a recorder ------------------------------------------------------------------------------

    @property
    def fault(self) -> str | None:
        """Why nothing is recorded any more."""
        return self._broken or self._heard.fault

    @property
    def dropped_n(self) -> int:
        """Messages that the disk or the second process was too slow for."""
        return self._heard.dropped_n + self._lost_n - self._lost_told_n

    # ---- the thread that hears the process ----------------------------------------------------------

    def _begin(self, record: str) -> None:
        """Start the process. Raises UsageError: it cannot serve or record so."""
        outbox = Outbox(MEMORY_BYTES)
        control, far_control = pair()
        fds = (outbox.far_end.fileno(), far_control.fileno(), outbox.fd)
        # In a session of its own: Ctrl-C at the terminal is the loop's, and its end is ours.
        self.process = subprocess.Popen(
            [sys.executable, "-m", "edge.aside", *map(str, fds)],
            pass_fds=fds,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        far_control.close()
        outbox.far_end.close()
        app = self._app
        level = logging.getLogger().getEffectiveLevel()
        begin = Begin(
            self._listen,
            app.source.name,
            app.source.rate_hz,
            str(self._recordings),
            record,
            self._tip,
            level,
        )
        control.send(pickle.dumps(begin))
        control.settimeout(START_S)
        early: list[
            Any
        ] = []  # viewers of an earlier process may be back before this one says that it is ready
        try:
            while isinstance(ready := _receive(control), Wants | Watched):
                early.append(ready)
        except TimeoutError:
            ready = None
        if not isinstance(ready, Ready) or ready.refused:
            outbox.close()
            control.close()
            _end(self.process, END_S)
            if isinstance(ready, Ready):
                raise getattr(errors, ready.kind)(ready.refused)
            raise UsageError("view, record: the process for it ended at its start; see above for why")
        control.settimeout(None)
        if self._listen is not None:
            self._listen = Listen(self._listen.host, ready.port, self._listen.token)
        self._shown = (None, None, None)
        self._started_s = time.monotonic()
        with self._sending:
            self._outbox = outbox
        self._control = control
        self._thread = threading.Thread(target=self._hear, args=(control, early), name="aside", daemon=True)
        self._thread.start()

    def _hear(self, control: socket.socket, early: list[Any]) -> None:
        with control:
            while (message := early.pop(0) if early else _receive(control)) is not None:
                match message:
                    case Wants(wants):
                        self._on_wants(wants)
                    case Watched():
                        self.page = message
                    case Recorded():
                        self._heard = message
                    case Ask():
                        answer = Answer(message.number, self._do(message))
                        try:
                            control.send(pickle.dumps(answer))
                        except OSError:
                            break
        if not self._closing:
            self._mourn()

    def _on_wants(self, wants: frozenset[str] | None) -> None:
        """Have computed what is looked at, and no more."""
        shown = frozenset[Feature]()
        if wants is not None:
            shown = SHOWN | ({Feature.SURFACE} if "surface" in wants else shown)

        def begin_or_end() -> None:
            if wants is None or not self._watched:
                self._rows.clear()
                self._shown = (None, None, None)
            self._watched = wants is not None
            self._app.set_shown(shown)

        self._app.post(begin_or_end)

    def _do(self, ask: Ask) -> str:
        """Do what a viewer asks for; "" or why it was not done."""
        app = self._app
        if ask.what == "tare":
            if app.touched and not ask.force:
                return "something touches the tip; let go, or force the tare"
            return self._in_loop(app.begin_tare)
        return self._in_loop(self._feed if ask.what == "feed" else self._starve)

    def _in_loop(self, command: Callable[[], None]) -> str:
        """Have the loop do it between two frames; "" or why it did not."""
        future = self._app.post(command)
        try:
            future.result(LOOP_S)
        except TimeoutError:
            future.cancel()
            return "the loop does not answer; nothing was done"
        return ""

    def _mourn(self) -> None:
        """The process ended by itself: say so, and serve the page again."""
        assert self.process is not None
        code = self.process.wait()
        log.error("the process for viewers and recordings ended (%s)", code)
        self._broken = f"its process ended ({code})"
        self.page = Watched()
        self._on_wants(None)
        with self._sending:
            outbox, self._outbox = self._outbox, None
            if outbox is not None:
                outbox.close()
        if self._listen is None or time.monotonic() - self._started_s < LIVED_S or self._closing:
            return
        try:
            self._begin("")
        except UsageError as error:
            log.error("the live page has ended: %s", error)


def _receive(control: socket.socket) -> Any:
    """The next message; None: the end."""
    packet = receive(control)
    return pickle.loads(packet) if packet else None


def _end(process: subprocess.Popen[bytes], patience_s: float) -> None:
    try:
        process.wait(patience_s)
    except subprocess.TimeoutExpired:
        log.error("the process for viewers and recordings does not end; killed")
        process.kill()
        process.wait()


def _row(at_s: float, state: State, features: Features | None) -> tuple[float, ...]:
    """One sample in the order of `edge.view.scene.CHART`."""
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
