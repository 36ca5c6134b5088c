"""Waiting for what another thread or process does, on a machine that may be busy with other work.

What comes at all comes in milliseconds: SOON_S only ends a test that fails.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path

SOON_S = 60.0
LOOK_S = 0.005


def until(condition: Callable[[], object], what: str = "what was waited for") -> None:
    """Wait until something holds, looked at now and then."""
    end_s = time.monotonic() + SOON_S
    while not condition():
        assert time.monotonic() < end_s, f"never: {what}"
        threading.Event().wait(LOOK_S)


def size_of(path: Path) -> int:
    """Bytes in a file, 0 while there is none: it may be renamed or removed by who writes it."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0
