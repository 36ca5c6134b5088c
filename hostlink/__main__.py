"""`python -m hostlink`: the host's program. Its commands: `hostlink.commands.cli`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

from hostlink.interrupt import exit_on_interrupt


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run a command and exit, with the exit codes of `hostlink.cli_exit`."""
    with exit_on_interrupt():  # imports take a part of a second; `run` takes over from here
        from hostlink.commands.cli import main as run

        run(arguments)


if __name__ == "__main__":
    main()
