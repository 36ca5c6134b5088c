"""How our processes share processor and memory, and how they end.

Numeric libraries use one thread: the arrays of a frame are small, a second thread costs more in hand-over
than it saves, and adds jitter and memory. A search of a whole image is no quicker with two threads of OpenCV,
and takes a tenth more processor time. The interpreter switches threads after 0.2 ms instead of 5: the loop
must not wait for a link's thread longer than a frame takes.

A rest frame takes 30 MB for a moment. The C library would keep them when they are freed, in each thread's
heap; large blocks that come from the system go back to it.

At exit the interpreter normally tears down its modules: 0.1 to 0.4 s on a desktop, seconds on a slow board,
with daemon threads that may still be inside a driver. None of that is needed: the kernel reclaims memory and
files.
"""

from __future__ import annotations

import ctypes
import logging
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

from edge.runtime.params import PARAMS

__all__ = ["limit_resources", "run_and_exit"]

#: `mallopt`'s M_MMAP_THRESHOLD, and its value: more than an image, so that no frame waits for new pages.
_MMAP_THRESHOLD, _LARGE_BYTES = -3, 1 << 20
_THREAD_COUNTS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


def limit_resources() -> None:
    """One thread for numeric libraries, short switch interval for ours, and large blocks of memory given back
    when they are freed (glibc). Call before NumPy and OpenCV are first imported.

    Variables already set in the environment stay.
    """
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "mallopt"):
        libc.mallopt(_MMAP_THRESHOLD, _LARGE_BYTES)
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
