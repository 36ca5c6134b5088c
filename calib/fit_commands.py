"""`python -m calib fit` and `evaluate`: a table of frames with truth in, a calibration or its errors out."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from calib.dataset import Dataset, open_dataset
from calib.errors import TableError
from calib.evaluate import evaluate
from calib.extract import Extract, executor
from calib.fit import Choice, fit
from calib.targets import COLUMNS
from edge.calibration import Calibration

_PATH = click.Path(path_type=Path)
_PLACE: list[Callable[[Any], Any]] = [
    click.argument("tables", metavar="TABLE...", nargs=-1, required=True, type=_PATH),
    click.option("--frames", "folder", type=_PATH, help="Folder of the frames that TARGETS.csv names."),
    click.option("--rest", "rest_image", type=_PATH, help="Image of the untouched tip, for TARGETS.csv."),
    click.option("--workers", type=click.IntRange(min=1), help="Processes; default: one a core."),
    click.option("--dask", metavar="ADDRESS", help="Scheduler of a Dask cluster, e.g. tcp://host:8786."),
    click.option("-q", "--quiet", is_flag=True, help="No progress bar."),
]


def _placed(command: Any) -> Any:
    for decorate in reversed(_PLACE):
        command = decorate(command)
    return command


@click.command("fit")
@_placed
@click.option("-o", "--output", required=True, type=_PATH, help="Calibration file to write (.json).")
@click.option("--serial", default="unnamed", show_default=True, help="Serial number of the tip.")
@click.option("--mm-per-px", type=click.FloatRange(min=0, min_open=True), help="Scale at the tip's centre.")
@click.option("--json", "as_json", is_flag=True, help="Print what was fitted as one JSON object.")
def fit_command(
    tables: tuple[Path, ...],
    folder: Path | None,
    rest_image: Path | None,
    workers: int | None,
    dask: str | None,
    quiet: bool,
    output: Path,
    serial: str,
    mm_per_px: float | None,
    as_json: bool,
) -> None:
    """Fit a calibration to frames with known truth.

    TABLE is a TARGETS.csv, with --frames and --rest, or one or more captures (.mcap) of one tip.

    Columns of TARGETS.csv: sensor_image and any of pose_z (mm), pose_Rx, pose_Ry (deg), shear_x, shear_y
    (mm), shear_Rz (deg), force_z (N), area (mm2), contact_x, contact_y, contact_depth (mm); a missing
    column is not fitted. The scale comes from contacts in known places, or from --mm-per-px; without
    either, what is in mm of the image (places, slip speed) stays invalid.
    """
    if not output.parent.is_dir():
        raise TableError(f"{output.parent}: no such folder to write {output.name} to")
    if output.is_dir():
        raise TableError(f"{output}: a folder; name the calibration file to write")
    data = open_dataset(tables, folder, rest_image)
    if data.targets.unread:
        columns = ", ".join(data.targets.unread)
        click.echo(f"not read: column {columns}; known are {', '.join(COLUMNS)}", err=True)
    calibration, choices = fit(
        data.rest,
        data.targets,
        _extract(data, workers, dask, quiet),
        serial=serial,
        mm_per_px=mm_per_px,
        on_refused=lambda why: click.echo(f"not fitted: {why}", err=True),
    )
    calibration.save(output)
    if as_json:
        click.echo(json.dumps({"output": str(output), "models": [_row(c) for c in choices]}))
    else:
        _print(choices, output)


@click.command("evaluate")
@click.argument("calibration_path", metavar="CAL.json", type=_PATH)
@_placed
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def evaluate_command(
    calibration_path: Path,
    tables: tuple[Path, ...],
    folder: Path | None,
    rest_image: Path | None,
    workers: int | None,
    dask: str | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Errors of a calibration on frames with known truth.

    TABLE is a TARGETS.csv, with --frames and --rest, or one or more captures (.mcap) of one tip.

    At the top stand the errors over all frames, under `accepted` those over the frames whose values the
    edge would have sent; the others it refuses, because it is not sure which pin is which.
    """
    calibration = Calibration.load(calibration_path)
    data = open_dataset(tables, folder, rest_image).seen_by(calibration)
    report = evaluate(calibration, data.targets, _extract(data, workers, dask, quiet))
    if as_json:
        click.echo(json.dumps(report))
        return
    for key, value in report.items():
        if isinstance(value, dict):
            click.echo(f"{key}:")
            for name, part in value.items():
                click.echo(f"  {name:28s} {part}")
        else:
            click.echo(f"{key:30s} {value}")


def _extract(data: Dataset, workers: int | None, dask: str | None, quiet: bool) -> Extract:
    with executor(dask, workers) as pool, _progress("frames", len(data), quiet) as advance:
        return data.extract(pool, advance)


@contextmanager
def _progress(what: str, total: int, quiet: bool) -> Iterator[Callable[[int], None]]:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), disable=quiet) as bar:
        task = bar.add_task(what, total=total)
        yield lambda n: bar.advance(task, n)


def _row(choice: Choice) -> dict[str, Any]:
    return {
        "outputs": choice.outputs,
        "model": choice.chosen.name,
        "terms": choice.chosen.n_terms,
        "rms_held_out": choice.chosen.rms,
        "sigma": choice.model.sigma,
        "tried": len(choice.tried),
    }


def _print(choices: list[Choice], output: Path) -> None:
    table = Table(title=f"{output}: what was fitted")
    for name in ("value", "model chosen", "terms", "held-out rms", "sigma"):
        table.add_column(name)
    for choice in choices:
        row = _row(choice)
        sigma = row["sigma"] if isinstance(row["sigma"], list) else [row["sigma"]]
        table.add_row(
            ", ".join(choice.outputs),
            row["model"],
            str(row["terms"]),
            f"{row['rms_held_out']:.3g}",
            ", ".join(f"{s:.3g}" for s in sigma),
        )
    Console().print(table)


@click.command("demo")
@click.option("--data", type=_PATH, default=Path("tests/data"), show_default=True, help="Bundled recordings.")
@click.option("--out", type=_PATH, default=Path("out/demo"), show_default=True, help="Folder for pictures.")
def demo_command(data: Path, out: Path) -> None:
    """Replay the bundled recordings through the whole chain, compare with the truth, draw pictures."""
    from calib.demo import demo

    if not data.is_dir():
        raise TableError(
            f"{data}: no such folder of recordings; run this in the project's folder, or give --data"
        )
    demo(data, out, Console())
