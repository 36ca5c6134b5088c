"""Waiting for another thread or process, on a machine that may be busy with other work.

Normally the condition holds within milliseconds: SOON_S only ends a test that fails.
"""

import threading
import time
from collections.abc import Callable
from pathlib import Path

SOON_S = 240.0
POLL_S = 0.005


def until(condition: Callable[[], object], what: str = "what was waited for") -> None:
    """Wait until something holds, tested from time to time."""
    end_s = time.monotonic() + SOON_S
    while not condition():
        assert time.monotonic() < end_s, f"never: {what}"
        threading.Event().wait(POLL_S)


def size_of(path: Path) -> int:
    """Bytes in a file, 0 while there is none: its writer may rename or remove it."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0
