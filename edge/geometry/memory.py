"""Arrays where vector units read them best."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["aligned"]

#: Bytes of a line of the cache, on x86 and on ARM.
_LINE = 64


def aligned(array: NDArray[Any]) -> NDArray[Any]:
    """A copy that begins with a line of the cache: a vector of whose size its rows are multiples lies in one
    line. NumPy's own arrays begin a quarter of a line further, and half of such vectors lie in two.
    """
    room = np.empty(array.nbytes + _LINE, np.uint8)
    first = -room.__array_interface__["data"][0] % _LINE
    copy = room[first : first + array.nbytes].view(array.dtype).reshape(array.shape)
    copy[...] = array
    return copy
