"""`python -m edge`: the commands, rows of COMMANDS. How a command ends: `hostlink.cli_exit`."""

import logging
import sys
from typing import NoReturn

import click

from edge.errors import InputError
from edge.runtime.process import limit_resources
from hostlink.cli_exit import program_name, run_command
from hostlink.command_group import CommandGroup, CommandRow

_SUMMARIES = {
    "run": "Run the finger: camera in, bus out, until stopped.",
    "hand": "Run the fingers of a hand whose cameras are on one OAK module, until stopped.",
    "replay": "Send RECORDING (MCAP, video, folder of images, example:press) as if it were live.",
    "render": "Make a video of RECORDING: cells, contacts and shear beside the camera's image.",
    "inspect": "Find the pins in each IMAGE, and say what is good and what to improve.",
    "sensor": "Describe a sensor by one IMAGE of its untouched skin, for --sensor and [sensor] model.",
    "doctor": "Check camera, pins, calibration, link, processor, clock and disk.",
}
COMMANDS = {name: CommandRow(f"edge.cli.{name}:{name}", text) for name, text in _SUMMARIES.items()}


@click.group(
    cls=CommandGroup,
    table=COMMANDS,
    extra="edge",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.option("-v", "--verbose", is_flag=True, help="Log in more detail.")
@click.version_option(package_name="voronoi-touch", message="%(prog)s %(version)s")
def cli(verbose: bool) -> None:
    """Reads touch from the pins of a camera-based fingertip and sends it over CAN, CAN FD or serial.

    \b
    First steps without hardware:
      python -m edge replay example:press --sink memory:  a recording through the whole chain
      python -m edge inspect IMAGE                        which pins are seen in a picture of a tip
    With a camera and a bus:
      python -m edge run --source v4l2:0 --sink can:can0 --calibration tip.json
    """
    logging.basicConfig(
        level=logging.INFO if verbose else logging.WARNING, format="%(levelname)s %(name)s: %(message)s"
    )


def main() -> NoReturn:
    """Run a command and exit, with the exit codes of `hostlink.cli_exit`."""
    limit_resources()
    name = program_name("voronoi-touch-edge", "edge")
    sys.exit(run_command(cli, name, (InputError,)))
