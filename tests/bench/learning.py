"""`python -m tests.bench learning`: error over the number of frames, for polynomials and for processes.

The first so many frames of a random order are fitted, and others judge, always the same: 120 of the published
600, so that 480 are the most; with `--others` all of a second folder of the same tip, and 600 are the most.

    --adaptive   also processes of frames that are chosen as protocol `adaptive` chooses poses, among the
                 recordings: by their poses alone, what a frame shows is seen after it is chosen
    --simulated  800 random poses on the simulated rig instead, of which 200 judge
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from rich.progress import track

from calib.adaptive import PARAMS, expected_inputs, letters_of
from calib.dataset import open_dataset
from calib.errors import FitError
from calib.evaluate import evaluate
from calib.extract import Extract, executor, extract
from calib.fit import ModelKind, Search, fit, fit_processes, tip_of
from calib.next_poses import choose, covariances
from calib.protocols import SURFACE_HIGH, SURFACE_LOW, sheared
from calib.rig import Pose
from calib.rig.simulated import SimulatedRig
from calib.sim import Tool
from calib.targets import Targets
from edge.calibration.inputs import FRAME_INPUTS
from edge.pins import take_rest
from edge.types import Image, Rest
from tests.bench.output import writes_results
from tests.bench.real import COLUMNS, HELD_OUT, row, table
from tests.bench.recordings import TIP_331, real_option

SIZES = (25, 50, 100, 200, 400, 600)
POLYNOMIALS = Search(kinds=frozenset({ModelKind.PLAIN, ModelKind.POLYNOMIAL}))
PROCESSES = Search(kinds=frozenset({ModelKind.PROCESS}))
SIMULATED, SIMULATED_TEST = 600, 200
REST_FRAMES = 10


@dataclass(frozen=True)
class Pool:
    """Frames to fit to, and others that judge."""

    rest: Rest
    targets: Targets
    seen: Extract
    test_targets: Targets
    test: Extract


def recorded(folder: Path, others: Path | None) -> Pool:
    """The published frames, of which 120 judge if there are no others."""
    data = open_dataset([folder / "targets.csv"], folder / "frames", folder / "rest.png")
    order = np.random.default_rng(0).permutation(len(data.targets))
    with executor() as pool:
        seen, targets = data.extract(pool), data.targets
        if others is None:
            test, order = order[:HELD_OUT], order[HELD_OUT:]
            return Pool(data.rest, targets.rows(order), seen.rows(order), targets.rows(test), seen.rows(test))
        other = open_dataset([others / "targets.csv"], others / "frames", others / "rest.png")
        other = other.seen_by(tip_of(data.rest))
        return Pool(data.rest, targets.rows(order), seen.rows(order), other.targets, other.extract(pool))


def simulated() -> Pool:
    """Random poses of protocol `surface`."""
    rig = SimulatedRig()
    rig.mount(Tool("flat"))
    rest = take_rest([rig.frame().image for _ in range(REST_FRAMES)])
    count = SIMULATED + SIMULATED_TEST
    values = np.random.default_rng(1).uniform(SURFACE_LOW, SURFACE_HIGH, (count, len(SURFACE_LOW)))

    def images() -> Iterator[Image]:
        for one in track(values.tolist(), "poses"):
            for step in sheared(*one):
                rig.move(step.pose)
            yield rig.frame().image

    with executor() as pool:
        seen = extract(rest, images(), pool)
    names = ("displacement_mm", "tilt_x_deg", "tilt_y_deg", "shear_x_mm", "shear_y_mm", "torsion_deg")
    frames = tuple(Path(f"pose-{i}") for i in range(count))
    targets = Targets("simulated", frames, dict(zip(names, values.T, strict=True)), "")
    fitted, held_out = range(SIMULATED), range(SIMULATED, count)
    return Pool(rest, targets.rows(fitted), seen.rows(fitted), targets.rows(held_out), seen.rows(held_out))


def errors(pool: Pool, rows: list[int], search: Search) -> list[float | None]:
    """Of a fit to these rows, on the frames that judge; None: too few of them can be used."""
    targets, seen = pool.targets.rows(rows), pool.seen.rows(rows)
    try:
        calibration, _ = fit(pool.rest, targets, seen, mm_per_px=None, search=search)
    except FitError:
        return [None] * len(COLUMNS)
    return list(row(evaluate(calibration, pool.test_targets, pool.test)))


def poses_of(targets: Targets) -> list[Pose]:
    """In the table's axes."""
    v = targets.values
    columns = (
        v["displacement_mm"], v["tilt_x_deg"], v["tilt_y_deg"], v["shear_x_mm"], v["shear_y_mm"],
        v["torsion_deg"],
    )  # fmt: skip
    return [sheared(*values)[-1].pose for values in np.column_stack(columns).tolist()]


def chosen(pool: Pool, sizes: list[int]) -> Iterator[list[int]]:
    """Rows in the order of the choice, for each size."""
    poses = poses_of(pool.targets)
    rows = list(range(min(PARAMS.poses_first, sizes[0])))
    for size in sizes:
        while len(rows) < size:
            count = min(round(PARAMS.batch_share * len(rows)), size - len(rows))
            try:
                found = fit_processes(pool.rest, pool.targets.rows(rows), pool.seen.rows(rows))
            except FitError:  # too few can be used: the next ones of the random order
                rows += [i for i in range(len(poses)) if i not in set(rows)][:count]
                continue
            used = [rows[i] for i in np.flatnonzero(found.usable)]
            left = [i for i in range(len(poses)) if i not in set(rows)]
            known, wanted = (
                letters_of([poses[i] for i in those], mirrored=found.mirrored) for those in (used, left)
            )
            inputs = expected_inputs(known, pool.seen.inputs[used], wanted)
            new = choose(covariances(found.fitted, FRAME_INPUTS, inputs), count)
            rows += [left[i] for i in new]
        yield list(rows)


@click.command()
@real_option
@click.option(
    "--others", "others", type=click.Path(path_type=Path, exists=True), help="Others of the same tip."
)
@click.option("--simulated", "on_rig", is_flag=True, help="Random poses on the simulated rig instead.")
@click.option("--adaptive", is_flag=True, help="Frames that are chosen, too.")
@click.option("--frames", "most", type=click.IntRange(25, 600), default=600, help="At most, to fit to.")
@writes_results
def command(folder: Path, others: Path | None, on_rig: bool, adaptive: bool, most: int, out: Path) -> None:
    """Errors over the number of frames fitted: polynomials, processes, processes of chosen frames."""
    pool = simulated() if on_rig else recorded(folder / TIP_331, others)
    most = min(most, len(pool.targets))
    sizes = sorted({min(size, most) for size in SIZES})
    rows: list[tuple[str, list[float | None]]] = []

    def add(name: str, those: list[int], search: Search) -> None:
        rows.append((f"{name}, {len(those)}", errors(pool, those, search)))
        click.echo(table(rows[-1:]).splitlines()[-1])

    for name, search in (("polynomials", POLYNOMIALS), ("processes", PROCESSES)):
        for size in sizes:
            add(name, list(range(size)), search)
    if adaptive:
        for those in chosen(pool, sizes):
            add("processes, chosen frames", those, PROCESSES)
    text = table(rows)
    click.echo(text)
    path = out / f"learning_{'simulated' if on_rig else 'real'}.md"
    path.write_text(f"# Error over the number of frames fitted\n\n{text}\n", encoding="utf-8")
