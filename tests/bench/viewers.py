"""What viewers of the live page cost the loop: its compute time with and without them, in one run.

    python -m tests.bench viewers --seconds 10 --rounds 3

One process runs the app at a camera's rate, its page is served by the second process (`edge.worker`), and the
viewers are a third one, as browsers are. Phases alternate with phases where nobody watches, round after
round, so that what else the machine does falls on all alike. Times are from taking a frame in hand: to the
sample's hand-over, and to the end of the turn (with what is copied for viewers or recorder). Loads are
processor time of the two processes; memory is their resident sets, the loop's after a collection.

    nobody       the page is served, no viewer
    one, two     viewers with the camera's image
    crowd        as many as the page takes (16)
    coming       100 open, look at 5 packets and close, over the phase; one more never reads
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
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from edge.runtime.loop import Loop
from edge.runtime.process import limit_threads
from edge.sources import Paced
from edge.worker import WorkerClient, WorkerConfig
from hostlink.web import parse_listen
from hostlink.web.limits import WebLimits
from tests.bench.frames import scene

PHASES = {"nobody": 0, "one": 1, "two": 2, "crowd": WebLimits().viewers_n, "coming": -100, "recording": 0}
SETTLE_S = 1.0


class _Frames:
    """Frames in memory as a recording; loops without a jump."""

    live, dropped_n, name = False, 0, "bench"

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
    """Be so many viewers; how many packets they got. Negative: come and go, and one never reads."""
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
    """Press a button of the page, and wait for what comes of it."""
    import aiohttp

    async with aiohttp.ClientSession() as session, session.ws_connect(url, max_msg_size=0) as socket:
        await socket.send_json({"token": token, "want": []})
        await socket.receive_json()
        await socket.send_json({"do": button})
        async for message in socket:
            if message.type is message.type.TEXT:
                said = json.loads(message.data)
                if not said["ok"]:
                    raise RuntimeError(said["words"])
                return


def _be_watched(url: str, viewers_n: int, seconds: float, begin: Callable[[], None]) -> int:
    """Have another process be the viewers; `begin` is called when it is up and nothing watches yet."""
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


def measure(seconds: float, rounds: int, rate_hz: float, fifo: bool = False) -> dict[str, Any]:
    """Run all phases, with the processor shared as the app shares it.

    Returns  per phase the loop's compute quantiles, packets and memory
    """
    limit_threads()
    source = Paced(_Frames(rate_hz), rate_hz, loop=True)
    app = Loop(source, [])
    with tempfile.TemporaryDirectory(prefix="viewers-") as folder:
        token = "bench-token"
        worker = WorkerClient(app, WorkerConfig(parse_listen("127.0.0.1:0", token), recordings=Path(folder)))
        worker.start()
        assert worker.process is not None
        sent_us: list[float] = []
        turn_us: list[float] = []
        step, end_turn, send = app.step, app._end_turn, app._send
        begun_ns = 0

        def stepped(frame: Any) -> Any:
            nonlocal begun_ns
            begun_ns = time.perf_counter_ns()
            return step(frame)

        def sent(*arguments: Any) -> Any:
            state = send(*arguments)
            sent_us.append((time.perf_counter_ns() - begun_ns) / 1e3)
            return state

        def ended() -> None:
            end_turn()
            turn_us.append((time.perf_counter_ns() - begun_ns) / 1e3)

        for name, timed in (("step", stepped), ("_send", sent), ("_end_turn", ended)):
            setattr(app, name, timed)

        def run() -> None:
            if fifo:  # of this thread and of the camera's, which it starts
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
            app.run()

        loop = threading.Thread(target=run)
        loop.start()
        time.sleep(3 * SETTLE_S)
        url = f"http://127.0.0.1:{worker.port}/live"
        taken: dict[str, list[list[float]]] = {name: [[], []] for name in PHASES}
        packets: dict[str, int] = dict.fromkeys(PHASES, 0)
        cpu_s: dict[str, list[float]] = {name: [0.0, 0.0] for name in PHASES}
        elapsed_s: dict[str, float] = dict.fromkeys(PHASES, 0.0)
        rss_mb: dict[str, tuple[float, float]] = {}
        dropped_n, lost_n = 0, 0
        pids = (os.getpid(), worker.process.pid)

        def begin() -> None:
            sent_us.clear()
            turn_us.clear()

        for _ in range(rounds):
            for name, viewers_n in PHASES.items():
                time.sleep(SETTLE_S)
                before_s, since_s = [_cpu_s(pid) for pid in pids], time.monotonic()
                before_n = source.dropped_n
                if viewers_n:
                    packets[name] += _be_watched(url, viewers_n, seconds, begin)
                elif name == "recording":
                    asyncio.run(_press(url, token, "record"))
                    begin()
                    time.sleep(seconds)
                else:
                    begin()
                    time.sleep(seconds)
                taken[name][0] += sent_us
                taken[name][1] += turn_us
                elapsed_s[name] += time.monotonic() - since_s
                for k, pid in enumerate(pids):
                    cpu_s[name][k] += _cpu_s(pid) - before_s[k]
                if name == "recording":
                    lost_n += worker.recording.dropped_n
                    asyncio.run(_press(url, token, "record"))
                    dropped_n += source.dropped_n - before_n
                    for path in Path(folder).glob("*.mcap"):
                        path.unlink()
                gc.collect()
                rss_mb[name] = (_rss_mb(pids[0]), _rss_mb(pids[1]))
        cut_off_n = worker.page.cut_off_n
        app.stop()
        source.close()
        loop.join()
        worker.close()
    rows = {}
    for name, (to_send, to_end) in taken.items():
        p50, p99, p999 = np.percentile(to_send, (50, 99, 99.9))
        each = packets[name] / rounds / max(1, PHASES[name]) / seconds if PHASES[name] > 0 else 0.0
        rows[name] = {
            "frames": len(to_send),
            "p50_us": float(p50),
            "p99_us": float(p99),
            "p99.9_us": float(p999),
            "turn_p50_us": float(np.percentile(to_end, 50)),
            "turn_p99_us": float(np.percentile(to_end, 99)),
            "packets_hz": each,
            "loop_load_%": 100 * cpu_s[name][0] / elapsed_s[name],
            "aside_load_%": 100 * cpu_s[name][1] / elapsed_s[name],
            "rss_mb": rss_mb[name][0],
            "aside_rss_mb": rss_mb[name][1],
        }
    return {
        "rate_hz": rate_hz,
        "rounds": rounds,
        "seconds": seconds,
        "phases": rows,
        "cut_off_n": cut_off_n,
        "recording_lost_n": lost_n,
        "recording_skipped_n": dropped_n,
    }


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
    """What viewers of the live page cost the loop."""
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
