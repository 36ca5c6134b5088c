"""`python -m calib report`: one page on how good the calibrations are."""

from pathlib import Path

import click

from calib.commands.options import PATH, overwrite_option, worker_options
from calib.errors import TableError
from calib.report.command import report
from hostlink.output_file import check_output


@click.command("report")
@click.option(
    "-o",
    "--out",
    type=PATH,
    default=Path("out/report"),
    show_default=True,
    help="Folder for page, pictures, tables.",
)
@overwrite_option
@click.option("--captures", type=PATH, help="Folder of captures; made there if missing.")
@click.option("--sim", type=PATH, help="The simulated rig (TOML); default: 331 pins.")
@click.option("--real", type=PATH, help="Folder with targets.csv, frames/, rest.png.")
@worker_options
def report_command(
    out: Path,
    overwrite: bool,
    captures: Path | None,
    sim: Path | None,
    real: Path | None,
    workers: int | None,
    dask: str | None,
) -> None:
    """One page on the accuracy of calibrations, and the reasons for the edge's methods."""
    if real is not None and not (real / "targets.csv").is_file():
        raise TableError(f"{real}: no targets.csv; give the folder with targets.csv, frames and rest.png")
    for folder in (out, captures or out):
        if folder.exists() and not folder.is_dir():
            raise TableError(f"{folder}: is a file; give a folder")
    out.mkdir(parents=True, exist_ok=True)
    check_output(out / "index.html", (".html",), (), overwrite)
    report(out, captures or out / "captures", sim, real, workers=workers, dask=dask)
