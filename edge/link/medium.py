"""An open bus or line, and the meaning of its failures: MediumFull (drop, go on), all others (reopen)."""

from __future__ import annotations

import errno
from typing import Any, Protocol

__all__ = ["FULL", "Medium", "MediumError", "MediumFull"]

FULL = frozenset({errno.ENOBUFS, errno.EAGAIN, errno.EWOULDBLOCK})


class MediumError(Exception):
    """The medium failed and must be reopened."""


class MediumFull(Exception):
    """The medium accepts nothing now; it may in a moment."""


class Medium(Protocol):
    """An open bus or line. What it carries: `CanFrame` on a bus, bytes on a line."""

    instant: bool  # whether a write always returns at once
    bus_off: bool

    def write(self, item: Any) -> None:
        """Raises MediumFull, MediumError."""
        ...

    def read(self, timeout_s: float) -> Any:
        """What came in, or None. Raises MediumError."""
        ...

    def close(self) -> None: ...
