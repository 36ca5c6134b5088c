"""The published recordings: where they are, and the tip that most benchmarks look at."""

import csv
import os
from pathlib import Path

import click

from calib.dataset import Dataset, open_dataset
from tests.bench.output import ROOT

REAL = Path(os.environ.get("VORONOI_TOUCH_REAL", ROOT.parent / "shared" / "real"))
TIP_331 = "tactip331_binary"  # 600 stills, each a jump from rest, their poses, and an untouched image

real_option = click.option(
    "--real", "folder", type=click.Path(path_type=Path), default=REAL, help="Published recordings."
)


def tip_331(folder: Path) -> Dataset:
    """Its stills with their truth. Raises calib.errors.TableError: they are not there."""
    where = folder / TIP_331
    return open_dataset([where / "targets.csv"], where / "frames", where / "rest.png")


def poses_of_stills(folder: Path) -> dict[str, list[float]]:
    """The robot's pose at each still of the tip in this folder, by the still's name."""
    with (folder / "targets.csv").open(encoding="utf-8") as file:
        return {
            row.pop("sensor_image"): [float(value) for value in row.values()] for row in csv.DictReader(file)
        }
