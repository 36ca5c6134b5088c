"""How this process shares the processor; to be called before NumPy is first imported.

- Numeric libraries use one thread: the arrays of one frame are small, a second thread costs more in
  hand-over than it takes off, its wake-ups are jitter, and its buffers are memory.
- The interpreter changes threads after 0.2 ms rather than 5: the loop must not wait for a link's thread
  that happens to run, for longer than a frame takes.
"""

from __future__ import annotations

import os
import sys

__all__ = ["share_the_processor"]

SWITCH_S = 2e-4
_COUNTS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")


def share_the_processor() -> None:
    """Set what is not set already in the environment."""
    for name in _COUNTS:
        os.environ.setdefault(name, "1")
    sys.setswitchinterval(SWITCH_S)
