"""Commands that the documentation shows run word for word, unless they need what only the reader has."""

import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = ("README", "docs/examples", "docs/from-camera-to-newtons", "docs/watch", "docs/simulator")
#: Cameras, buses, ports, pictures and logs, and a second program.
OF_READERS = r"v4l2:|can:|/dev/|picture\.png|touch\.mp4 -(-|o seen)|targets\.csv|manual|hand\.log|udp:"
COMMANDS = sorted(
    {
        line.split("  #")[0].strip()
        for page in PAGES
        for line in re.findall(
            r"^    (python .*)$", (ROOT / f"{page}.md").read_text(encoding="utf-8"), re.MULTILINE
        )
        if not re.search(OF_READERS, line)
    }
)


def test_there_are_commands_to_run() -> None:
    assert sum("example:press" in command for command in COMMANDS) >= 3


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_runs_as_it_is_shown(command: str, tmp_path: Path) -> None:
    program, *arguments = shlex.split(command)
    assert program == "python"
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    with subprocess.Popen(
        [sys.executable, *arguments], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as running:
        assert running.stderr is not None
        if "--loop" in arguments:  # until it is stopped
            assert "live page: http://" in running.stderr.readline()
            running.send_signal(signal.SIGINT)
        out, err = running.communicate(timeout=300)
    assert running.returncode == 0, err
    assert out
    assert "CALIBRATION" not in err, "the calibration fits"
