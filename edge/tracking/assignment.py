"""Rows given to columns at the least total cost. A kernel: compiled by Cython, and the same when it is not.

Idea: one row after the other takes a column; those before it move on along the path that costs least. Prices
of rows and columns keep all reduced costs at 0 and above, so that path is found as a shortest one (Dijkstra).

Source  Kuhn, The Hungarian method for the assignment problem, Naval Research Logistics Quarterly 2, 1955;
        Edmonds and Karp, Theoretical improvements in algorithmic efficiency for network flow problems,
        Journal of the ACM 19, 1972
"""

# mypy: disable-error-code="attr-defined,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.types import Array, Index

if cython.compiled:
    from cython.cimports.libc.math import HUGE_VAL
else:
    from math import inf as HUGE_VAL  # noqa: N812


def assign(cost: Array) -> Index:
    """(n,) int32, the column of each row; no column twice, the sum of their costs the least that there is.

    cost    (n, m) float64
    Raises  ValueError: fewer columns than rows, a cost that is not finite
    """
    cost = np.ascontiguousarray(cost, np.float64)
    if cost.ndim != 2 or cost.shape[0] > cost.shape[1] or not np.isfinite(cost).all():
        raise ValueError(f"finite costs (n, m >= n) are wanted, not {cost.shape}")
    n, m = cost.shape
    # The last column is where the search for a row begins.
    row_of, before = np.full(m + 1, -1, np.int32), np.empty(m + 1, np.int32)
    _assign(cost, row_of, before, np.zeros(n), np.zeros(m + 1), np.empty(m + 1), np.empty(m + 1, np.uint8))
    column = np.empty(n, np.int32)
    taken = np.flatnonzero(row_of[:m] >= 0)
    column[row_of[taken]] = taken
    return column


@cython.cfunc
@cython.exceptval(check=False)
def _assign(
    cost: cython.const[cython.double][:, ::1],
    row_of: cython.int[::1],
    before: cython.int[::1],
    row_price: cython.double[::1],
    column_price: cython.double[::1],
    distance: cython.double[::1],
    reached: cython.uchar[::1],
) -> cython.void:
    """row_of     of each column the row that has it, -1: none
    before     the column before it on the shortest path
    distance   of each column that is not yet reached
    """
    m: cython.Py_ssize_t = cost.shape[1]
    i: cython.Py_ssize_t
    j: cython.Py_ssize_t
    at: cython.Py_ssize_t
    row: cython.Py_ssize_t
    next_: cython.Py_ssize_t
    step: cython.double
    reduced: cython.double
    for i in range(cost.shape[0]):
        for j in range(m + 1):
            distance[j] = HUGE_VAL
            reached[j] = False
        at = m
        row_of[m] = i
        while row_of[at] >= 0:
            reached[at] = True
            row = row_of[at]
            next_ = at
            step = HUGE_VAL
            for j in range(m):
                if reached[j]:
                    continue
                reduced = cost[row, j] - row_price[row] - column_price[j]
                if reduced < distance[j]:
                    distance[j] = reduced
                    before[j] = at
                if distance[j] < step:
                    step = distance[j]
                    next_ = j
            for j in range(m + 1):
                if reached[j]:
                    row_price[row_of[j]] += step
                    column_price[j] -= step
                else:
                    distance[j] -= step
            at = next_
        while at != m:
            row_of[at] = row_of[before[at]]
            at = before[at]
