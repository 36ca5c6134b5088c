"""The cost of viewers of the live page for the loop: its compute time with and without them, in one run.

    python -m tests.bench viewers --seconds 10 --rounds 3

One process runs the loop at a camera's rate, its page is served by the second process (`edge.worker`), and
the viewers are a third one, like browsers. Phases alternate with phases where nobody watches, round after
round, so that the machine's other load affects all alike. Times are from the start of work on a frame: to the
sample's hand-over, and to the end of the turn (with copying for viewers or recorder). Loads are
processor time of the two processes; memory is their resident sets, the loop's after a collection.

    nobody       the page is served, no viewer
    one, two     viewers with the camera's image
    crowd        as many as the page takes (16)
    coming       100 open, read 5 packets and close, over the phase; one more never reads
    recording    nobody watches; images and values are recorded without loss
"""

from __future__ import annotations

import asyncio
import gc
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from edge.runtime.loop import Loop
from edge.runtime.process import limit_resources
from edge.sources import Paced
from edge.types import Frame, Lens, Polarity
from edge.worker import WorkerClient, WorkerConfig
from hostlink.web import parse_listen
from hostlink.web.limits import WebLimits
from hostlink.wire import State
from tests.bench.frames import scene

PHASES = {"nobody": 0, "one": 1, "two": 2, "crowd": WebLimits().viewers_n, "coming": -100, "recording": 0}
TOKEN = "bench-token"
IDLE_S = 60.0  # longer than it takes to notice that a viewer left


class _Frames:
    """Frames in memory as a recording; loops without a jump."""

    live, dropped_n, name = False, 0, "bench"
    polarity = Polarity.FOUND
    lens: Lens | None = None

    def __init__(self, rate_hz: float) -> None:
        frames = scene("press")
        self._frames = [*frames, *frames[-2:0:-1]]
        height, width = frames[0].image.shape
        self.size_px, self.rate_hz = (width, height), rate_hz

    def __iter__(self) -> Any:
        return iter(self._frames)

    def close(self) -> None: ...


async def _look(session: Any, url: str, until_s: float, packets_max: int = 0) -> int:
    async with session.ws_connect(url, max_msg_size=0) as socket:
        await socket.send_json({"want": ["image"]})
        got_n = 0
        async for message in socket:
            if message.type is message.type.BINARY:
                got_n += 1
                await socket.send_json({"got": got_n})
            if time.monotonic() > until_s or (packets_max and got_n == packets_max):
                break
        return got_n


async def _watch(url: str, viewers_n: int, seconds: float) -> int:
    """Act as so many viewers; returns the packets received. Negative: they come and go, one never reads."""
    import aiohttp

    until_s = time.monotonic() + seconds
    async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(limit=0)) as session:
        if viewers_n > 0:
            return sum(await asyncio.gather(*(_look(session, url, until_s) for _ in range(viewers_n))))
        async with session.ws_connect(url, max_msg_size=0, autoping=False) as silent:
            await silent.send_json({"want": ["image"]})
            tasks = []
            for _ in range(-viewers_n):
                tasks.append(asyncio.create_task(_look(session, url, until_s, 5)))
                await asyncio.sleep(seconds / -viewers_n * 0.9)
            return sum(await asyncio.gather(*tasks))


def _rss_mb(pid: int) -> float:
    for line in Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    return float("nan")


def _cpu_s(pid: int) -> float:
    """Processor time that a process has used, all its threads."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


async def _press(url: str, token: str, button: str) -> None:
    """Run a command of the page, and wait for its answer."""
    import aiohttp

    async with aiohttp.ClientSession() as session, session.ws_connect(url, max_msg_size=0) as socket:
        await socket.send_json({"token": token, "want": []})
        await socket.receive_json()
        await socket.send_json({"do": button})
        async for message in socket:
            if message.type is message.type.TEXT:
                output = json.loads(message.data)
                if not output["ok"]:
                    raise RuntimeError(output["message"])
                return


def _be_watched(url: str, viewers_n: int, seconds: float, begin: Callable[[], None]) -> int:
    """Run the viewers in another process; `begin` is called when it is up and nobody watches yet."""
    command = [sys.executable, "-m", "tests.bench.viewers", "--watch", url, str(viewers_n)]
    with subprocess.Popen(
        [*command, "--seconds", str(seconds)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        begin()
        child.stdin.write("go\n")
        child.stdin.flush()
        return int(child.stdout.readline())


class _Meter:
    """Times of the loop's turns."""

    def __init__(self, loop: Loop, worker: WorkerClient) -> None:
        self.loop, self.worker = loop, worker
        self._idle = threading.Event()
        self._begun_ns = 0
        self.sent_us: list[float] = []
        self.turn_us: list[float] = []
        self._step, self._send, self._end_cycle = loop.step, loop._send, loop._end_cycle
        for name, timed in (("step", self._stepped), ("_send", self._sent), ("_end_cycle", self._ended)):
            setattr(loop, name, timed)

    def _stepped(self, frame: Frame) -> State:
        self._begun_ns = time.perf_counter_ns()
        return self._step(frame)

    def _sent(self, *arguments: Any) -> State:
        state = self._send(*arguments)
        self.sent_us.append((time.perf_counter_ns() - self._begun_ns) / 1e3)
        return state

    def _ended(self) -> None:
        self._end_cycle()
        self.turn_us.append((time.perf_counter_ns() - self._begun_ns) / 1e3)
        if self.loop.last is not None and not self.worker.view.watched and not self.loop.session.recorder:
            self._idle.set()

    def begin(self) -> None:
        """Discard the times measured before."""
        self.sent_us.clear()
        self.turn_us.clear()

    def wait_until_idle(self) -> None:
        """Wait for a turn with a rest frame and without viewers or recording."""
        self._idle.clear()
        if not self._idle.wait(IDLE_S):
            raise RuntimeError(f"the loop is watched or recorded for {IDLE_S:g} s after the last viewer left")


@dataclass(slots=True)
class _Phase:
    """The measurements of a phase, over all rounds.

    skipped_n      frames that the loop did not take; lost_n: messages that were not recorded
    cpu_s, rss_mb  of the loop's process and of the worker
    """

    sent_us: list[float] = field(default_factory=list)
    turn_us: list[float] = field(default_factory=list)
    packets_n: int = 0
    skipped_n: int = 0
    lost_n: int = 0
    elapsed_s: float = 0.0
    cpu_s: tuple[float, float] = (0.0, 0.0)
    rss_mb: tuple[float, float] = (0.0, 0.0)

    def row(self, viewers_n: int, watched_s: float) -> dict[str, float]:
        """The figures of a phase of this length."""
        p50, p99, p999 = np.percentile(self.sent_us, (50, 99, 99.9))
        packets_hz = self.packets_n / viewers_n / watched_s if viewers_n > 0 else 0.0
        return {
            "frames": len(self.sent_us),
            "p50_us": float(p50),
            "p99_us": float(p99),
            "p99.9_us": float(p999),
            "turn_p50_us": float(np.percentile(self.turn_us, 50)),
            "turn_p99_us": float(np.percentile(self.turn_us, 99)),
            "packets_hz": packets_hz,
            "loop_load_%": 100 * self.cpu_s[0] / self.elapsed_s,
            "worker_load_%": 100 * self.cpu_s[1] / self.elapsed_s,
            "rss_mb": self.rss_mb[0],
            "worker_rss_mb": self.rss_mb[1],
        }


def measure(seconds: float, rounds: int, rate_hz: float, fifo: bool = False) -> dict[str, Any]:
    """Run all phases, with the processor shared like in operation.

    Returns  per phase the loop's compute quantiles, packets and memory
    """
    limit_resources()
    source = Paced(_Frames(rate_hz), rate_hz, loop=True)
    loop = Loop(source, [])
    phases = {name: _Phase() for name in PHASES}

    def run() -> None:
        if fifo:  # of this thread and of the camera's, which it starts
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        loop.run()

    with tempfile.TemporaryDirectory(prefix="viewers-") as folder:
        listen = parse_listen("127.0.0.1:0", TOKEN)
        worker = WorkerClient(loop, WorkerConfig(listen, recordings=Path(folder)))
        worker.start()
        meter = _Meter(loop, worker)
        thread = threading.Thread(target=run)
        thread.start()
        for _ in range(rounds):
            for name, phase in phases.items():
                meter.wait_until_idle()
                _run_phase(name, phase, meter, seconds)
                for path in Path(folder).glob("*.mcap"):
                    path.unlink()
        cut_off_n = worker.page.cut_off_n
        loop.stop()
        source.close()
        thread.join()
        worker.close()
    return {
        "rate_hz": rate_hz,
        "rounds": rounds,
        "seconds": seconds,
        "phases": {name: phase.row(PHASES[name], seconds * rounds) for name, phase in phases.items()},
        "cut_off_n": cut_off_n,
        "recording_lost_n": phases["recording"].lost_n,
        "recording_skipped_n": phases["recording"].skipped_n,
    }


def _run_phase(name: str, phase: _Phase, meter: _Meter, seconds: float) -> None:
    worker, source = meter.worker, meter.loop.source
    assert worker.process is not None
    url, pids = f"http://127.0.0.1:{worker.port}/live", (os.getpid(), worker.process.pid)
    before_s, since_s, before_n = [_cpu_s(pid) for pid in pids], time.monotonic(), source.dropped_n
    if PHASES[name]:
        phase.packets_n += _be_watched(url, PHASES[name], seconds, meter.begin)
    else:
        if name == "recording":
            asyncio.run(_press(url, TOKEN, "record"))
        meter.begin()
        time.sleep(seconds)
    phase.sent_us += meter.sent_us
    phase.turn_us += meter.turn_us
    phase.elapsed_s += time.monotonic() - since_s
    used_s = [_cpu_s(pid) - before for pid, before in zip(pids, before_s, strict=True)]
    phase.cpu_s = (phase.cpu_s[0] + used_s[0], phase.cpu_s[1] + used_s[1])
    phase.skipped_n += source.dropped_n - before_n
    if name == "recording":
        phase.lost_n += worker.recording.dropped_n
        asyncio.run(_press(url, TOKEN, "record"))
    gc.collect()
    phase.rss_mb = (_rss_mb(pids[0]), _rss_mb(pids[1]))


@click.command()
@click.option("--seconds", type=click.FloatRange(min=1), default=10.0, show_default=True, help="Of a phase.")
@click.option("--rounds", type=click.IntRange(1, 100), default=3, show_default=True)
@click.option(
    "--fifo", is_flag=True, help="Real-time priority, so that other load is not measured; needs root."
)
@click.option("--rate", type=click.FloatRange(1, 2000), default=240.0, show_default=True, help="Frames/s.")
@click.option("--json", "json_file", type=click.Path(path_type=Path), help="Write the figures there too.")
@click.option("--watch", nargs=2, hidden=True, help="Be the viewers: address, how many.")
def command(
    seconds: float,
    rounds: int,
    fifo: bool,
    rate: float,
    json_file: Path | None,
    watch: tuple[str, str] | None,
) -> None:
    """The cost of viewers of the live page for the loop."""
    if watch is not None:
        import aiohttp  # noqa: F401  (so that its loading is over before the measurement begins)

        os.nice(19)  # browsers run on another machine: they must not take the loop's processor
        click.echo("ready")
        sys.stdin.readline()
        click.echo(asyncio.run(_watch(watch[0], int(watch[1]), seconds)))
        return
    made = measure(seconds, rounds, rate, fifo)
    table = Table("", *next(iter(made["phases"].values())), "p99 / nobody's")
    base = made["phases"]["nobody"]["p99_us"]
    for name, row in made["phases"].items():
        table.add_row(name, *(f"{value:,.0f}" for value in row.values()), f"{row['p99_us'] / base:.2f}")
    console = Console(width=160)
    console.print(table)
    console.print(
        f"cut off because they never read: {made['cut_off_n']}; while recording, messages lost: "
        f"{made['recording_lost_n']}, frames skipped by the loop: {made['recording_skipped_n']}"
    )
    if json_file is not None:
        json_file.write_text(json.dumps(made, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    command()
