"""A constant matrix times a vector, in 16-bit integers.

Idea: the surface's operators are constant, and their products are most of a frame's arithmetic. As 16-bit
integers with one step a row they stream through the cache in half the time of single precision. Sums are
exact; rounding and what is left out add an error of 1e-4 of the highest area change, 2e-4 at most (a tour
over 331 pins), a tenth of the noise of an area. Weights of pins far away are small: where columns of pins
that lie together follow each other, each row leaves out the smallest blocks of them, as many as add no more
to its error than rounding does.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Index

#: Largest weight, and largest value of a vector, in steps.
_WEIGHT_MAX = 32767.0
_VALUE_MAX = cython.declare(cython.float, 32767.0)
#: Largest sum of a row's weights: with values of 15 bits the sums then fit 32.
_ROW_MAX = 65000.0
#: Adding and subtracting it rounds a single-precision number below 2**22 to the nearest integer, ties to
#: even.
_ROUND = cython.declare(cython.float, 1.5 * 2.0**23)
#: Columns that are kept or left out together, for long runs.
BLOCK = 16


@cython.final
@cython.cclass
class QuantizedOperator:
    """A (k, m) matrix; `values` in, `result` out, both good until the next call.

    values   (m,) float32, finite; to be written before `apply` or `apply_rows`
    result   (k,) float32; of `apply` or `apply_rows`
    """

    def __init__(self, matrix: Array) -> None:
        """Raises ValueError: the matrix is empty, or a weight is not finite."""
        if matrix.ndim != 2 or not matrix.size or not np.isfinite(matrix).all():
            raise ValueError(f"a matrix (k, m) of finite numbers is wanted, not {matrix.shape}")
        k, m = matrix.shape
        size = np.abs(matrix)
        least = np.maximum(size.max(axis=1) / _WEIGHT_MAX, size.sum(axis=1) / _ROW_MAX)
        step = np.where(least > 0.0, least, 1.0)
        self._weights, self._start, self._begin, self._ahead = _in_runs(matrix, step)
        self._row_step = step.astype(np.float32)
        self._vector = np.zeros(-(-m // BLOCK) * BLOCK, np.int16)
        self._all = np.arange(k, dtype=np.int32)
        self.values = np.zeros(m, np.float32)
        self.result = np.empty(k, np.float32)

    def apply(self) -> cython.void:
        """`result`: the matrix times `values`."""
        self._multiply(self._all, self._all.shape[0])

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
        self._multiply(which, n)

    def _multiply(self, which: cython.const[cython.int][::1], n: cython.Py_ssize_t) -> cython.void:
        p: cython.Py_ssize_t
        step: cython.float = self._quantize()
        row_step: cython.float[::1] = self._row_step
        result: cython.float[::1] = self.result
        for p in range(n):
            result[p] = cython.cast(cython.float, self._product(which[p])) * row_step[which[p]] * step

    def _product(self, row: cython.Py_ssize_t) -> cython.int:
        """A row times the vector, in whole steps, which fits 32 bits."""
        weights: cython.short[::1] = self._weights
        vector: cython.short[::1] = self._vector
        r: cython.Py_ssize_t
        i: cython.Py_ssize_t
        ahead: cython.Py_ssize_t
        total: cython.int = 0
        for r in range(self._start[row], self._start[row + 1]):
            ahead = self._ahead[r]
            for i in range(self._begin[r], self._begin[r + 1]):
                total += cython.cast(cython.int, weights[i]) * cython.cast(cython.int, vector[ahead + i])
        return total

    def _quantize(self) -> cython.float:
        """The values in whole steps; returns the step."""
        i: cython.Py_ssize_t
        size: cython.float
        highest: cython.float = 0.0
        values: cython.float[::1] = self.values
        vector: cython.short[::1] = self._vector
        for i in range(values.shape[0]):
            highest = max(highest, abs(values[i]))
        scale: cython.float = _VALUE_MAX / highest if highest > 0.0 else 0.0
        for i in range(values.shape[0]):
            size = values[i] * scale + _ROUND
            vector[i] = cython.cast(cython.short, size - _ROUND)
        return highest / _VALUE_MAX


def _in_runs(matrix: Array, step: Array) -> tuple[NDArray[np.int16], Index, Index, Index]:
    """The blocks of each row that are kept, in whole steps, those that follow each other as one run.

    Returns  their weights, row after row; where each row's runs begin in the next two, and the last one's
             end; where each run's weights begin, and the last one's end; how far ahead of them its
             columns are
    """
    k, m = matrix.shape
    whole = np.zeros((k, -(-m // BLOCK) * BLOCK))
    whole[:, :m] = matrix / step[:, None]
    blocks = whole.reshape(k, -1, BLOCK)
    size2 = (blocks**2).sum(axis=2)
    smallest = np.argsort(size2, axis=1)
    left_out = np.cumsum(np.take_along_axis(size2, smallest, axis=1), axis=1) <= m / 12.0
    left_out[:, -1] = False  # a row has one block at least
    kept = np.empty_like(left_out)
    np.put_along_axis(kept, smallest, ~left_out, axis=1)
    first = kept & ~np.pad(kept, ((0, 0), (1, 0)))[:, :-1]
    start = np.cumsum([0, *first.sum(axis=1)], dtype=np.int32)
    begin = BLOCK * np.append(np.flatnonzero(first[kept]), kept.sum()).astype(np.int32)
    ahead = BLOCK * np.nonzero(first)[1].astype(np.int32) - begin[:-1]
    return np.rint(blocks[kept]).ravel().astype(np.int16), start, begin, ahead
