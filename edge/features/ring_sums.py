"""The sums of `contact_detector` for uncompiled runs; `ring_sums.pxd` has them in C.

Both add in the same order and give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.types import Array


def highest_ring(ring: NDArray[np.uint16], values: Array, highest: Array) -> int:
    """Which ring (n, 7) of rows of values has the highest sum; 0 if none is above 0, -1 if one is NaN.

    highest  (1,) float64, written: that sum, or 0
    """
    sums = np.add.accumulate(values[ring], axis=1)[:, -1]
    highest[0] = max(np.max(sums), 0.0)
    if np.isnan(sums).any():
        return -1
    return int(np.argmax(sums)) if highest[0] > 0.0 else 0
