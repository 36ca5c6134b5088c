"""What benchmarks print and write: tables; results in `out/bench`, on request in `tests/bench/results`."""

import functools
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table

from hostlink.output_file import OutputError

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


def text_of(value: object) -> str:
    """A cell of a table: nothing for what is not known, four digits of what is no count."""
    if value is None or value != value:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"
    return f"{value:,}" if isinstance(value, int) else str(value)


def show(rows: Sequence[Mapping[str, object]], title: str = "", console: Console | None = None) -> None:
    """A table on the terminal: a column for each key of the first row; nothing for no rows."""
    if not rows:
        return
    table = Table(title=title or None)
    for name, value in rows[0].items():
        table.add_column(name, justify="left" if isinstance(value, str) else "right")
    for row in rows:
        table.add_row(*map(text_of, row.values()))
    (console or Console(width=150)).print(table)


def markdown(rows: Sequence[Mapping[str, object]]) -> str:
    """The same as Markdown."""
    head = f"| {' | '.join(rows[0])} |\n{'|---' * len(rows[0])}|\n"
    return head + "\n".join(f"| {' | '.join(map(text_of, row.values()))} |" for row in rows)


def write_json(path: Path, result: object) -> None:
    """A result in a file of its own."""
    path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
