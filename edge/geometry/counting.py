"""The selection of `select` for uncompiled runs; `counting.pxd` has it in C.

There the range of the numbers is halved, and those below are counted, until the wanted one is the lowest or
the highest of it: counts are vectorised, while the branches of a partition are unpredictable. Both give
exactly the same.
"""

from __future__ import annotations

import numpy as np

from edge.types import Array


def kth(v: Array, n: int, k: int) -> float:
    """k-th smallest, from 0, of the first n > k numbers, none of which is NaN."""
    return float(np.partition(v[:n], k)[k])
