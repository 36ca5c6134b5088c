"""`python -m calib capture`: options in, a recording and a table out."""

import math
from pathlib import Path

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from calib.adaptive import PARAMS, AdaptivePlan
from calib.capture import capture, progress_of
from calib.errors import CaptureError
from calib.extract import executor
from calib.protocols import ADAPTIVE, PROTOCOLS, AnyPlan, Step, load_protocol
from calib.rig import Rig, ask_here, open_rig
from edge.calibration.file import UNTOUCHED
from hostlink.cli_types import WholeNumber, counted
from hostlink.output_file import check_output

POSES = 200  # of protocol adaptive, if no number is given


@click.command(name="capture")
@click.option(
    "--rig",
    "rig",
    required=True,
    metavar="SPEC",
    help="sim, sim:FILE.toml, sim:SENSOR, gcode:PORT, gcode:FILE.toml or manual.",
)
@click.option(
    "--protocol", required=True, metavar="NAME", help=f"{', '.join(PROTOCOLS)}, {ADAPTIVE} or FILE.toml."
)
@click.option(
    "--poses",
    type=WholeNumber(1, PARAMS.candidates),
    help=f"Poses of protocol {ADAPTIVE} at most; default: {POSES}.",
)
@click.option(
    "--until",
    "goals",
    multiple=True,
    metavar="VALUE=ERROR",
    help=f"End protocol {ADAPTIVE} when the expected error is this or less, e.g. tilt_x_deg=0.3; repeatable.",
)
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
def capture_command(
    rig: str,
    protocol: str,
    poses: int | None,
    goals: tuple[str, ...],
    output: Path,
    camera: str,
    resume: bool,
) -> None:
    """Run a calibration protocol on a rig and record it with its truth.

    Protocol adaptive presses a flat surface at poses that it chooses itself: those after which the values
    are most certain, judged by all frames so far.
    """
    if protocol != ADAPTIVE:
        if poses is not None or goals:
            raise CaptureError(f"--poses and --until: only of protocol {ADAPTIVE}, not {protocol}")
        _run(rig, load_protocol(protocol), output, camera, resume=resume)
        return
    wanted = dict(_goal(text) for text in goals)
    with executor() as pool:
        plan = AdaptivePlan(poses or POSES, wanted, pool=pool, on_fitted=_print_errors)
        _run(rig, plan, output, camera, resume=resume)


def _goal(text: str) -> tuple[str, float]:
    """Raises CaptureError: not NAME=NUMBER."""
    name, _, number = text.partition("=")
    try:
        error = float(number)
    except ValueError:
        error = math.nan
    if name not in UNTOUCHED or not 0 < error < math.inf:
        raise CaptureError(
            f"--until {text}: give VALUE=ERROR, e.g. tilt_x_deg=0.3; values are {', '.join(UNTOUCHED)}"
        )
    return name, error


def _print_errors(poses: int, errors: dict[str, float]) -> None:
    text = ", ".join(f"{name} {error:.3g}" for name, error in errors.items())
    click.echo(f"{poses} poses; errors expected: {text}", err=True)


def _run(rig: str, plan: AnyPlan, output: Path, camera: str, *, resume: bool) -> None:
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
    n_frames = progress_of(output, plan).frames
    now = "" if taken == n_frames else f" ({taken or 'none'} of them now)"
    click.echo(
        f"{output}: complete, {counted(n_frames, 'frame')} of protocol {plan.name}{now}; "
        f"table {output.with_suffix('.csv')}"
    )
