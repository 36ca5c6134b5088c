"""The products of `quantized_operator` for uncompiled runs; `row_products.pxd` has them in C.

Sums are of integers and fit 32 bits, so both give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.types import Index

Shorts = NDArray[np.int16]


def all_rows(
    weights: Shorts, start: Index, block: NDArray[np.uint16], vector: Shorts, taken: Shorts, sums: Index
) -> None:
    """Products of all rows.

    weights  of groups of four rows, of their rows, of the group's blocks of 16 columns
    start    (groups + 1,) where the blocks of each group begin in the next
    block    which of a row's blocks they are
    vector   (columns,)
    taken    (columns,), scratch
    sums     (4 groups,), written
    """
    some_rows(weights, start, block, np.arange(len(sums), dtype=np.int32), len(sums), vector, taken, sums)


def some_rows(
    weights: Shorts,
    start: Index,
    block: NDArray[np.uint16],
    which: Index,
    n: int,
    vector: Shorts,
    taken: Shorts,
    sums: Index,
) -> None:
    """Those of the first n rows that `which` names, into the first n of sums."""
    blocks = vector.reshape(-1, 16).astype(np.int32)
    for p in range(n):
        group, row = divmod(int(which[p]), 4)
        begin, end = start[group], start[group + 1]
        rows = weights[64 * begin : 64 * end].reshape(4, -1, 16)
        sums[p] = (rows[row] * blocks[block[begin:end]]).sum()
