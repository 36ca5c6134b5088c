"""`python -m edge`: the finger's own program. Commands are rows of COMMANDS, in `edge/cli`.

A user's mistake is one line on stderr and exit code 2. Heavy modules load with the command that needs them.
"""

from __future__ import annotations

import logging
import sys
from importlib import import_module
from typing import NoReturn

import click

from edge.errors import InputError
from edge.runtime.process import limit_threads, run_and_exit
from hostlink.cli_exit import program_name, run_command

COMMANDS = {
    "run": "edge.cli.run:run",
    "replay": "edge.cli.replay:replay",
    "render": "edge.cli.render:render",
    "inspect": "edge.cli.inspect:inspect",
    "doctor": "edge.cli.doctor:doctor",
}


class _EdgeCommands(click.Group):
    """Commands by name, each imported when it is needed."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, _, name = COMMANDS[cmd_name].partition(":")
        command = getattr(import_module(module), name)
        assert isinstance(command, click.Command)
        return command

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except ImportError as error:  # only the host's part is installed
            raise InputError(f"{error}; install voronoi-touch[edge]") from error


@click.command(
    cls=_EdgeCommands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.option("-v", "--verbose", is_flag=True, help="Log in more detail.")
@click.version_option(package_name="voronoi-touch", message="%(prog)s %(version)s")
def cli(verbose: bool) -> None:
    """Reads touch from the pins of a camera-based fingertip and sends it over CAN, CAN FD or serial.

    \b
    First steps without hardware:
      python -m edge inspect IMAGE                    which pins are seen in a picture of a tip
      python -m edge replay RECORDING --sink memory:  a recording through the whole chain
    With a camera and a bus:
      python -m edge run --source v4l2:0 --sink can:can0 --calibration tip.json
    """
    logging.basicConfig(
        level=logging.INFO if verbose else logging.WARNING, format="%(levelname)s %(name)s: %(message)s"
    )


def main() -> NoReturn:
    """Run a command and exit, with the exit codes of `hostlink.cli_exit`."""
    limit_threads()
    name = program_name("voronoi-touch-edge", "edge")
    sys.exit(run_command(cli, name, (InputError,)))


def program() -> NoReturn:
    """`main`, for its own process."""
    run_and_exit(main)


if __name__ == "__main__":
    program()
