# cython: infer_types=True
"""Counts over a frame's image, for its faults, and which numbers reach their limits.

A kernel (`CONTRIBUTING.md`, "Kernels"). Meaning and limits are explained by the callers.
"""

import cython
import numpy as np
from cython.cimports.libc.math import sqrt

from edge.limits import IMAGE_SIDE_PX
from edge.params import PARAMS
from edge.types import Image, Index

if cython.compiled:
    from cython.cimports.edge.geometry.select import select_kth
    from cython.cimports.libc.string import memcpy
else:
    from edge.geometry.select import select_kth

_LEVELS = np.dtype(np.uint8), np.dtype(np.uint16)
_SAMPLE_N = cython.declare(cython.Py_ssize_t, PARAMS.sample_n)


def level_of(image: Image, bits: cython.int) -> tuple[float, float]:
    """Mean level and share of saturated pixels, of full scale; 0 of an image without pixels.

    image   (h, w) uint8 or uint16, of which `bits` of each pixel are significant
    Raises  ValueError: no such image, or no such number of bits
    """
    _check_image(image)
    if not 1 <= bits <= 16:
        raise ValueError(f"1 to 16 bits are wanted, not {bits}")
    size: cython.Py_ssize_t = image.size
    top: cython.long = (1 << bits) - 1
    if size == 0:
        return 0.0, 0.0
    step = max(1, cython.cast(cython.Py_ssize_t, sqrt(size)) // _SAMPLE_N)
    if image.itemsize == 1:
        return _level_of_bytes(image, step, top)
    samples = image[::step, ::step]
    return int(samples.sum()) / (samples.size * top), np.count_nonzero(samples >= top) / samples.size


@cython.cfunc
def _level_of_bytes(
    image: cython.const[cython.uchar][:, :], step: cython.Py_ssize_t, top: cython.long
) -> tuple[float, float]:
    level: cython.long
    total: cython.double = 0.0
    full: cython.double = 0.0
    rows: cython.Py_ssize_t = (image.shape[0] + step - 1) // step
    columns: cython.Py_ssize_t = (image.shape[1] + step - 1) // step
    for y in range(rows):
        for x in range(columns):
            level = cython.cast(cython.long, image[y * step, x * step])
            total += level
            full += level >= top
    return total / (rows * columns * top), full / (rows * columns)


def which_reach(values: tuple[float, ...], limits: list[float], below_n: cython.Py_ssize_t) -> int:
    """A bit for each value, the lowest for the first: whether it reaches its limit; the first `below_n` do
    below it. Of a value without a limit, whether it is true. NaN reaches none.

    Raises  ValueError: more limits than values, or than bits
    """
    bits: cython.longlong = 0
    one: cython.longlong = 1
    n: cython.Py_ssize_t = len(limits)
    if not n <= len(values) <= 62:
        raise ValueError(f"{n} to 62 values are wanted, not {len(values)}")
    for i in range(n):
        value: cython.double = values[i]
        limit: cython.double = limits[i]
        if value <= limit if i < below_n else value >= limit:
            bits |= one << i
    for i in range(n, len(values)):
        if values[i]:
            bits |= one << i
    return bits


@cython.cclass
class FocusWindows:
    """Windows of an image in which the focus is measured.

    corners  (m, 2) int32, px: the first column and row of each
    side     px, of each
    sample_n  of its rows and columns about so many are read, evenly spread; one in so many of the lowest
             levels, and of the highest, is not part of the span
    Raises   ValueError: no such windows
    """

    side: cython.Py_ssize_t
    every: cython.Py_ssize_t  # of the rows and columns one is read
    tail: cython.Py_ssize_t
    corners: cython.int[:, ::1]
    levels: cython.double[::1]
    bytes: cython.uchar[::1]
    counts: cython.Py_ssize_t[::1]

    def __init__(self, corners: Index, side: int, sample_n: int) -> None:
        are_pairs = corners.ndim == 2 and corners.shape[1] == 2
        if not (are_pairs and 1 < side <= IMAGE_SIDE_PX and 2 <= sample_n <= 64):
            raise ValueError(
                f"corners (m, 2) and a side of 2 to {IMAGE_SIDE_PX}, sample_n of 2 to 64, are wanted"
            )
        self.corners = np.array(corners, np.int32, order="C")
        self.side, self.every, self.tail = side, max(1, round(side / sample_n)), sample_n
        self.levels, self.bytes = np.empty(side * side), np.empty(side * side, np.uint8)
        self.counts = np.empty(256, np.intp)

    def measure(self, image: Image, out: cython.double[:, ::1]) -> float:
        """Mean level of the windows; 0 where there is none.

        image   (h, w) uint8 or uint16
        out     (m, 2): of each window the mean square of the differences of pixels that are read next to
                each other, along x and y together, and the span of its levels without the tails; written
        Raises  ValueError: no such image, a window that is not within it
        """
        _check_image(image)
        if out.shape[0] != self.corners.shape[0] or out.shape[1] != 2:
            raise ValueError(f"out ({self.corners.shape[0]}, 2) is wanted")
        rows: cython.Py_ssize_t = image.shape[0]
        columns: cython.Py_ssize_t = image.shape[1]
        for w in range(self.corners.shape[0]):
            x, y = self.corners[w, 0], self.corners[w, 1]
            if x < 0 or y < 0 or x + self.side > columns or y + self.side > rows:
                raise ValueError("a window that is not within the image")
        if self.corners.shape[0] == 0:
            return 0.0
        if image.itemsize == 1:
            return self._measure_bytes(image, out)
        return self._measure(image, out)

    @cython.cfunc
    def _measure(self, image: cython.const[cython.ushort][:, :], out: cython.double[:, ::1]) -> cython.double:
        m: cython.Py_ssize_t = 1 + (self.side - 1) // self.every
        n: cython.Py_ssize_t = m * m
        k: cython.Py_ssize_t
        levels: cython.double[::1] = self.levels
        total = 0.0
        for w in range(self.corners.shape[0]):
            sum_ = 0.0
            energy = 0.0
            k = 0
            for y in range(m):
                for x in range(m):
                    column, row = self.corners[w, 0] + self.every * x, self.corners[w, 1] + self.every * y
                    level: cython.double = image[row, column]
                    dx = level - levels[k - 1] if x else 0.0
                    dy = level - levels[k - m] if y else 0.0
                    energy += dx * dx + dy * dy
                    sum_ += level
                    levels[k] = level
                    k += 1
            out[w, 0] = energy / (m * (m - 1))
            low = select_kth(levels, n, n // self.tail)
            out[w, 1] = select_kth(levels, n, n - 1 - n // self.tail) - low
            total += sum_ / n
        return total / self.corners.shape[0]

    @cython.cfunc
    def _measure_bytes(
        self, image: cython.const[cython.uchar][:, :], out: cython.double[:, ::1]
    ) -> cython.double:
        """The same in whole numbers, of which a vector holds many."""
        m: cython.Py_ssize_t = 1 + (self.side - 1) // self.every
        n: cython.Py_ssize_t = m * m
        step: cython.int
        sum_: cython.int
        energy: cython.int
        own: cython.uchar[::1] = self.bytes
        every = self.every
        is_dense: cython.bint = every == 1 and image.strides[1] == 1
        total = 0.0
        for w in range(self.corners.shape[0]):
            sum_ = energy = 0  # 32 bits hold 16,000 squares
            left, top = self.corners[w, 0], self.corners[w, 1]
            for y in range(m):
                if cython.compiled and is_dense:
                    memcpy(cython.address(own[m * y]), cython.address(image[top + y, left]), m)
                    continue
                for x in range(m):
                    own[m * y + x] = image[top + every * y, left + every * x]
            for i in range(1, n):
                step = cython.cast(cython.int, own[i]) - cython.cast(cython.int, own[i - 1])
                energy += step * step
            for i in range(m, n):
                step = cython.cast(cython.int, own[i]) - cython.cast(cython.int, own[i - m])
                energy += step * step
            for y in range(1, m):  # not along a row: from its end to the next one's
                step = cython.cast(cython.int, own[m * y]) - cython.cast(cython.int, own[m * y - 1])
                energy -= step * step
            for i in range(n):
                sum_ += cython.cast(cython.int, own[i])
            out[w, 0] = cython.cast(cython.double, energy) / (m * (m - 1))
            out[w, 1] = self._span(n)
            total += cython.cast(cython.double, sum_) / n
        return total / self.corners.shape[0]

    @cython.cfunc
    def _span(self, n: cython.Py_ssize_t) -> cython.double:
        """The span of `bytes`, by counting."""
        below: cython.Py_ssize_t
        low: cython.Py_ssize_t = 0
        high: cython.Py_ssize_t = 255
        counts: cython.Py_ssize_t[::1] = self.counts
        own: cython.uchar[::1] = self.bytes
        for i in range(256):
            counts[i] = 0
        for i in range(n):
            counts[own[i]] += 1
        below = counts[low]
        while below <= n // self.tail:
            low += 1
            below += counts[low]
        below = counts[high]
        while below <= n // self.tail:
            high -= 1
            below += counts[high]
        return high - low


@cython.cfunc
def _check_image(image: Image) -> None:
    if image.ndim != 2 or image.dtype not in _LEVELS:
        raise ValueError(f"an image (h, w) of uint8 or uint16 is wanted, not {image.shape} of {image.dtype}")
