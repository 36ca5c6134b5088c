"""`python -m tests.bench real`: fit on part of the published recordings, evaluate on the rest.

Five random splits of 480 frames to fit and 120 to evaluate, and a learning curve: the same 120 with only
50, 100, 200 frames to fit. Frames are processed once; the splits only select among the results.
"""

from pathlib import Path
from typing import Any

import click
import numpy as np

from calib.evaluate import evaluate
from calib.extract import Extract, executor
from calib.fit import fit
from calib.targets import Targets
from edge.types import Index, Rest
from tests.bench.output import markdown, writes_results
from tests.bench.recordings import real_option, tip_331

SPLITS = 5
HELD_OUT = 120
SIZES = (50, 100, 200, 480)

#: The table reports these columns; beside each is its place in the object that `calib evaluate` prints.
COLUMNS: dict[str, tuple[str, int | None]] = {
    "depth mm": ("displacement_mae_mm", None),
    "tilt x deg": ("tilt_mae_deg", 0),
    "tilt y deg": ("tilt_mae_deg", 1),
    "shear x mm": ("shear_mae_mm", 0),
    "shear y mm": ("shear_mae_mm", 1),
    "direction mean deg": ("shear_direction_mean_deg", None),
    "median deg": ("shear_direction_median_deg", None),
    "torsion deg": ("torsion_mae_deg", None),
    "coverage 68 %": ("sigma_coverage_68", None),
}
#: Published beside the recordings: a convolutional network on its own test run.
NETWORK = (0.148, 1.27, 1.45, 1.22, 1.19, 25.9, 13.8, 1.60, None)


def split(rest: Rest, targets: Targets, seen: Extract, train: Index, test: Index) -> dict[str, Any]:
    """Errors on the test rows of a calibration fitted to the training rows only."""
    calibration, _ = fit(rest, targets.rows(train), seen.rows(train), mm_per_px=None)
    return evaluate(calibration, targets.rows(test), seen.rows(test))


def row(report: dict[str, Any]) -> list[float]:
    """A report's columns; NaN where a quantity could not be fitted."""
    values = []
    for key, index in COLUMNS.values():
        value = report[key] if index is None else report[key][index]
        values.append(float("nan") if value is None else float(value))
    return values


def splits(n: int, seed: int) -> tuple[Index, Index]:
    """(480,) rows to fit, in random order, and (120,) to evaluate."""
    order = np.random.default_rng(seed).permutation(n).astype(np.int32)
    return order[HELD_OUT:], order[:HELD_OUT]


def table(rows: list[tuple[str, list[float | None]]]) -> str:
    """As Markdown."""
    return markdown([{"": name, **dict(zip(COLUMNS, values, strict=True))} for name, values in rows])


@click.command()
@real_option
@writes_results
def command(folder: Path, out: Path) -> None:
    """Errors on published recordings: five splits, and a learning curve."""
    data = tip_331(folder)
    with executor() as pool:
        seen = data.extract(pool)
    targets = data.targets
    by_size: dict[int, list[list[float]]] = {size: [] for size in SIZES}
    for seed in range(SPLITS):
        train, test = splits(len(targets), seed)
        for size in SIZES:
            by_size[size].append(row(split(data.rest, targets, seen, train[:size], test)))
    full = by_size[SIZES[-1]]
    rows: list[tuple[str, list[float | None]]] = [(f"split {i}", list(r)) for i, r in enumerate(full)]
    rows += [
        (f"{size} frames, mean of {SPLITS}", [float(v) for v in np.mean(by_size[size], axis=0)])
        for size in SIZES
    ]
    rows.append(("published network", list(NETWORK)))
    text = (
        "# Published recordings of a 331-pin tip, held-out frames\n\n"
        f"`python -m tests.bench real`: mean absolute errors on {HELD_OUT} random frames of {len(targets)}, "
        f"models fitted to {SIZES[-1]} others (or fewer). Errors over all frames, refused ones too "
        f"({int((~seen.trusted).sum())} of {len(targets)} are refused). Direction: shear over 1.5 mm.\n\n"
        f"{table(rows)}\n"
    )
    click.echo(text)
    (out / "real.md").write_text(text, encoding="utf-8")
