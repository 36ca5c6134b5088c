"""Shells complete the installed commands: subcommands and options come from the program itself."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.waiting import SOON_S

SCRIPTS = {
    "voronoi-touch-edge": ("replay", "render"),
    "voronoi-touch-host": ("monitor", "view", "plot"),
}


def run(script: str, **environment: str) -> str:
    path = Path(sys.executable).with_name(script)
    assert path.exists(), f"{path} is not installed"
    env = {**os.environ, **environment}
    return subprocess.run([path], env=env, capture_output=True, text=True, timeout=SOON_S).stdout


@pytest.mark.parametrize("script", SCRIPTS)
def test_subcommands_complete(script: str) -> None:
    variable = f"_{script.upper().replace('-', '_')}_COMPLETE"
    words = run(script, **{variable: "bash_complete", "COMP_WORDS": f"{script} ", "COMP_CWORD": "1"})
    for name in SCRIPTS[script]:
        assert f"plain,{name}" in words.splitlines()
    for shell in ("bash", "zsh", "fish"):
        text = run(script, **{variable: f"{shell}_source"})
        assert script in text
        assert variable in text
