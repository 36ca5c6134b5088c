"""Programs in a process of their own, with the deadline that all tests have."""

import os
import resource
import signal
import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from tests.support.waiting import SOON_S


def program(*command: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    """A program with these arguments, to its end; what it prints is kept."""
    given: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "check": False} | options
    return subprocess.run([*map(str, command)], text=True, timeout=SOON_S, **given)


def python(*arguments: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    """This interpreter with these arguments."""
    return program(sys.executable, *arguments, **options)


def edge(*arguments: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    """`python -m edge` with these arguments."""
    return python("-m", "edge", *arguments, **options)


def small_disk(n_bytes: int) -> dict[str, Any]:
    """No file of the process may grow beyond this: like on a full disk, except for the error number."""

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, n_bytes))

    return {"preexec_fn": limit}


def source_files(root: Path, *patterns: str) -> list[Path]:
    """The project's files of these patterns: those that git has, in an unpacked source archive all."""
    names = program("git", "ls-files", *patterns, cwd=root).stdout.split()
    if not names:
        every = (path.relative_to(root).as_posix() for path in root.rglob("*"))
        names = [name for name in every if any(fnmatch(name, pattern) for pattern in patterns)]
    return sorted(root / name for name in names if (root / name).is_file())


def uncounted() -> dict[str, str]:
    """This process's environment, without what has a child's lines counted under `make coverage`.

    For children whose disk is full, or that are stopped in the middle of an import: counting imports and
    writes on its own.
    """
    return {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}
