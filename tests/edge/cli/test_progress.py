"""Progress is shown on a terminal, and not in a file or a script."""

import os
import pty
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from edge.cli.progress import counting, waiting


def on_a_terminal(command: list[str]) -> str:
    """What a command writes to a terminal as its stderr."""
    master, slave = pty.openpty()
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=slave, env={**os.environ, "TERM": "xterm"}
    ):
        os.close(slave)
        seen = b""
        with suppress(OSError):  # Linux raises it when the last user of the terminal has closed it
            while data := os.read(master, 65536):
                seen += data
    os.close(master)
    return seen.decode(errors="replace")


@pytest.mark.parametrize("quiet", [False, True])
def test_a_replay_counts_its_frames(data_dir: Path, quiet: bool) -> None:
    command = [sys.executable, "-m", "edge", "replay", str(data_dir / "nothing.mcap"), "--sink", "memory:"]
    seen = on_a_terminal([*command, "--speed", "1", *(["--quiet"] if quiet else [])])
    assert ("opening" in seen) is not quiet
    assert ("replay" in seen and "/16" in seen) is not quiet


def test_without_a_terminal_nothing_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    with waiting("long work", True), counting("frames", 3, True) as count:
        count(1)
    assert capsys.readouterr() == ("", "")
