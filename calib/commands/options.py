"""Common to the commands: options for frames with known truth, the rule for output files, a progress bar."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from calib.dataset import Dataset, open_dataset
from calib.extract import Extract, executor
from calib.press_axis import along_press
from calib.table import renamed
from calib.targets import COLUMNS, KNOWN_AS, Targets
from edge.sources.lens_file import load_lens
from hostlink.cli_types import WholeNumber

PATH = click.Path(path_type=Path)

overwrite_option = click.option("--overwrite", is_flag=True, help="Replace the output if it exists.")
_WORKERS: list[Callable[[Any], Any]] = [
    click.option("--workers", type=WholeNumber(1, 1024), help="Number of processes; default: one a core."),
    click.option("--dask", metavar="ADDRESS", help="Scheduler of a Dask cluster, e.g. tcp://host:8786."),
]
_FRAMES: list[Callable[[Any], Any]] = [
    click.argument("tables", metavar="TABLE...", nargs=-1, required=True, type=PATH),
    click.option("--frames", "folder", type=PATH, help="Folder of the frames that TARGETS.csv names."),
    click.option(
        "--rest",
        "rest_image",
        type=PATH,
        metavar="IMAGE|auto",
        help="Image of the untouched tip, for TARGETS.csv; default: the least deformed frame.",
    ),
    click.option(
        "--lens",
        "lens_file",
        type=PATH,
        metavar="FILE",
        help="Lens of the frames, by `calib lens`: its distortion is removed from the pins' places.",
    ),
    click.option(
        "--region",
        default="",
        metavar="KEYS",
        help="Where the frames show the skin, as in an address: 'roi=54,79,215,220&roi=308,91,219,216'."
        " Parts that do not touch each other are views, as of mirrors; each is calibrated by itself.",
    ),
    *_WORKERS,
    click.option("-q", "--quiet", is_flag=True, help="No progress bar."),
]


def _with(options: list[Callable[[Any], Any]], command: Any) -> Any:
    for decorate in reversed(options):
        command = decorate(command)
    return command


def worker_options(command: Any) -> Any:
    """--workers and --dask."""
    return _with(_WORKERS, command)


def frames_options(command: Any) -> Any:
    """The options whose values make a `Frames`."""
    return _with(_FRAMES, command)


@dataclass(frozen=True, slots=True)
class Frames:
    """Frames with known truth, from the command line, and the workers that process them."""

    tables: tuple[Path, ...]
    folder: Path | None
    rest_image: Path | None
    lens_file: Path | None
    region: str
    workers: int | None
    dask: str | None
    quiet: bool

    @property
    def inputs(self) -> list[Path]:
        """The input files, without the frames themselves."""
        beside = [path.with_suffix(".csv") for path in self.tables if path.suffix == ".mcap"]
        rest = [self.rest_image] if self.rest_image and str(self.rest_image) != "auto" else []
        return [*self.tables, *beside, *rest]

    def open(self) -> Dataset:
        """Raises TableError, CaptureError. Unknown columns of the table are reported on stderr."""
        lens = None if self.lens_file is None else load_lens(self.lens_file)
        data = open_dataset(self.tables, self.folder, self.rest_image, lens, self.region)
        if data.rest_message:
            click.echo(f"rest frame: {data.rest_message}", err=True)
        for where, why in data.touched_rests:
            click.echo(
                f"warning: {where}: something touches the tip in the rest frame ({why}); all motion counts "
                "from it: give an image of the untouched tip, or is the camera not square to it?",
                err=True,
            )
        if data.targets.unread:
            columns = ", ".join(data.targets.unread)
            advice = renamed(data.targets.unread, KNOWN_AS)
            click.echo(f"columns ignored: {columns}{advice}; known are {', '.join(COLUMNS)}", err=True)
        return data

    def extract(self, data: Dataset) -> tuple[Targets, Extract]:
        """Run the edge over all frames, with a progress bar.

        Returns  the truth, depths and forces positive into the tip, and the edge's results
        Raises   TableError: a column of the table cannot be made one
        """
        extract = self.measured(data)
        captured, rest_given = bool(data.rows), not data.rest_message
        targets, lines = along_press(data.targets, extract, captured=captured, rest_given=rest_given)
        for line in lines:
            click.echo(f"axes: {line}", err=True)
        return targets, extract

    def measured(self, data: Dataset) -> Extract:
        """The edge's results, with a progress bar."""
        with executor(self.dask, self.workers) as pool, progress_bar(self.quiet) as bar:
            task = bar.add_task("frames", total=len(data))
            return data.extract(pool, lambda n: bar.advance(task, n))


@contextmanager
def progress_bar(quiet: bool = False) -> Iterator[Progress]:
    """A bar on stderr, with counts, and the time that has passed and remains."""
    # The elapsed time moves while a long fit does not tell how far it is.
    counts = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
    columns = (*counts, TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), disable=quiet) as bar:
        yield bar
