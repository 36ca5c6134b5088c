"""Exit codes of the three programs, and their one line of error message.

    0    done; also if the reader of stdout stopped (`... | head -1`) or there is no stdout (`>&-`)
    1    a failure that is not the user's: a link, a sensor, a full disk
    2    the user's mistake: "error: what, where, what would be right" on stderr, and nothing else
    130  Ctrl-C; 129, 131 and 143 for SIGHUP, SIGQUIT and SIGTERM, as in a shell

Only a defect ends in a traceback.
"""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence

import click

from hostlink.input_file import InputFileError
from hostlink.interrupt import exit_code, interrupting
from hostlink.output_file import OutputError, WriteError

__all__ = ["print_error", "program_name", "run_command"]

Kinds = tuple[type[Exception], ...]

_NO_NAME = frozenset({errno.ENAMETOOLONG, errno.ELOOP})  # no file could have it
_STDOUT_FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})


def program_name(script: str, module: str) -> str:
    """The program as the user typed it: shells complete the installed script, by
    `_VORONOI_TOUCH_..._COMPLETE`.
    """
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
    mistakes   errors of the user; failures: other errors. A class in both is a mistake
    arguments  None: those of the process
    """
    wrong: Kinds = (OutputError, InputFileError, *mistakes)
    _replace_closed_streams()
    stdout = sys.stdout
    try:
        with interrupting():
            code = command.main(args=arguments, prog_name=name, standalone_mode=False)
        sys.stdout.flush()  # here, and not at the interpreter's end, where it would be a traceback
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return 2
    except click.ClickException as error:
        return print_error(_click_message(error))
    except WriteError as error:
        return print_error(str(error), 1)
    except wrong as error:
        return print_error(str(error))
    except failures as error:
        return print_error(str(error), 1)
    except KeyboardInterrupt as interrupt:
        return exit_code(interrupt)
    except click.Abort as abort:  # made by click of KeyboardInterrupt
        return exit_code(abort.__cause__)
    except BrokenPipeError:
        return _stdout_ended()
    except SystemExit:  # shell completion ends like this, and click with a broken pipe, whose stdout it wraps
        if sys.stdout is stdout:
            raise
        return _stdout_ended()
    except OSError as error:
        if error.filename is not None:
            return print_error(
                f"{os.fsdecode(error.filename)}: {error.strerror}", 2 if error.errno in _NO_NAME else 1
            )
        if error.errno not in _STDOUT_FULL:
            raise
        _stdout_ended()
        return print_error(f"stdout: cannot be written: {error.strerror}", 1)
    return code if isinstance(code, int) else 0


def _replace_closed_streams() -> None:
    """Streams that the shell closed (`>&-`, `2>&-`) are None: print to nowhere instead. Their descriptors are
    taken as well, or the next file opened would get what C libraries print.
    """
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is not None:
            continue
        try:
            os.fstat(descriptor)
        except OSError:  # closed; it is the lowest free one, as those below are open by now
            os.open(os.devnull, os.O_RDWR)
        mode = "r" if name == "stdin" else "w"
        setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115 - open until the end


def _stdout_ended() -> int:
    """Stdout is closed: drop its buffer, so that the interpreter prints no error."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    return 0


def print_error(message: str, code: int = 2) -> int:
    """One line on stderr; the exit code."""
    click.echo("error: " + " ".join(message.split()), err=True)
    return code


def _click_message(error: click.ClickException) -> str:
    """Click's message, and where the correct use is described."""
    message = error.format_message()
    if isinstance(error, click.UsageError) and error.ctx is not None:
        return f"{message.rstrip('.')}; see {error.ctx.command_path} --help"
    return message
