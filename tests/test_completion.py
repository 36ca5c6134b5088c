"""Shells complete the installed commands: subcommands and options come from the program itself."""

import os
import sys
from pathlib import Path

import pytest

from tests.support.processes import program

SCRIPTS = {"voronoi-touch-edge": ("replay", "render"), "voronoi-touch-host": ("monitor", "view", "plot")}


def run(script: str, **environment: str) -> str:
    path = Path(sys.executable).with_name(script)
    assert path.exists(), f"{path} is not installed"
    return program(path, env=os.environ | environment).stdout


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
