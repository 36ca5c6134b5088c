"""`python -m calib`: capture, fit, evaluate, report. Commands are rows of COMMANDS, in `calib/commands`.

A user's mistake is one line on stderr and exit code 2. A command's module is imported when it is called, so
that `--help` is quick and one command's missing library does not stop the others.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from typing import NoReturn

import click

from edge.errors import EdgeError, InputError
from hostlink.cli_exit import program_name, run_command

# Name: module and function, what it does.
COMMANDS: dict[str, tuple[str, str]] = {
    "capture": ("calib.commands.capture:capture_command", "Record a protocol on a rig, with its truth."),
    "demo": ("calib.commands.demo:demo_command", "The whole chain on bundled recordings."),
    "fit": ("calib.commands.fit:fit_command", "Fit a calibration to frames with known truth."),
    "report": ("calib.commands.report:report_command", "One page: errors, curves, speed against error."),
    "evaluate": ("calib.commands.evaluate:evaluate_command", "Errors of a calibration on known frames."),
}


class _CalibCommands(click.Group):
    """Commands by name, each imported when it is needed."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, _, name = COMMANDS[cmd_name][0].partition(":")
        command = getattr(import_module(module), name)
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except ImportError as error:
            raise InputError(f"{error}; install voronoi-touch[calib]") from error


@click.group(cls=_CalibCommands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="voronoi-touch", message="%(prog)s %(version)s")
def cli() -> None:
    """Calibrate a fingertip: capture on a rig, fit, evaluate, report."""


def main() -> NoReturn:
    """Run a command and exit, with the exit codes of `hostlink.cli_exit`."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy: processes are the parallelism here
    sys.exit(run_command(cli, program_name("voronoi-touch-calib", "calib"), (EdgeError,)))


if __name__ == "__main__":
    main()
