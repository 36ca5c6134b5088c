"""Sums of motion over neighbours, for uncompiled runs; `pair_sums.pxd` has them in C. How they are prepared.

Both add in the same order, in single precision, and give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.geometry.lattice import N_RING
from edge.geometry.memory import short_rows
from edge.types import Array, Index


def pair_rows(near: Index, weight: Array) -> tuple[NDArray[np.uint16], NDArray[np.float32]]:
    """Neighbours (n, k) and their weights, 0 beyond those that there are, as `pair_sums` wants them.

    Raises  ValueError: a row that 16 bits do not hold
    """
    n, k = near.shape
    width = -(-k // N_RING) * N_RING
    rows, weights = np.zeros((n, width), np.uint16), np.zeros((n, width), np.float32)
    rows[:, :k], weights[:, :k] = short_rows(near), weight
    return rows, weights


def pair_sums(
    near: NDArray[np.uint16],
    weight: NDArray[np.float32],
    motion: NDArray[np.float32],
    sums: NDArray[np.float32],
) -> None:
    """Weighted sum over the neighbours of each of the first n points.

    near    (n, k) rows of motion, k a multiple of 6
    weight  (n, k)
    motion  (m, 2) px, finite
    sums    (n or more, 2) px; written
    """
    terms = weight[:, :, None] * motion[near]
    by_turns = [np.add.accumulate(terms[:, first::2], axis=1)[:, -1] for first in (0, 1)]
    sums[: len(near)] = by_turns[0] + by_turns[1]
