"""The program under a random schedule of all faults, checked against its promises: `make soak SECONDS=3600`.

    simulated tip -> Paced -> FaultySource -> Loop -> Node -> faulty bus -> host library
                                               ^ FaultyBoard: temperature, storage

Promises
- the loop lives, and no exception reaches it
- each fault is announced within 0.1 s (one of a link: from the first sample that it did not take) and cleared
  within 1 s after its end
- no wrong sample leaves unflagged: displacement and shear are those of an undisturbed run, or a status bit
  forbids their use; and the host decodes what was sent
- the link delivers within 1 s after its fault
- memory does not grow with the samples: its slope over the last two thirds is below `SLOPE_BYTES` a sample

Not promised: a frozen image can be recognised only after 45 ms.

A second process measures how long this machine's own load delays processes: so much is allowed on top,
and the table has the worst delays with and without it.
"""

import math
import subprocess
import sys
import threading
import time
from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
from rich.console import Console
from scipy.stats import theilslopes

from calib.sim.source import SceneSource
from edge.calibration import Calibration
from edge.faults.registry import FaultRegistry
from edge.frame import Pipeline
from edge.link.node import Node
from edge.link.settings import SettingsFile
from edge.link.sinks import CanFdSink, opener
from edge.pins import take_rest
from edge.rest.tip_match import match_tip
from edge.runtime.board_monitor import BoardMonitor
from edge.runtime.device import LoopDevice
from edge.runtime.loop import Loop
from edge.sources import open_source
from edge.sources.paced import Paced
from edge.types import Feature, Result
from hostlink import connect
from hostlink.client import Sample
from hostlink.wire import FaultCode, State, Status
from hostlink.wire.address import parse_address
from tests.bench.output import ROOT, show, writes_results
from tests.support import fault_injection as faults

CALIBRATION = ROOT / "tests" / "data" / "rings331_ball.json"
SCENE = "sim:tour?width=320&height=320&paced=0"
NODE = 5

ANNOUNCED_S = 0.1
CLEARED_S = 1.0
BACK_S = 1.0
PATIENCE_S = 60.0  # for the first sample
SLOPE_BYTES = 40.0  # a sample; a tuple of two numbers in a list takes 112
MEMORY_LEAST_N = 20  # values, one a second
NOISE_MB = 4.0  # by which the first minutes differ; 160 bytes a sample exceed it within a quarter of an hour
WRONG_MM = 0.4  # of displacement and shear, against the undisturbed run; its own noise is 0.05 mm
UNUSABLE = (
    Status.CAMERA_FAULT | Status.IMAGE_FAULT | Status.PINS_LOST | Status.TRACKER_LOST | Status.TARE_FAULT
    | Status.CAMERA_MOVED | Status.CLOCK_STEP
)  # fmt: skip
KINDS = {"camera": faults.CAMERA, "link": faults.LINK, "board": faults.BOARD}
BRISK_S = (0.3, 0.5)  # episodes and pauses of a short run
VALUES = ("displacement_mm", "shear_x_mm", "shear_y_mm")


def memory_mb() -> float:
    """Resident memory of this process, MB of 2**20 bytes."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS:")) / 1024


class Metronome:
    """How long this machine delays a process: gaps in the heartbeat of one that does nothing else."""

    HEARTBEAT_S, GAP_S = 0.005, 0.015
    CODE = (
        "import sys,time\nlast=time.monotonic()\nwhile True:\n time.sleep(0.005); now=time.monotonic()\n"
        " if now-last>0.015: print(last,now,flush=True)\n last=now"
    )

    def __init__(self) -> None:
        self._process = subprocess.Popen([sys.executable, "-c", self.CODE], stdout=subprocess.PIPE, text=True)
        self._ends: list[float] = []
        self._gaps: list[float] = []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self._process.stdout
        for line in self._process.stdout:
            start, end = map(float, line.split())
            self._gaps.append(end - start - self.HEARTBEAT_S)
            self._ends.append(end)

    def held_up_s(self, start_s: float, end_s: float) -> float:
        """Sum of the gaps that ended within or just after this time."""
        i, j = bisect_left(self._ends, start_s), bisect_left(self._ends, end_s + self.GAP_S)
        return sum(self._gaps[i:j])

    def close(self) -> None:
        self._process.kill()
        self._process.wait()


@dataclass
class Row:
    """Result for one kind of fault. Delays in ms; `net`: without delays of the machine."""

    injected: int = 0
    announced: int = 0
    cleared: int = 0
    unseen: int = 0  # not observable: no sample within the episode
    announce_ms: list[float] = field(default_factory=list)
    announce_net_ms: list[float] = field(default_factory=list)
    clear_ms: list[float] = field(default_factory=list)

    def cells(self, kind: str) -> dict[str, object]:
        """A row of the table; medians, and the worst."""
        announced, cleared = (self.announced, self.cleared) if faults.EXPECTED[kind] else ("-", "-")

        def ms(of: Callable[[Any], float], values: list[float]) -> int | None:
            return round(float(of(values))) if values else None

        return {
            "fault": kind, "injected": self.injected, "announced": announced, "cleared": cleared,
            "not visible": self.unseen or None, "announce ms": ms(np.median, self.announce_ms),
            "worst": ms(max, self.announce_ms), "less machine": ms(max, self.announce_net_ms),
            "clear ms": ms(np.median, self.clear_ms), "worst to clear": ms(max, self.clear_ms),
        }  # fmt: skip


@dataclass
class Outcome:
    """The whole run."""

    seconds: float
    seed: int
    rows: dict[str, Row] = field(default_factory=lambda: defaultdict(Row))
    violations: list[str] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    memory_mb: list[float] = field(default_factory=list)
    slope_bytes: float | None = None  # a sample; None: too short a run

    def fail(self, message: str) -> None:
        self.violations.append(message)

    def check_memory(self, samples_n: int) -> None:
        """Check the slope of the memory, noted at even times while so many samples were made."""
        kept = np.array(self.memory_mb[len(self.memory_mb) // 3 :])
        if len(kept) < MEMORY_LEAST_N:
            return
        grown_mb = float(theilslopes(kept).slope) * len(kept)  # the median of all pairs' knows no steps
        slope = 2**20 * grown_mb / (samples_n * len(kept) / len(self.memory_mb))
        self.slope_bytes = round(slope, 1)
        if slope > SLOPE_BYTES and grown_mb > NOISE_MB:
            self.fail(f"memory grew by {grown_mb:.1f} MB, {slope:.0f} bytes a sample")


def undisturbed(scene: SceneSource, calibration: Calibration) -> np.ndarray:
    """(n, 3) VALUES of each frame of the scene, without faults."""
    frames = list(scene)
    pipeline = Pipeline(
        match_tip(calibration, take_rest([f.image for f in frames[:8]]))[0], calibration, frozenset(Feature)
    )
    values = np.empty((len(frames), 3))
    for i, frame in enumerate(frames):
        reading = pipeline.process(frame).reading
        values[i] = [reading.values.get(name, np.nan) for name in VALUES]
    return values


class Soak:
    """One finger in this process, with faults."""

    def __init__(self, outcome: Outcome, rate_hz: float, brisk: bool = False) -> None:
        self.outcome = outcome
        self.metronome = Metronome()
        self.calibration = Calibration.load(CALIBRATION)
        scene = open_source(SCENE)
        assert isinstance(scene, SceneSource)
        kept = SceneSource(scene._simulator, "tour", keep=True)  # rendered once, in memory
        self.truth = undisturbed(kept, self.calibration)
        self.started_s: float | None = None
        length_s, pause_s = (BRISK_S, BRISK_S) if brisk else (faults.LENGTH_S, faults.PAUSE_S)
        until_s = outcome.seconds - 2.0
        self.rows: dict[str, list[faults.Episode]] = {
            name: faults.schedule(outcome.seed * 10 + i, until_s, kinds, length_s=length_s, pause_s=pause_s)
            for i, (name, kinds) in enumerate(KINDS.items())
        }
        paced = Paced(kept, speed=rate_hz / kept.rate_hz, loop=True)
        self.source = faults.FaultySource(paced, self.rows["camera"], self.clock, outcome.seed)
        self.board = faults.FaultyBoard(self.rows["board"], self.clock)
        self.announced: defaultdict[FaultCode, list[tuple[float, float]]] = defaultdict(list)  # from, to
        self.registry = FaultRegistry()
        self.registry.listeners.append(self.on_fault)
        monitor = BoardMonitor(self.registry, self.board.temperature, [self.board.storage])
        self.loop = Loop(self.source, [], self.calibration, faults=self.registry, board=monitor)
        address = parse_address(f"virtual:soak{outcome.seed}")
        self.refused_s: dict[faults.Episode, float] = {}  # when it first took no sample
        self.back_s: dict[faults.Episode, float] = {}  # when the first sample arrived after it
        self.disturbed = list(self.rows["link"])  # of which no sample has arrived yet
        faulty = faults.faulty_medium(
            opener(address, ()), self.rows["link"], self.clock, outcome.seed, self.on_refused
        )
        self.node = Node(CanFdSink(str(address), faulty, NODE), LoopDevice(self.loop, "soak"), SettingsFile())
        self.registry.listeners.append(self.node.report)
        self.loop.sinks.append(self.node)
        self.loop.result_callbacks.append(self.on_result)
        self.host = connect(str(address))
        self.host.on_sample(self.on_sample)

        self.sent: dict[int, State] = {}
        self.error: BaseException | None = None
        self.thread = threading.Thread(target=self.run, name="loop")

    def clock(self) -> float:
        return time.monotonic() - self.started_s if self.started_s is not None else -1.0

    def run(self) -> None:
        try:
            self.loop.run()
        except BaseException as error:  # noqa: BLE001  (the first promise: it is reported as broken)
            self.error = error

    # ---- listening --------------------------------------------------------------------------------

    def on_fault(self, code: FaultCode, active: bool, message: str) -> None:
        spans = self.announced[code]
        if active:
            spans.append((self.clock(), math.inf))
        elif spans:
            spans[-1] = spans[-1][0], self.clock()

    def on_refused(self, at_s: float) -> None:
        episode = self.episode("link", at_s)
        if episode is not None:
            self.refused_s.setdefault(episode, at_s)

    def episode(self, row: str, now_s: float) -> faults.Episode | None:
        for episode in self.rows[row]:
            if episode.start_s <= now_s < episode.end_s:
                return episode
        return None

    def on_result(self, result: Result, state: State) -> None:
        now_s = self.clock()
        if self.started_s is None:
            if not state.status & UNUSABLE:
                self.started_s = time.monotonic()
            return
        self.sent[state.sample & 0xFFFF] = state
        if len(self.sent) > 4096:
            self.sent.pop(next(iter(self.sent)))
        self.outcome.counts["samples judged"] += 1
        if state.status & UNUSABLE:
            self.outcome.counts["samples flagged"] += 1
            return
        k = result.frame.sequence % len(self.truth)
        off = np.abs([getattr(state, name) for name in VALUES] - self.truth[k])
        if not np.nanmax(off, initial=0.0) > WRONG_MM:
            return
        kind = self.source.kinds.get(result.frame.sequence, "")  # an image may outlast its episode
        episode = self.episode("camera", now_s)
        if kind == "freeze" and episode is not None and now_s - episode.start_s < 2 * ANNOUNCED_S:
            self.outcome.counts["samples wrong, cannot be known yet (freeze)"] += 1
        else:
            by = (
                f"{', '.join(f'{v:.2f}' for v in off)} mm (frame {k}, {kind or 'no fault'}, "
                f"{result.tracks.n_seen} pins, confidence {result.tracks.confidence:.2f})"
            )
            self.outcome.fail(f"{now_s:.3f} s: unflagged, and wrong by {by}")

    def on_sample(self, sample: Sample) -> None:
        now_s = self.clock()
        while self.disturbed and self.disturbed[0].end_s <= now_s:
            self.back_s[self.disturbed.pop(0)] = now_s
        self.outcome.counts["samples received"] += 1
        sent = self.sent.get(sample.state.sample)
        if sent is None:  # not yet entered (the watcher runs after the sink), or a keepalive without an image
            return
        a, b = sample.state.displacement_mm, sent.displacement_mm
        if a == a and abs(a - b) > 0.01:
            self.outcome.fail(f"host decoded {a:.3f} mm where {b:.3f} mm was sent")

    # ---- evaluation ----------------------------------------------------------------------------------

    def check(self, done_s: float) -> None:
        """Check every episode that has ended long enough ago against the announcements."""
        outcome = self.outcome
        for row, episodes in self.rows.items():
            for e in episodes:
                if e.end_s + CLEARED_S > done_s:
                    continue
                entry = outcome.rows[e.kind]
                entry.injected += 1
                if faults.EXPECTED[e.kind]:
                    self.check_announced(e, entry)
                if row == "link":
                    self.check_link(e)

    def check_announced(self, e: faults.Episode, entry: Row) -> None:
        since_s = e.start_s
        if e.kind in faults.LINK:  # it cannot be observed before a sample is sent
            since_s = self.refused_s.get(e, math.inf)
            if since_s > e.end_s - ANNOUNCED_S:
                entry.unseen += 1
                return
        at_s = self.announced_at(e)
        if at_s is None:
            held_s = self.metronome.held_up_s(self.at(since_s), self.at(e.end_s))
            if e.end_s - since_s - held_s < ANNOUNCED_S:  # over before this machine could run the check
                entry.unseen += 1
                return
            self.outcome.fail(f"{e.kind} at {e.start_s:.2f} s for {e.length_s:.2f} s: not announced")
            return
        late_s = max(0.0, at_s - since_s)
        net_s = max(0.0, late_s - self.metronome.held_up_s(self.at(since_s), self.at(at_s)))
        entry.announce_ms.append(round(1e3 * late_s, 1))
        entry.announce_net_ms.append(round(1e3 * net_s, 1))
        if net_s > ANNOUNCED_S:
            self.outcome.fail(f"{e.kind} at {e.start_s:.2f} s: announced after {1e3 * net_s:.0f} ms")
        else:
            entry.announced += 1
        clear_s = self.cleared_at(e)
        if clear_s is None:
            self.outcome.fail(f"{e.kind} until {e.end_s:.2f} s: still announced {CLEARED_S:g} s later")
            return
        entry.cleared += 1
        entry.clear_ms.append(round(1e3 * max(0.0, clear_s - e.end_s), 1))

    def at(self, clock_s: float) -> float:
        assert self.started_s is not None
        return self.started_s + clock_s

    def announced_at(self, e: faults.Episode) -> float | None:
        """When the first of the expected faults was active; it may have been so before."""
        times = [
            max(begun_s, e.start_s)
            for code in faults.EXPECTED[e.kind]
            for begun_s, ended_s in self.announced[code]
            if ended_s > e.start_s and begun_s <= e.end_s + ANNOUNCED_S
        ]
        return min(times, default=None)

    def cleared_at(self, e: faults.Episode) -> float | None:
        """When, after its end, none of the expected faults was active."""
        held_s = self.metronome.held_up_s(self.at(e.end_s), self.at(e.end_s + CLEARED_S))
        times = [
            ended_s
            for code in faults.EXPECTED[e.kind]
            for begun_s, ended_s in self.announced[code]
            if begun_s <= e.end_s < ended_s
        ]
        latest_s = max(times, default=e.end_s)
        return latest_s if latest_s <= e.end_s + CLEARED_S + held_s else None

    def check_link(self, e: faults.Episode) -> None:
        back_s = self.back_s.get(e, math.inf) - e.end_s
        held_s = self.metronome.held_up_s(self.at(e.end_s), self.at(e.end_s + BACK_S))
        self.outcome.counts["link faults"] += 1
        worst = self.outcome.counts["link back after at most, ms"]
        self.outcome.counts["link back after at most, ms"] = max(worst, round(1e3 * min(back_s, 1e6)))
        if back_s > BACK_S + held_s:
            self.outcome.fail(f"{e.kind} until {e.end_s:.2f} s: link back after {back_s:.2f} s")

    # ---- the run ----------------------------------------------------------------------------------

    def start(self) -> None:
        self.thread.start()
        end = time.monotonic() + PATIENCE_S
        while self.started_s is None and time.monotonic() < end:
            self.thread.join(0.05)
        if self.started_s is None:
            raise RuntimeError(f"the loop does not start: {self.error or self.registry.active}")

    def finish(self) -> None:
        self.loop.stop()
        self.thread.join(5.0)
        done_s = self.clock()
        if self.thread.is_alive():
            self.outcome.fail("the loop does not end")
        if self.error is not None:
            self.outcome.fail(f"the loop died: {self.error!r}")
        self.check(done_s)
        self.outcome.check_memory(self.loop.frames_n)

    def close(self) -> None:
        self.loop.stop()
        self.host.close()
        self.node.close()
        self.source.close()
        self.metronome.close()


def soak(seconds: float, seed: int = 1, rate_hz: float = 60.0, brisk: bool = False) -> Outcome:
    """Run, check, and report.

    brisk  short episodes and pauses: as many faults in less than half of the time
    """
    cv2.setNumThreads(1)
    outcome = Outcome(seconds, seed)
    run = Soak(outcome, rate_hz, brisk)
    try:
        run.start()
        while run.clock() < seconds and run.thread.is_alive():
            run.thread.join(1.0)
            outcome.memory_mb.append(round(memory_mb(), 1))
        run.finish()
    finally:
        run.close()
    return outcome


def tell(outcome: Outcome, console: Console) -> None:
    """The table of faults, the counts, the violations."""
    rows = [row.cells(kind) for kind, row in sorted(outcome.rows.items())]
    show(rows, f"soak: {outcome.seconds:g} s, seed {outcome.seed}", console)
    for name, n in sorted(outcome.counts.items()):
        console.print(f"{name:55s} {n}")
    memory = outcome.memory_mb
    if memory:
        third = len(memory) // 3
        console.print(
            f"memory MB: median of the second third {np.median(memory[third : 2 * third] or [0]):.1f}, "
            f"of the last {np.median(memory[-third:] or [0]):.1f}, most {max(memory):.1f}"
        )
    if outcome.slope_bytes is not None:
        console.print(f"memory: {outcome.slope_bytes:+.0f} bytes a sample")
    for message in outcome.violations[:50]:
        console.print(f"VIOLATION {message}", style="red")
    console.print(f"{len(outcome.violations)} violations")


@click.command()
@click.option("--seconds", default=60.0, show_default=True, type=click.FloatRange(min=10))
@click.option("--seed", default=1, show_default=True)
@writes_results
def command(seconds: float, seed: int, out: Path) -> None:
    """The program under a random schedule of all faults, checked against its promises."""
    outcome = soak(seconds, seed)
    tell(outcome, Console(width=120))
    with (out / "soak.md").open("w") as file:
        day = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
        file.write(f"# Soak\n\n`make soak SECONDS={seconds:g}`, seed {seed}, {day}.\n\n```\n")
        tell(outcome, Console(file=file, width=120, no_color=True))
        file.write("```\n")
    sys.exit(1 if outcome.violations else 0)
