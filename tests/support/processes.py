"""Programs in a process of their own, with the deadline that all tests have."""

import subprocess
import sys
from pathlib import Path
from typing import Any

from tests.support.waiting import SOON_S

__all__ = ["edge", "program", "python"]


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
