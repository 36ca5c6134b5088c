"""The published recordings: where they are, and the tip that most benchmarks look at."""

from __future__ import annotations

import os
from pathlib import Path

import click

from calib.dataset import Dataset, open_dataset
from tests.bench.output import ROOT

__all__ = ["REAL", "TIP_331", "real_option", "tip_331"]

REAL = Path(os.environ.get("VORONOI_TOUCH_REAL", ROOT.parent / "shared" / "real"))
TIP_331 = "tactip331_binary"  # 600 stills, each a jump from rest, their poses, and an untouched image

real_option = click.option(
    "--real", "folder", type=click.Path(path_type=Path), default=REAL, help="Published recordings."
)


def tip_331(folder: Path) -> Dataset:
    """Its stills with their truth. Raises calib.errors.TableError: they are not there."""
    where = folder / TIP_331
    return open_dataset([where / "targets.csv"], where / "frames", where / "rest.png")
