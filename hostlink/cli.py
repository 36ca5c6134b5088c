"""`python -m hostlink`: the commands, and how they end.

Rules
- A command is a row of COMMANDS, imported when it is called. Other packages add theirs through the entry
  point group `voronoi_touch.host_commands`: a name and a click command.
- Every mistake of the user is one line on stderr and exit code 2; a link or sensor that fails is one line
  and exit code 1. Nothing ends in a traceback but a defect.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import entry_points

import click

from hostlink.errors import LinkError, UsageError
from hostlink.wire.address import AddressError

__all__ = ["COMMANDS", "cli", "main"]

COMMANDS: dict[str, str] = {
    "monitor": "hostlink.cli_live:monitor",
    "record": "hostlink.cli_live:record",
    "decode": "hostlink.cli_live:decode",
    "view": "hostlink.view.command:view",
    "plot": "hostlink.plot:plot",
    "info": "hostlink.cli_ask:info",
    "tare": "hostlink.cli_ask:tare",
    "set": "hostlink.cli_ask:set_object",
    "busload": "hostlink.cli_ask:busload",
}
ENTRY_POINTS = "voronoi_touch.host_commands"


class _Commands(click.Group):
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


@click.command(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
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


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and exit: 0 done, 1 the link or the sensor failed, 2 the user's mistake."""
    # Shells complete the installed script, by _VORONOI_TOUCH_HOST_COMPLETE.
    script = os.path.basename(sys.argv[0]) == "voronoi-touch-host"
    name = "voronoi-touch-host" if script else "python -m hostlink"
    try:
        code = cli.main(args=arguments, prog_name=name, standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        sys.exit(2)
    except click.ClickException as error:
        sys.exit(_complain(error.format_message(), 2))
    except (UsageError, AddressError) as error:
        sys.exit(_complain(str(error), 2))
    except LinkError as error:
        sys.exit(_complain(str(error), 1))
    except (KeyboardInterrupt, click.Abort):
        sys.exit(130)  # as a shell has it for SIGINT
    except BrokenPipeError:
        # `... | head` has seen enough; keep the interpreter's last flush from complaining about it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    sys.exit(code if isinstance(code, int) else 0)


def _complain(words: str, code: int) -> int:
    click.echo("error: " + " ".join(words.split()), err=True)
    return code
