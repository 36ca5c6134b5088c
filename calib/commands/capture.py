"""`python -m calib capture`: options in, a recording and a table out."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from calib.capture import capture, progress_of
from calib.errors import CaptureError
from calib.protocols import PROTOCOLS, Step, load_protocol
from calib.rig import Rig, ask_here, open_rig
from hostlink.cli_types import counted
from hostlink.output_file import check_output


@click.command(name="capture")
@click.option(
    "--rig",
    "rig",
    required=True,
    metavar="SPEC",
    help="sim, sim:FILE.toml, gcode:PORT, gcode:FILE.toml or manual.",
)
@click.option("--protocol", required=True, metavar="NAME", help=f"{', '.join(PROTOCOLS)} or FILE.toml.")
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path, dir_okay=False),
    help="Recording to write (.mcap); the table goes beside it (.csv).",
)
@click.option(
    "--camera",
    default="v4l2:0",
    show_default=True,
    metavar="SPEC",
    help="Source of frames, for rigs that have none of their own.",
)
@click.option("--resume", is_flag=True, help="Continue a recording that was broken off.")
def capture_command(rig: str, protocol: str, output: Path, camera: str, resume: bool) -> None:
    """Run a calibration protocol on a rig and record it with its truth."""
    plan = load_protocol(protocol)
    if output.suffix != ".mcap":
        raise CaptureError(f"--output {output}: give a name that ends in .mcap")
    if not output.exists():
        check_output(output, (".mcap",))
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    bar = Progress(*columns, console=Console(stderr=True))
    task = bar.add_task(plan.name, total=plan.n_frames)
    if resume:
        bar.update(task, completed=progress_of(output, plan).frames)

    def ask(text: str) -> None:
        bar.stop()  # a live bar and a prompt do not share a terminal
        ask_here(text)
        bar.start()

    def opened(first: int) -> Rig:
        opened_rig = open_rig(rig, camera, first, ask)
        bar.start()  # not before, so that a missing rig is reported in one line
        return opened_rig

    def on_frame(step: Step, done: int) -> None:
        bar.update(task, completed=done)

    try:
        taken = capture(opened, plan, output, resume=resume, on_frame=on_frame)
    finally:
        if bar.live.is_started:
            bar.stop()
    now = "" if taken == plan.n_frames else f" ({taken or 'none'} of them now)"
    click.echo(
        f"{output}: complete, {counted(plan.n_frames, 'frame')} of protocol {plan.name}{now}; "
        f"table {output.with_suffix('.csv')}"
    )
