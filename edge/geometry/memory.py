"""Constants as they lie best in memory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from edge.types import Index

__all__ = ["aligned", "short_rows"]

#: Bytes of a line of the cache, on x86 and on ARM.
_LINE = 64


def aligned(array: NDArray[Any]) -> NDArray[Any]:
    """A copy that begins with a line of the cache: a vector of whose size its rows are multiples lies in one
    line. NumPy's own arrays begin a quarter of a line further, and half of such vectors lie in two.
    """
    memory = np.empty(array.nbytes + _LINE, np.uint8)
    first = -memory.__array_interface__["data"][0] % _LINE
    copy = memory[first : first + array.nbytes].view(array.dtype).reshape(array.shape)
    copy[...] = array
    return copy


def short_rows(rows: Index) -> NDArray[np.uint16]:
    """Rows of a table in half the memory. Raises ValueError: a row that 16 bits do not hold."""
    most = np.iinfo(np.uint16).max
    if rows.size and not (rows.min() >= 0 and rows.max() <= most):
        raise ValueError(f"rows of 0 to {most} are wanted, not {rows.min()} to {rows.max()}")
    return np.ascontiguousarray(rows, np.uint16)
