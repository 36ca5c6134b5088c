"""Benchmarks and long checks: `python -m tests.bench [COMMAND]`.

Each command is a module that is imported when it is called. A new one is a line in `COMMANDS`: name, module,
description. Its module has a click command named `command`. Called with
options only, the group runs `DEFAULT`.
"""

from __future__ import annotations

import importlib

import click

COMMANDS = {
    "accuracy": ("tests.bench.accuracy", "Time of a frame against its error, for every kind of model."),
    "axes": ("tests.bench.axes", "Errors on the published recordings, with eight forms of the rig's axes."),
    "bridge": ("tests.bench.bridge", "Fingers through the ROS 2 bridge to a peer: losses and latency."),
    "identity": ("tests.bench.identity", "Pin identity after a jump, on real and simulated frames."),
    "instructions": ("tests.bench.instructions", "Instructions and cache misses of a frame, counted."),
    "paced": ("tests.bench.paced", "The running program at 240 frames/s: latency, memory, losses."),
    "speed": ("tests.bench.speed", "Time per frame and stage, against reference and floor (default)."),
    "real": ("tests.bench.real", "Errors on the published recordings, five splits and a learning curve."),
    "videos": ("tests.bench.videos", "Identities held through the published videos."),
    "hazards": ("tests.bench.hazards", "Rendered hazards through the whole chain: identities, place, depth."),
    "learning": ("tests.bench.learning", "Error over the number of frames fitted; chosen frames."),
    "link": ("tests.bench.link", "Fingers on one bus: losses and latency."),
    "viewers": ("tests.bench.viewers", "Viewers of the live page: what they cost the loop."),
    "wire": ("tests.bench.wire", "Coding of frames: processor time of one."),
    "slip": ("tests.bench.slip", "Slip announced before it happens, and false alarms."),
    "soak": ("tests.bench.soak", "The program under a random schedule of all faults, and its promises."),
    "stability": ("tests.bench.stability", "Hard cases of the geometry against exact arithmetic."),
}
DEFAULT = "speed"


class LazyGroup(click.Group):
    """Imports a command's module when the command is called, not to list it."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(COMMANDS[cmd_name][0]).command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, COMMANDS[name][1]) for name in self.list_commands(ctx)])

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if DEFAULT in COMMANDS and "--help" not in args and (not args or args[0].startswith("-")):
            args = [DEFAULT, *args]
        return super().parse_args(ctx, args)


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
def main() -> None:
    """Benchmarks and long checks; results go to out/bench."""


if __name__ == "__main__":
    main(prog_name="python -m tests.bench")
