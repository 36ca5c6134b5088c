"""Benchmarks and long checks: `python -m tests.bench [COMMAND]`.

A new one is a line in `COMMANDS`, and a module of that name with a click command named `command`. Called with
options only, the group runs `DEFAULT`.
"""

import sys

import click

from edge.errors import EdgeError
from hostlink.cli_exit import run_command
from hostlink.command_group import CommandGroup, CommandRow

COMMANDS = {
    "accuracy": "Instructions of a frame against its error, for every kind of model.",
    "contacts": "Contacts on a second, independent simulator, against their bounds.",
    "dynamics": "Noise, smallest press, steps, false touches and creep of a simulated tip.",
    "forces": "Forces of weights on a published dome, against scikit-learn, leave one load out.",
    "grasp": "Two simulated fingers, an object with mass and a gripper, end to end.",
    "hazards": "Rendered hazards through the whole chain: identities, place, depth.",
    "host": "A sample at the host, and a recording: against python-can and cantools.",
    "identity": "Pin identity after a jump and its confidence, on real and simulated frames.",
    "real": "Errors on the published recordings, five splits and a learning curve.",
    "sensors": "The table of docs/sensors.md: each real sensor, and a picture of some.",
    "sigma": "Share of the errors on the published recordings that is within sigma.",
    "slip": "Slip announced before it happens, and false alarms.",
    "soak": "The program under a random schedule of all faults, and its promises.",
    "speed": "Time per frame, against the reference (default).",
    "stability": "Hard cases of the geometry against exact arithmetic.",
    "step": "Instructions, misses and calls of one step, from the image to the CAN FD frame.",
    "videos": "Identities held and contacts found in the published videos.",
}
DEFAULT = "speed"
HELP = ("-h", "--help")


class _Benchmarks(CommandGroup):
    """Called with options only: DEFAULT."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args or (args[0].startswith("-") and args[0] not in HELP):
            args = [DEFAULT, *args]
        return super().parse_args(ctx, args)


@click.group(
    cls=_Benchmarks,
    table={name: CommandRow(f"tests.bench.{name}:command", text) for name, text in COMMANDS.items()},
    extra="dev",
    context_settings={"help_option_names": list(HELP)},
)
def main() -> None:
    """Benchmarks and long checks; results go to out/bench."""


if __name__ == "__main__":
    sys.exit(run_command(main, "python -m tests.bench", (EdgeError,)))
