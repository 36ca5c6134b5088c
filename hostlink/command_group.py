"""A program's commands from a table, each imported when it is called.

So `--help` is quick, and a library that is missing stops only the commands that need it.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any, NamedTuple

import click

from hostlink.interrupt import exit_on_interrupt

__all__ = ["CommandGroup", "CommandRow"]


class CommandRow(NamedTuple):
    """A command."""

    place: str  # module:function
    summary: str  # first sentence of its help


class CommandGroup(click.Group):
    """Commands by name.

    extra  of the package, that brings the commands' libraries: named where one is missing; "": none is needed
    """

    def __init__(
        self, *args: Any, table: Mapping[str, CommandRow], extra: str = "", **attributes: Any
    ) -> None:
        super().__init__(*args, **attributes)
        self._table, self._extra = table, extra

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self._table)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self._table:
            return None
        module, _, name = self._table[cmd_name].place.partition(":")
        with exit_on_interrupt():
            command = getattr(import_module(module), name)
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, self._summary(ctx, name)) for name in self.list_commands(ctx)])

    def _summary(self, ctx: click.Context, name: str) -> str:
        if name in self._table:
            return self._table[name].summary
        command = self.get_command(ctx, name)
        return "" if command is None else command.get_short_help_str()

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except ImportError as error:
            if not self._extra:
                raise
            if error.name == "cython":  # a folder of the source comes before what is installed
                way_out = "`pip install -e .` compiles it, or start the command in another folder"
                raise click.ClickException(f"the source in this folder is not compiled; {way_out}") from error
            raise click.ClickException(
                f"{error}; install voronoi-touch[{self._extra}] or -e .[{self._extra}]"
            ) from error
