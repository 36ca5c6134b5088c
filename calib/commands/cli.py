"""`python -m calib`: the commands, rows of COMMANDS. How a command ends: `hostlink.cli_exit`."""

import os
import sys
from typing import NoReturn

import click

from edge.errors import EdgeError
from hostlink.cli_exit import program_name, run_command
from hostlink.command_group import CommandGroup, CommandRow

COMMANDS = {
    name: CommandRow(f"calib.commands.{name}:{name}_command", text)
    for name, text in {
        "capture": "Run a calibration protocol on a rig and record it with its truth.",
        "demo": "Replay the bundled recordings through the whole chain, compare with the truth, "
        "draw pictures.",
        "fit": "Fit a calibration to frames with known truth.",
        "lens": "Measure a lens by IMAGEs of a checkerboard, for ?lens=FILE in a source's address.",
        "report": "One page on the accuracy of calibrations, and the reasons for the edge's methods.",
        "scale": "Press on a kitchen scale by hand: pictures and forces for `calib fit`.",
        "simulate": "Press a known sensor's simulated tip at random, and fit a calibration to what its "
        "camera sees.",
        "evaluate": "Errors of a calibration on frames with known truth.",
    }.items()
}


@click.group(
    cls=CommandGroup,
    table=COMMANDS,
    extra="calib",
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="voronoi-touch", message="%(prog)s %(version)s")
def cli() -> None:
    """Calibrate a fingertip: capture on a rig, fit, evaluate, report."""


def main() -> NoReturn:
    """Run a command and exit, with the exit codes of `hostlink.cli_exit`."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy: processes are the parallelism here
    sys.exit(run_command(cli, program_name("voronoi-touch-calib", "calib"), (EdgeError,)))
