"""The program under a random schedule of all faults, checked against its promises: `make soak SECONDS=3600`.

    simulated tip -> Paced -> FaultySource -> Loop -> Node -> faulty bus -> host library
                                               ^ FaultyBoard: temperature, storage
    meanwhile, repeatedly: a separate process that is ended by SIGTERM, and one that is killed while a
    host writes settings and calibrations into it

Promises
- the loop lives, and no exception reaches it
- each fault is announced within 0.1 s (one of a link: from the first sample that it did not take) and cleared
  within 1 s after its end
- no wrong sample leaves unflagged: displacement and shear are those of an undisturbed run, or a status bit
  forbids their use; and the host decodes what was sent
- the link delivers within 1 s after its fault
- memory does not grow with the samples, of this process and of an `edge replay --loop` beside it: its slope
  over the last two thirds is below `SLOPE_BYTES` a sample
- hostile viewers of the live page, all the time, cost its process a bounded memory, and an honest one still
  gets its pictures
- SIGTERM ends cleanly within 1 s; after kill -9, at any moment of an upload too, settings and calibration are
  those last acknowledged or those being written, complete, and the next start uses them

Not promised: a frozen image can be recognised only after 45 ms.

A second process measures how long this machine's own load delays processes: so much is allowed on top,
and the table has the worst delays with and without it.
"""

import asyncio
import json
import math
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import aiohttp
import can
import click
import cv2
import numpy as np
from rich.console import Console

from calib.sim.source import SceneSource
from edge.calibration import Calibration
from edge.faults.registry import FaultRegistry
from edge.frame import Pipeline
from edge.link.medium import opener
from edge.link.node import Node
from edge.link.settings import SettingsFile
from edge.link.sinks import CanFdSink
from edge.rest.tare import tare
from edge.runtime.board_monitor import BoardMonitor
from edge.runtime.device import LoopDevice
from edge.runtime.loop import Loop
from edge.sources import Paced, open_source
from edge.types import Feature, Result
from edge.worker import WorkerClient, WorkerConfig
from hostlink import connect
from hostlink.client import Connection, Sample
from hostlink.errors import LinkError
from hostlink.output_file import find_unfinished
from hostlink.web import parse_listen
from hostlink.wire import CanIds, FaultCode, Kind, State, Status
from hostlink.wire.address import parse_address
from tests.bench.output import ROOT, show, writes_results
from tests.bench.usage import memory_mb
from tests.support.fault_injection import (
    BOARD,
    CAMERA,
    EXPECTED,
    LENGTH_S,
    LINK,
    PAUSE_S,
    Episode,
    FaultyBoard,
    FaultySource,
    faulty_medium,
    schedule,
)
from tests.support.hostile_viewer import HostileViewers, look

CALIBRATION = ROOT / "tests" / "data" / "rings331_ball.json"
SCENE = "sim:tour?width=320&height=320&paced=0"
NODE = 5
GROUP = "239.255.43.21"

ANNOUNCED_S = 0.1
CLEARED_S = 1.0
BACK_S = 1.0
ENDED_S = 1.0
SLOPE_BYTES = 40.0  # a sample; a tuple of two numbers in a list takes 112
MEMORY_LEAST_N = 20  # values, one a second
NOISE_MB = 4.0  # by which the first minutes differ; 160 bytes a sample exceed it within a quarter of an hour
PAGE_MB = 300.0  # of the page's process: 130 MB, and up to 16 viewers with two packets each
WRONG_MM = 0.4  # of displacement and shear, against the undisturbed run; its own noise is 0.05 mm
UNUSABLE = (
    Status.CAMERA_FAULT | Status.IMAGE_FAULT | Status.PINS_LOST | Status.TRACKER_LOST | Status.TARE_FAULT
    | Status.CAMERA_MOVED | Status.CLOCK_STEP
)  # fmt: skip
FLOOD_S, FLOODED_SHARE = 5.0, 0.5  # of the samples must arrive while the bus is flooded; 0.25 did before
BRISK_S = (0.3, 0.5)  # episodes and pauses of a short run
VALUES = ("displacement_mm", "shear_x_mm", "shear_y_mm")


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

    def worst_s(self) -> float:
        return max(self._gaps, default=0.0)

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
        known = bool(EXPECTED[kind])
        return {
            "fault": kind,
            "injected": self.injected,
            "announced": self.announced if known else "-",
            "cleared": self.cleared if known else "-",
            "not visible": self.unseen or None,
            "announce ms": round(float(np.median(self.announce_ms))) if self.announce_ms else None,
            "worst": round(max(self.announce_ms)) if self.announce_ms else None,
            "less machine": round(max(self.announce_net_ms)) if self.announce_net_ms else None,
            "clear ms": round(float(np.median(self.clear_ms))) if self.clear_ms else None,
            "worst to clear": round(max(self.clear_ms)) if self.clear_ms else None,
        }


@dataclass
class Outcome:
    """The whole run."""

    seconds: float
    seed: int
    rows: dict[str, Row] = field(default_factory=lambda: defaultdict(Row))
    violations: list[str] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    memory_mb: list[float] = field(default_factory=list)
    slopes_bytes: dict[str, float] = field(default_factory=dict)  # a sample, of each process
    machine_held_up_ms: float = 0.0
    sigterm_s: list[float] = field(default_factory=list)

    def fail(self, message: str) -> None:
        self.violations.append(message)

    def check_memory(self, what: str, memory_mb: Sequence[float], samples_n: int) -> None:
        """Check the slope of a process's memory, noted at even times while so many samples were made."""
        kept = np.array(memory_mb[len(memory_mb) // 3 :])
        if len(kept) < MEMORY_LEAST_N:
            return
        i, j = np.triu_indices(len(kept), 1)
        slopes_mb = (kept[j] - kept[i]) / (j - i)  # the median of all pairs', Theil and Sen's, knows no steps
        grown_mb = float(np.median(slopes_mb)) * len(kept)
        slope = 2**20 * grown_mb / (samples_n * len(kept) / len(memory_mb))
        self.slopes_bytes[what] = round(slope, 1)
        if slope > SLOPE_BYTES and grown_mb > NOISE_MB:
            self.fail(f"memory of {what} grew by {grown_mb:.1f} MB, {slope:.0f} bytes a sample")


def undisturbed(scene: SceneSource, calibration: Calibration) -> np.ndarray:
    """(n, 3) VALUES of each frame of the scene, without faults."""
    frames = list(scene)
    pipeline = Pipeline(
        tare([f.image for f in frames[:8]], 1e9, calibration), calibration, frozenset(Feature)
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
        length_s, pause_s = (BRISK_S, BRISK_S) if brisk else (LENGTH_S, PAUSE_S)
        until_s = outcome.seconds - 2.0
        self.rows: dict[str, list[Episode]] = {
            name: schedule(outcome.seed * 10 + i, until_s, kinds, length_s=length_s, pause_s=pause_s)
            for i, (name, kinds) in enumerate((("camera", CAMERA), ("link", LINK), ("board", BOARD)))
        }
        self.source = FaultySource(
            Paced(kept, rate_hz, loop=True), self.rows["camera"], self.clock, outcome.seed
        )
        self.board = FaultyBoard(self.rows["board"], self.clock)
        self.announced: defaultdict[FaultCode, list[tuple[float, float]]] = defaultdict(list)  # from, to
        self.registry = FaultRegistry()
        self.registry.listeners.append(self.on_fault)
        monitor = BoardMonitor(self.registry, self.board.temperature, [self.board.storage])
        self.loop = Loop(self.source, [], self.calibration, faults=self.registry, board=monitor)
        address = parse_address(f"virtual:soak{outcome.seed}")
        self.refused_s: dict[Episode, float] = {}  # when it first took no sample
        self.back_s: dict[Episode, float] = {}  # when the first sample arrived after it
        self.disturbed = list(self.rows["link"])  # of which no sample has arrived yet
        faulty = faulty_medium(
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
        self.page = WorkerClient(self.loop, WorkerConfig(parse_listen("127.0.0.1:0")))
        self.page_mb = 0.0
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

    def episode(self, row: str, now_s: float) -> Episode | None:
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
                if EXPECTED[e.kind]:
                    self.check_announced(e, entry)
                if row == "link":
                    self.check_link(e)

    def check_announced(self, e: Episode, entry: Row) -> None:
        since_s = e.start_s
        if e.kind in LINK:  # it cannot be observed before a sample is sent
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

    def announced_at(self, e: Episode) -> float | None:
        """When the first of the expected faults was active; it may have been so before."""
        times = [
            max(begun_s, e.start_s)
            for code in EXPECTED[e.kind]
            for begun_s, ended_s in self.announced[code]
            if ended_s > e.start_s and begun_s <= e.end_s + ANNOUNCED_S
        ]
        return min(times, default=None)

    def cleared_at(self, e: Episode) -> float | None:
        """When, after its end, none of the expected faults was active."""
        held_s = self.metronome.held_up_s(self.at(e.end_s), self.at(e.end_s + CLEARED_S))
        times = [
            ended_s
            for code in EXPECTED[e.kind]
            for begun_s, ended_s in self.announced[code]
            if begun_s <= e.end_s < ended_s
        ]
        latest_s = max(times, default=e.end_s)
        return latest_s if latest_s <= e.end_s + CLEARED_S + held_s else None

    def check_link(self, e: Episode) -> None:
        back_s = self.back_s.get(e, math.inf) - e.end_s
        held_s = self.metronome.held_up_s(self.at(e.end_s), self.at(e.end_s + BACK_S))
        self.outcome.counts["link faults"] += 1
        worst = self.outcome.counts["link back after at most, ms"]
        self.outcome.counts["link back after at most, ms"] = max(worst, round(1e3 * min(back_s, 1e6)))
        if back_s > BACK_S + held_s:
            self.outcome.fail(f"{e.kind} until {e.end_s:.2f} s: link back after {back_s:.2f} s")

    # ---- the run ----------------------------------------------------------------------------------

    def start(self, patience_s: float = 60.0) -> None:
        self.page.start()
        self.thread.start()
        end = time.monotonic() + patience_s
        while self.started_s is None and time.monotonic() < end:
            self.thread.join(0.05)
        if self.started_s is None:
            raise RuntimeError(f"the loop does not start: {self.error or self.registry.active}")

    def look(self) -> None:
        """Memory of the page's process."""
        assert self.page.process is not None
        if self.page.process.poll() is not None:
            self.outcome.fail("the page's process has ended")
            return
        self.page_mb = max(self.page_mb, memory_mb(self.page.process.pid))

    def check_page(self, attack: HostileViewers) -> None:
        """After the attack: one honest viewer, and the cost of the hostile ones."""
        self.outcome.counts.update({f"attacks on the page: {name}": n for name, n in attack.counts.items()})
        self.outcome.counts["viewers cut off"] = self.page.page.cut_off_n
        self.outcome.counts["page's process, MB at most"] = round(self.page_mb)
        if self.page_mb > PAGE_MB:
            self.outcome.fail(f"the page's process grew to {self.page_mb:.0f} MB")
        try:
            seen_n = asyncio.run(asyncio.wait_for(look(f"http://127.0.0.1:{self.page.port}/live", 2), 10.0))
        except (OSError, TimeoutError, aiohttp.ClientError) as error:
            self.outcome.fail(f"an honest viewer is not served: {error!r}")
        else:
            self.outcome.counts["pictures of an honest viewer"] = seen_n

    def finish(self) -> None:
        self.loop.stop()
        self.thread.join(5.0)
        done_s = self.clock()
        if self.thread.is_alive():
            self.outcome.fail("the loop does not end")
        if self.error is not None:
            self.outcome.fail(f"the loop died: {self.error!r}")
        self.check(done_s)
        self.outcome.check_memory("the soaked process", self.outcome.memory_mb, self.loop.frames_n)
        self.outcome.machine_held_up_ms = 1e3 * self.metronome.worst_s()

    def close(self) -> None:
        self.loop.stop()
        self.page.close()
        self.host.close()
        self.node.close()
        self.source.close()
        self.metronome.close()


# ---- processes that end ------------------------------------------------------------------------------


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("", 0))
        return int(s.getsockname()[1])


def started(*arguments: str, stdout: int, stderr: int) -> subprocess.Popen[bytes]:
    """The program as a process."""
    command = [sys.executable, "-m", "edge", *arguments]
    environment = dict(os.environ, OMP_NUM_THREADS="1")
    return subprocess.Popen(command, cwd=ROOT, env=environment, stdout=stdout, stderr=stderr)


class Process:
    """The program as a process, on a bus that another process can read."""

    def __init__(self, folder: Path) -> None:
        self.port = _free_port()
        self.address = f"udp:{GROUP}?port={self.port}&ttl=0&node={NODE}"
        config = folder / "edge.toml"
        config.write_text(
            f'[sensor]\nnode_id = {NODE}\n[source]\nspec = "sim:nothing?width=320&height=320"\nrate_hz = 60\n'
            f'[link]\nsinks = ["{self.address}"]\n[state]\ndirectory = "{folder}"\n'
        )
        self.process = started(
            "run", "-c", str(config), "--json", stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        )

    def end(self, number: int, patience_s: float = 10.0) -> tuple[int, float, str]:
        """Send a signal: exit status, seconds until the end, output."""
        assert self.process.stderr is not None
        handle = os.pidfd_open(self.process.pid)  # Popen.wait looks every 50 ms only
        try:
            sent_s = time.monotonic()
            self.process.send_signal(number)
            if not select.select([handle], [], [], patience_s)[0]:
                self.process.kill()
            code = self.process.wait()
            took_s = time.monotonic() - sent_s
        finally:
            os.close(handle)
        with self.process.stderr as pipe:
            return code, took_s, pipe.read().decode(errors="replace")


@contextmanager
def running(folder: Path) -> Iterator[tuple[Process, Connection]]:
    """The program, and a host that has its first sample; who uses it ends the program."""
    program = Process(folder)
    with connect(program.address) as host:
        next(host.samples(timeout_s=60.0))
        yield program, host


class Replay:
    """`edge replay --loop` in a process of its own: the whole command's memory."""

    def __init__(self) -> None:
        self.memory_mb: list[float] = []
        recording = str(ROOT / "tests" / "data" / "nothing.mcap")
        options = ("--loop", "--speed", "4", "--json")
        self._process = started(
            "replay", recording, *options, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )

    def look(self) -> None:
        self.memory_mb.append(memory_mb(self._process.pid))

    def end(self, outcome: Outcome) -> None:
        self._process.send_signal(signal.SIGTERM)
        summary = self._process.communicate()[0]
        if self._process.returncode:
            outcome.fail(f"edge replay --loop: exit status {self._process.returncode}")
            return
        outcome.check_memory("edge replay --loop", self.memory_mb, json.loads(summary)["frames_n"])


def end_cleanly(outcome: Outcome, random: Random, metronome: Metronome, folder: Path) -> None:
    """SIGTERM at a random moment while samples flow."""
    with running(folder) as (program, _):
        time.sleep(random.uniform(0.0, 0.5))  # the moment is what is random here
        began_s = time.monotonic()
        code, took_s, message = program.end(signal.SIGTERM)
    net_s = took_s - metronome.held_up_s(began_s, began_s + took_s)
    outcome.sigterm_s.append(round(took_s, 3))
    if code != 0 or net_s > ENDED_S:
        outcome.fail(f"SIGTERM: exit status {code} after {took_s:.2f} s: {message.strip()[-200:]}")


def kill_while_writing(outcome: Outcome, random: Random, folder: Path) -> None:
    """kill -9 while a host writes: acknowledged values are there afterwards."""
    acknowledged: list[float] = []
    tried = 0.0
    with running(folder) as (program, host):
        finger = host.finger(NODE)
        timer = threading.Timer(random.uniform(0.02, 1.0), lambda: program.end(signal.SIGKILL))
        try:
            while timer.is_alive() or not acknowledged:
                tried = float(random.randrange(10, 200))
                finger.set_rate(tried)
                acknowledged.append(tried)
                if len(acknowledged) == 1:
                    timer.start()
        except LinkError:
            outcome.counts["killed while asked"] += 1  # the answer never came
        timer.join()
    outcome.counts["kills"] += 1
    outcome.counts["settings written"] += len(acknowledged)
    settings = folder / "settings.json"
    if acknowledged:
        stored = json.loads(settings.read_text())["rate_hz"] if settings.exists() else None
        if stored not in (acknowledged[-1], tried):
            outcome.fail(f"kill -9: rate {acknowledged[-1]} acknowledged, {stored} stored")


def _calibrations() -> tuple[bytes, bytes]:
    """Two files of one tip that differ, as the edge writes them."""
    made = json.loads(CALIBRATION.read_bytes())
    made["data"]["created"] = "another one"
    return Calibration.load(CALIBRATION).encoded, Calibration.parse(json.dumps(made).encode(), "soak").encoded


def _being_written(folder: Path) -> bool:
    """Whether there is a calibration beside the one in use."""
    return bool(find_unfinished(folder / "calibration.json"))


def kill_while_uploading(outcome: Outcome, random: Random, folder: Path, at_the_write: bool) -> None:
    """kill -9 while a host uploads a calibration: the old or the new one is there, complete, and is used.

    at_the_write  kill when the file is being written; else at any moment of the upload
    """
    old, new = _calibrations()
    (folder / "calibration.json").write_bytes(old)
    acknowledged = False
    ended = threading.Event()

    def killer() -> None:
        # An upload of this size takes some 6 s; the write is visible only in the folder.
        patience_s = 30.0 if at_the_write else random.uniform(0.0, 9.0)
        end_s = time.monotonic() + patience_s
        while time.monotonic() < end_s and not (at_the_write and (_being_written(folder) or ended.is_set())):
            ended.wait(0.001 if at_the_write else patience_s)
        program.end(signal.SIGKILL)

    with running(folder) as (program, host):
        thread = threading.Thread(target=killer, name="killer")
        thread.start()
        try:
            host.finger(NODE).upload_calibration(new)
            acknowledged = True
        except LinkError:
            outcome.counts["killed within an upload"] += 1
        ended.set()
        thread.join()
    outcome.counts["kills"] += 1
    stored = (folder / "calibration.json").read_bytes()
    outcome.counts["uploads that were whole before the kill"] += stored == new
    if stored not in (old, new):
        outcome.fail(f"kill -9 within an upload: {len(stored)} bytes that are neither calibration")
        return
    if acknowledged and stored != new:
        outcome.fail("kill -9 after an upload was acknowledged: the old calibration is stored")
    with running(folder) as (again, host):
        used = host.finger(NODE).info().calibration_id
        if _being_written(folder):
            outcome.fail("kill -9 within an upload: what was written of it is there after the next start")
        again.end(signal.SIGTERM)
    if used != f"{Calibration.parse(stored, 'stored').content_id:08x}":
        outcome.fail(f"kill -9 within an upload: afterwards calibration {used or 'none'} is used")


def flood(outcome: Outcome, random: Random, folder: Path) -> None:
    """Junk datagrams and a flood of requests: samples go on."""
    over = threading.Event()
    requests = CanIds().of(Kind.SDO_REQUEST, NODE)

    def send(port: int) -> None:
        with (
            can.Bus(interface="udp_multicast", channel=GROUP, port=port, hop_limit=0) as bus,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as junk,
        ):
            junk.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            while not over.wait(0.0005):
                head = random.choice((0x00, 0x10, 0x20, 0x40, 0x60, 0x70, 0xC0))
                data = bytes((head, 0x30, 0x20, 0, *random.randbytes(4)))
                bus.send(can.Message(arbitration_id=requests, data=data, is_extended_id=False))
                junk.sendto(random.randbytes(20), (GROUP, port))

    with running(folder) as (program, host):
        thread = threading.Thread(target=send, args=(program.port,), name="flood")
        thread.start()
        n, end_s = 0, time.monotonic() + FLOOD_S
        try:
            for _ in host.samples(timeout_s=5.0):
                n += 1
                if time.monotonic() > end_s:
                    break
        except LinkError as error:
            outcome.fail(f"a flooded bus: {error}")
        over.set()
        thread.join()
        outcome.counts["samples while the bus was flooded"] += n
        if n < FLOODED_SHARE * FLOOD_S * 60.0:  # at the host: its link receives the same flood
            outcome.fail(f"a flooded bus: {n / FLOOD_S:.0f} of 60 samples a second")
        program.end(signal.SIGTERM)


def one_round(seed: int) -> Outcome:
    """Each kind of end. In its own process: a working host must not slow the finger under test."""
    outcome, random = Outcome(0.0, seed), Random(seed)
    metronome = Metronome()
    try:
        with TemporaryDirectory(prefix="soak-") as name:
            folder = Path(name)
            end_cleanly(outcome, random, metronome, folder)
            flood(outcome, random, folder)
            for _ in range(3):
                kill_while_writing(outcome, random, folder)
            for at_the_write in (False, True):
                kill_while_uploading(outcome, random, folder, at_the_write)
    finally:
        metronome.close()
    return outcome


def _endings(outcome: Outcome, every_s: float, until: threading.Event) -> None:
    """Round after round until the end."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        for n in count():
            try:
                done = pool.submit(one_round, 1000 * outcome.seed + n).result()
            except Exception as error:  # noqa: BLE001  (a promise that could not be checked is broken)
                outcome.fail(f"processes that are ended, round {n}: {error!r}")
            else:
                outcome.counts.update(done.counts)
                outcome.sigterm_s += done.sigterm_s
                outcome.violations += done.violations
            if until.wait(every_s):
                return


def soak(
    seconds: float,
    seed: int = 1,
    rate_hz: float = 60.0,
    endings_every_s: float = 120.0,
    brisk: bool = False,
) -> Outcome:
    """Run, check, and report.

    endings_every_s  0: without the processes that end
    brisk            short episodes and pauses: as many faults in less than half of the time
    """
    cv2.setNumThreads(1)
    outcome = Outcome(seconds, seed)
    run = Soak(outcome, rate_hz, brisk)
    replay = Replay() if endings_every_s else None
    over = threading.Event()
    endings = threading.Thread(
        target=_endings, args=(outcome, endings_every_s, over), name="endings", daemon=True
    )
    try:
        run.start()
        if endings_every_s:
            endings.start()
        with HostileViewers(run.page.port, seed) as attack:
            while run.clock() < seconds and run.thread.is_alive():
                run.thread.join(1.0)
                outcome.memory_mb.append(round(memory_mb(), 1))
                if replay is not None:
                    replay.look()
                run.look()
        run.check_page(attack)
        if replay is not None:
            replay.end(outcome)
            over.set()
            endings.join(180.0)
            if endings.is_alive() or not outcome.counts["kills"]:
                outcome.fail("the processes that are ended did not come to an end")
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
    for what, slope in outcome.slopes_bytes.items():
        console.print(f"memory of {what}: {slope:+.0f} bytes a sample")
    console.print(f"SIGTERM to end, s: {', '.join(map(str, outcome.sigterm_s)) or 'not tried'}")
    console.print(f"longest time the machine ran nothing of one process: {outcome.machine_held_up_ms:.0f} ms")
    for message in outcome.violations[:50]:
        console.print(f"VIOLATION {message}", style="red")
    console.print(f"{len(outcome.violations)} violations")


@click.command()
@click.option("--seconds", default=60.0, show_default=True, type=click.FloatRange(min=10))
@click.option("--seed", default=1, show_default=True)
@click.option("--rate", "rate_hz", default=60.0, show_default=True, help="Frames a second.")
@writes_results
def command(seconds: float, seed: int, rate_hz: float, out: Path) -> None:
    """The program under a random schedule of all faults, checked against its promises."""
    outcome = soak(seconds, seed, rate_hz)
    tell(outcome, Console(width=120))
    with (out / "soak.md").open("w") as file:
        day = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
        file.write(f"# Soak\n\n`make soak SECONDS={seconds:g}`, seed {seed}, {day}.\n\n```\n")
        tell(outcome, Console(file=file, width=120, no_color=True))
        file.write("```\n")
    sys.exit(1 if outcome.violations else 0)
