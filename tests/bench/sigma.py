"""`python -m tests.bench sigma`: how many errors on published recordings are within one and two sigma.

Five models, each fitted to four fifths of the 600 frames and evaluated on the rest, so that each frame counts
once; a share of 200 frames is known to 3 %. Sorted into thirds by what was read, by what was true, and by
sigma; and with pins taken away at random, on one side, or in a spot near the contact.

A reading is the mean of what is likely given the pins, not given the truth: what slips is read towards the
mean, so that among the largest true shears errors are larger than sigma, among the middle ones smaller.
"""

from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from calib.evaluate import predict
from calib.extract import LOSSES, Extract, executor
from calib.fit import fit
from calib.targets import Targets
from edge.calibration.inputs import FRAME_INPUTS
from edge.types import Array, Index, Rest
from tests.bench.output import markdown, writes_results
from tests.bench.recordings import real_option, tip_331

FOLDS = 5
GAP = FRAME_INPUTS.index("gap")
SHEAR, DEPTH = ("shear_x_mm", "shear_y_mm"), "displacement_mm"
Table = dict[str, Array]


def evaluated(
    rest: Rest, targets: Targets, seen: Extract, rows: tuple[Index, Index]
) -> list[tuple[Table, Table]]:
    """Values and sigmas of the second rows by a model of the first: of the whole tip, then of each loss."""
    train, test = rows
    calibration, _ = fit(rest, targets.rows(train), seen.rows(train), mm_per_px=None)
    part = seen.rows(test)
    losses = (replace(part, inputs=part.lossy[:, k]) for k in range(len(LOSSES)))
    return [predict(calibration, variant) for variant in (part, *losses)]


def held_out(rest: Rest, targets: Targets, seen: Extract, pool: Executor) -> list[tuple[Table, Table]]:
    """The same of all frames, each by a model that has not seen it."""
    order = np.random.default_rng(0).permutation(len(targets)).astype(np.int32)
    tests = np.array_split(order, FOLDS)
    trains = [np.setdiff1d(order, test) for test in tests]
    parts = list(pool.map(partial(evaluated, rest, targets, seen), zip(trains, tests, strict=True)))
    back = np.argsort(np.concatenate(tests))
    found = []
    for same in zip(*parts, strict=True):  # of one variant, by each of the models
        values, sigmas = (
            {name: np.concatenate([part[which][name] for part in same])[back] for name in same[0][which]}
            for which in (0, 1)
        )
        found.append((values, sigmas))
    return found


def thirds(by: Array) -> list[Any]:
    """(n,) bool of the rows with the least third of these, the middle and the largest."""
    ends = np.nanquantile(by, [1 / 3, 2 / 3])
    return [by <= ends[0], (by > ends[0]) & (by <= ends[1]), by > ends[1]]


def _share(inside: Any) -> str:
    return f"{100.0 * float(np.mean(inside)):.0f}" if len(inside) else "-"


def _in_thirds(z: Array, by: Array) -> str:
    return ", ".join(_share(z[rows & np.isfinite(z)] <= 1.0) for rows in thirds(by))


def _length(table: Table) -> Array:
    return np.hypot(*(table[name] for name in SHEAR))


def whole_table(truth: Table, values: Table, sigmas: Table) -> list[dict[str, object]]:
    """A row for each value."""
    rows: list[dict[str, object]] = []
    for name in sorted(truth.keys() & values.keys()):
        error = np.abs(values[name] - truth[name])
        z = error / sigmas[name]
        known = np.isfinite(z)
        by = {
            "thirds of depth read": values[DEPTH], "of true depth": truth[DEPTH],
            "of shear read": _length(values), "of true shear": _length(truth), "of sigma": sigmas[name],
        }  # fmt: skip
        rows.append({
            "% within sigma": name, "one": _share(z[known] <= 1.0), "two": _share(z[known] <= 2.0),
            **{what: _in_thirds(z, one) for what, one in by.items()},
            "correlation of sigma with the error":
                round(float(np.corrcoef(sigmas[name][known], error[known])[0, 1]), 2),
        })  # fmt: skip
    return rows


def loss_table(truth: Table, seen: Extract, found: list[tuple[Table, Table]]) -> list[dict[str, object]]:
    """A row for each value, kind of loss and third of the gap."""
    table: list[dict[str, object]] = []
    for kind in sorted(set(LOSSES)):
        which = [k for k, lost in enumerate(LOSSES) if lost == kind]
        gap = np.concatenate([seen.lossy[:, k, GAP].real for k in which])
        for rows in thirds(gap):
            low, high = np.nanmin(gap[rows]), np.nanmax(gap[rows])
            for name in sorted(truth.keys() & found[0][0].keys()):
                whole = np.tile(np.abs(found[0][0][name] - truth[name]), len(which))[rows]
                error = np.concatenate([np.abs(found[1 + k][0][name] - truth[name]) for k in which])[rows]
                z = error / np.concatenate([found[1 + k][1][name] for k in which])[rows]
                known = np.isfinite(z)
                if not known.any():
                    continue
                table.append({
                    "pins lost": kind,
                    "gap in the tip's circle": f"{100 * low:.0f} to {100 * high:.0f} %", "value": name,
                    "mean error over that of the whole tip":
                        round(float(error[known].mean() / whole[known].mean()), 2),
                    "% within one": _share(z[known] <= 1.0), "two": _share(z[known] <= 2.0),
                    "% without a value": _share(~known),
                })  # fmt: skip
    return table


@click.command()
@real_option
@writes_results
def command(folder: Path, out: Path) -> None:
    """What share of the errors is within sigma: of all frames, of thirds, with pins lost."""
    data = tip_331(folder)
    with executor() as pool:
        seen = data.extract(pool)
        found = held_out(data.rest, data.targets, seen, pool)
    truth = data.targets.values
    text = (
        "# Errors within sigma, held-out frames of a published 331-pin tip\n\n"
        f"`python -m tests.bench sigma`: {len(data.targets)} frames, each read by a model of four fifths "
        "of the others. 68 and 95 % are wanted; a third of the frames tells a share to 3 %.\n\n"
        f"{markdown(whole_table(truth, *found[0]))}\n\n{markdown(loss_table(truth, seen, found))}\n"
    )
    click.echo(text)
    (out / "sigma.md").write_text(text, encoding="utf-8")
