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
- Without images the loop wakes all the same: faults are announced within 0.1 s, and samples without values go
  on at `BEAT_S`. Signals and commands only set a mark; the loop acts on it, and ends within a beat.
- The garbage collector does not run when it likes: what start-up made is frozen, what a frame makes has no
  cycles, and once a minute, after a sample has left, what other threads made is collected.
"""

from __future__ import annotations

import gc
import logging
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import replace
from math import nan
from threading import Event
from typing import Any, TypeVar

import numpy as np

from edge.calibration import Calibration
from edge.drift import LIMIT_PX, Drift
from edge.errors import CalibrationError, EdgeError, NoPins, SourceError
from edge.faults import LOAD_PITCHES, NO_CALIBRATION, Faults
from edge.health import Health, Vitals
from edge.notify import Notifier
from edge.pack import to_state
from edge.pipeline import Pipeline, Result, tare
from edge.recorded import Recorded
from edge.statistics import Ring, Statistics
from edge.transport import Sink
from edge.types import Clock, Feature, Frame, FrameSource, Reading
from hostlink.wire import FaultCode, State, Status

log = logging.getLogger(__name__)
T = TypeVar("T")

TARE_FRAMES = 8
STEADY_PX = 0.5  # largest motion of the pins while the rest frame is taken
DRAIN_S = 1.0  # how long a recording waits for a link that takes nothing
PINS_KEPT_SHARE = 0.9  # a new rest frame with fewer pins than this share of the old one's is implausible
WAIT_S = 0.02  # longest wait for an image before faults and commands are looked at
BEAT_S = 0.05  # samples without images: "the slow rate" of the fault table
LATE_NS = 2_000_000_000  # an image older than this, or from the future, is stamped by another clock than ours
GARBAGE_S = 60.0  # what other threads leave in cycles (viewers, requests) is collected this often
_NOTHING = np.empty((0, 3))

#: Somebody who wants to see results: viewer, detail stream, summary. Must return at once.
Watcher = Callable[[Result, State], None]


class App:
    """One finger.

    source       where frames come from
    sinks        where samples go
    calibration  of this tip, or None: values that need one are sent as invalid
    demand       what is computed
    tare_frames  how many frames make the rest frame
    drift_px     largest drift of a pin that is taken off the measurement; 0: none
    load_pitches motion of the pins beyond which the tip is overloaded
    health       faults; a new one where not given
    vitals       what is looked after beside the images; None: nothing
    notifier     the service manager; None: nobody
    clock_ns     the host's monotonic clock
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
        *,
        drift_px: float = LIMIT_PX,
        load_pitches: float = LOAD_PITCHES,
        vitals: Vitals | None = None,
        notifier: Notifier | None = None,
        clock_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.source = source
        self.sinks = list(sinks)
        self.calibration = calibration
        self.demand = demand
        self.health = health or Health()
        self.recorded = Recorded(self.health)
        self.watchers: list[Watcher] = []
        self.turns: list[Callable[[], None]] = []
        self.pipeline: Pipeline | None = None
        self.drift: Drift | None = None
        self.last: Result | None = None
        self.frame: Frame | None = None  # the newest, with a result or without
        self.tares_n = 0
        self._shown: frozenset[Feature] = frozenset()
        self._vitals = vitals
        self._notifier = notifier or Notifier({})
        self._clock_ns = clock_ns
        self._faults = Faults(source, self.health, load_pitches, clock_ns)
        self._drift_px = drift_px
        self._tare_frames = tare_frames
        self._steady_px = steady_px
        self._commands: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._stop = Event()
        self._sample = 0
        self._gaps_n = 0  # in the frames' numbers, since the start
        self._beat_due_ns = 0
        self._garbage_due_ns = clock_ns() + round(GARBAGE_S * 1e9)
        self._begun_ns: int | None = None  # when the frame in hand was taken up
        self._broken = False  # the last frame broke the computation
        self._statistics = Statistics()
        self._compute_us, self._latency_us, self._held = Ring(), Ring(), Ring()
        self._started_s = 0.0
        self._taring: list[Frame] | None = []
        if calibration is None:
            self.health.report(FaultCode.CALIBRATION_MISSING, True, NO_CALIBRATION)

    # ---- from other threads ------------------------------------------------------------------------

    def post(self, command: Callable[[], T]) -> Future[T]:
        """Have the loop run a command between two frames; the future holds its answer or its exception."""
        future: Future[T] = Future()
        self._commands.append((command, future))
        return future

    def stop(self) -> None:
        """End the loop after the frame in hand. May be called from a signal handler; closes nothing."""
        self._stop.set()

    @property
    def touched(self) -> bool:
        """Whether the last frame showed a touch; a tare now would be wrong."""
        return self.last is not None and self.last.features is not None and self.last.features.touched

    @property
    def frames_n(self) -> int:
        """Frames since the start."""
        return self._statistics.frames_n

    @property
    def taring(self) -> bool:
        """Whether a rest frame is being taken."""
        return self._taring is not None

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
            damaged_n=s.damaged_n,
            beats_n=s.beats_n,
            sent_n=s.sent_n,
            pins_n=len(self.pipeline.rest) if self.pipeline else 0,
            held_min_n=int(held.min()) if held.size else 0,
            held_median_n=int(np.median(held)) if held.size else 0,
            drift_px=self.drift.offset_px if self.drift else 0.0,
            rate_hz=s.frames_n / elapsed_s if s.frames_n else 0.0,
            compute_us=self._compute_us.quantiles(),
            latency_us=self._latency_us.quantiles(),
            faults={code.name: n for code, n in self.health.appeared.items()},
        )

    # ---- commands: run by the loop ------------------------------------------------------------------

    def begin_tare(self) -> None:
        """Take a new rest frame from the next frames; samples go on without values until it is there."""
        self._taring = []

    def forget_drift(self) -> None:
        """Measure from the rest frame as it was taken, until drift is learnt anew."""
        if self.drift is not None:
            self.drift.forget()

    def set_demand(self, demand: frozenset[Feature]) -> None:
        """Compute these features from the next frame on."""
        self.demand = demand
        self._set_demand()

    def set_shown(self, features: frozenset[Feature]) -> None:
        """What viewers look at, beyond the demand: computed for as long as they do."""
        self._shown = features
        self._set_demand()

    def _set_demand(self) -> None:
        if self.pipeline is not None:
            self.pipeline.demand = self.demand | self._shown

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
        if self._vitals is not None:
            self._vitals.watches += [self._faults.camera, self._watch_loop]
            self._vitals.start()
        try:
            for frame in self._frames():
                self._run_commands()
                if frame is None:
                    self._idle()
                else:
                    self.step(frame)
                self._end_turn()
                if self._stop.is_set() or self._statistics.frames_n == frames_max:
                    break
            if self.pipeline is None and self._taring is not None and not self._stop.is_set():
                self._finish_tare(self._taring)  # a recording shorter than the tare
        finally:
            self._notifier.stopping()
            if self._vitals is not None:
                self._vitals.close()
            if automatic:
                gc.enable()
            gc.unfreeze()
            self._run_commands()
        return self.statistics()

    def _frames(self) -> Iterator[Frame | None]:
        """The source's frames; from a live source also None, whenever none came for a while."""
        read: Callable[[float], Frame | None] | None = getattr(self.source, "read", None)
        if read is None:
            yield from self.source
            return
        while True:
            frame = read(WAIT_S)
            if frame is None and getattr(self.source, "ended", False):
                return
            yield frame

    def _idle(self) -> None:
        """No image came. Say why, and that we live."""
        known = self.health.status
        self._faults.frozen = False
        self._faults.camera()
        now_ns = self._clock_ns()
        if Status.CAMERA_FAULT not in self.health.status:
            return  # a slow camera: not late yet
        if self.health.status == known and now_ns < self._beat_due_ns:
            return
        self._beat_due_ns = now_ns + round(BEAT_S * 1e9)
        self._statistics.beats_n += 1
        frame, since_ns = self._faults.last or (None, now_ns)
        # On the camera's clock, as all other samples: its last time and what has passed since.
        capture_ns = frame.capture_ns + now_ns - since_ns if frame else now_ns
        self._send(None, capture_ns, 0.0)

    def _watch_loop(self) -> None:
        """Called from another thread: whether the frame in hand takes long."""
        # A recording waits for its search; and the first frame after a tare has to search.
        if self._taring is None and self.last is not None and self.source.live:
            self._faults.slow(self._begun_ns)

    def step(self, frame: Frame) -> State:
        """Everything that one frame causes."""
        begun_ns = self._clock_ns()
        s = self._statistics
        s.frames_n += 1
        self._gaps_n += self._faults.order(frame, begun_ns)
        # A frame that gave way to a newer one leaves a gap too, but did not get lost on its way here.
        s.lost_by_camera_n = max(s.lost_by_camera_n, self._gaps_n - self.source.dropped_n)
        self._faults.camera()
        self.frame = frame
        self._faults.image(frame)
        self._begun_ns = begun_ns
        result = self._measure_safely(frame)
        self._begun_ns = None
        computed_ns = self._clock_ns()
        # A recorded or foreign clock cannot be subtracted from ours: then latency counts from the hand-over.
        ours = frame.clock in (Clock.HOST, Clock.DRIVER) and 0 <= begun_ns - frame.capture_ns < LATE_NS
        since_ns = frame.capture_ns if ours else begun_ns
        state = self._send(result, frame.capture_ns, (computed_ns - since_ns) / 1e3)
        self._latency_us.add((self._clock_ns() - since_ns) / 1e3)
        self._notifier.frame()
        self.recorded.take(frame, result, state)
        if result is not None:
            self.last = result
            for watch in list(self.watchers):
                try:
                    watch(result, state)
                except Exception:
                    log.exception("a viewer failed and is not told any more")
                    self.watchers.remove(watch)
        if begun_ns > self._garbage_due_ns:
            self._garbage_due_ns = begun_ns + round(GARBAGE_S * 1e9)
            gc.collect()  # after the sample has left; what start-up made is frozen and not looked at
        self._compute_us.add((computed_ns - begun_ns) / 1e3)
        return state

    def _send(self, result: Result | None, capture_ns: int, latency_us: float) -> State:
        state = to_state(
            result,
            sample=self._sample,
            status=self._faults.status(result, self._statistics.lost_by_camera_n + self.source.dropped_n),
            latency_us=latency_us,
            capture_time_us=capture_ns // 1000,
            temperature_degc=self._vitals.temperature_degc if self._vitals else nan,
        )
        self._sample += 1
        for sink in self.sinks:
            if not self.source.live:  # a recording goes as fast as the link takes it, and loses nothing
                sink.drain(DRAIN_S)
            self._statistics.sent_n += sink.send(state)
        return state

    def _end_turn(self) -> None:
        """Tell whoever looks at every turn, with an image or without; who fails is told no more."""
        for turn in list(self.turns):
            try:
                turn()
            except Exception:
                log.exception("a viewer failed and is not told any more")
                self.turns.remove(turn)

    def _measure_safely(self, frame: Frame) -> Result | None:
        """No image, whatever it shows, ends the loop: what cannot be computed is a lost tracker."""
        try:
            result = self._measure(frame)
        except (CalibrationError, SourceError):
            raise  # of a recording, at its start: the user's to put right
        except Exception as error:
            if not self._broken:
                log.log(
                    logging.WARNING if isinstance(error, EdgeError) else logging.ERROR,
                    "image %d: %s", frame.sequence, error, exc_info=not isinstance(error, EdgeError),
                )  # fmt: skip
            self._broken = True
            self._statistics.damaged_n += 1
            self.health.report(FaultCode.TRACKER_LOST, True, f"image cannot be measured: {error}")
            self._taring = [] if self._taring is not None else None
            if self.pipeline is not None:
                self.pipeline.forget()
            return None
        self._broken = False
        return result

    def _measure(self, frame: Frame) -> Result | None:
        if self._taring is not None:
            self._taring.append(frame)
            if len(self._taring) < self._tare_frames:
                return None
            frames, self._taring = self._taring, None
            self._finish_tare(frames)
        if self.pipeline is None:
            return None
        faults, s = self._faults, self._statistics
        if faults.after_gap:
            self.pipeline.forget()
        result = self.pipeline.process(frame, self.drift)
        s.searched_n += result.searched
        if result.features is not None and faults.impossible(result.tracks):
            self.pipeline.forget()
            tracks = replace(result.tracks, confidence=0.0)
            result = replace(result, tracks=tracks, cells=None, features=None)
        tracks, features = result.tracks, result.features
        s.unsure_n += features is None
        self._held.add(tracks.n_seen)
        if not faults.pins(frame, tracks, features) or faults.blind:
            blank = Reading({}, {}, _NOTHING, calibrated=self.calibration is not None)
            result = replace(result, reading=blank)
        faults.load(features)
        drift = self.drift
        untouched = features is not None and not features.touched
        if features is not None:
            faults.place(features.displacement_px, features.touched, drift is not None and drift.at_limit)
        if drift is not None:
            drift.learn(tracks, frame.capture_ns, untouched and faults.quiet)
        return result

    def _finish_tare(self, frames: Sequence[Frame]) -> None:
        images = [frame.image for frame in frames]
        try:
            # A recording is what it is; only a live tip can be asked to keep still.
            steady_px = self._steady_px if self.source.live else np.inf
            rest = tare(images, steady_px, self.calibration)
            if self._stop.is_set():
                return  # what would be made of it takes as long again
        except NoPins as error:
            if not self.source.live and self.pipeline is None:
                raise SourceError(f"{self.source.name}: {error}") from None
            self._refuse_tare(str(error))
        except CalibrationError as error:
            if self.pipeline is None and not self.source.live:
                raise
            self.health.report(FaultCode.CALIBRATION_FOREIGN, True, str(error))
            self._refuse_tare(str(error))
            if self.pipeline is not None and self.pipeline.calibration is not self.calibration:
                self.pipeline.calibration = None  # the file before it was put away, its values too
        else:
            before = len(self.pipeline.rest) if self.pipeline else 0
            if len(rest) < PINS_KEPT_SHARE * before:
                self._refuse_tare(
                    f"tare: {len(rest)} pins, {before} at the last one; clear the camera's view"
                )
                return
            self.pipeline = Pipeline(rest, self.calibration, self.demand | self._shown)
            self.tares_n += 1
            self.drift = Drift(rest, self._drift_px)
            self._faults.learn(rest, frames[-1], self.calibration is not None)
            log.info("%s: rest frame with %d pins", self.source.name, len(rest))

    def _refuse_tare(self, why: str) -> None:
        """Keep the rest frame that we have; without one, try again with the next frames."""
        if FaultCode.TARE_IMPLAUSIBLE not in self.health.active:
            log.warning("%s", why)
        self.health.report(FaultCode.TARE_IMPLAUSIBLE, True, why)
        if self.pipeline is None:
            self._taring = []

    def _run_commands(self) -> None:
        while self._commands:
            command, future = self._commands.popleft()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(command())
            except Exception as error:  # noqa: BLE001  (it is the asker's to handle)
                future.set_exception(error)
