"""The sums of `contact_fit` for uncompiled runs; `normal_sums.pxd` has them in C.

Both add in the same order and give exactly the same.
"""

from __future__ import annotations

import numpy as np

from edge.types import Array


def normal_sums(rows: Array, n: int, columns: int, sums: Array) -> None:
    """Add the products of each two columns of the first n rows.

    rows     (n or more, w) float64, w a multiple of 4
    n        a multiple of 4
    columns  that count, w at most
    sums     (w, w) float64; what is above the diagonal is of no use
    """
    for four in rows[:n, :columns].reshape(-1, 4, columns):
        a, b, c, d = (np.outer(row, row) for row in four)
        sums[:columns, :columns] += (a + b) + (c + d)
