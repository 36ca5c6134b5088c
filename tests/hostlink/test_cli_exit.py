"""Programs end with an exit code and at most one line, for any failure of stdout."""

from __future__ import annotations

import subprocess
import sys
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path

import click

from hostlink.cli_exit import run_command

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


def shell(line: str) -> subprocess.CompletedProcess[str]:
    """Run a line in which $COUNT is a program that prints."""
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; {line}"],
        env={"COUNT": PROGRAM, "PYTHON": sys.executable, "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )


def test_closing_stdout_is_no_error() -> None:
    run = shell('"$PYTHON" -c "$COUNT" --lines 100000 | head -1')
    assert (run.returncode, run.stdout, run.stderr) == (0, "0\n", "")


def test_stdout_closed_before_the_first_flush_is_no_error() -> None:
    run = shell('"$PYTHON" -c "$COUNT" | true')
    assert (run.returncode, run.stderr) == (0, "")


def test_stdout_and_stderr_closed_from_the_start_are_no_error() -> None:
    run = shell('"$PYTHON" -c "$COUNT" --lines 100000 >&-')
    assert (run.returncode, run.stderr) == (0, "")
    run = shell('"$PYTHON" -c "$COUNT" <&- 2>&-')
    assert (run.returncode, run.stdout) == (0, "0\n")
    run = shell('"$PYTHON" -c "$COUNT" --unknown <&- >&- 2>&-')
    assert (run.returncode, run.stdout, run.stderr) == (2, "", "")


def test_no_file_takes_the_place_of_a_closed_stdout() -> None:
    """What a C library prints must not end up in a file that a command writes."""
    opens = PROGRAM.replace("click.echo(str(i))", "sys.exit(open('/dev/null', 'wb').fileno())")
    run = subprocess.run(["bash", "-c", '"$0" -c "$1" >&-', sys.executable, opens], check=False)
    assert run.returncode > 2


def test_a_file_that_fails_is_one_line(tmp_path: Path) -> None:
    """Wherever it is met: the file's name and why."""
    path = tmp_path / "gone" / "x"

    @click.command()
    def command() -> None:
        path.write_text("")

    with redirect_stderr(StringIO()) as output:
        assert run_command(command, "command", (), arguments=[]) == 1
    assert output.getvalue() == f"error: {path}: No such file or directory\n"


def test_a_full_stdout_is_one_line() -> None:
    for lines in (1, 100_000):
        run = shell(f'"$PYTHON" -c "$COUNT" --lines {lines} > /dev/full')
        assert run.returncode == 1
        assert run.stderr == "error: stdout: cannot be written: No space left on device\n"
