"""The start of a finger, counted from its first import to its first values: `python -m tests.bench start`.

What is counted, and of what, says `tests.bench.start_child`. It runs once before it is counted, so that
bytecode is there, as after an installation.
"""

import json
import platform
import tempfile
from pathlib import Path

import click

from tests.bench.arm64 import Board
from tests.bench.counter import Counts, counted
from tests.bench.output import show, write_json, writes_results
from tests.bench.step import PLAIN_START, VARIANTS, Step


@click.command("start")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout, nothing else.")
@click.option("--arch", type=click.Choice(["arm64"]), help="Count on an emulated board, too.")
@writes_results
def command(as_json: bool, arch: str | None, out: Path) -> None:
    """Instructions from the first import of a finger to its first values."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        child = ["tests.bench.start_child", *Step(VARIANTS["contact"], folder).inputs]
        board = Board(folder) if arch else None
        counts: dict[str, Counts] = {}
        for _ in range(2):
            own = counted(child, 1, folder / "own", environment=PLAIN_START)
            counts[platform.machine()] = own
            if board is not None:
                counts["aarch64"] = board.counted(child, 1, folder)
    result = {machine: {"instructions": found.instructions} for machine, found in counts.items()}
    write_json(out / "start.json", result)
    if as_json:
        click.echo(json.dumps(result))
        return
    for machine, found in counts.items():
        rows = [{"part": part, "M instructions": round(n / 1e6)} for part, n in found.parts().items()]
        show(rows[:8], f"{machine}: {found.instructions / 1e9:.2f} G to the first values")
