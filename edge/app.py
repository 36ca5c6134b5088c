"""The loop: frames in, samples out. The only place where stages, links, recorder and commands meet.

    source --newest frame--> [tare] --> Pipeline.process --> State --> every sink
                                             |                 \\--> node (EMCY, SYNC), statistics
                                             \\--> recorder, viewers (only if somebody asked)

Rules
- One thread runs the loop. Other threads (bus nodes, viewers) never touch the pipeline: they `post` a
  command, which runs between two frames, and wait for its answer.
- Nothing that fails outside of the computation stops the loop: a fault is a status bit, an emergency and
  a counter.
- A frame whose pins are in doubt is sent with its status bits and without values, never left out: the
  host must see that the finger is alive and does not know.
- The garbage collector's full passes do not run inside the loop: what start-up made is frozen, and what a
  frame makes has no cycles.
"""

from __future__ import annotations

import gc
import logging
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import asdict, dataclass, field
from threading import Event
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from edge.calibration import Calibration
from edge.errors import CalibrationError, NoPins, SourceError
from edge.health import Health
from edge.pack import to_state
from edge.pipeline import Pipeline, Result, tare
from edge.transport import Sink
from edge.types import Array, Clock, Feature, Frame, FrameSource
from hostlink.wire import FaultCode, State, Status

if TYPE_CHECKING:
    from edge.recording import Recorder

log = logging.getLogger(__name__)
T = TypeVar("T")

TARE_FRAMES = 8
STEADY_PX = 0.5  # largest motion of the pins while the rest frame is taken
PINS_LOST_SHARE = 0.5  # below this share of pins the values are too coarse to be trusted
DRAIN_S = 1.0  # how long a recording waits for a link that takes nothing
LATENCIES = 1 << 14  # frames that the latency statistics look back on: 68 s at 240 frames/s
#: Mean grey level (of the full scale) outside of which an image cannot show pins well.
DARK, BRIGHT = 0.004, 0.98
_SAMPLE_STEP = 16  # the image's brightness is read on every 16th row and column: 1200 pixels of 640x480


#: Somebody who wants to see results: viewer, detail stream, summary. Must return at once.
Watcher = Callable[[Result, State], None]


@dataclass(slots=True)
class Statistics:
    """What the loop has done since it started. Times: median, 99 %, 99.9 % of the last `LATENCIES` frames."""

    frames_n: int = 0
    lost_by_camera_n: int = 0
    dropped_n: int = 0
    searched_n: int = 0
    unsure_n: int = 0
    sent_n: int = 0
    pins_n: int = 0
    held_min_n: int = 0
    held_median_n: int = 0
    rate_hz: float = 0.0
    compute_us: tuple[float, float, float] = (0.0, 0.0, 0.0)
    latency_us: tuple[float, float, float] = (0.0, 0.0, 0.0)
    faults: dict[str, int] = field(default_factory=dict)


class _Ring:
    """The last values of a series, preallocated."""

    def __init__(self, size: int) -> None:
        self._values = np.zeros(size)
        self._n = 0

    def add(self, value: float) -> None:
        self._values[self._n % len(self._values)] = value
        self._n += 1

    @property
    def values(self) -> Array:
        return self._values[: min(self._n, len(self._values))]

    def quantiles(self) -> tuple[float, float, float]:
        if not self._n:
            return (0.0, 0.0, 0.0)
        a, b, c = np.quantile(self.values, (0.5, 0.99, 0.999))
        return (float(a), float(b), float(c))


class App:
    """One finger.

    source       where frames come from
    sinks        where samples go
    calibration  of this tip, or None: values that need one are sent as invalid
    demand       what is computed
    tare_frames  how many frames make the rest frame
    on_tare      called with the pipeline whenever a rest frame was taken
    """

    def __init__(
        self,
        source: FrameSource,
        sinks: Sequence[Sink],
        calibration: Calibration | None = None,
        demand: frozenset[Feature] = frozenset(Feature) - {Feature.SURFACE},
        tare_frames: int = TARE_FRAMES,
        steady_px: float = STEADY_PX,
        health: Health | None = None,
    ) -> None:
        self.source = source
        self.sinks = list(sinks)
        self.calibration = calibration
        self.demand = demand
        self.health = health or Health()
        self.watchers: list[Watcher] = []
        self.recorder: Recorder | None = None
        self.pipeline: Pipeline | None = None
        self.last: Result | None = None
        self._tare_frames = tare_frames
        self._steady_px = steady_px
        self._commands: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._stop = Event()
        self._sample = 0
        self._last_sequence: int | None = None
        self._statistics = Statistics()
        self._compute_us, self._latency_us, self._held = _Ring(LATENCIES), _Ring(LATENCIES), _Ring(LATENCIES)
        self._started_s = 0.0
        self._taring: list[Frame] | None = []
        if calibration is None:
            self.health.report(FaultCode.CALIBRATION_MISSING, True, "no calibration file was given")

    # ---- from other threads ------------------------------------------------------------------------

    def post(self, command: Callable[[], T]) -> Future[T]:
        """Have the loop run a command between two frames; the future holds its answer or its exception."""
        future: Future[T] = Future()
        self._commands.append((command, future))
        return future

    def stop(self) -> None:
        """End the loop after the frame in hand."""
        self._stop.set()
        self.source.close()

    @property
    def touched(self) -> bool:
        """Whether the last frame showed a touch; a tare now would be wrong."""
        return self.last is not None and self.last.features is not None and self.last.features.touched

    def statistics(self) -> Statistics:
        """A copy of the counters and times as they stand."""
        s = self._statistics
        held = self._held.values
        elapsed_s = time.monotonic() - self._started_s
        return Statistics(
            frames_n=s.frames_n,
            lost_by_camera_n=s.lost_by_camera_n,
            dropped_n=self.source.dropped_n,
            searched_n=s.searched_n,
            unsure_n=s.unsure_n,
            sent_n=s.sent_n,
            pins_n=len(self.pipeline.rest) if self.pipeline else 0,
            held_min_n=int(held.min()) if held.size else 0,
            held_median_n=int(np.median(held)) if held.size else 0,
            rate_hz=s.frames_n / elapsed_s if s.frames_n else 0.0,
            compute_us=self._compute_us.quantiles(),
            latency_us=self._latency_us.quantiles(),
            faults={code.name: n for code, n in self.health.appeared.items()},
        )

    # ---- commands: run by the loop ------------------------------------------------------------------

    def begin_tare(self) -> None:
        """Take a new rest frame from the next frames; samples go on without values until it is there."""
        self._taring = []

    def set_demand(self, demand: frozenset[Feature]) -> None:
        """Compute these features from the next frame on."""
        self.demand = demand
        if self.pipeline is not None:
            self.pipeline.demand = demand

    def set_calibration(self, calibration: Calibration) -> None:
        """Use another calibration; it must belong to this tip, so the rest frame is taken anew with it."""
        self.calibration = calibration
        self.begin_tare()

    # ---- the loop -----------------------------------------------------------------------------------

    def run(self, frames_max: int | None = None) -> Statistics:
        """Run until the source ends, `stop`, or a number of frames.

        Raises  SourceError when a recording shows no pins to begin with
        """
        self._started_s = time.monotonic()
        gc.collect()
        gc.freeze()
        automatic = gc.isenabled()
        gc.disable()
        try:
            for frame in self.source:
                self._run_commands()
                self.step(frame)
                if self._stop.is_set() or self._statistics.frames_n == frames_max:
                    break
            if self.pipeline is None and self._taring is not None and not self._stop.is_set():
                self._finish_tare(self._taring)  # a recording shorter than the tare
        finally:
            if automatic:
                gc.enable()
            gc.unfreeze()
            self._run_commands()
        return self.statistics()

    def step(self, frame: Frame) -> State:
        """Everything that one frame causes."""
        begun_ns = time.monotonic_ns()
        s = self._statistics
        s.frames_n += 1
        if self._last_sequence is not None and frame.sequence > self._last_sequence + 1:
            s.lost_by_camera_n += frame.sequence - self._last_sequence - 1
        self._last_sequence = frame.sequence
        self._judge_image(frame)
        if self.recorder is not None:
            self.recorder.frame(frame)
        result = self._measure(frame)
        computed_ns = time.monotonic_ns()
        # A recorded or foreign clock cannot be subtracted from ours: then latency counts from the hand-over.
        since_ns = frame.capture_ns if frame.clock in (Clock.HOST, Clock.DRIVER) else begun_ns
        state = to_state(
            result,
            sample=self._sample,
            status=self._status(result),
            latency_us=(computed_ns - since_ns) / 1e3,
            capture_time_us=frame.capture_ns // 1000,
        )
        self._sample += 1
        for sink in self.sinks:
            if not self.source.live:  # a recording goes as fast as the link takes it, and loses nothing
                sink.drain(DRAIN_S)
            s.sent_n += sink.send(state)
        if result is not None:
            self.last = result
            if self.recorder is not None:
                self._record(self.recorder, result, state)
            for watch in self.watchers:
                watch(result, state)
        self._compute_us.add((computed_ns - begun_ns) / 1e3)
        self._latency_us.add((time.monotonic_ns() - since_ns) / 1e3)
        return state

    @staticmethod
    def _record(recorder: Recorder, result: Result, state: State) -> None:
        frame = result.frame
        recorder.pins(frame, result.tracks, result.features)
        if result.cells is not None:
            recorder.cells(frame, result.cells)
        if result.features is not None:
            recorder.features(frame, result.features)
        recorder.sample(frame, asdict(state))

    def _measure(self, frame: Frame) -> Result | None:
        if self._taring is not None:
            self._taring.append(frame)
            if len(self._taring) < self._tare_frames:
                return None
            frames, self._taring = self._taring, None
            self._finish_tare(frames)
        if self.pipeline is None:
            return None
        result = self.pipeline.process(frame)
        s = self._statistics
        s.searched_n += result.searched
        unsure = result.features is None
        s.unsure_n += unsure
        self._held.add(result.tracks.n_seen)
        n = len(self.pipeline.rest)
        self.health.report(FaultCode.TRACKER_LOST, unsure, "pins cannot be told apart")
        few = result.tracks.n_seen < PINS_LOST_SHARE * n
        self.health.report(FaultCode.PINS_LOST, few, f"{result.tracks.n_seen} of {n} pins are seen")
        return result

    def _finish_tare(self, frames: Sequence[Frame]) -> None:
        images = [frame.image for frame in frames]
        try:
            # A recording is what it is; only a live tip can be asked to keep still.
            steady_px = self._steady_px if self.source.live else np.inf
            rest = tare(images, steady_px, self.calibration)
        except NoPins as error:
            if not self.source.live and self.pipeline is None:
                raise SourceError(f"{self.source.name}: {error}") from None
            self._refuse_tare(str(error))
        except CalibrationError as error:
            if self.pipeline is None and not self.source.live:
                raise
            self.health.report(FaultCode.CALIBRATION_FOREIGN, True, str(error))
            self._refuse_tare(str(error))
        else:
            self.pipeline = Pipeline(rest, self.calibration, self.demand)
            for code in (FaultCode.TARE_IMPLAUSIBLE, FaultCode.CALIBRATION_FOREIGN):
                self.health.report(code, False)
            self.health.report(
                FaultCode.CALIBRATION_MISSING, self.calibration is None, "no calibration file was given"
            )
            log.info("%s: rest frame with %d pins", self.source.name, len(rest))

    def _refuse_tare(self, why: str) -> None:
        """Keep the rest frame that we have; without one, try again with the next frames."""
        if FaultCode.TARE_IMPLAUSIBLE not in self.health.active:
            log.warning("%s", why)
        self.health.report(FaultCode.TARE_IMPLAUSIBLE, True, why)
        if self.pipeline is None:
            self._taring = []

    def _judge_image(self, frame: Frame) -> None:
        level = float(frame.image[::_SAMPLE_STEP, ::_SAMPLE_STEP].mean()) / ((1 << frame.bits) - 1)
        self.health.report(FaultCode.IMAGE_DARK, level < DARK, f"mean grey level {level:.1%} of full scale")
        self.health.report(
            FaultCode.IMAGE_BRIGHT, level > BRIGHT, f"mean grey level {level:.1%} of full scale"
        )

    def _status(self, result: Result | None) -> Status:
        status = self.health.status
        if result is not None and result.features is not None and result.features.touched:
            status |= Status.TOUCHED
        if result is not None and result.reading.saturated:
            status |= Status.SATURATED
        if not self.source.live:
            status |= Status.NOT_LIVE
        return status

    def _run_commands(self) -> None:
        while self._commands:
            command, future = self._commands.popleft()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(command())
            except Exception as error:  # noqa: BLE001  (it is the asker's to handle)
                future.set_exception(error)
