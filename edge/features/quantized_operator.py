"""A constant matrix times a vector, in 16-bit integers.

Idea: the surface's operators are constant, and their products are most of a frame's arithmetic. As 16-bit
integers with one step a row they stream through the cache in half the time of single precision. Sums are
exact; rounding adds an error of 1e-4 of the highest value, a tenth of the noise of an area.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.types import Array

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
#: Rows are filled up to a multiple of this, for the vector units.
_BLOCK = 16


@cython.final
@cython.cclass
class QuantizedOperator:
    """A (k, m) matrix; `values` in, `result` out, both good until the next call.

    values   (m,) float32, finite; to be written before `quantize`
    result   (k,) float32; of `apply` or `apply_rows`
    step     float32, of the quantized values
    """

    def __init__(self, matrix: Array) -> None:
        """Raises ValueError: the matrix is empty, or a weight is not finite."""
        if matrix.ndim != 2 or not matrix.size or not np.isfinite(matrix).all():
            raise ValueError(f"a matrix (k, m) of finite numbers is wanted, not {matrix.shape}")
        k, m = matrix.shape
        step = np.empty(k)
        rows = np.zeros((k, -(-m // _BLOCK) * _BLOCK), np.int16)
        for i, row in enumerate(matrix):
            size = np.abs(row)
            least = max(size.max() / _WEIGHT_MAX, size.sum() / _ROW_MAX)
            step[i] = least if least > 0.0 else 1.0
            rows[i, :m] = np.rint(row / step[i])
        self._rows, self._row_step = rows, step.astype(np.float32)
        self._vector = np.zeros(rows.shape[1], np.int16)
        self._sums = np.empty(k, np.int32)
        self._step = 0.0
        self.values = np.zeros(m, np.float32)
        self.result = np.empty(k, np.float32)

    def apply(self) -> cython.void:
        """`result`: the matrix times `values`."""
        with cython.nogil:
            self._quantize()
            all_rows(self._rows, self._vector, self._sums)
            self._scale(self._row_step.shape[0])

    def apply_rows(self, which: cython.const[cython.int][::1], n: cython.Py_ssize_t) -> cython.void:
        """The first n of `result`: the first n of these rows times `values`.

        which    (at least n,) int32
        Raises   ValueError: n beyond `which`, or no such row
        """
        p: cython.Py_ssize_t
        k: cython.Py_ssize_t = self._rows.shape[0]
        if n < 0 or n > which.shape[0] or n > k:
            raise ValueError(f"n: 0 to {min(which.shape[0], k)} rows are wanted, not {n}")
        for p in range(n):
            if which[p] < 0 or which[p] >= k:
                raise ValueError(f"which: rows of 0 to {k - 1} are wanted, not {which[p]}")
        with cython.nogil:
            self._quantize()
            some_rows(self._rows, which, n, self._vector, self._sums)
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
            size = self.values[i] * scale + _ROUND
            self._vector[i] = cython.cast(cython.short, size - _ROUND)
        self._step = highest / _VALUE_MAX

    def _scale(self, k: cython.Py_ssize_t) -> cython.void:
        p: cython.Py_ssize_t
        for p in range(k):
            self.result[p] = cython.cast(cython.float, self._sums[p]) * self._row_step[p] * self._step
