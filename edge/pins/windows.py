"""The inner loops of `centroids` for uncompiled runs; `windows.pxd` has them in C.

Sums are of integers, the rest are the same operations: both give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.pins.templates import BLOCK, PHASES
from edge.types import Array, Image, Index

Shorts = NDArray[np.int16]

#: What is known of one kind of pins:
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

#: What of an 8-bit image is fetched into the cache before windows are read: its rows in the order of memory.
#: Reading the pins of an image that lies in memory takes 1.35 times as long so as of one in the cache, twice
#: with the rows of each window fetched on their own, 3.3 times without. That is with 331 pins, 640 x 480,
#: 2 or 3 times the mean number of rows, 2 or 3 windows ahead. With the mean, or with as many rows as there
#: are, it is 2.1 times, with 1 window ahead 1.5.
#: row, end, stride  bytes: the next row, the first that is not wanted, and from row to row
#: first, beyond     bytes: what is wanted of each
#: rows              for each window at most
#: ahead             bytes: as far beyond the middle of the window in hand
FETCH = np.dtype([(name, np.intp) for name in ("row", "end", "stride", "first", "beyond", "rows", "ahead")])


def place(
    norm_of: Index, inner: Array, stride: int, xy: Array, who: Index, n: int, others: Index, at: Index,
    begin: Index, middle: Array,
) -> int:  # fmt: skip
    """Which windows to read.

    norm_of  row of each pin's first phase in the norms
    inner    (4,) phases: the least x and y of pins whose windows are within the image, and the least beyond
    stride   of the image, bytes
    xy       (m, 2) px, where each pin is about
    who      the n pins asked for, and space for more; those with windows within the image are put first, ...
    others   ... the others here
    at       row in the norms, of the nearest phase
    begin    byte of the image where the middle of the window is
    middle   (2, n) px, x and y of the middle of the template of that phase
    Returns  how many have windows within the image
    """
    asked = who[:n].copy()
    with np.errstate(invalid="ignore"):
        phases = PHASES * xy[asked] + 2
        within = ((inner[:2] <= phases) & (phases < inner[2:])).all(axis=1)
    taken = int(within.sum())
    who[:taken], others[: n - taken] = asked[within], asked[~within]
    x, y = phases[within].astype(np.int64).T
    at[:taken] = norm_of[who[:taken]] + y % PHASES * PHASES + x % PHASES
    begin[:taken] = y // PHASES * stride + x // PHASES
    middle[:, :taken] = 0.25 * np.stack([x, y]) - 0.375
    return taken


def sum_windows(
    image: Image, fetch: NDArray[np.void], begin: Index, at: Index, n: int, kinds: NDArray[np.void],
    steps: Index, values: Shorts, uv: NDArray[np.int8], norms: NDArray[np.float64],
    pixels: NDArray[np.uint8], dark: bool, sums: Array,
) -> None:  # fmt: skip
    """Sums over n windows of an 8-bit image.

    fetch      (1,) `FETCH`; here of no use
    begin, at  of `place`
    kinds      `KIND` of each kind of pins
    steps      of each span, bytes from the begin of the one before it, the first from the middle of
               the window, and its pixels; behind each kind's LANES zeros: rows are copied several at once
    pixels     takes the spans, one after the other
    dark       sums are those of 255 - I
    sums       (n, 8): I d, I tx, I ty, I, I u, I v, I^2 and 1, each times its factor in `norms`

    Of each row `row_bytes` are copied, as many as the longest span has or more: the next span overwrites what
    is too many, and zeros what is behind the last one.
    """
    rows, columns = image.shape
    memory = np.lib.stride_tricks.as_strided(image, (image.strides[0] * (rows - 1) + columns,), (1,))
    for j in range(n):
        kind, phase = divmod(int(at[j]), PHASES * PHASES)
        k = kinds[kind]
        to, row = 0, begin[j]
        for step, length in steps[k["first_step"] : k["end_step"]]:
            row += step
            pixels[to : to + k["row_bytes"]] = memory[row : row + k["row_bytes"]]
            to += length
        pixels[to : to + BLOCK] = 0
        first = k["first"] + 3 * k["plane"] * phase
        _sums(pixels, values, first, uv, k["first_uv"], k["plane"], norms[at[j]], sums[j])
        if dark:  # the sums of the other templates are 0
            white = 255.0 * k["pixels"]
            square, level = sums[j, 6] + 255.0 * (white - 2.0 * sums[j, 3]), white - sums[j, 3]
            sums[j, :6] *= -1.0
            sums[j, 3], sums[j, 6] = level, square


def sum_shorts(
    window: Shorts, wide: bool, values: Shorts, first: int, uv: NDArray[np.int8], first_uv: int, plane: int,
    norm: NDArray[np.float64], sums: Array,
) -> None:  # fmt: skip
    """Those sums of levels at hand, zeros behind the last one; `wide`: their squares may have 24 bits."""
    _sums(window, values, first, uv, first_uv, plane, norm, sums)


def _sums(
    window: NDArray[np.uint8] | Shorts, values: Shorts, first: int, uv: NDArray[np.int8], first_uv: int,
    n: int, norm: NDArray[np.float64], sums: Array,
) -> None:  # fmt: skip
    level = window[:n].astype(np.int64)
    d, tx, ty = values[first : first + 3 * n].astype(np.int64).reshape(3, n) @ level
    u, v = uv[first_uv : first_uv + 2 * n].astype(np.int64).reshape(2, n) @ level
    sums[:8] = np.array([d, tx, ty, level.sum(), u, v, level @ level, 1], np.float64) * norm[:8]
