"""The loop: frames in, samples out. The only place where stages, links, recorder and commands meet.

    source --newest frame--> Measurement.measure --> State --> every sink
                                   |                     \\--> node (EMCY, SYNC), statistics
                                   \\--> recorder, viewers (only if somebody asked)

Rules
- One thread runs the loop. Other threads (bus nodes, viewers) never touch the pipeline: they `post` a
  command, which runs between two frames, and wait for its answer.
- No frame stops the loop: a failure is a status bit, an emergency and a counter. Only an unusable
  recording raises.
- A frame whose pins cannot be identified is sent with its status bits and without values, never skipped:
  the host must see that the finger is alive but has no values.
- Without images the loop wakes all the same: faults are announced within 0.1 s, and samples without values
  are sent every `check_s`. Signals and commands only set a flag; the loop acts on it within that time.
- The garbage collector runs at fixed times: objects of the start-up are frozen, a frame makes no cycles,
  and now and then, after a sample has left, garbage of other threads is collected. What searches worked in
  is given back to the system then: both take 0.2 ms.
"""

import gc
import logging
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from math import nan
from threading import Event
from typing import Any, TypeVar

from edge.calibration import Calibration
from edge.faults.detector import FaultDetector
from edge.faults.registry import FaultRegistry
from edge.link.sinks import Sink
from edge.link.state_packer import StatePacker
from edge.params import PARAMS as RUNTIME
from edge.recording.session import RecordingSession
from edge.runtime.board_monitor import BoardMonitor
from edge.runtime.measurement import LoopConfig, Measurement
from edge.runtime.process import give_back_memory
from edge.runtime.statistics import LoopStatistics, StatisticsCollector
from edge.runtime.systemd import Notifier
from edge.sources.live import ThreadedSource
from edge.types import Clock, Frame, FrameSource, Result
from hostlink.wire import State, Status

log = logging.getLogger(__name__)
T = TypeVar("T")


_OUR_CLOCKS = Clock.HOST, Clock.DRIVER

#: Called with each result and its sample: viewer, detail stream, summary. Must return at once.
ResultCallback = Callable[[Result, State], None]


class Loop:
    """One finger: frames of a source, measured as the configuration says, go to sinks; None: without it."""

    def __init__(
        self,
        source: FrameSource,
        sinks: Sequence[Sink],
        calibration: Calibration | None = None,
        config: LoopConfig | None = None,
        *,
        faults: FaultRegistry | None = None,
        board: BoardMonitor | None = None,
        notifier: Notifier | None = None,
        clock_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.source = source
        self.sinks = list(sinks)
        self.faults = faults or FaultRegistry()
        self.session = RecordingSession(self.faults)
        self.result_callbacks: list[ResultCallback] = []
        self.tick_callbacks: list[Callable[[], None]] = []  # after each cycle, with or without an image
        self.frame: Frame | None = None  # the newest, with or without a result
        config = config or LoopConfig()
        self._counters = StatisticsCollector()
        self._detector = FaultDetector(source, self.faults, clock_ns, config.load_pitches)
        self.measurement = Measurement(
            source, calibration, config, self.faults, self._detector, self._counters
        )
        self._board = board
        self._notifier = notifier or Notifier({})
        self._clock_ns = clock_ns
        self._commands: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._stop = Event()
        self._garbage_due_ns = clock_ns() + round(RUNTIME.rarely_s * 1e9)
        self._sample = self._keepalive_due_ns = self._searches_n = 0
        self._to_state = StatePacker().to_state
        self._frame_begun_ns: int | None = None  # when work on the current frame began

    # ---- from other threads ------------------------------------------------------------------------

    def post(self, command: Callable[[], T]) -> Future[T]:
        """Have the loop run a command between two frames; the future holds its answer or its exception."""
        future: Future[T] = Future()
        self._commands.append((command, future))
        return future

    def stop(self) -> None:
        """End the loop after the current frame. May be called from a signal handler; closes nothing."""
        self._stop.set()

    @property
    def frames_n(self) -> int:
        return self._counters.counts.frames_n

    def statistics(self) -> LoopStatistics:
        pipeline = self.measurement.pipeline
        return self._counters.snapshot(
            dropped_n=self.source.dropped_n,
            pins_n=len(pipeline.rest) if pipeline else 0,
            drift_px=pipeline.drift.offset_px if pipeline and pipeline.drift else 0.0,
            faults={code.name: n for code, n in self.faults.appeared.items()},
            without_values=dict(self._detector.without_values),
        )

    # ---- the loop -----------------------------------------------------------------------------------

    def run(self, frames_max: int | None = None) -> LoopStatistics:
        """Run until the source ends, `stop`, or so many frames. Raises SourceError: no pins are recorded."""
        self._counters.started_s = time.monotonic()
        self.measurement.tare.in_thread = self.source.live  # a recording waits for the tare
        if self._board is not None:
            self._board.checks += [self._detector.camera, self._check_frame_time]
            self._board.start()
        try:
            with _garbage_left():
                for frame in self._frames():
                    self._run_commands()
                    if frame is None:
                        self._keep_alive()
                    else:
                        self.step(frame)
                    _call_each(self.tick_callbacks)
                    if self._stop.is_set() or self.frames_n == frames_max:
                        break
                if not self._stop.is_set():
                    self.measurement.source_ended()
        finally:
            self._notifier.stopping()
            if self._board is not None:
                self._board.close()
            self.measurement.tare.close()
            self._run_commands()
        return self.statistics()

    def _frames(self) -> Iterator[Frame | None]:
        """The source's frames; from a live source also None, whenever none came for a while."""
        source = self.source
        if not isinstance(source, ThreadedSource):
            yield from source
            return
        wait_s = RUNTIME.wait_s
        while True:
            frame = source.read(wait_s)
            if frame is None and source.ended:
                return
            yield frame

    def _keep_alive(self) -> None:
        """No image came: report why, and send a keepalive sample."""
        status_before = self.faults.status
        self._detector.frozen = False
        self._detector.camera()
        now_ns = self._clock_ns()
        if not self.faults.status & Status.CAMERA_FAULT:
            return  # a slow camera: not late yet
        if self.faults.status == status_before and now_ns < self._keepalive_due_ns:
            return
        self._keepalive_due_ns = now_ns + round(RUNTIME.check_s * 1e9)
        self._counters.counts.keepalives_n += 1
        frame, since_ns = self._detector.last or (None, now_ns)
        if now_ns - since_ns > RUNTIME.patience_s * 1e9:
            self.measurement.no_images()
        # It is on the camera's clock, like all samples: its last time plus the time since.
        capture_ns = frame.capture_ns + now_ns - since_ns if frame else now_ns
        self._send(None, capture_ns, 0.0)

    def _check_frame_time(self) -> None:
        """Called from the board's thread: whether the current frame takes long."""
        # A recording waits for its search; and the first frame after a tare has to search.
        if not self.measurement.tare.busy and self.measurement.last is not None and self.source.live:
            self._detector.slow(self._frame_begun_ns)

    def step(self, frame: Frame) -> State:
        begun_ns = self._frame_begun_ns = self._clock_ns()
        self._detector.begin(frame, begun_ns)
        counts = self._counters.counts
        counts.frames_n += 1
        # A frame replaced by a newer one leaves a gap too, but was not lost by the camera.
        lost_n = self._detector.gaps_n - self.source.dropped_n
        if lost_n > counts.lost_by_camera_n:
            counts.lost_by_camera_n = lost_n
        self.frame = frame
        result = self.measurement.measure(frame)
        self._frame_begun_ns = None
        computed_ns = self._clock_ns()
        # A recorded or foreign clock cannot be subtracted from ours: latency then counts from the hand-over.
        ours = frame.clock in _OUR_CLOCKS and frame.capture_ns <= begun_ns
        since_ns = frame.capture_ns if ours else begun_ns
        state = self._send(result, frame.capture_ns, (computed_ns - since_ns) / 1e3)
        pins_n = nan if result is None else result.tracks.n_seen
        self._counters.last.append((since_ns, begun_ns, computed_ns, self._clock_ns(), pins_n))
        self._notifier.frame()
        if self.session.put is not None:
            self.session.take(frame, result, state)
        if result is not None and self.result_callbacks:
            _call_each(self.result_callbacks, result, state)
        if begun_ns > self._garbage_due_ns:
            self._garbage_due_ns = begun_ns + round(RUNTIME.rarely_s * 1e9)
            gc.collect()  # of other threads
            if counts.full_searches_n != self._searches_n:  # what they worked in
                self._searches_n = counts.full_searches_n
                give_back_memory()
        return state

    def _send(self, result: Result | None, capture_ns: int, latency_us: float) -> State:
        counts = self._counters.counts
        skipped_n = counts.lost_by_camera_n + self.source.dropped_n
        state = self._to_state(
            result, self._sample, self._detector.status(result, skipped_n), capture_ns // 1000, latency_us,
            self._board.temperature_degc if self._board else nan,
        )  # fmt: skip
        self._sample += 1
        for sink in self.sinks:
            if not self.source.live:  # a recording is sent as fast as the link takes it, without loss
                sink.drain(RUNTIME.patience_s)
            counts.sent_n += sink.send(state)
        return state

    def _run_commands(self) -> None:
        while self._commands:
            command, future = self._commands.popleft()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(command())
            except Exception as error:  # noqa: BLE001  (handled by the one that waits on the future)
                future.set_exception(error)


def _call_each(callbacks: list[Any], *arguments: Any) -> None:
    """Call all; one that raises is removed."""
    for callback in list(callbacks):
        try:
            callback(*arguments)
        except Exception:
            log.exception("viewer callback raised; removed")
            callbacks.remove(callback)


@contextmanager
def _garbage_left() -> Iterator[None]:
    """No collection of garbage but those that are asked for, and these skip what is there now."""
    gc.collect()
    gc.freeze()
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
        gc.unfreeze()
