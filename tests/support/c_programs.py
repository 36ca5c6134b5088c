"""C programs made of the shipped sources, with every warning an error."""

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

import hostlink

C = Path(hostlink.__file__).parent / "c"
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1")


def compiled(program: Path, sources: Sequence[Path], *options: str) -> Path:
    """Compile, with the shipped headers. The test is skipped where there is no compiler."""
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("no gcc")
    command = [compiler, *STRICT, *options, f"-I{C}", *map(str, sources), "-lm", "-o", str(program)]
    subprocess.run(command, check=True)
    return program
