"""A process ends with its status and complete output, even if one of its threads never returns."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support.waiting import SOON_S

PROGRAM = """
import atexit, sys, threading
from edge.runtime.process import run_and_exit
from tests.support.waiting import SOON_S
threading.Thread(target={work}).start()  # not a daemon: the interpreter would wait for it
atexit.register(lambda: print("taken apart"))
def main():
    sys.stdout.write("last words")
    {end}
run_and_exit(main)
"""


@pytest.mark.parametrize(
    ("end", "status", "output"),
    [
        ("return", 0, ""),
        ("sys.exit()", 0, ""),
        ("sys.exit(2)", 2, ""),
        ("sys.exit(True)", 1, ""),
        ("sys.exit('why')", 1, "why\n"),
    ],
)
def test_exit_status_and_last_output(end: str, status: int, output: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(end=end, work="threading.Event().wait")],
        capture_output=True,
        text=True,
        timeout=SOON_S,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (status, "last words", output)


def test_an_exception_is_not_hidden() -> None:
    program = PROGRAM.format(end="raise ValueError('broken')", work="list")
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=SOON_S, check=False
    )
    assert done.returncode == 1
    assert done.stderr.startswith("Traceback")
