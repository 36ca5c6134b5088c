"""The products of `quantized_operator` for uncompiled runs; `row_products.pxd` has them in C.

Sums are of integers and fit 32 bits, so both give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.types import Index

Shorts = NDArray[np.int16]


def row_products(
    weights: Shorts,
    start: Index,
    block: NDArray[np.uint16],
    which: Index,
    n: int,
    vector: Shorts,
    sums: Index,
) -> None:
    """Products of the first n rows that `which` names, into the first n of sums.

    weights  of each row's blocks of 16 columns, row after row
    start    (rows + 1,) where the blocks of each row begin in the next
    block    which of the columns' blocks they are
    vector   (columns,)
    """
    rows, columns = weights.reshape(-1, 16).astype(np.int32), vector.reshape(-1, 16).astype(np.int32)
    for p in range(n):
        of_row = slice(start[which[p]], start[which[p] + 1])
        sums[p] = (rows[of_row] * columns[block[of_row]]).sum()
