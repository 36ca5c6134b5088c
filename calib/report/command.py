"""`python -m calib report`: the paper's protocols on a simulated rig, published recordings if they are at
hand, every design choice against its alternatives; one page, PNGs and CSVs.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from calib.capture import capture, read_capture
from calib.curve import paper_curve
from calib.dataset import Dataset, open_dataset
from calib.evaluate import evaluate, predict
from calib.extract import DEMAND, LOOKS, Extract, executor, join_extracts
from calib.fit import Choice, fit
from calib.protocols import PROTOCOLS, Plan, Step
from calib.report import plots, slip, study
from calib.report.page import Page, model_table, write_page
from calib.report.pairs import RESOLVED, pairs, resolvable_mm, shares
from calib.rig.base import CLEAR, Pose
from calib.rig.simulated import SimulatedRig, Simulation, load_simulation
from calib.sim import Tool
from edge.calibration import Calibration
from edge.pipeline import Pipeline, Result
from edge.types import Array, Frame

Rows = NDArray[np.intp]
HELD_OUT = 0.2  # share of random poses that the fit does not see
STUDY_FRAMES = 12  # of each alternative: medians settle
NETWORK = (
    "depth 0.148 mm, tilt 1.27 and 1.45 deg, shear 1.22 and 1.19 mm, torsion 1.60 deg, direction 25.9 deg"
)


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


@dataclass(frozen=True, slots=True)
class Check:
    """What must hold, and whether it does."""

    what: str
    limit: float
    measured: float
    unit: str
    at_least: bool = False

    @property
    def holds(self) -> bool:
        return self.measured >= self.limit if self.at_least else self.measured <= self.limit


@dataclass(frozen=True, slots=True)
class Seen:
    """A data set and what the edge saw in it."""

    data: Dataset
    extract: Extract

    def fit(self, rows: Any = None) -> tuple[Calibration, list[Choice]]:
        targets, extract = self.data.targets, self.extract
        if rows is not None:
            targets, extract = targets.rows(rows), extract.rows(rows)
        return fit(self.data.rest, targets, extract, mm_per_px=None)

    def evaluate(self, calibration: Calibration, rows: Any = None) -> dict[str, Any]:
        targets, extract = self.data.targets, self.extract
        if rows is not None:
            targets, extract = targets.rows(rows), extract.rows(rows)
        return evaluate(calibration, targets, extract)

    def shear(self) -> Any:
        values = self.data.targets.values
        return values["shear_x_mm"] + 1j * values["shear_y_mm"]


def report(
    out: Path,
    captures: Path,
    sim: Path | None,
    real: Path | None,
    *,
    workers: int | None,
    dask: str | None,
) -> None:
    """Capture what is missing, fit, judge, write the page, print what must hold."""
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
        resume=True,
        on_frame=lambda step, done: bar.update(task, completed=done),
    )


def _see(tables: list[Path], folder: Path | None, pool: Executor, bar: Progress) -> Seen:
    frames, rest = (folder / "frames", folder / "rest.png") if folder else (None, None)
    data = open_dataset(tables, frames, rest)
    task = bar.add_task(f"look at {tables[0].stem}", total=len(data))
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
) -> tuple[list[Check], list[study.Row]]:
    """Write the page, its pictures and tables."""
    page, checks = Page("Calibration report"), []
    summary = page.section("What must hold, and what was measured")
    checks += _paper(page, out, seen)
    checks += _tilted(page, seen["surface"])
    checks += _contacts(page, out, seen)
    checks += _slip(page, slipped)
    if published is not None:
        _real(page, out, published)
    rows = _study(page, out, captures, seen, published)
    summary.text(
        "Simulated rig: 331 pins, 640x480 images with a small webcam's noise. Errors are mean absolute "
        "errors on "
        "frames that the fit has not seen."
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
    with (out / "checks.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("what", "limit", "measured", "unit", "at_least"))
        writer.writerows(astuple(check) for check in checks)
    return checks, rows


def _every(n: int, first: int) -> Rows:
    return np.arange(first, n, 2)


def _paper(page: Page, out: Path, seen: dict[str, Seen]) -> list[Check]:
    """Displacement, shear and direction as the paper does them: every second frame fits, the others judge."""
    section = page.section("The paper's protocols")
    press, shear, round_ = seen["displacement"], seen["shear"], seen["direction"]
    both = Seen(
        Dataset((*press.data.parts, *shear.data.parts)),
        join_extracts([press.extract, shear.extract]),
    )
    calibration, choices = both.fit(_every(len(both.data), 0))
    on_press = press.evaluate(calibration, _every(len(press.data), 1))
    on_shear = shear.evaluate(calibration, _every(len(shear.data), 1))
    on_round = round_.evaluate(calibration)
    depth = press.data.targets.values["displacement_mm"]
    volume = press.extract.inputs[:, 0].real
    curve = paper_curve(volume, depth)
    moved = np.abs(shear.extract.inputs[:, 1]) * shear.data.rest.pattern.tip_radius_px
    line = plots.curves(
        out / "curves.png", volume, depth, np.array(curve.knots), moved, np.abs(shear.shear())
    )
    section.text(
        "Calibration curves (paper, Fig. 10): volume of deformation over displacement, mean motion of the "
        f"pins over shear. The line misses zero by {line['offset_px']:+.2f} px, unsheared frames read "
        f"{line['at_rest_px']:.2f} px. An offset of unsheared frames is preload, as in the paper; the models "
        "carry it as their constant term, and follow the bend that the line does not."
    )
    section.picture(out / "curves.png", "displacement and shear curves")
    values, _ = predict(calibration, round_.extract)
    read = values["shear_x_mm"] + 1j * values["shear_y_mm"]
    mean = plots.directions(out / "directions.png", round_.shear(), read)
    section.text(
        "Direction (paper, Fig. 11): 36 directions, 10 frames each, read by a calibration that saw shear "
        "along x "
        "alone. A round tip does not care which way it is sheared, so its models cannot either."
    )
    section.picture(out / "directions.png", "true and read directions")
    model_table(section, choices)
    return [
        Check("direction of shear, mean (36 directions)", 1.0, mean, "deg"),
        Check("displacement, 0..5 mm", 0.03, on_press["displacement_mae_mm"], "mm"),
        Check("shear magnitude, 0..2 mm along x", 0.03, on_shear["shear_magnitude_mae_mm"], "mm"),
        Check("shear magnitude, 2 mm all round", 0.03, on_round["shear_magnitude_mae_mm"], "mm"),
    ]


def _split(n: int) -> tuple[Rows, Rows]:
    order = np.random.default_rng(0).permutation(n)
    held = round(HELD_OUT * n)
    return order[held:], order[:held]


def _tilted(page: Page, surface: Seen) -> list[Check]:
    section = page.section("Tilted and off-centre contact")
    train, test = _split(len(surface.data))
    calibration, choices = surface.fit(train)
    result = surface.evaluate(calibration, test)
    section.text(
        f"{len(train)} random poses on a flat surface fit, {len(test)} others judge: depth 1..5 mm, tilt up "
        f"to "
        "15 deg about both axes (the contact wanders up to 7 mm off the tip's axis), shear up to 2 mm per "
        "axis, twist up "
        "to 5 deg."
    )
    names = (
        "displacement_mae_mm",
        "shear_magnitude_mae_mm",
        "shear_direction_mean_deg",
        "shear_direction_median_deg",
        "torsion_mae_deg",
        "force_mae_n",
        "contact_area_mae_mm2",
        "sigma_coverage_68",
    )
    rows = [(name, "-" if result[name] is None else f"{result[name]:.3g}") for name in names]
    section.table(("held-out frames", "error"), rows)
    model_table(section, choices)
    flat_one = float((surface.extract.counts == 1).mean()) * 100.0
    return [
        Check(
            "direction of shear, tilt to 15 deg, off centre", 3.0, result["shear_direction_mean_deg"], "deg"
        ),
        Check("flat contacts found as one", 99.0, flat_one, "%", at_least=True),
    ]


def _contacts(page: Page, out: Path, seen: dict[str, Seen]) -> list[Check]:
    section = page.section("Contact places")
    probes = seen["contacts"]
    rows = probes.data.rows
    tool = np.array([row["tool"] for row in rows])
    gap = np.array([float(row["tool_distance_mm"]) for row in rows])
    calibration, choices = probes.fit()
    place = next(c for c in choices if c.outputs[0] == "contact_x_mm")
    values = probes.data.targets.values
    true = values["contact_x_mm"] + 1j * values["contact_y_mm"]
    used = np.isfinite(true) & np.isfinite(probes.extract.contact[:, 0])
    scale = (calibration.mm_per_px or math.nan) * probes.data.rest.pattern.tip_radius_px
    raw = probes.extract.contact[used, 0] * scale
    plots.place_map(out / "places.png", true[used], raw, place.held_out)
    off = float(np.abs(place.held_out - true[used]).mean())
    section.text(
        "A probe of 1.5 mm radius pressed 2 mm deep, on a 3 mm grid; each place is read by a calibration "
        "that has not "
        "seen it."
    )
    section.picture(out / "places.png", "error of the contact's place over the tip")
    single = float((probes.extract.counts[tool == "sphere"] == 1).mean()) * 100.0
    apart = seen["pairs"]
    apart_mm = np.array([float(row["tool_distance_mm"]) for row in apart.data.rows])
    found = shares(apart_mm, apart.extract.counts)
    plots.apart(out / "pairs.png", found)
    section.text(
        "Two probes of 1 mm radius, 2 mm deep, anywhere within 5 mm of the axis and any way round: resolved "
        f"(found as two in {RESOLVED:g} % of the frames and more) from {resolvable_mm(found):g} mm on. The "
        f"pins are {_pitch_mm(calibration, apart):.1f} mm apart."
    )
    section.picture(out / "pairs.png", "share of pairs found as one, two, more, over their distance")
    section.table(
        ("distance, mm", "one, %", "two, %", "more, %"),
        [tuple(f"{value:g}" if i == 0 else f"{value:.0f}" for i, value in enumerate(row)) for row in found],
    )
    by_gap = {d: probes.extract.counts[(tool == "two") & (gap == d)] for d in (4.0, 5.0)}
    bars = seen["edges"]
    angle = np.array([float(row["tool_angle_deg"]) for row in bars.data.rows])
    turned = np.abs((np.degrees(bars.extract.angle_rad) - angle + 90.0) % 180.0 - 90.0)
    one_bar = float((bars.extract.counts == 1).mean()) * 100.0
    section.text(
        f"A bar in 18 directions, through the middle and beside it: direction off by "
        f"{np.nanmean(turned):.2f} deg in the "
        f"mean, {np.nanmax(turned):.2f} at the most; {one_bar:.0f} % found as one contact."
    )
    model_table(section, choices)
    return [
        Check("place of a single contact, mean over the tip", 0.2, off, "mm"),
        Check("single probes found as one", 99.0, single, "%", at_least=True),
        Check(
            "probes 4 mm apart found as two", 99.0, float((by_gap[4.0] == 2).mean()) * 100, "%", at_least=True
        ),
        Check(
            "probes 5 mm apart found as two", 99.0, float((by_gap[5.0] == 2).mean()) * 100, "%", at_least=True
        ),
        Check(
            "random pairs 4 mm apart and more found as two",
            RESOLVED,
            float((apart.extract.counts[apart_mm >= 4.0] == 2).mean()) * 100,
            "%",
            at_least=True,
        ),
        Check(
            "random pairs 2 mm apart found as one",
            RESOLVED,
            float((apart.extract.counts[apart_mm == 2.0] == 1).mean()) * 100,
            "%",
            at_least=True,
        ),
        Check(
            "a third contact beside two probes",
            0.0,
            float((np.concatenate([probes.extract.counts, apart.extract.counts]) > 2).mean()) * 100,
            "%",
        ),
        Check("direction of a long contact, mean", 3.0, float(np.nanmean(turned)), "deg"),
    ]


def _pitch_mm(calibration: Calibration, seen: Seen) -> float:
    return (calibration.mm_per_px or math.nan) * seen.data.rest.pattern.pitch_px


def _slip(page: Page, slipped: list[slip.Slipped]) -> list[Check]:
    section = page.section("Slip")
    every = slip.outcome(slip.join(slipped))
    section.text(
        f"A tool pressed {slip.DEPTH_MM:g} mm deep is dragged {slip.WAY_MM:g} mm in a second at "
        "several frictions, until it creeps (slides in part, from the contact's rim inwards) and then "
        "glides. Slip counts as felt at a probability over one half. Gliding moves no pin: no camera behind "
        "the skin sees it. What is felt is the creep before it: "
        f"{every.felt_percent:.0f} % of its frames; the speed read there is the skin's own motion against "
        f"itself, {every.read_mm_s:.2f} mm/s where the tool runs at {every.true_mm_s:.2f} mm/s over the "
        "contact in the mean."
    )
    rows = []
    for one, seen in zip(slip.DRAGS, slipped, strict=True):
        o = slip.outcome(seen)
        numbers = (o.false_percent, o.felt_percent, o.glide_percent, 100.0 * o.felt_from)
        speeds = (o.true_mm_s, o.read_mm_s)
        cells = [f"{v:.0f}" for v in numbers] + [f"{v:.2f}" for v in speeds]
        cells = ["-" if cell == "nan" else cell for cell in cells]
        rows.append((one.tool.kind, f"{one.friction:g}", *cells))
    section.table(
        ("tool", "friction", "felt while it sticks, %", "while it creeps, %", "while it glides, %",
         "first felt when so much slides, %", "tool over skin, mm/s", "read, mm/s"),
        rows,
    )  # fmt: skip
    return [Check("slip felt while the contact sticks", 1.0, every.false_percent, "%")]


def _real(page: Page, out: Path, published: Seen) -> None:
    section = page.section("Published recordings")
    train, test = _split(len(published.data))
    calibration, choices = published.fit(train)
    result = published.evaluate(calibration, test)
    values, sigmas = predict(calibration, published.extract.rows(test))
    true = {name: column[test] for name, column in published.data.targets.values.items()}
    plots.real_scatter(out / "real.png", true, values, sigmas)
    section.text(
        f"One random split: {len(train)} frames fit, {len(test)} judge (five splits: python -m tests.bench "
        f"real). The "
        f"network published with the set: {NETWORK}. Direction here: "
        f"{result['shear_direction_mean_deg']:.1f} deg mean, "
        f"{result['shear_direction_median_deg']:.1f} median. One-sigma intervals hold "
        f"{100 * result['sigma_coverage_68']:.0f} % of the values. {result['n_refused']} frames refused."
    )
    section.picture(out / "real.png", "read against true values on held-out frames")
    model_table(section, choices)


def _study(
    page: Page, out: Path, captures: Path, seen: dict[str, Seen], published: Seen | None
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
    judged = published or seen["surface"]
    rows += study.shear_models(judged.data.rest, judged.data.targets, judged.extract)
    plots.trade(out / "trade.png", rows)
    section.text(
        "Each step's alternatives on the same frames; the star is what is in use. The line joins what "
        "nothing else beats "
        f"in both. Shear: held-out frames of "
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
    with (out / "trade.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("step", "alternative", "time_us", "error", "unit", "in_use"))
        writer.writerows(
            (r.stage, r.choice, f"{r.time_us:.2f}", f"{r.error:.6g}", r.unit, int(r.chosen)) for r in rows
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
        for _ in range(LOOKS):  # a jump, and held: as `calib.extract.measure` has it
            result = pipeline.process(frame, even_unsure=True)
        results.append(result)
    return results
