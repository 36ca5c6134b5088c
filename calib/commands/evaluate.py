"""`python -m calib evaluate`: a calibration and frames with truth in, its errors out."""

import json
import logging
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table

from calib.commands.options import PATH, Frames, frames_options
from calib.evaluate import counts_line, error_rows, evaluate
from edge.calibration import Calibration

log = logging.getLogger(__name__)


@click.command("evaluate")
@click.argument("calibration_path", metavar="CAL.json", type=PATH)
@frames_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def evaluate_command(calibration_path: Path, as_json: bool, **frames: Any) -> None:
    """Errors of a calibration on frames with known truth.

    TABLE is a TARGETS.csv, with --frames and --rest, or one or more captures (.mcap) of one tip.

    Errors are given over all frames that have a value, and over the accepted ones, whose values the edge
    would have sent. The edge refuses frames whose pins are not identified with certainty. A frame that is
    pressed but read as untouched counts with the zeros that the edge sends, and its number is printed.
    """
    given = Frames(**frames)
    calibration = Calibration.load(calibration_path)
    data = given.open().seen_by(calibration)
    if data.targets.sha256 == calibration.content.data.sha256:
        log.warning("%s was fitted to these frames; errors on others tell more", calibration_path)
    views = zip(calibration.views, data.views(), strict=True)
    reports = [evaluate(own, *given.extract(view)) for own, view in views]
    if as_json:
        click.echo(json.dumps(reports[0] if len(reports) == 1 else {"views": reports}))
        return
    for k, report in enumerate(reports):
        which = f", view {k + 1} of {len(reports)}" if len(reports) > 1 else ""
        print_report(report, f"{calibration_path}{which}")


def print_report(report: dict[str, Any], of: str) -> None:
    """A report of `calib.evaluate.evaluate` as a table."""
    table = Table(title=f"Mean absolute errors: {of}")
    for name in ("value", "all frames", "accepted", "within sigma", "unit"):
        table.add_column(name, justify="left" if name in ("value", "unit") else "right")
    for row in error_rows(report):
        table.add_row(*row)
    Console().print(table)
    click.echo(counts_line(report))
    if beyond := report["n_beyond_range"]:
        found = ", ".join(f"{name} {n}" for name, n in beyond.items())
        click.echo(f"frames beyond the calibrated range (its end is sent, flagged SATURATED): {found}")
    missing = {name: n for name, n in report["n_without_value"].items() if n}
    if missing:
        click.echo(
            "frames with truth but without a value: " + ", ".join(f"{k} {n}" for k, n in missing.items())
        )
