"""`python -m hostlink`: the commands.

Rules
- A command is a row of COMMANDS, imported when it is called. Other packages add theirs through the entry
  point group `voronoi_touch.host_commands`: a name and a click command.
- How a command ends: `hostlink.cli_exit`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import entry_points
from typing import NoReturn

import click

from hostlink.cli_exit import program_name, run_command
from hostlink.errors import LinkError, UsageError
from hostlink.wire import SCHEMA_HASH, VERSION
from hostlink.wire.address import AddressError

__all__ = ["COMMANDS", "cli", "main"]

COMMANDS: dict[str, str] = {
    "monitor": "hostlink.commands.live:monitor",
    "record": "hostlink.commands.live:record",
    "decode": "hostlink.commands.live:decode",
    "view": "hostlink.commands.view:view",
    "plot": "hostlink.commands.plot:plot",
    "info": "hostlink.commands.ask:info",
    "tare": "hostlink.commands.ask:tare",
    "set": "hostlink.commands.ask:set_object",
    "busload": "hostlink.commands.ask:busload",
    "bridge": "hostlink.commands.bridge:bridge",
}
ENTRY_POINTS = "voronoi_touch.host_commands"


class _HostCommands(click.Group):
    """Commands by name, each imported when it is needed."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [*COMMANDS, *(e.name for e in entry_points(group=ENTRY_POINTS) if e.name not in COMMANDS)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name in COMMANDS:
            module, _, name = COMMANDS[cmd_name].partition(":")
            command = getattr(import_module(module), name)
        else:
            found = [e for e in entry_points(group=ENTRY_POINTS) if e.name == cmd_name]
            if not found:
                return None
            command = found[0].load()
        assert isinstance(command, click.Command)
        return command


@click.command(cls=_HostCommands, context_settings={"help_option_names": ["-h", "--help"]})
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
