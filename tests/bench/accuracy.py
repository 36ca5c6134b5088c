"""`python -m tests.bench accuracy`: instructions of a frame against its error, for each kind of model.

Models are fitted to 480 of the published recordings; the other 120 judge them. Instructions are those of the
same recordings, whole: from the image to the calibrated values.

The paper's method is `tests.bench.reference`, with a curve of its volume for the depth and a linear function
of its mean motion for the shear. It follows pins from frame to frame and cannot follow a still's jump: the
places of the pins are given to it. It has no tilt and no torsion.
"""

import os
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import cv2
import matplotlib.pyplot as plt
import numpy as np
from rich.progress import track

from calib.evaluate import evaluate
from calib.extract import DEMAND, Extract, executor, extract
from calib.fit import ModelKind, Search, fit
from calib.targets import Targets
from edge.calibration import Calibration
from edge.calibration.inputs import FRAME_INPUTS
from edge.frame import Pipeline
from edge.sources.files import read_image
from edge.types import Feature, Frame, Image, Rest
from tests.bench.counter import counted as count_between_marks
from tests.bench.frames import GRASP
from tests.bench.output import show, write_json, writes_results
from tests.bench.real import NETWORK, row, splits
from tests.bench.recordings import TIP_331, real_option, tip_331
from tests.bench.reference import Reference

COUNTED = 4  # stills whose instructions are counted
ROUNDS = 4  # of each
#: Errors by name of the value: the columns of a report that are averaged, and what it is a part of.
ERRORS = {
    "depth mm": ((0,), Feature.DISPLACEMENT), "tilt deg": ((1, 2), Feature.TILT),
    "shear mm": ((3, 4), Feature.SHEAR), "torsion deg": ((7,), Feature.TORSION),
}  # fmt: skip
PUBLISHED = {name: float(np.mean([NETWORK[i] or 0.0 for i in at])) for name, (at, _) in ERRORS.items()}
PLAIN, POLYNOMIAL = frozenset({ModelKind.PLAIN}), frozenset({ModelKind.POLYNOMIAL})
PROCESS = frozenset({ModelKind.PROCESS})


@dataclass(frozen=True)
class Configuration:
    """Models, and what is wanted of them."""

    name: str
    search: Search
    demand: frozenset[Feature] = DEMAND


CONFIGURATIONS = (
    Configuration("curve, plain mean", Search(kinds=PLAIN), GRASP),
    Configuration("polynomials", Search(kinds=POLYNOMIAL)),
    Configuration("polynomials; depth, shear", Search(kinds=POLYNOMIAL), GRASP),
    Configuration("processes, 12 terms", Search(kinds=PROCESS, terms_max=12)),
    Configuration("processes, 40 terms", Search(kinds=PROCESS, terms_max=40)),
    Configuration("processes", Search(kinds=PROCESS)),
    Configuration("processes; depth, shear", Search(kinds=PROCESS), GRASP),
)


def errors(report: dict[str, Any], demand: frozenset[Feature]) -> dict[str, float | None]:
    """Mean absolute errors, of x and y their mean; None: not in demand, or there is no such model."""
    values = row(report)
    found: dict[str, float | None] = {}
    for name, (columns, feature) in ERRORS.items():
        mean = float(np.mean([values[i] for i in columns]))
        found[name] = mean if feature in demand and np.isfinite(mean) else None
    return found


def as_the_paper(rest: Rest, targets: Targets, seen: Extract, untouched: Image) -> Extract:
    """The same frames with volume and mean motion as the reference finds them."""
    pipeline = Pipeline(rest, demand=DEMAND)
    reference = Reference(untouched, rest.pattern.pin_radius_px, rest_img=rest.xy_img)
    radius = rest.pattern.tip_radius_px
    inputs = seen.inputs.copy()
    for i, path in enumerate(track(targets.frames, "the paper's method")):
        image = read_image(path)
        pipeline.forget()
        reference.place(pipeline.process(Frame(image, 0, 0), even_untrusted=True).tracks.xy_img)
        found = reference.step(image)
        inputs[i, FRAME_INPUTS.index("volume")] = found.volume_px2 / (np.pi * radius**2)
        inputs[i, FRAME_INPUTS.index("shear")] = complex(*found.shear_px) / radius
    return replace(seen, inputs=inputs)


def instructions(calibrations: list[Calibration], stills: list[Image], rest: Image) -> list[int]:
    """Of a frame, the reference's first."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        np.savez(folder / "stills.npz", rest=rest, images=np.stack(stills))
        work = [("paper", DEMAND)]
        for i, (one, calibration) in enumerate(zip(CONFIGURATIONS, calibrations, strict=True)):
            file = folder / f"{i}.json"
            file.write_bytes(calibration.encoded)
            work.append((str(file), one.demand))

        def count(number: int) -> int:
            path, demand = work[number]
            names = ",".join(sorted(demand))
            child = ["tests.bench.accuracy_child", str(folder / "stills.npz"), path, names, str(ROUNDS)]
            frames = COUNTED * ROUNDS
            return count_between_marks(child, frames, folder / f"counts.{number}").instructions

        with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:  # threads wait for valgrind alone
            return list(track(pool.map(count, range(len(work))), "instructions", total=len(work)))


def models(
    rest: Rest, targets: Targets, seen: Extract, paper: Extract, size: int
) -> tuple[list[Calibration], list[dict[str, float | None]]]:
    """Calibrations of all configurations, and errors, those of the paper's method first.

    size  frames to fit to, the first ones; the others judge
    """
    fitted: dict[Search, Calibration] = {}
    train, test = range(size), range(size, len(targets))

    def fit_to(extract: Extract, search: Search) -> Calibration:
        return fit(rest, targets.rows(train), extract.rows(train), mm_per_px=None, search=search)[0]

    def errors_of(
        extract: Extract, calibration: Calibration, demand: frozenset[Feature]
    ) -> dict[str, float | None]:
        return errors(evaluate(calibration, targets.rows(test), extract.rows(test)), demand)

    found = [errors_of(paper, fit_to(paper, Search(kinds=PLAIN)), GRASP)]
    for one in track(CONFIGURATIONS, "models"):
        if one.search not in fitted:
            fitted[one.search] = fit_to(seen, one.search)
        found.append(errors_of(seen, fitted[one.search], one.demand))
    return [fitted[one.search] for one in CONFIGURATIONS], found


def accuracy_plot(rows: list[dict[str, Any]], errors: dict[str, float], path: Path) -> None:
    """Error over instructions of a frame, a panel for each value, each point with its name.

    errors  name of each value, and an error to compare with: a dashed line
    """
    least = min(row["instructions"] for row in rows) / 1e6
    figure, axes = plt.subplots(1, len(errors), figsize=(13, 3.6), sharex=True, layout="constrained")
    for axis, (name, published) in zip(axes, errors.items(), strict=True):
        points = [
            (row[name], row["instructions"] / 1e6, row["name"]) for row in rows if row[name] is not None
        ]
        highest = 1.2 * max([published, *(error for error, _, _ in points)])
        height = 0.0
        for error, at, text in sorted(points):
            axis.plot(at, error, "o", color="C0", markersize=5)
            if at > 10.0 * least:
                axis.annotate(text, (at, error), (0, 6), textcoords="offset points", ha="right", fontsize=7)
                continue
            height = max(
                error - 0.1 * highest, height + 0.05 * highest
            )  # names below each other, a line to the point
            line = {"arrowstyle": "-", "color": "0.7", "linewidth": 0.6, "relpos": (0, 0.5)}
            axis.annotate(text, (at, error), (4.0 * least, height), va="center", fontsize=7, arrowprops=line)
        axis.axhline(published, color="grey", linestyle="--", linewidth=1.0)
        axis.set(title=name, xlabel="million instructions a frame", xscale="log", ylim=(0, highest))
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("mean absolute error, held-out frames\n(dashed: a published network)")
    figure.savefig(path, dpi=110)
    plt.close(figure)


@click.command()
@real_option
@click.option("--frames", "size", type=click.IntRange(24, 480), default=480, help="To fit to.")
@click.option("--seed", type=click.IntRange(min=0), default=0, help="Of the split.")
@writes_results
def command(folder: Path, size: int, seed: int, out: Path) -> None:
    """Instructions per frame against error on held-out published frames: a table, JSON and a picture."""
    cv2.setNumThreads(1)
    plt.switch_backend("Agg")
    data = tip_331(folder)
    rest = read_image(folder / TIP_331 / "rest.png")
    train, test = splits(len(data.targets), seed)
    targets = data.targets.rows([*train[:size], *test])
    with executor(workers=1) as pool:
        seen = extract(data.rest, targets.frames, pool)
    paper = as_the_paper(data.rest, targets, seen, rest)
    calibrations, found = models(data.rest, targets, seen, paper, size)
    held_out = range(size, len(targets))
    stills = [read_image(targets.frames[i]) for i in held_out if seen.trusted[i]][:COUNTED]
    counts = instructions(calibrations, stills, rest)
    names = ["the paper's method", *(one.name for one in CONFIGURATIONS)]
    rows: list[dict[str, Any]] = [
        {"name": name, "instructions": n, "ratio": counts[0] / n, **errors_}
        for name, n, errors_ in zip(names, counts, found, strict=True)
    ]
    result = {"frames_fitted": size, "frames_held_out": len(held_out), "seed": seed, "configurations": rows}
    write_json(out / "accuracy.json", result)
    accuracy_plot(rows, PUBLISHED, out / "accuracy.png")
    show(rows)
