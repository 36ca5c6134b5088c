"""Where the results of a benchmark go: `out/bench`; only on request the tracked `tests/bench/results`."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from hostlink.output_file import OutputError

__all__ = ["ROOT", "writes_results"]

ROOT = Path(__file__).resolve().parents[2]
RESULTS = Path(__file__).parent / "results"


def writes_results(command: Callable[..., None]) -> Callable[..., None]:
    """Adds `--out` and `--keep` to a command; it gets `out`, a folder that exists."""

    @click.option(
        "--out",
        default=ROOT / "out" / "bench",
        show_default="out/bench",
        type=click.Path(file_okay=False, path_type=Path),
        help="Folder of the results.",
    )
    @click.option("--keep", is_flag=True, help="Put the results into tests/bench/results instead.")
    @functools.wraps(command)
    def with_folder(*, out: Path, keep: bool, **options: Any) -> None:
        folder = RESULTS if keep else out
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"--out {folder}: {error.strerror}; give a folder that can be made") from None
        command(out=folder, **options)

    return with_folder
