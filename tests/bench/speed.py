"""Time per frame, by contact and demand, against the paper's method implemented directly.

    python -m tests.bench            tables
    python -m tests.bench --json     one JSON object on stdout, nothing else
    python -m tests.bench --quick    with fewer frames

Rules
- Pipeline and reference see the same frames in one process on one thread, alternating in blocks of eight
  frames. So both have the same load of the machine, and the pipeline has a cache that
  the reference has used, like after a camera's frame. The ratio is that of the medians. The clock of the
  pair is the thread's own processor time, so other programs do not count. All other
  times are wall-clock times.
- A frame is everything from image to calibrated values, all features. What its parts take is counted, in
  instructions, by `tests.bench.step --top`.
"""

import gc
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click
import cv2
import numpy as np

from calib.sim.script import REST_FRAMES
from edge.calibration import Calibration
from edge.frame import ALL, Pipeline
from edge.rest.tare import tare
from edge.types import Feature, Frame
from tests.bench.frames import GRASP, back_and_forth, calibration_of, scene
from tests.bench.output import show, write_json, writes_results
from tests.bench.paced import run_child
from tests.bench.reference import Reference

BLOCK = 8  # frames of each in turn
WARM = 24  # frames before anything is counted
#: The same demand without and with a contact.
FREE, FULL = "nothing touches, all (a viewer watches)", "contact, all (a viewer watches)"

Series = dict[str, list[float]]
T = TypeVar("T")


def spread(us: list[float]) -> dict[str, float]:
    """Median and tails, microseconds."""
    p50, p99, p999 = np.percentile(us, (50, 99, 99.9))
    return {"p50_us": float(p50), "p99_us": float(p99), "p999_us": float(p999), "n": len(us)}


def timed(into: list[float], clock_ns: Callable[[], int], work: Callable[[T], Any], given: T) -> Any:
    """The result; its time by this clock is appended, microseconds."""
    begun = clock_ns()
    answer = work(given)
    into.append((clock_ns() - begun) / 1e3)
    return answer


def started(
    frames: list[Frame], calibration: Calibration | None = None, demand: frozenset[Feature] = ALL
) -> Pipeline:
    """A pipeline that has taken its rest frame and tracks."""
    rest = tare([frame.image for frame in frames[:REST_FRAMES]], np.inf, calibration)
    pipeline = Pipeline(rest, calibration, demand)
    for frame in frames:
        pipeline.process(frame)
    return pipeline


def back_again(frames: list[Frame]) -> list[Frame]:
    """From the last frame back to the first that counts, and to the last again: without a jump."""
    return frames[-2 : WARM - 1 : -1] + frames[WARM + 1 :]


def pair(frames: list[Frame], calibration: Calibration) -> tuple[Series, Pipeline]:
    """Pipeline and reference in turn on the same frames."""
    pipeline = started(frames[:WARM], calibration)
    reference = Reference(frames[0].image, pipeline.rest.pattern.pin_radius_px)
    for frame in frames[:WARM]:
        reference.step(frame.image)
    times: Series = {"pipeline": [], "reference": []}
    for at in range(WARM, len(frames), BLOCK):
        block = frames[at : at + BLOCK]
        for frame in block:
            result = timed(times["pipeline"], time.thread_time_ns, pipeline.process, frame)
            assert not result.searched, "the benchmark is to measure tracking"
        for frame in block:
            timed(times["reference"], time.thread_time_ns, reference.step, frame.image)
    return times, pipeline


def whole(frames: list[Frame], pipeline: Pipeline, rounds: int) -> list[float]:
    """Frame after frame with the garbage collection of the loop."""
    us: list[float] = []
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        for _ in range(rounds):
            for frame in back_again(frames):
                timed(us, time.perf_counter_ns, pipeline.process, frame)
    finally:
        gc.enable()
        gc.unfreeze()
    return us


def demands(frames: list[Frame], calibration: Calibration, rounds: int) -> Series:
    """Time of a frame by contact and demand."""
    approach = frames[: REST_FRAMES + 8]  # down to where the contact is well developed
    touching = approach + back_and_forth(frames[len(approach) :], 3 * WARM)
    nothing = back_and_forth(frames[:REST_FRAMES], len(touching))
    cases = {
        name: (run, started(run, calibration, demand))
        for name, run, demand in (
            (FREE, nothing, ALL),
            ("contact, displacement and shear", touching, GRASP),
            ("contact, all but the surface", touching, ALL - {Feature.SURFACE}),
            (FULL, touching, ALL),
        )
    }
    out: Series = {name: [] for name in cases}
    for _ in range(rounds):  # in turn, so that the machine's other load affects all alike
        for name, (run, pipeline) in cases.items():
            out[name] += whole(run, pipeline, 1)
    return out


def measure(quick: bool) -> dict[str, Any]:
    """All results, for the JSON."""
    cv2.setNumThreads(1)
    frames = scene("press-shear" if quick else "tour")
    calibration = calibration_of(frames)
    times, pipeline = pair(frames, calibration)
    rounds = 1 if quick else 5
    alone = whole(frames, pipeline, rounds)
    by_demand = demands(scene("press"), calibration, 4 * rounds)
    frame_us, reference_us = (float(np.median(times[who])) for who in ("pipeline", "reference"))
    demand_us = {name: spread(us) for name, us in by_demand.items()}
    running = run_child(2.0 if quick else 5.0)
    return {
        "ratio_331": reference_us / frame_us,
        "frame_us_331": frame_us,
        "reference_us_331": reference_us,
        "p999_us_331": spread(alone)["p999_us"],
        "rss_mb": running["rss_mb"],
        "startup_s": running["startup_s"],
        "no_contact_share": demand_us[FREE]["p50_us"] / demand_us[FULL]["p50_us"],
        "load": os.getloadavg()[0],
        "paired": {who: spread(us) for who, us in times.items()},
        "alone": spread(alone),
        "demands": demand_us,
        "running": running,
    }


def tell_of(report: dict[str, Any]) -> None:
    """The report as tables."""
    times = {
        "whole frame, in turn with the reference": report["paired"]["pipeline"],
        "reference": report["paired"]["reference"],
        "whole frame, alone": report["alone"],
        **report["demands"],
    }
    show([{"331 pins, 640x480": name, **row} for name, row in times.items()])
    figures = {
        "times faster than the reference": report["ratio_331"],
        "frame without contact over full one": report["no_contact_share"],
        "memory of the running program, MB": report["rss_mb"],
        "start to first sample, s": report["startup_s"],
        "load of the machine": report["load"],
    }
    show([{"": name, "figure": value} for name, value in figures.items()])


@click.command()
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
@click.option("--quick", is_flag=True, help="Fewer frames.")
@writes_results
def command(as_json: bool, quick: bool, out: Path) -> None:
    """Time per frame, against the reference."""
    report = measure(quick)
    write_json(out / "speed.json", report)
    if as_json:
        click.echo(json.dumps(report))
    else:
        tell_of(report)
