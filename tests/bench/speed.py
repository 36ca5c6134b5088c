"""Time per frame against the paper's method implemented directly.

    python -m tests.bench            tables
    python -m tests.bench --json     one JSON object on stdout, nothing else

Rules
- Pipeline and reference see the same frames in one process on one thread, alternating in blocks of eight
  frames. So both have the same load of the machine, and the pipeline has a cache that
  the reference has used, like after a camera's frame. The ratio is that of the medians. The clock
  is the thread's own processor time, so other programs do not count.
- A frame is everything from image to calibrated values, all features. What its parts take is counted, in
  instructions, by `tests.bench.step --top`.
"""

import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import click
import cv2
import numpy as np

from calib.sim.script import REST_FRAMES
from edge.calibration import Calibration
from edge.frame import ALL, Pipeline
from edge.rest.tare import take_rest_frame
from edge.types import Frame
from tests.bench.frames import calibration_of, scene
from tests.bench.output import show, write_json, writes_results
from tests.bench.reference import Reference

BLOCK = 8  # frames of each in turn
WARM = 24  # frames before anything is counted


def timed(into: list[float], work: Callable[[Any], Any], given: Any) -> Any:
    """The result; its time is appended, microseconds."""
    begun_ns = time.thread_time_ns()
    answer = work(given)
    into.append((time.thread_time_ns() - begun_ns) / 1e3)
    return answer


def measure(frames: list[Frame], calibration: Calibration) -> dict[str, list[float]]:
    """Microseconds of a frame: pipeline and reference in turn on the same frames."""
    rest = take_rest_frame([frame.image for frame in frames[:REST_FRAMES]], calibration=calibration).rest
    pipeline = Pipeline(rest, calibration, ALL)
    reference = Reference(frames[0].image, rest.pattern.pin_radius_px)
    for frame in frames[:WARM]:
        pipeline.process(frame)
        reference.step(frame.image)
    us: dict[str, list[float]] = {"pipeline": [], "reference": []}
    for at in range(WARM, len(frames), BLOCK):
        block = frames[at : at + BLOCK]
        for frame in block:
            result = timed(us["pipeline"], pipeline.process, frame)
            assert not result.searched, "the benchmark is to measure tracking"
        for frame in block:
            timed(us["reference"], reference.step, frame.image)
    return us


@click.command()
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
@writes_results
def command(as_json: bool, out: Path) -> None:
    """Time per frame, against the reference."""
    cv2.setNumThreads(1)
    frames = scene("tour")
    us = measure(frames, calibration_of(frames))
    rows = [
        {"331 pins, 640x480": who, "median us": median(times), "99 % us": float(np.percentile(times, 99))}
        for who, times in us.items()
    ]
    frame_us, reference_us = (median(us[who]) for who in ("pipeline", "reference"))
    report = {
        "ratio_331": reference_us / frame_us,
        "frame_us_331": frame_us,
        "reference_us_331": reference_us,
        "frames": len(us["pipeline"]),
        "load": os.getloadavg()[0],
    }
    write_json(out / "speed.json", report)
    if as_json:
        click.echo(json.dumps(report))
    else:
        show(rows, f"times faster than the reference: {report['ratio_331']:.1f}")
