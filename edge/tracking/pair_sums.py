"""The sums of `follow` for uncompiled runs; `pair_sums.pxd` has them in C.

Both add in the same order, in single precision, and give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def pair_sums(
    near: NDArray[np.uint16],
    weight: NDArray[np.float32],
    motion: NDArray[np.float32],
    sums: NDArray[np.float32],
) -> None:
    """Weighted sum over the neighbours of each pin.

    near    (n, k) pins, k a multiple of 6
    weight  (n, k)
    motion  (n, 2) px, finite
    sums    (n, 2) px; written
    """
    terms = weight[..., None] * motion[near]
    by_turns = [np.add.accumulate(terms[:, first::2], axis=1)[:, -1] for first in (0, 1)]
    sums[:] = by_turns[0] + by_turns[1]
