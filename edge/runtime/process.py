"""How our processes share the processor, and how they end.

Numeric libraries use one thread: the arrays of a frame are small, a second thread costs more in hand-over
than it saves, and adds jitter and memory. The interpreter switches threads after 0.2 ms instead of 5: the
loop must not wait for a link's thread longer than a frame takes.

At exit the interpreter normally tears down its modules: 0.1 to 0.4 s on a desktop, seconds on a slow board,
with daemon threads that may still be inside a driver. None of that is needed: the kernel reclaims memory and
files.
"""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

from edge.runtime.params import PARAMS

__all__ = ["limit_threads", "run_and_exit"]

_THREAD_COUNTS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")


def limit_threads() -> None:
    """One thread for numeric libraries, short switch interval for ours. Call before NumPy is first imported.

    Variables already set in the environment stay.
    """
    for name in _THREAD_COUNTS:
        os.environ.setdefault(name, "1")
    sys.setswitchinterval(PARAMS.switch_s)


def run_and_exit(main: Callable[[], None]) -> NoReturn:
    """Call `main`, flush logs and streams, and end the process at once with its exit status.

    An exception other than SystemExit passes through, and ends the process with its traceback as usual.
    """
    code: str | int | None = 0
    try:
        main()
    except SystemExit as end:
        code = end.code
    if isinstance(code, str):  # like `sys.exit`
        print(code, file=sys.stderr)
        code = 1
    logging.shutdown()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):  # the reader has gone away, or the stream was closed
            stream.flush()
    os._exit(code or 0)
