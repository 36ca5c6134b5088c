"""Command lines, run in this process: how they ended, and what they printed."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

import pytest

from calib.__main__ import main as calib_main
from edge.__main__ import main as edge_main
from hostlink.commands.cli import main as host_main
from tests.support.processes import python


@dataclass(frozen=True)
class Done:
    """How a command ended."""

    code: int
    out: str = ""
    err: str = ""

    @property
    def printed(self) -> str:
        """What a command printed that succeeded."""
        assert self.code == 0, self
        return self.out

    @property
    def refusal(self) -> str:
        """The one line of a command that was refused: its exit code is 2, and it printed nothing else."""
        assert (self.code, self.out) == (2, ""), self
        (line,) = self.err.splitlines()
        assert line.startswith("error: ")
        return line


def run_host(*arguments: str | Path) -> Done:
    """`python -m hostlink ...`."""
    return _done(lambda: host_main([str(argument) for argument in arguments]))


def run_calib(*arguments: str | Path) -> Done:
    """`python -m calib ...`."""
    return _as_typed(calib_main, "calib", *arguments)


def run_edge(*arguments: str | Path) -> Done:
    """`python -m edge ...`."""
    return _as_typed(edge_main, "edge", *arguments)


def _as_typed(main: Callable[[], object], *words: str | Path) -> Done:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("sys.argv", [*map(str, words)])
        return _done(main)


def run_host_without(modules: list[str], *arguments: str | Path) -> Done:
    """`python -m hostlink ...` like in an installation without these modules."""
    program = (
        f"import sys; sys.modules.update(dict.fromkeys({modules!r}));"
        "from hostlink.commands.cli import main; main(sys.argv[1:])"
    )
    ended = python("-c", program, *arguments)
    return Done(ended.returncode, ended.stdout, ended.stderr)


def _done(main: Callable[[], object]) -> Done:
    with TemporaryFile("w+") as out, TemporaryFile("w+") as err:
        with _printing_to(out, err), pytest.raises(SystemExit) as end:
            main()
        assert isinstance(end.value.code, int)
        for file in (out, err):
            file.seek(0)
        return Done(end.value.code, out.read(), err.read())


@contextmanager
def _printing_to(out: IO[str], err: IO[str]) -> Iterator[None]:
    """Until the block ends, what Python and the C libraries print goes to these files."""
    kept = os.dup(1), os.dup(2)
    os.dup2(out.fileno(), 1)
    os.dup2(err.fileno(), 2)
    try:
        with redirect_stdout(out), redirect_stderr(err):
            yield
    finally:
        for number, descriptor in enumerate(kept, 1):
            os.dup2(descriptor, number)
            os.close(descriptor)
