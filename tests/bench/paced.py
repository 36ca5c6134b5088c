"""The running program at a camera's rate for minutes: latency, memory, losses.

    python -m tests.bench paced --minutes 10
    python -m tests.bench paced --minutes 1 --busy    with the other core (or all of them) kept busy

A separate process runs the loop as `python -m edge run` composes it: paced source, calibration, all
features but the surface, CANopen node, virtual CAN FD bus, and a listener on that bus. Latency is from the
moment the frame was due to after the bus has taken the sample, so that the pacing thread's own wake-up is
included. The images are in memory (their size is reported): a camera would have a few buffers.
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

__all__ = ["command", "run_child"]

HERE = Path(__file__).parent


def run_child(
    seconds: float, rate_hz: float = 240.0, every_s: float = 0.0, name: str = "press", realtime: bool = False
) -> dict[str, Any]:
    """Run the loop in its own process; returns the report of `paced_child`."""
    frames = scene(name)
    images = np.stack([frame.image for frame in frames])
    touched = images[REST_FRAMES:]
    images = np.concatenate([images[:REST_FRAMES], touched, touched[-2:0:-1]])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "frames.npy"
        np.save(file, images)
        calibration_of(frames).save(Path(folder) / "tip.json")
        options = {
            "frames": str(file), "rest_n": REST_FRAMES, "seconds": seconds, "rate_hz": rate_hz,
            "realtime": realtime, "calibration": str(Path(folder) / "tip.json"),
            "started_s": time.monotonic(),
        } | ({"every_s": every_s} if every_s else {})  # fmt: skip
        run = subprocess.run(
            [sys.executable, "-m", "tests.bench.paced_child", json.dumps(options)],
            cwd=HERE.parent.parent, stdout=subprocess.PIPE, text=True, check=True,
        )  # fmt: skip
    return dict(json.loads(run.stdout.splitlines()[-1]))


def _burn() -> None:
    while True:
        sum(range(10_000))


@click.command()
@click.option("--minutes", type=click.FloatRange(min=0.02), default=10.0, show_default=True)
@click.option("--rate", type=click.FloatRange(1, 2000), default=240.0, show_default=True, help="Frames/s.")
@click.option("--busy", is_flag=True, help="Keep another core busy meanwhile.")
@click.option("--realtime", is_flag=True, help="Scheduled as by deploy/realtime.conf (needs root).")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def command(minutes: float, rate: float, busy: bool, realtime: bool, as_json: bool) -> None:
    """The running program at a camera's rate. Exit code 1: a frame that it accepted was lost."""
    burner = multiprocessing.get_context("spawn").Process(target=_burn, daemon=True) if busy else None
    if burner is not None:
        burner.start()
    load = [os.getloadavg()[0]]
    try:
        report = run_child(
            60.0 * minutes, rate, 0.0 if as_json else max(1.0, minutes * 60.0 / 20.0), realtime=realtime
        )
    finally:
        if burner is not None:
            burner.terminate()
    load.append(os.getloadavg()[0])
    report["load"] = load
    report["lost"] = report["frames_accepted"] - report["samples_received"]
    if as_json:
        click.echo(json.dumps(report))
    else:
        table = Table(f"{minutes:g} minutes at {rate:g} frames/s", "")
        for key in (
            "frames_offered", "dropped_at_tare", "dropped_after", "frames_accepted", "samples_sent",
            "samples_received", "gaps", "lost", "p50_us", "p99_us", "p999_us", "max_us", "over_2ms",
            "over_3ms", "cpu_share", "startup_s", "rss_mb", "frames_mb",
        ):  # fmt: skip
            value = report[key]
            table.add_row(key, f"{value:,}" if isinstance(value, int) else f"{value:,.2f}")
        heavy = report["rss_over_time_mb"]
        if heavy:
            table.add_row("rss first, last", f"{heavy[0]:.1f}, {heavy[-1]:.1f}")
        table.add_row("load before, after", f"{load[0]:.1f}, {load[1]:.1f}")
        Console().print(table)
    sys.exit(1 if report["lost"] or report["gaps"] else 0)


if __name__ == "__main__":
    command()
