"""Waiting for another thread or process, on a machine that may be busy with other work.

Normally the condition holds within milliseconds: SOON_S only ends a test that fails.
"""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

SOON_S = 240.0
POLL_S = 0.005
T = TypeVar("T")


def until(condition: Callable[[], object], what: str = "what was waited for") -> None:
    """Wait until something holds, tested from time to time."""
    end_s = time.monotonic() + SOON_S
    while not condition():
        assert time.monotonic() < end_s, f"never: {what}"
        threading.Event().wait(POLL_S)


def present(value: T | None) -> T:
    """The value, which the test knows to be there."""
    assert value is not None
    return value


def size_of(path: Path) -> int:
    """Bytes in a file, 0 while there is none: its writer may rename or remove it."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0
