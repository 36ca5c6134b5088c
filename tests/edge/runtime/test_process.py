"""A process ends with its status and complete output, even if one of its threads never returns."""

import os

import pytest

from tests.support.processes import python

PROGRAM = """
import atexit, sys, threading
from edge.runtime.process import run_and_exit
threading.Thread(target={work}).start()  # not a daemon: the interpreter would wait for it
atexit.register(lambda: print("taken apart"))
def main():
    sys.stdout.write("last words")
    {end}
run_and_exit(main)
"""

THREADS = """
import os
from edge.runtime.process import limit_resources
limit_resources()
import cv2, numpy as np
cv2.GaussianBlur(np.zeros((2000, 2000), np.float32), (31, 31), 5)
np.ones((500, 500)) @ np.ones((500, 500))
print(len(os.listdir("/proc/self/task")))
"""

MEMORY = """
from pathlib import Path
from edge.runtime.process import give_back_memory, limit_resources
limit_resources()
def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) / 256
bytearray(8 << 20)  # from now on the C library keeps what is freed
blocks = [bytearray(b"x") * (1 << 20) for _ in range(64)]
full_mb, blocks = resident_mb(), blocks[-1:]  # the last one holds the others below it
held_mb = resident_mb()
give_back_memory()
print(full_mb - held_mb, held_mb - resident_mb())
"""


@pytest.mark.parametrize(
    ("end", "status", "output"),
    [("return", 0, ""), ("sys.exit(2)", 2, ""), ("sys.exit(True)", 1, ""), ("sys.exit('why')", 1, "why\n")],
)
def test_exit_status_and_last_output(end: str, status: int, output: str) -> None:
    done = python("-c", PROGRAM.format(end=end, work="threading.Event().wait"))
    assert (done.returncode, done.stdout, done.stderr) == (status, "last words", output)


def test_an_exception_is_not_hidden() -> None:
    done = python("-c", PROGRAM.format(end="raise ValueError('broken')", work="list"))
    assert done.returncode == 1
    assert done.stderr.startswith("Traceback")


def test_numeric_libraries_have_one_thread() -> None:
    variables = {k: v for k, v in os.environ.items() if not k.endswith(("_NUM_THREADS", "_THREADS_NUM"))}
    assert python("-c", THREADS, env=variables).stdout == "1\n"


def test_freed_memory_is_kept_until_it_is_given_back() -> None:
    at_once_mb, given_back_mb = map(float, python("-c", MEMORY).stdout.split())
    assert at_once_mb < 10.0
    assert given_back_mb > 50.0
