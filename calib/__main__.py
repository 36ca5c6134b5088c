"""`python -m calib`: capture, fit, evaluate, report.

Each command's module is imported when it is called, so that `--help` is quick and one command's missing
library does not stop the others.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from typing import NoReturn

import click

from edge.errors import EdgeError
from hostlink.ending import program_name, run_command

# name: (module, attribute, what it does)
COMMANDS: dict[str, tuple[str, str, str]] = {
    "capture": ("calib.commands", "capture_command", "Run a protocol on a rig and record it with its truth."),
    "demo": ("calib.fit_commands", "demo_command", "The whole chain on bundled recordings."),
    "fit": ("calib.fit_commands", "fit_command", "Fit a calibration to frames with known truth."),
    "report": ("calib.report.command", "report_command", "One page: errors, curves, speed against error."),
    "evaluate": ("calib.fit_commands", "evaluate_command", "Errors of a calibration on known frames."),
}


class LazyGroup(click.Group):
    """A group that knows its commands' names and first lines, and imports them on use."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, attribute, _ = COMMANDS[cmd_name]
        command = getattr(import_module(module), attribute)
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, _, text) in COMMANDS.items()])


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
def cli() -> None:
    """Calibrate a fingertip: capture on a rig, fit, evaluate, report."""


def main() -> NoReturn:
    """Run a command and exit, as `hostlink.ending` has it."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy: processes are the parallelism here
    sys.exit(run_command(cli, program_name("voronoi-touch-calib", "calib"), (EdgeError,)))


if __name__ == "__main__":
    main()
