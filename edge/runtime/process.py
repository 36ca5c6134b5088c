"""How our processes share processor and memory, and how they end.

Numeric libraries use one thread: the arrays of a frame are small, a second thread costs more in hand-over
than it saves. The interpreter switches threads after 0.2 ms instead of 5: the loop must not wait for a link's
thread longer than a frame takes. Of freed memory the C library keeps as much as an image's floating-point
copy takes: fetching its pages anew cost a fifth of a whole-image search. All threads take from one heap: the
interpreter runs one of them at a time, and what one has freed serves the others.

At exit the interpreter would tear down its modules, for seconds on a slow board, with daemon threads that may
still be inside a driver. The kernel reclaims memory and files without that.
"""

import ctypes
import logging
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

from edge.params import PARAMS

_MMAP_THRESHOLD, _TRIM_THRESHOLD, _ARENA_MAX = -3, -1, -8  # `mallopt`'s, glibc's malloc.h
#: Value of both: more than an image of 640 x 480 px in double precision.
_LARGE_BYTES = 4 << 20
_THREAD_COUNTS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


def limit_resources() -> None:
    """One thread for numeric libraries, short switch interval for ours, and a bound for freed memory that is
    kept (glibc). Call before NumPy and OpenCV are first imported.

    Variables already set in the environment stay.
    """
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "mallopt"):
        for threshold in (_MMAP_THRESHOLD, _TRIM_THRESHOLD):
            libc.mallopt(threshold, _LARGE_BYTES)
        libc.mallopt(_ARENA_MAX, 1)
    for name in _THREAD_COUNTS:
        os.environ.setdefault(name, "1")
    sys.setswitchinterval(PARAMS.switch_s)


def give_back_memory() -> None:
    """Give the system all that the C library keeps of freed memory (glibc)."""
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "malloc_trim"):
        libc.malloc_trim(0)


def run_and_exit(main: Callable[[], None]) -> NoReturn:
    """Call `main`, flush logs and streams, and end with its status; an exception ends with its traceback."""
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
