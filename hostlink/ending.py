"""How the three programs end: with one line for a mistake, and an exit code that says whose it was.

    0    done
    1    something failed that the user did not do: a link, a sensor
    2    the user's mistake: "error: what, where, what would be right" on stderr, and nothing else
    130  Ctrl-C, as a shell has it for SIGINT

Nothing ends in a traceback but a defect.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

import click

__all__ = ["complain", "program_name", "run_command"]

Kinds = tuple[type[Exception], ...]


def program_name(script: str, module: str) -> str:
    """What the user typed: shells complete the installed script, by `_VORONOI_TOUCH_..._COMPLETE`."""
    return script if os.path.basename(sys.argv[0]) == script else f"python -m {module}"


def run_command(
    command: click.Command,
    name: str,
    mistakes: Kinds,
    failures: Kinds = (),
    arguments: Sequence[str] | None = None,
) -> int:
    """Run a command line; its exit code.

    name       of the program, as it was typed
    mistakes   what the user did; failures: what he did not. A class in both is a mistake
    arguments  None: those of the process
    """
    try:
        code = command.main(args=arguments, prog_name=name, standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return 2
    except click.ClickException as error:
        return complain(_words(error))
    except mistakes as error:
        return complain(str(error))
    except failures as error:
        return complain(str(error), 1)
    except (KeyboardInterrupt, click.Abort):
        return 130
    except BrokenPipeError:
        # `... | head` has seen enough; keep the interpreter's last flush from complaining about it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code if isinstance(code, int) else 0


def complain(words: str, code: int = 2) -> int:
    """One line on stderr; the exit code."""
    click.echo("error: " + " ".join(words.split()), err=True)
    return code


def _words(error: click.ClickException) -> str:
    """What click found wrong, and where what would be right is told."""
    words = error.format_message()
    if isinstance(error, click.UsageError) and error.ctx is not None:
        return f"{words.rstrip('.')}; see {error.ctx.command_path} --help"
    return words
