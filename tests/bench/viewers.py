"""The cost of viewers of the live page for the loop: its compute time with and without them, in one run.

    python -m tests.bench viewers --seconds 10 --rounds 3

One process runs the loop at a camera's rate, its page is served by the second process (`edge.worker`), and
the viewers are a third one, like browsers. Phases alternate with phases where nobody watches, round after
round, so that the machine's other load affects all alike. Times are from the start of work on a frame to the
sample's hand-over. Loads are processor time of the two processes; memory is their resident sets, the loop's
after a collection.

    nobody       the page is served, no viewer
    one, two     viewers with the camera's image
    crowd        as many as the page takes (16)
    coming       100 open, read 5 packets and close, over the phase; one more never reads
    recording    nobody watches; images and values are recorded without loss
"""

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

import aiohttp
import click
import numpy as np

from edge.runtime.loop import Loop
from edge.sources import Paced
from edge.types import Frame
from edge.worker import WorkerClient, WorkerConfig
from hostlink.web import parse_listen
from hostlink.web.limits import WebLimits
from hostlink.wire import State
from tests.bench.frames import there_and_back
from tests.bench.output import show, write_json, writes_results
from tests.bench.paced_child import Images
from tests.bench.usage import cpu_s, memory_mb
from tests.support.hostile_viewer import look

PHASES = {"nobody": 0, "one": 1, "two": 2, "crowd": WebLimits().viewers_n, "coming": -100, "recording": 0}
TOKEN = "bench-token"
IDLE_S = 60.0  # longer than it takes to notice that a viewer left


async def _watch(url: str, viewers_n: int, seconds: float) -> int:
    """Act as so many viewers; returns the packets received. Negative: they come and go, one never reads."""
    until_s = time.monotonic() + seconds
    if viewers_n > 0:
        return sum(await asyncio.gather(*(look(url, 0, until_s) for _ in range(viewers_n))))
    async with aiohttp.ClientSession() as session, session.ws_connect(url, autoping=False) as silent:
        await silent.send_json({"want": ["image"]})
        tasks = []
        for _ in range(-viewers_n):
            tasks.append(asyncio.create_task(look(url, 5, until_s)))
            await asyncio.sleep(seconds / -viewers_n * 0.9)
        return sum(await asyncio.gather(*tasks))


async def _press(url: str, button: str) -> None:
    """Run a command of the page, and wait for its answer."""
    async with aiohttp.ClientSession() as session, session.ws_connect(url, max_msg_size=0) as socket:
        await socket.send_json({"token": TOKEN, "want": []})
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
    command = [sys.executable, "-m", "tests.bench", "viewers", "--watch", url, str(viewers_n)]
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
        if self.loop.last is not None and not self.worker.view.watched and not self.loop.session.recorder:
            self._idle.set()

    def begin(self) -> None:
        """Discard the times measured before."""
        self.sent_us.clear()

    def wait_until_idle(self) -> None:
        """Wait for a turn with a rest frame and without viewers or recording."""
        self._idle.clear()
        if not self._idle.wait(IDLE_S):
            raise RuntimeError(f"the loop is watched or recorded for {IDLE_S:g} s after the last viewer left")


@dataclass(slots=True)
class _Phase:
    """The measurements of a phase, over all rounds.

    skipped_n            frames that the loop did not take; lost_n: messages that were not recorded
    loop_s, worker_s     processor time of the two processes
    rss_mb               memory of the two
    """

    sent_us: list[float] = field(default_factory=list)
    packets_n: int = 0
    skipped_n: int = 0
    lost_n: int = 0
    elapsed_s: float = 0.0
    loop_s: float = 0.0
    worker_s: float = 0.0
    rss_mb: tuple[float, float] = (0.0, 0.0)

    def row(self, name: str, watched_s: float, base_us: float) -> dict[str, Any]:
        """The figures of a phase of this length, and its 99 % over that of the loop alone."""
        p50, p99, p999 = map(float, np.percentile(self.sent_us, (50, 99, 99.9)))
        viewers_n = PHASES[name]
        return {
            "phase": name, "frames": len(self.sent_us), "p50_us": p50, "p99_us": p99, "p99.9_us": p999,
            "packets_hz": self.packets_n / viewers_n / watched_s if viewers_n > 0 else 0.0,
            "loop_load_%": 100 * self.loop_s / self.elapsed_s,
            "worker_load_%": 100 * self.worker_s / self.elapsed_s,
            "rss_mb": self.rss_mb[0], "worker_rss_mb": self.rss_mb[1], "p99 / nobody's": p99 / base_us,
        }  # fmt: skip


def measure(seconds: float, rounds: int, rate_hz: float) -> dict[str, Any]:
    """Run all phases, with the processor shared like in operation.

    Returns  per phase the loop's compute quantiles, packets and memory
    """
    images, rest_n = there_and_back("press")
    shown = Images(images, rest_n, rate_hz, sys.maxsize)
    source = Paced(shown, rate_hz)
    loop = Loop(source, [])
    shown.tared = lambda: loop.last is not None
    phases = {name: _Phase() for name in PHASES}
    with tempfile.TemporaryDirectory(prefix="viewers-") as folder:
        listen = parse_listen("127.0.0.1:0", TOKEN)
        worker = WorkerClient(loop, WorkerConfig(listen, recordings=Path(folder)))
        worker.start()
        meter = _Meter(loop, worker)
        thread = threading.Thread(target=loop.run)
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
    base_us, watched_s = float(np.percentile(phases["nobody"].sent_us, 99)), seconds * rounds
    return {
        "rate_hz": rate_hz, "rounds": rounds, "seconds": seconds,
        "phases": [phase.row(name, watched_s, base_us) for name, phase in phases.items()],
        "cut_off_n": cut_off_n, "recording_lost_n": phases["recording"].lost_n,
        "recording_skipped_n": phases["recording"].skipped_n,
    }  # fmt: skip


def _run_phase(name: str, phase: _Phase, meter: _Meter, seconds: float) -> None:
    worker, source = meter.worker, meter.loop.source
    assert worker.process is not None
    url, ours, theirs = f"http://127.0.0.1:{worker.port}/live", os.getpid(), worker.process.pid
    since_s, loop_s, worker_s, before_n = time.monotonic(), cpu_s(ours), cpu_s(theirs), source.dropped_n
    if PHASES[name]:
        phase.packets_n += _be_watched(url, PHASES[name], seconds, meter.begin)
    else:
        if name == "recording":
            asyncio.run(_press(url, "record"))
        meter.begin()
        time.sleep(seconds)
    phase.sent_us += meter.sent_us
    phase.elapsed_s += time.monotonic() - since_s
    phase.loop_s += cpu_s(ours) - loop_s
    phase.worker_s += cpu_s(theirs) - worker_s
    phase.skipped_n += source.dropped_n - before_n
    if name == "recording":
        phase.lost_n += worker.recording.dropped_n
        asyncio.run(_press(url, "record"))
    gc.collect()
    phase.rss_mb = (memory_mb(ours), memory_mb(theirs))


@click.command()
@click.option("--seconds", type=click.FloatRange(min=1), default=10.0, show_default=True, help="Of a phase.")
@click.option("--rounds", type=click.IntRange(1, 100), default=3, show_default=True)
@click.option("--rate", type=click.FloatRange(1, 2000), default=240.0, show_default=True, help="Frames/s.")
@click.option("--watch", nargs=2, hidden=True, help="Be the viewers: address, how many.")
@writes_results
def command(seconds: float, rounds: int, rate: float, watch: tuple[str, str] | None, out: Path) -> None:
    """The cost of viewers of the live page for the loop."""
    if watch is not None:
        os.nice(19)  # browsers run on another machine: they must not take the loop's processor
        click.echo("ready")
        sys.stdin.readline()
        click.echo(asyncio.run(_watch(watch[0], int(watch[1]), seconds)))
        return
    made = measure(seconds, rounds, rate)
    show(made["phases"])
    click.echo(
        f"cut off because they never read: {made['cut_off_n']}; while recording, messages lost: "
        f"{made['recording_lost_n']}, frames skipped by the loop: {made['recording_skipped_n']}"
    )
    write_json(out / "viewers.json", made)
