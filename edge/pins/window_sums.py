"""Sums over a pin's window, for uncompiled runs; `window_sums.c` has them in C, for vectors.

Sums are of integers: both give exactly the same.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from edge.pins.templates import BLOCK, PHASES
from edge.types import Array, Image, Index

Shorts = NDArray[np.int16]

#: Columns of what is known of one kind of pins:
#: half             px, half width of its window
#: first_span, end_span  its rows in the spans of all kinds
#: first_step, end_step  and in their steps
#: row_bytes        copied of each row of a window: the longest, filled up to LANES
#: first, first_uv, plane  as in `TemplateSet`
#: pixels           of its support
KIND = np.dtype(
    [
        (name, np.intp)
        for name in (
            "half", "first_span", "end_span", "first_step", "end_step", "row_bytes", "first", "first_uv",
            "plane", "pixels",
        )
    ]
)  # fmt: skip

#: The part of an 8-bit image that is fetched into the cache before windows are read: its rows in the order
#: of memory. Reading the pins of an image that lies in memory takes 1.35 times as long so as of one in the
#: cache, twice with the rows of each window fetched on their own, 3.3 times without. That is with 331 pins,
#: 640 x 480, 2 or 3 times the mean number of rows, 2 or 3 windows ahead. It is 2.1 times with the mean, or
#: with as many rows as there are, and 1.5 times with 1 window ahead.
#: row, end, stride  bytes: the next row, the first that is not wanted, and from row to row
#: first, beyond     bytes: what is wanted of each
#: rows              for each window at most
#: ahead             bytes: as far beyond the middle of the window in hand
FETCH = np.dtype([(name, np.intp) for name in ("row", "end", "stride", "first", "beyond", "rows", "ahead")])


class Windows(NamedTuple):
    """What the windows of an 8-bit image share.

    fetch    (1,) `FETCH`; here of no use
    kinds    `KIND` of each kind of pins
    steps    of each span, bytes from the begin of the one before it, the first from the middle of the window,
             and its pixels; behind each kind's LANES zeros: rows are copied several at once
    values, uv, norms  of the templates
    pixels   takes a window's spans, one after the other
    sums     (8,): I d, I tx, I ty, I, I u, I v, I^2 and 1 of a window, each times its factor in `norms`
    dark     sums are those of 255 - I
    """

    image: Image
    fetch: NDArray[np.void]
    kinds: NDArray[np.void]
    steps: Index
    values: Shorts
    uv: NDArray[np.int8]
    norms: Array
    pixels: NDArray[np.uint8]
    sums: Array
    dark: bool


windows_of = Windows


def sum_window(windows: Windows, begin: int, kind: int, norm: int) -> None:
    """Write `sums` of one window.

    begin  byte of the image where the middle of the window is
    norm   row of its kind's phase in `norms`

    Of each row `row_bytes` are copied, as many as the longest span has or more: the next span overwrites what
    is too many, and zeros what is behind the last one.
    """
    image, _, kinds, all_steps, values, uv, norms, pixels, sums, dark = windows
    rows, columns = image.shape
    memory = np.lib.stride_tricks.as_strided(image, (image.strides[0] * (rows - 1) + columns,), (1,))
    k = kinds[kind]
    to, row = 0, begin
    for step, length in all_steps[k["first_step"] : k["end_step"]]:
        row += step
        pixels[to : to + k["row_bytes"]] = memory[row : row + k["row_bytes"]]
        to += length
    pixels[to : to + BLOCK] = 0
    n, first_uv = k["plane"], k["first_uv"]
    first = k["first"] + 3 * n * (norm % PHASES**2)
    level = pixels[:n].astype(np.int64)
    d, tx, ty = values[first : first + 3 * n].astype(np.int64).reshape(3, n) @ level
    u, v = uv[first_uv : first_uv + 2 * n].astype(np.int64).reshape(2, n) @ level
    sums[:8] = np.array([d, tx, ty, level.sum(), u, v, level @ level, 1], np.float64) * norms[norm, :8]
    if dark:  # the sums of the other templates are 0
        white = 255.0 * k["pixels"]
        square, total = sums[6] + 255.0 * (white - 2.0 * sums[3]), white - sums[3]
        sums[:6] *= -1.0
        sums[3], sums[6] = total, square
