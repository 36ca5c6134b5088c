"""`python -m hostlink`: the commands.

Rules
- A command is a row of COMMANDS, imported when it is called. Other packages add theirs through the entry
  point group `voronoi_touch.host_commands`: a name and a click command.
- How a command ends: `hostlink.cli_exit`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.metadata import entry_points
from typing import NoReturn

import click

from hostlink.cli_exit import program_name, run_command
from hostlink.command_group import CommandGroup, CommandRow
from hostlink.errors import LinkError, UsageError
from hostlink.interrupt import exit_on_interrupt
from hostlink.wire import SCHEMA_HASH, VERSION
from hostlink.wire.address import AddressError

__all__ = ["COMMANDS", "cli", "main"]

COMMANDS = {
    "monitor": CommandRow(
        "hostlink.commands.live:monitor",
        "Show the samples of the fingers at ADDRESS, and the state of the link.",
    ),
    "record": CommandRow(
        "hostlink.commands.live:record",
        "Record all that comes in at ADDRESS into FILE: .log or .blf for a bus, .serial for a line.",
    ),
    "decode": CommandRow(
        "hostlink.commands.live:decode",
        "Print the samples in FILE, one line each, or write them as a table.",
    ),
    "view": CommandRow(
        "hostlink.commands.view:view",
        "Show the fingers at ADDRESS in a browser, laid out as a hand.",
    ),
    "plot": CommandRow("hostlink.commands.plot:plot", "Draw what FILE holds over time."),
    "info": CommandRow("hostlink.commands.ask:info", "Identity, settings and statistics of a finger."),
    "tare": CommandRow(
        "hostlink.commands.ask:tare",
        "Take the rest frame (tare) anew, and wait until it is in use.",
    ),
    "set": CommandRow(
        "hostlink.commands.ask:set_object",
        "Set object NAME of a finger: rate_hz, divider, features, heartbeat_ms, detail_divider, ...",
    ),
    "busload": CommandRow("hostlink.commands.ask:busload", "How full a bus gets, with worst-case stuffing."),
    "hand": CommandRow(
        "hostlink.commands.hand:hand",
        "Check the hand in FILE and list its fingers; write its URDF, or a view for RViz.",
    ),
    "dbc": CommandRow(
        "hostlink.commands.dbc:dbc",
        "Write a CAN database (DBC) of the fingers with these numbers, or of those of a hand.",
    ),
    "bridge": CommandRow(
        "hostlink.commands.bridge:bridge",
        "Pass the samples of the fingers at ADDRESS to ROS 2 (--ros jazzy), to viewers (--foxglove) or both.",
    ),
}
ENTRY_POINTS = "voronoi_touch.host_commands"


class _HostCommands(CommandGroup):
    """Ours, and those of other packages."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        ours = super().list_commands(ctx)
        return [*ours, *(e.name for e in entry_points(group=ENTRY_POINTS) if e.name not in ours)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if (ours := super().get_command(ctx, cmd_name)) is not None:
            return ours
        found = [e for e in entry_points(group=ENTRY_POINTS) if e.name == cmd_name]
        if not found:
            return None
        with exit_on_interrupt():
            command = found[0].load()
        assert isinstance(command, click.Command)
        return command


@click.group(cls=_HostCommands, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(
    package_name="voronoi-touch",
    message=f"%(package)s %(version)s, wire version {VERSION}, schema 0x{SCHEMA_HASH:08x}",
)
def cli() -> None:
    """Watch, record and set voronoi-touch fingertips.

    \b
    ADDRESS is where they are:
      can:can0                           SocketCAN, CAN FD; ?fd=0 for classic
      can:PCAN_USBBUS1?interface=pcan    any interface that python-can knows
      slcan:/dev/ttyACM0?bitrate=1000000 serial-line CAN adapter
      udp:239.0.0.1                      CAN frames over UDP on this machine
      serial:/dev/ttyACM0?baud=921600    UART or USB CDC
    """


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run a command and exit, with the exit codes of `hostlink.cli_exit`."""
    name = program_name("voronoi-touch-host", "hostlink")
    sys.exit(run_command(cli, name, (UsageError, AddressError), (LinkError,), arguments))
