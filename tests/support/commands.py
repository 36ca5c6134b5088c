"""Command lines, run in this process: their exit codes, and the one line of those that are refused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from calib.__main__ import main as calib_main
from hostlink.commands.cli import main as host_main


def run_host(*arguments: str | Path) -> int:
    """The exit code of `python -m hostlink ...`."""
    with pytest.raises(SystemExit) as end:
        host_main([str(argument) for argument in arguments])
    assert isinstance(end.value.code, int)
    return end.value.code


def run_calib(*arguments: str | Path) -> int:
    """The exit code of `python -m calib ...`."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("sys.argv", ["calib", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            calib_main()
    assert isinstance(end.value.code, int)
    return end.value.code


def only_error(capture: pytest.CaptureFixture[str]) -> str:
    """What a refused command printed: a line on stderr, and nothing else."""
    out, err = capture.readouterr()
    assert out == ""
    (line,) = err.splitlines()
    assert line.startswith("error: ")
    return line


def run_host_without(modules: list[str], *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """The command, like in an installation without these modules."""
    program = (
        f"import sys; sys.modules.update(dict.fromkeys({modules!r}));"
        "from hostlink.commands.cli import main; main(sys.argv[1:])"
    )
    return subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)], capture_output=True, text=True, check=False
    )
