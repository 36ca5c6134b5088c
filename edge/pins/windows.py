"""The inner loops of `centroids` for uncompiled runs; `windows.pxd` has them in C.

Sums are of integers, so both give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Image, Index

Bytes = NDArray[np.uint8]
Shorts = NDArray[np.int16]


def sums_of_bytes(
    image: Image, x: int, y: int, steps: Index, begin: int, end: int, row_bytes: int, pixels: Bytes,
    templates: Shorts, at: int, common: int, n: int, sums: Array,
) -> None:  # fmt: skip
    """Sums over some spans of an 8-bit image of I d, I tx, I ty, I, I u, I v, I^2.

    steps   of each span, bytes from the begin of the one before it, the first from (x, y); and its pixels
    pixels  takes the spans, one after the other
    at      begin of d, tx, ty of one phase in `templates`, n each
    common  where the support, u and v stand

    Of each row `row_bytes` are copied, as many as the longest span has or more: the next span overwrites what
    is too many, and behind the last one they stay.
    """
    rows, columns = image.shape
    memory = np.lib.stride_tricks.as_strided(image, (image.strides[0] * (rows - 1) + columns,), (1,))
    to, row = 0, y * image.strides[0] + x
    for step, length in steps[begin:end]:
        row += step
        pixels[to : to + row_bytes] = memory[row : row + row_bytes]
        to += length
    _sums(pixels[:n].astype(np.int64), templates, at, common, n, sums)


def sums_of_shorts(
    pixels: Shorts, wide: bool, templates: Shorts, at: int, common: int, n: int, sums: Array
) -> None:
    """The same of levels at hand, for `common` and n as above; `wide`: their squares may have 24 bits."""
    _sums(pixels[:n].astype(np.int64), templates, at, common, n, sums)


def _sums(level: NDArray[np.int64], templates: Shorts, at: int, common: int, n: int, sums: Array) -> None:
    planes = [templates[first + k * n : first + (k + 1) * n] for first in (at, common) for k in range(3)]
    sums[:6] = [level @ plane.astype(np.int64) for plane in planes]
    sums[6] = (level * level) @ planes[3].astype(np.int64)
