"""The sums of `modes` for uncompiled runs; `mode_sums.pxd` has them in C.

Both add in the same order, in single precision, and give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.types import Array


def mode_sums(
    basis: NDArray[np.int16], step: NDArray[np.float32], motion: Array, sums: NDArray[np.float32]
) -> None:
    """Sums over the pins of basis times motion.

    basis   (n, 24), real, in whole steps
    step    (24,)
    motion  (n, 2) float64
    sums    (48,) of x, then of y; written
    """
    x, y = motion.astype(np.float32).T[:, :, None]
    terms = np.concatenate([basis * x, basis * y], axis=1)
    sums[:] = np.add.accumulate(terms, axis=0)[-1] * np.tile(step, 2)
