"""A constant matrix times a vector, in 16-bit integers.

Idea: the surface's operators are constant, and their products are most of a frame's arithmetic. As 16-bit
integers with one step a row they stream through the cache in half the time of single precision. Sums are
exact; rounding adds an error of 1e-4 of the highest value, a tenth of the noise of an area. Weights of pins
far away round to zero: of columns of pins that lie together, whole blocks are left out.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Index

if cython.compiled:
    from cython.cimports.edge.features.row_products import all_rows, some_rows
else:
    from edge.features.row_products import all_rows, some_rows

#: Largest weight, and largest value of a vector, in steps.
_WEIGHT_MAX = 32767.0
_VALUE_MAX = cython.declare(cython.float, 32767.0)
#: Largest sum of a row's weights: with values of 15 bits the sums then fit 32.
_ROW_MAX = 65000.0
#: Adding and subtracting it rounds a single-precision number below 2**22 to the nearest integer, ties to
#: even.
_ROUND = cython.declare(cython.float, 1.5 * 2.0**23)
#: Columns that are kept or left out together, for the vector units, ...
BLOCK = 16
#: ... by this many rows, whose products are formed together.
_GROUP = 4


@cython.final
@cython.cclass
class QuantizedOperator:
    """A (k, m) matrix; `values` in, `result` out, both good until the next call.

    values   (m,) float32, finite; to be written before `quantize`
    result   (k,) float32; of `apply` or `apply_rows`
    step     float32, of the quantized values
    """

    def __init__(self, matrix: Array, order: Index | None = None) -> None:
        """The matrix, and an order of its columns in which near ones are together; None: as they are.

        Raises   ValueError: the matrix is empty, or a weight is not finite; not an order of its columns
        """
        if matrix.ndim != 2 or not matrix.size or not np.isfinite(matrix).all():
            raise ValueError(f"a matrix (k, m) of finite numbers is wanted, not {matrix.shape}")
        k, m = matrix.shape
        columns = np.arange(m) if order is None else np.asarray(order)
        if not np.array_equal(np.sort(columns), np.arange(m)):
            raise ValueError(f"order: each column of 0 to {m - 1} once is wanted")
        size = np.abs(matrix)
        least = np.maximum(size.max(axis=1) / _WEIGHT_MAX, size.sum(axis=1) / _ROW_MAX)
        step = np.where(least > 0.0, least, 1.0)
        self._weights, self._start, self._block = _in_blocks(matrix[:, columns], step)
        self._order, self._row_step = columns.astype(np.int32), step.astype(np.float32)
        self._vector, self._taken = np.zeros((2, -(-m // BLOCK) * BLOCK), np.int16)
        self._sums = np.empty(-(-k // _GROUP) * _GROUP, np.int32)
        self._step = 0.0
        self.values = np.zeros(m, np.float32)
        self.result = np.empty(k, np.float32)

    def apply(self) -> cython.void:
        """`result`: the matrix times `values`."""
        with cython.nogil:
            self._quantize()
            all_rows(self._weights, self._start, self._block, self._vector, self._taken, self._sums)
            self._scale(self._row_step.shape[0])

    def apply_rows(self, which: cython.const[cython.int][::1], n: cython.Py_ssize_t) -> cython.void:
        """The first n of `result`: the first n of these rows times `values`.

        which    (at least n,) int32
        Raises   ValueError: n beyond `which`, or no such row
        """
        p: cython.Py_ssize_t
        k: cython.Py_ssize_t = self._row_step.shape[0]
        if n < 0 or n > which.shape[0] or n > k:
            raise ValueError(f"n: 0 to {min(which.shape[0], k)} rows are wanted, not {n}")
        for p in range(n):
            if which[p] < 0 or which[p] >= k:
                raise ValueError(f"which: rows of 0 to {k - 1} are wanted, not {which[p]}")
        with cython.nogil:
            self._quantize()
            some_rows(
                self._weights, self._start, self._block, which, n, self._vector, self._taken, self._sums
            )
        for p in range(n):
            self.result[p] = cython.cast(cython.float, self._sums[p]) * self._row_step[which[p]] * self._step

    def _quantize(self) -> cython.void:
        i: cython.Py_ssize_t
        size: cython.float
        highest: cython.float = 0.0
        for i in range(self.values.shape[0]):
            size = abs(self.values[i])
            if size > highest:
                highest = size
        scale: cython.float = _VALUE_MAX / highest if highest > 0.0 else 0.0
        for i in range(self.values.shape[0]):
            size = self.values[self._order[i]] * scale + _ROUND
            self._vector[i] = cython.cast(cython.short, size - _ROUND)
        self._step = highest / _VALUE_MAX

    def _scale(self, k: cython.Py_ssize_t) -> cython.void:
        p: cython.Py_ssize_t
        for p in range(k):
            self.result[p] = cython.cast(cython.float, self._sums[p]) * self._row_step[p] * self._step


def _in_blocks(matrix: Array, step: Array) -> tuple[NDArray[np.int16], Index, NDArray[np.uint16]]:
    """The rows of each group, in whole steps, without the blocks that are zero in all of them, group after
    group; where the blocks of each group begin in the next, and the end of the last; which these are.
    """
    groups = -(-len(matrix) // _GROUP)
    rows = np.zeros((groups * _GROUP, -(-matrix.shape[1] // BLOCK) * BLOCK), np.int16)
    for row, weights, unit in zip(rows, matrix, step, strict=False):
        row[: len(weights)] = np.rint(weights / unit)
    blocks = rows.reshape(groups, _GROUP, -1, BLOCK)
    kept = (blocks != 0).any(axis=(1, 3))
    kept[~kept.any(axis=1), 0] = True
    start = np.concatenate([[0], np.cumsum(kept.sum(axis=1))])
    weights = np.concatenate([group[:, of].ravel() for group, of in zip(blocks, kept, strict=True)])
    return weights, start.astype(np.int32), np.nonzero(kept)[1].astype(np.uint16)
