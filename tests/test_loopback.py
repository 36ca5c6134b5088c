"""Recorded frames through the whole chain and back: the host decodes what the edge computed."""

from pathlib import Path

import pytest
from rich.console import Console

from calib.demo import RECORDINGS, demo


def test_the_demo_compares_and_draws_all_recordings(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    demo(data_dir, tmp_path, Console(width=100))
    rows = {
        line.split()[0]: line.split()[1:4] for line in capsys.readouterr().out.splitlines() if line.split()
    }
    assert [rows[name][1:] for name in RECORDINGS] == [[n, "yes"] for n in ("331", "127", "331", "127")]
    pictures = {path.name for path in tmp_path.iterdir()}
    assert {f"{name}.png" for name in RECORDINGS} <= pictures
    assert "press_surface.png" in pictures
