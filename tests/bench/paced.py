"""The running program at a camera's rate for minutes: latency, memory, losses.

    python -m tests.bench paced --minutes 10
    python -m tests.bench paced --minutes 1 --fingers 5    as fingers on one board: what they take together
    python -m tests.bench paced --minutes 1 --viewers 2 --record    with viewers of the page, and recorded

A separate process runs the loop as `python -m edge run` composes it: paced source, calibration, all
features but the surface, CANopen node, CAN FD frames of the kernel, and a listener. Latency is from the
moment the frame was due to after the bus has taken the sample, so that the pacing thread's own wake-up is
included. The images are in memory (their size is reported): a camera would have a few buffers. Python's
bytecode is there before the start, as pip leaves it on a board.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import click
import numpy as np

from tests.bench.frames import calibration_of, scene, there_and_back
from tests.bench.output import ROOT, show

#: Keys of a report that are shown.
SHOWN = (
    "frames_offered", "dropped_at_tare", "dropped_after", "frames_accepted", "samples_sent",
    "samples_received", "gaps", "lost", "p50_us", "p99_us", "p999_us", "max_us",
    "cpu_share", "startup_s", "values_s", "rss_mb", "rss_first_mb", "pss_mb", "frames_mb",
    "unrecorded", "page_cpu_share", "page_rss_mb",
)  # fmt: skip


def run_children(fingers_n: int, seconds: float, **options: Any) -> list[dict[str, Any]]:
    """Run loops at once, a process each, as fingers on one board; begun together. Reports of `paced_child`.

    options  of `paced_child`
    """
    images, rest_n = there_and_back("press")
    with tempfile.TemporaryDirectory() as folder:
        file, tip = Path(folder) / "frames.npy", Path(folder) / "tip.json"
        np.save(file, images)
        calibration_of(scene("press")).save(tip)
        environment = _with_bytecode()
        options |= {"frames": str(file), "rest_n": rest_n, "seconds": seconds, "calibration": str(tip)}
        options["started_s"] = time.monotonic()

        def of_finger(node: int) -> dict[str, Any]:
            return {"node": node, "record": f"{folder}/{node}.mcap" if options.get("record") else ""}

        runs = [
            subprocess.Popen(
                [sys.executable, "-m", "tests.bench.paced_child", json.dumps(options | of_finger(node))],
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
    reports = [dict(json.loads(text.splitlines()[-1])) for text in printed]
    for report in reports:
        report["lost"] = report["frames_accepted"] + report["keepalives"] - report["samples_received"]
    return reports


def _with_bytecode() -> dict[str, str]:
    """The environment of a process that finds the bytecode of all that it imports."""
    environment = os.environ | {"PYTHONPYCACHEPREFIX": str(ROOT / "out" / "bytecode")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    subprocess.run(
        [sys.executable, "-c", "import tests.bench.paced_child"], cwd=ROOT, env=environment, check=True
    )
    return environment


@click.command()
@click.option("--minutes", type=click.FloatRange(min=0.02), default=10.0, show_default=True)
@click.option("--rate", type=click.FloatRange(1, 2000), default=240.0, show_default=True, help="Frames/s.")
@click.option("--realtime", is_flag=True, help="Scheduled as by deploy/realtime.conf (needs root).")
@click.option("--fingers", type=click.IntRange(1, 16), default=1, show_default=True, help="At once.")
@click.option("--viewers", type=click.IntRange(0, 16), default=0, show_default=True, help="Of the page.")
@click.option("--record", is_flag=True, help="Record all images and values.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def command(minutes: float, rate: float, fingers: int, as_json: bool, **options: Any) -> None:
    """The running program at a camera's rate. Exit code 1: a frame that it accepted was lost."""
    load = [os.getloadavg()[0]]
    reports = run_children(fingers, 60.0 * minutes, rate_hz=rate, **options)
    load.append(os.getloadavg()[0])
    if as_json:
        made = reports[0] | {"load": load}
        click.echo(json.dumps(made if fingers == 1 else {"fingers": reports, "load": load}))
    else:
        show(
            [{"": key, **{f"finger {k + 1}": r.get(key) for k, r in enumerate(reports)}} for key in SHOWN],
            f"{minutes:g} minutes at {rate:g} frames/s",
        )
        pss_mb, cpu = (sum(report[key] for report in reports) for key in ("pss_mb", "cpu_share"))
        click.echo(
            f"together {pss_mb:.0f} MB, {reports[0]['frames_mb']:.0f} MB of them the images; "
            f"{cpu:.2f} of a core; load before {load[0]:.1f}, after {load[1]:.1f}"
        )
    sys.exit(1 if any(report["lost"] or report["gaps"] for report in reports) else 0)
