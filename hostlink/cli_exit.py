"""How the three programs end: with an exit code, and with one line where something went wrong.

    0    done; also where the reader of stdout had enough (`... | head -1`)
    1    something failed that the user did not do: a link, a sensor, a full disk
    2    the user's mistake: "error: what, where, what would be right" on stderr, and nothing else
    130  Ctrl-C, as a shell has it for SIGINT

Nothing ends in a traceback but a defect.
"""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence

import click

from hostlink.output_file import OutputError, WriteError

__all__ = ["complain", "program_name", "run_command"]

Kinds = tuple[type[Exception], ...]

_STDOUT_FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})


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
    wrong: Kinds = (OutputError, *mistakes)
    stdout = sys.stdout
    try:
        code = command.main(args=arguments, prog_name=name, standalone_mode=False)
        sys.stdout.flush()  # here, and not at the interpreter's end, where it would be a traceback
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return 2
    except click.ClickException as error:
        return complain(_words(error))
    except WriteError as error:
        return complain(str(error), 1)
    except wrong as error:
        return complain(str(error))
    except failures as error:
        return complain(str(error), 1)
    except (KeyboardInterrupt, click.Abort):
        return 130
    except BrokenPipeError:
        return _stdout_ended()
    except SystemExit:  # shell completion ends like this, and click with a broken pipe, whose stdout it wraps
        if sys.stdout is stdout:
            raise
        return _stdout_ended()
    except OSError as error:
        if error.errno not in _STDOUT_FULL or error.filename is not None:
            raise
        _stdout_ended()
        return complain(f"stdout: cannot be written: {error.strerror}", 1)
    return code if isinstance(code, int) else 0


def _stdout_ended() -> int:
    """Stdout takes no more: drop what is left in its buffer, so that the interpreter does not complain."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    return 0


def complain(words: str, code: int = 2) -> int:
    """One line on stderr; the exit code."""
    click.echo("error: " + " ".join(words.split()), err=True)
    return code


def _words(error: click.ClickException) -> str:
    """What click found wrong, and where to read what would be right."""
    words = error.format_message()
    if isinstance(error, click.UsageError) and error.ctx is not None:
        return f"{words.rstrip('.')}; see {error.ctx.command_path} --help"
    return words
