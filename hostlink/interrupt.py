"""Ctrl-C while a program starts: it ends at once, with exit code 130 and without a traceback.

Python's own handler raises KeyboardInterrupt wherever the program is. In the middle of an import that is a
traceback, or another error: compiled modules turn it into an ImportError.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["INTERRUPTED", "exit_on_interrupt"]

INTERRUPTED = 130  # as in a shell for SIGINT


@contextmanager
def exit_on_interrupt() -> Iterator[None]:
    """Until the block ends, Ctrl-C ends the process. For imports: no file is open that must be closed.

    Where SIGINT is ignored (a background job) or handled by the program itself, it stays so.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
