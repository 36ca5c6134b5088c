"""Programs end with an exit code and at most one line, for any failure of stdout."""

import sys
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path

import click
import pytest

from hostlink.cli_exit import run_command
from tests.support.processes import program

PROGRAM = """
import sys, click
from hostlink.cli_exit import run_command

@click.command()
@click.option("--lines", type=int, default=1)
def count(lines):
    for i in range(lines):
        click.echo(str(i))

sys.exit(run_command(count, "count", ()))
"""


FULL = "error: stdout: cannot be written: No space left on device\n"


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("--lines 100000 | head -1", (0, "0\n", "")),
        ("| true", (0, "", "")),
        ("--lines 100000 >&-", (0, "", "")),
        ("<&- 2>&-", (0, "0\n", "")),
        ("--unknown <&- >&- 2>&-", (2, "", "")),
        ("--lines 100000 > /dev/full", (1, "", FULL)),
    ],
)
def test_streams_that_are_closed_or_full(line: str, expected: tuple[int, str, str]) -> None:
    """A reader that has seen enough is no error, and neither is a stream that was closed from the start."""
    environment = {"COUNT": PROGRAM, "PYTHON": sys.executable, "PATH": "/usr/bin:/bin"}
    run = program("bash", "-c", f'set -o pipefail; "$PYTHON" -c "$COUNT" {line}', env=environment)
    assert (run.returncode, run.stdout, run.stderr) == expected


def test_no_file_takes_the_place_of_a_closed_stdout() -> None:
    """What a C library prints must not end up in a file that a command writes."""
    opens = PROGRAM.replace("click.echo(str(i))", "sys.exit(open('/dev/null', 'wb').fileno())")
    assert program("bash", "-c", '"$0" -c "$1" >&-', sys.executable, opens).returncode > 2


def test_a_file_that_fails_is_one_line(tmp_path: Path) -> None:
    """Wherever it is met: the file's name and why."""
    path = tmp_path / "gone" / "x"

    @click.command()
    def command() -> None:
        path.write_text("")

    with redirect_stderr(StringIO()) as output:
        assert run_command(command, "command", (), arguments=[]) == 1
    assert output.getvalue() == f"error: {path}: No such file or directory\n"
