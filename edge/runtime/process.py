"""How a process of ours shares the processor, and how it ends.

Numeric libraries use one thread: the arrays of one frame are small, a second thread costs more in hand-over
than it saves, its wake-ups are jitter, and its buffers are memory. The interpreter changes threads after
0.2 ms rather than 5: the loop must not wait for a link's thread for longer than a frame takes.

Left to itself the interpreter takes its modules apart at exit: 0.1 to 0.4 s on a desktop, seconds on a slow
board, with daemon threads that may still be inside of a driver. None of that is needed: the kernel takes
back memory and files.
"""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

__all__ = ["limit_threads", "run_and_exit"]

SWITCH_INTERVAL_S = 2e-4
_THREAD_COUNTS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")


def limit_threads() -> None:
    """One thread for numeric libraries, short turns for ours. Call before NumPy is first imported.

    What is set in the environment already stays.
    """
    for name in _THREAD_COUNTS:
        os.environ.setdefault(name, "1")
    sys.setswitchinterval(SWITCH_INTERVAL_S)


def run_and_exit(main: Callable[[], None]) -> NoReturn:
    """Call `main`, flush logs and streams, and end the process at once with its exit status.

    An exception other than SystemExit passes through, and ends the process with its traceback as usual.
    """
    code: str | int | None = 0
    try:
        main()
    except SystemExit as end:
        code = end.code
    if isinstance(code, str):  # as `sys.exit` has it
        print(code, file=sys.stderr)
        code = 1
    logging.shutdown()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):  # the reader has gone away, or the stream was closed
            stream.flush()
    os._exit(code or 0)
