"""`python -m calib report`: the paper's protocols on a simulated rig, published recordings if they are at
hand, every design choice against its alternatives; one page, PNGs and CSVs.
"""

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import astuple
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from calib.capture import capture, read_capture
from calib.dataset import open_dataset
from calib.evaluate import predict
from calib.extract import DEMAND, REPEATS, executor
from calib.protocols import PROTOCOLS, Plan, Step
from calib.report import plots, sections, slip, study
from calib.report.page import ReportPage, write_page, write_table
from calib.report.pairs import pairs
from calib.report.sections import Requirement, Seen
from calib.rig.base import CLEAR, Pose
from calib.rig.simulated import SimulatedRig, Simulation, load_simulation
from calib.sim import Tool
from edge.frame import Pipeline
from edge.types import Array, Frame, Result

STUDY_FRAMES = 12  # of each alternative: medians settle


def edges() -> Plan:
    """A bar 2 mm deep in 18 directions, through the middle and 3 mm beside it; 2 frames each."""
    steps = [Step(CLEAR, Tool("edge", 1.5), 10, "rest")]
    for angle in range(0, 180, 10):
        bar = Tool("edge", radius_mm=1.5, angle_deg=float(angle))
        for off in (0.0, 3.0):
            a = math.radians(angle)
            pose = Pose(x_mm=-off * math.sin(a), y_mm=off * math.cos(a), depth_mm=2.0)
            steps += [Step(CLEAR, bar, 0), Step(pose, bar, 2)]
    return Plan("edges", tuple(steps))


PLANS: dict[str, Callable[[], Plan]] = {**PROTOCOLS, "edges": edges, "pairs": pairs}


def report(
    out: Path,
    captures: Path,
    sim: Path | None,
    real: Path | None,
    *,
    workers: int | None,
    dask: str | None,
) -> None:
    """Capture what is missing, fit, evaluate, write the page, print the limits."""
    simulation = load_simulation(sim)
    for folder in (out, captures):
        folder.mkdir(parents=True, exist_ok=True)
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=console) as bar, executor(dask, workers) as pool:
        for name, plan in PLANS.items():
            _captured(captures / f"{name}.mcap", plan(), simulation, bar)
        seen = {name: _see([captures / f"{name}.mcap"], None, pool, bar) for name in PLANS}
        published = _see([real / "targets.csv"], real, pool, bar) if real is not None else None
        slipped = _drags(simulation, pool, bar)
        checks, rows = make_report(out, captures, seen, slipped, published)
    for check in checks:
        mark = "holds" if check.holds else "MISSES"
        sign = ">=" if check.at_least else "<="
        click.echo(f"{mark:7} {check.what:62} {check.measured:8.4g} {sign} {check.limit:g} {check.unit}")
    click.echo(f"{out / 'index.html'}: {len(rows)} alternatives compared")


def _captured(path: Path, plan: Plan, simulation: Simulation, bar: Progress) -> None:
    if path.with_suffix(".csv").is_file():
        return
    task = bar.add_task(f"capture {plan.name}", total=plan.n_frames)
    capture(
        lambda first: SimulatedRig(simulation, first),
        plan,
        path,
        resume=path.exists(),
        on_frame=lambda step, done: bar.update(task, completed=done),
    )


def _see(tables: list[Path], folder: Path | None, pool: Executor, bar: Progress) -> Seen:
    frames, rest = (folder / "frames", folder / "rest.png") if folder else (None, None)
    data = open_dataset(tables, frames, rest)
    task = bar.add_task(f"process {tables[0].stem}", total=len(data))
    return Seen(data, data.extract(pool, lambda n: bar.advance(task, n)))


def _drags(simulation: Simulation, pool: Executor, bar: Progress) -> list[slip.Slipped]:
    """One after the other in the picture, side by side on the processors."""
    running = [pool.submit(slip.drag, simulation, one) for one in slip.DRAGS]
    task = bar.add_task("drag until it slides", total=len(running))
    done = []
    for future in running:
        done.append(future.result())
        bar.advance(task)
    return done


def make_report(
    out: Path,
    captures: Path,
    seen: dict[str, Seen],
    slipped: list[slip.Slipped],
    published: Seen | None,
) -> tuple[list[Requirement], list[study.Row]]:
    """Write the page, its pictures and tables."""
    page, checks = ReportPage("Calibration report"), []
    summary = page.section("What must hold, and what was measured")
    checks += sections.paper(page, out, seen)
    checks += sections.tilted(page, seen["surface"])
    checks += sections.contacts(page, out, seen)
    checks += sections.slips(page, slipped)
    if published is not None:
        sections.real(page, out, published)
    rows = _study(page, out, captures, seen, published)
    summary.text(
        "Simulated rig: 331 pins, 640x480 images with a small webcam's noise. Errors are mean absolute "
        "errors on frames that the fit has not seen."
    )
    summary.table(
        ("", "limit", "measured", "unit", ""),
        [
            (
                c.what,
                f"{'>=' if c.at_least else '<='} {c.limit:g}",
                f"{c.measured:.3g}",
                c.unit,
                "holds" if c.holds else "misses",
            )
            for c in checks
        ],
        marked=[not c.holds for c in checks],
    )
    write_page(page, out / "index.html")
    write_table(out / "checks.csv", ("what", "limit", "measured", "unit", "at_least"), map(astuple, checks))
    return checks, rows


def _study(
    page: ReportPage, out: Path, captures: Path, seen: dict[str, Seen], published: Seen | None
) -> list[study.Row]:
    section = page.section("Speed against error")
    press, probes = seen["displacement"], seen["contacts"]
    rest = press.data.rest
    steps, depths = _first_of_each(captures / "displacement.mcap")
    results = _results(rest, steps)
    rows = study.detectors(rest, steps[:: max(1, len(steps) // STUDY_FRAMES)])
    rows += study.tessellations(rest, results[:: max(1, len(results) // STUDY_FRAMES)])
    pressed = [i for i, r in enumerate(results) if r.features is not None and r.features.in_contact]
    rows += study.surfaces(rest, [results[i] for i in pressed], depths[pressed])
    singles, _ = _first_of_each(captures / "contacts.mcap", "sphere")
    calibration, _ = probes.fit()
    spots = _results(probes.data.rest, singles)
    steps_of = [row["step"] for row in probes.data.rows]
    first = [
        i
        for i, row in enumerate(probes.data.rows)
        if row["tool"] == "sphere" and (i == 0 or steps_of[i - 1] != row["step"])
    ]
    values, _ = predict(calibration, probes.extract.rows(first))
    read = np.column_stack([values["contact_x_mm"], values["contact_y_mm"]])
    rows += study.places(probes.data.rest, spots, probes.data.targets.rows(first), read)
    shown = published or seen["surface"]
    rows += study.shear_models(shown.data.rest, shown.data.targets, shown.extract)
    plots.trade(out / "trade.png", rows)
    section.text(
        "Each step's alternatives on the same frames; the star is what is in use. The line joins what "
        "nothing else beats in both. Shear: held-out frames of "
        f"{'the published recordings' if published else 'random tilted poses'}; the "
        "rest: the simulated rig, against its truth."
    )
    section.picture(out / "trade.png", "time and error of every alternative")
    section.table(
        ("step", "alternative", "time, us", "error", "", "why it is in use"),
        [(r.stage, r.choice, f"{r.time_us:.3g}", f"{r.error:.3g}", r.unit, r.why) for r in rows],
        marked=[r.chosen for r in rows],
        numbers_from=9,
    )
    write_table(
        out / "trade.csv",
        ("step", "alternative", "time_us", "error", "unit", "in_use"),
        ((r.stage, r.choice, f"{r.time_us:.2f}", f"{r.error:.6g}", r.unit, int(r.chosen)) for r in rows),
    )
    return rows


def _first_of_each(capture_path: Path, tool: str | None = None) -> tuple[list[Frame], Array]:
    """The first frame of every step, and its depth, mm."""
    frames, depths, last = [], [], None
    for frame, row in read_capture(capture_path):
        if row["role"] == "rest" or row["step"] == last or tool not in (None, row["tool"]):
            continue
        last = row["step"]
        frames.append(frame)
        depths.append(float(row["pose_z"]))
    return frames, np.array(depths)


def _results(rest: Any, frames: list[Frame]) -> list[Result]:
    pipeline = Pipeline(rest, demand=DEMAND)
    results = []
    for frame in frames:
        pipeline.forget()
        for _ in range(REPEATS):  # a jump, then repeated: as in `calib.extract.measure`
            result = pipeline.process(frame, even_untrusted=True)
        results.append(result)
    return results
