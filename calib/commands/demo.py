"""`python -m calib demo`: the whole chain on bundled recordings."""

from pathlib import Path

import click
from rich.console import Console

from calib.commands.options import PATH, overwrite_option
from calib.demo import demo
from calib.errors import TableError


@click.command("demo")
@click.option("--data", type=PATH, default=Path("tests/data"), show_default=True, help="Bundled recordings.")
@click.option("--out", type=PATH, default=Path("out/demo"), show_default=True, help="Folder for pictures.")
@overwrite_option
def demo_command(data: Path, out: Path, overwrite: bool) -> None:
    """Replay the bundled recordings through the whole chain, compare with the truth, draw pictures."""
    if not data.is_dir():
        raise TableError(
            f"{data}: no such folder of recordings; run this in the project's folder, or give --data"
        )
    demo(data, out, Console(), overwrite=overwrite)
