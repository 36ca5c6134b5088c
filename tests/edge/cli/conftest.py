"""`python -m edge` as a user types it, within this process."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from edge.__main__ import main


@dataclass(frozen=True)
class Done:
    """How a command ended, and what it wrote."""

    code: int
    out: str
    err: str


Command = Callable[..., Done]


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    def run(*arguments: str | Path) -> Done:
        capfd.readouterr()
        monkeypatch.setattr("sys.argv", ["edge", *map(str, arguments)])
        code = 0
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 1
        return Done(code, *capfd.readouterr())

    return run
