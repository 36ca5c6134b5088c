"""The products of `quantized_operator` for uncompiled runs; `row_products.pxd` has them in C.

Sums are of integers and fit 32 bits, so both give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.types import Index

Shorts = NDArray[np.int16]


def all_rows(rows: Shorts, vector: Shorts, sums: Index) -> None:
    """rows (k, w) times vector (w,) into sums (k,); w is a multiple of 16."""
    sums[:] = rows.astype(np.int32) @ vector.astype(np.int32)


def some_rows(rows: Shorts, which: Index, n: int, vector: Shorts, sums: Index) -> None:
    """The first n of the rows that `which` names, times vector, into the first n of sums."""
    sums[:n] = rows[which[:n]].astype(np.int32) @ vector.astype(np.int32)
