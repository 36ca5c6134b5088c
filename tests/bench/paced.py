"""The running program at a camera's rate for minutes: latency, memory, losses.

    python -m tests.bench paced --minutes 10
    python -m tests.bench paced --minutes 1 --busy    with the other core (or all of them) kept busy
    python -m tests.bench paced --minutes 1 --fingers 5    as fingers on one board: what they take together

A separate process runs the loop as `python -m edge run` composes it: paced source, calibration, all
features but the surface, CANopen node, CAN FD frames of the kernel, and a listener. Latency is from the
moment the frame was due to after the bus has taken the sample, so that the pacing thread's own wake-up is
included. The images are in memory (their size is reported): a camera would have a few buffers. Python's
bytecode is there before the start, as pip leaves it on a board.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from tests.bench.frames import REST_FRAMES, calibration_of, scene
from tests.bench.output import ROOT

__all__ = ["command", "run_child"]


def run_child(
    seconds: float, rate_hz: float = 240.0, every_s: float = 0.0, name: str = "press", realtime: bool = False
) -> dict[str, Any]:
    """Run the loop in its own process; returns the report of `paced_child`."""
    return run_children(1, seconds, rate_hz, every_s, name, realtime)[0]


def run_children(
    fingers_n: int,
    seconds: float,
    rate_hz: float = 240.0,
    every_s: float = 0.0,
    name: str = "press",
    realtime: bool = False,
) -> list[dict[str, Any]]:
    """The same with several at once, a process each, as fingers on one board; begun together."""
    frames = scene(name)
    images = np.stack([frame.image for frame in frames])
    touched = images[REST_FRAMES:]
    images = np.concatenate([images[:REST_FRAMES], touched, touched[-2:0:-1]])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "frames.npy"
        np.save(file, images)
        calibration_of(frames).save(Path(folder) / "tip.json")
        environment = _with_bytecode()
        options = {
            "frames": str(file), "rest_n": REST_FRAMES, "seconds": seconds, "rate_hz": rate_hz,
            "realtime": realtime, "calibration": str(Path(folder) / "tip.json"),
            "started_s": time.monotonic(),
        } | ({"every_s": every_s} if every_s else {})  # fmt: skip
        arguments = [sys.executable, "-m", "tests.bench.paced_child"]
        runs = [
            subprocess.Popen(
                [*arguments, json.dumps(options | {"node": node})],
                cwd=ROOT,
                env=environment,
                stdout=subprocess.PIPE,
                text=True,
            )
            for node in range(1, fingers_n + 1)
        ]
        printed = [run.communicate()[0] for run in runs]
        for run in runs:
            if run.returncode:
                raise subprocess.CalledProcessError(run.returncode, run.args)
    return [dict(json.loads(text.splitlines()[-1])) for text in printed]


def _with_bytecode() -> dict[str, str]:
    """The environment of a process that finds the bytecode of all that it imports."""
    environment = os.environ | {"PYTHONPYCACHEPREFIX": str(ROOT / "out" / "bytecode")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    subprocess.run(
        [sys.executable, "-c", "import tests.bench.paced_child"], cwd=ROOT, env=environment, check=True
    )
    return environment


def _burn() -> None:
    while True:
        sum(range(10_000))


@click.command()
@click.option("--minutes", type=click.FloatRange(min=0.02), default=10.0, show_default=True)
@click.option("--rate", type=click.FloatRange(1, 2000), default=240.0, show_default=True, help="Frames/s.")
@click.option("--busy", is_flag=True, help="Keep another core busy meanwhile.")
@click.option("--realtime", is_flag=True, help="Scheduled as by deploy/realtime.conf (needs root).")
@click.option("--fingers", type=click.IntRange(1, 16), default=1, show_default=True, help="At once.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def command(minutes: float, rate: float, busy: bool, realtime: bool, fingers: int, as_json: bool) -> None:
    """The running program at a camera's rate. Exit code 1: a frame that it accepted was lost."""
    burner = multiprocessing.get_context("spawn").Process(target=_burn, daemon=True) if busy else None
    if burner is not None:
        burner.start()
    load = [os.getloadavg()[0]]
    every_s = 0.0 if as_json or fingers > 1 else max(1.0, minutes * 60.0 / 20.0)
    try:
        reports = run_children(fingers, 60.0 * minutes, rate, every_s, realtime=realtime)
    finally:
        if burner is not None:
            burner.terminate()
    load.append(os.getloadavg()[0])
    for report in reports:
        report["lost"] = report["frames_accepted"] + report["keepalives"] - report["samples_received"]
    if as_json:
        report = reports[0] | {"load": load}
        click.echo(json.dumps(report if fingers == 1 else {"fingers": reports, "load": load}))
    else:
        _print(reports, f"{minutes:g} minutes at {rate:g} frames/s", load)
    sys.exit(1 if any(report["lost"] or report["gaps"] for report in reports) else 0)


def _print(reports: list[dict[str, Any]], title: str, load: list[float]) -> None:
    table = Table(title, *(f"finger {k + 1}" if len(reports) > 1 else "" for k in range(len(reports))))
    for key in (
        "frames_offered", "dropped_at_tare", "dropped_after", "frames_accepted", "samples_sent",
        "samples_received", "gaps", "lost", "p50_us", "p99_us", "p999_us", "max_us", "over_2ms",
        "over_3ms", "cpu_share", "startup_s", "startup_cpu_s", "values_s", "rss_mb", "pss_mb", "frames_mb",
    ):  # fmt: skip
        values = [report[key] for report in reports]
        table.add_row(key, *(f"{value:,}" if isinstance(value, int) else f"{value:,.2f}" for value in values))
    over_time = [report["rss_over_time_mb"] for report in reports]
    if all(over_time):
        table.add_row("rss first, last", *(f"{mb[0]:.1f}, {mb[-1]:.1f}" for mb in over_time))
    Console().print(table)
    images_mb, pss_mb = reports[0]["frames_mb"], sum(report["pss_mb"] for report in reports)
    cpu = sum(report["cpu_share"] for report in reports)
    Console().print(
        f"together {pss_mb:.0f} MB, {images_mb:.0f} MB of them the images; {cpu:.2f} of a core; "
        f"load before {load[0]:.1f}, after {load[1]:.1f}"
    )


if __name__ == "__main__":
    command()
