"""A short run of the kernels' fuzzer, in a process of its own: a crash is a failed test."""

import os
import subprocess
import sys

import pytest

from tests.support.kernels import ROOT


@pytest.mark.kernels
@pytest.mark.compiled
def test_no_kernel_crashes_on_wrong_arguments() -> None:
    """With the build under test: the checked one detects an index out of bounds where it happens."""
    command = [sys.executable, "-m", "tests.fuzz.fuzz_kernels", "--rounds", "25"]
    done = subprocess.run(command, cwd=ROOT, env=os.environ, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
