"""`python -m tests.bench learning`: error over the number of frames, for polynomials and for processes.

The first so many frames of a random order are fitted, and others judge, always the same: 120 of the published
600, so that 480 are the most; with `--others` all of a second folder of the same tip, and 600 are the most.

    --adaptive   also processes of frames that are chosen as protocol `adaptive` chooses poses, among the
                 recordings: by their poses alone, what a frame shows is seen after it is chosen
    --simulated  800 random poses on the simulated rig instead, of which 200 judge
"""

from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from calib.adaptive import PARAMS, expected_inputs, letters_of
from calib.dataset import open_dataset
from calib.errors import FitError
from calib.extract import Extract, executor
from calib.fit import ModelKind, Search, fit_processes, tip_of
from calib.next_poses import choose, covariances
from calib.protocols import sheared
from calib.rig import Pose
from calib.targets import Targets
from edge.calibration.inputs import FRAME_INPUTS
from tests.bench.carry_over import FIRST, OUTPUTS, Seen, errors, recorded, simulated
from tests.bench.output import writes_results
from tests.bench.real import HELD_OUT, table
from tests.bench.recordings import TIP_331, real_option

SIZES = (25, 50, 100, 200, 400, 600)
POLYNOMIALS = Search(kinds=frozenset({ModelKind.PLAIN, ModelKind.POLYNOMIAL}))
PROCESSES = Search(kinds=frozenset({ModelKind.PROCESS}))
SIMULATED, SIMULATED_TEST = 600, 200


@dataclass(frozen=True)
class Frames:
    """Frames to fit to, and others that judge."""

    fitted: Seen
    targets: Targets
    test: Extract


def shared(seen: Seen, fitted: list[int], judging: list[int]) -> Frames:
    rows = Seen(seen.rest, seen.targets.rows(fitted), seen.extract.rows(fitted))
    return Frames(rows, seen.targets.rows(judging), seen.extract.rows(judging))


def published(folder: Path, others: Path | None, pool: Executor) -> Frames:
    """The published frames, of which 120 judge if there are no others."""
    seen = recorded(folder, folder / "rest.png", pool)
    order = np.random.default_rng(0).permutation(len(seen.targets)).tolist()
    if others is None:
        return shared(seen, order[HELD_OUT:], order[:HELD_OUT])
    other = open_dataset([others / "targets.csv"], others / "frames", others / "rest.png")
    other = other.seen_by(tip_of(seen.rest))
    return Frames(shared(seen, order, []).fitted, other.targets, other.extract(pool))


def poses_of(targets: Targets) -> list[Pose]:
    """In the table's axes."""
    columns = np.column_stack([targets.values[name] for name in OUTPUTS])
    return [sheared(*values)[-1].pose for values in columns.tolist()]


def chosen(seen: Seen, sizes: list[int]) -> Iterator[list[int]]:
    """Rows in the order of the choice, for each size."""
    poses = poses_of(seen.targets)
    rows = list(range(min(PARAMS.poses_first, sizes[0])))
    for size in sizes:
        while len(rows) < size:
            count = min(round(PARAMS.batch_share * len(rows)), size - len(rows))
            try:
                found = fit_processes(seen.rest, seen.targets.rows(rows), seen.extract.rows(rows))
            except FitError:  # too few can be used: the next ones of the random order
                rows += [i for i in range(len(poses)) if i not in set(rows)][:count]
                continue
            used = [rows[i] for i in np.flatnonzero(found.usable)]
            left = [i for i in range(len(poses)) if i not in set(rows)]
            known, wanted = (
                letters_of([poses[i] for i in those], mirrored=found.mirrored) for those in (used, left)
            )
            inputs = expected_inputs(known, seen.extract.inputs[used], wanted)
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
    rows: list[tuple[str, list[float | None]]] = []
    with executor() as pool:
        if on_rig:
            count = SIMULATED + SIMULATED_TEST
            seen = simulated("poses", FIRST, count, 1, pool)
            frames = shared(seen, list(range(SIMULATED)), list(range(SIMULATED, count)))
        else:
            frames = published(folder / TIP_331, others, pool)
        most = min(most, len(frames.fitted.targets))
        sizes = sorted({min(size, most) for size in SIZES})
        runs = [("polynomials", list(range(size)), POLYNOMIALS) for size in sizes]
        runs += [("processes", list(range(size)), PROCESSES) for size in sizes]
        if adaptive:
            runs += [("processes, chosen frames", those, PROCESSES) for those in chosen(frames.fitted, sizes)]
        for name, those, search in runs:
            found = errors(frames.fitted, those, search, frames.targets, frames.test, pool)
            rows.append((f"{name}, {len(those)}", found))
            click.echo(table(rows[-1:]).splitlines()[-1])
    text = table(rows)
    click.echo(text)
    path = out / f"learning_{'simulated' if on_rig else 'real'}.md"
    path.write_text(f"# Error over the number of frames fitted\n\n{text}\n", encoding="utf-8")
