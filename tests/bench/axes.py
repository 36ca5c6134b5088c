"""`python -m tests.bench axes`: the published recordings as rigs with other axes would have written them.

In each of the eight ways to negate and swap a rig's x and y, the same frames are fitted, and the same
others evaluated.
A calibration must be as good whichever way the rig's axes lie.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import click

from calib.axes import Axes
from calib.evaluate import evaluate
from calib.extract import executor
from calib.fit import fit
from calib.targets import Targets
from edge.types import Array
from tests.bench.real import COLUMNS, row, splits, table
from tests.bench.recordings import real_option, tip_331

FORMS = tuple(product((1, -1), (1, -1), (False, True)))
VECTORS = (("tilt_x_deg", "tilt_y_deg"), ("shear_x_mm", "shear_y_mm"))


def in_axes(values: dict[str, Array], form: tuple[int, int, bool]) -> dict[str, Array]:
    """The truth in a rig's axes: signs of x and y, then whether they are swapped."""
    sign_x, sign_y, swapped = form
    result = dict(values)
    for x, y in VECTORS:
        if x in values and y in values:
            parts = sign_x * values[x], sign_y * values[y]
            result[x], result[y] = parts[::-1] if swapped else parts
    if "torsion_deg" in values:
        result["torsion_deg"] = sign_x * sign_y * (-1 if swapped else 1) * values["torsion_deg"]
    return result


def name_of(form: tuple[int, int, bool]) -> str:
    sign_x, sign_y, swapped = form
    names = f"{'' if sign_x > 0 else '-'}x", f"{'' if sign_y > 0 else '-'}y"
    return ", ".join(names[::-1] if swapped else names)


@click.command()
@real_option
@click.option("--frames", "size", type=click.IntRange(24, 480), default=480, help="To fit to.")
@click.option("--workers", type=click.IntRange(min=1), help="Processes; default: one a core.")
def command(folder: Path, size: int, workers: int | None) -> None:
    """Errors with the rig's axes in all eight forms, and how far they differ."""
    data = tip_331(folder)
    rows: list[tuple[str, list[float | None]]] = []
    with executor(workers=workers) as pool:
        seen, targets = data.extract(pool), data.targets
        train, test = splits(len(targets), 0)
        for form in FORMS:
            turned: Targets = replace(targets, values=in_axes(targets.values, form))
            axes: list[Axes] = []
            calibration, _ = fit(
                data.rest,
                turned.rows(train[:size]),
                seen.rows(train[:size]),
                mm_per_px=None,
                on_axes=axes.append,
                pool=pool,
            )
            click.echo("; ".join((*axes[0].lines, *axes[0].warnings)))
            found: list[float | None] = list(row(evaluate(calibration, turned.rows(test), seen.rows(test))))
            rows.append((name_of(form), found))
    click.echo(table(rows))
    worst = 0.0
    # x and y change places with the axes: what is compared is their mean.
    for group in ((0,), (1, 2), (3, 4), (5,), (6,), (7,)):
        means = [sum(values[i] or 0.0 for i in group) / len(group) for _, values in rows]
        worst = max(worst, (max(means) - min(means)) / min(means))
    click.echo(f"largest difference between forms, of {', '.join(list(COLUMNS)[:8])}: {100 * worst:.2g} %")


if __name__ == "__main__":
    command()
