"""A serial port for one program alone: two readers would take each other's bytes.

pyserial locks a port that it opens with `exclusive=True`; this is the same lock for other ways of opening it
(python-can's slcan). It is advisory: programs that do not lock are not kept out.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

__all__ = ["PortLock"]


class PortLock:
    """Holds a port's lock until `close`.

    path    of the device; one that is no path of this system (COM3, loop://) is not locked
    Raises  OSError: EAGAIN if another program holds it
    """

    def __init__(self, path: str) -> None:
        self._handle: int | None = None
        if sys.platform == "win32" or not Path(path).is_char_device():
            return
        import fcntl

        handle = os.open(path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(handle)
            raise
        self._handle = handle

    def close(self) -> None:
        handle, self._handle = self._handle, None
        if handle is not None:
            os.close(handle)
