"""The products of `quantized_operator` for uncompiled runs; `row_products.pxd` has them in C.

Sums are of integers and fit 32 bits, so both give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.types import Index

Shorts = NDArray[np.int16]


def all_rows(weights: Shorts, start: Index, first: Index, vector: Shorts, sums: Index) -> None:
    """Products of all rows.

    weights  bands of groups of four rows, of their rows
    start    (groups + 1,) of each group in them
    first    (groups,) column of each band; bands are multiples of 16 wide
    vector   (columns,)
    sums     (4 groups,), written
    """
    some_rows(weights, start, first, np.arange(len(sums), dtype=np.int32), len(sums), vector, sums)


def some_rows(
    weights: Shorts, start: Index, first: Index, which: Index, n: int, vector: Shorts, sums: Index
) -> None:
    """Those of the first n rows that `which` names, into the first n of sums."""
    for p in range(n):
        group, row = divmod(int(which[p]), 4)
        band = weights[start[group] : start[group + 1]].reshape(4, -1)[row].astype(np.int32)
        sums[p] = band @ vector[first[group] :][: len(band)]
