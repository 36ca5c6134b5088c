# cython: infer_types=True
"""Counts over a frame's image, for its faults.

A kernel (`CONTRIBUTING.md`, "Kernels"). Meaning and limits are explained by the callers.
"""

import cython
import numpy as np
from cython.cimports.libc.math import sqrt

from edge.limits import IMAGE_SIDE_PX
from edge.params import PARAMS
from edge.types import Image, Index

if cython.compiled:
    from cython.cimports.edge.geometry.select import median, select_kth
    from cython.cimports.libc.string import memcpy
else:
    from edge.geometry.select import median, select_kth

    def means_of(image: Image, step: int, top: int) -> tuple[float, float]:
        """Of each step-th pixel of each step-th row: level over `top`, and whether it is as high."""
        _check_image(image)
        samples = image[::step, ::step]
        return float(samples.mean()) / top, float(np.mean(samples >= top))


_LEVELS = np.dtype(np.uint8), np.dtype(np.uint16)
_SAMPLE_N = cython.declare(cython.Py_ssize_t, PARAMS.sample_n)


def level_of(image: Image, bits: cython.int) -> tuple[float, float]:
    """Mean level and share of saturated pixels, of full scale; 0 of an image without pixels.

    image   (h, w) uint8 or uint16, of which `bits` of each pixel are significant
    Raises  ValueError: no such image, or no such number of bits
    """
    if not 1 <= bits <= 16:
        raise ValueError(f"1 to 16 bits are wanted, not {bits}")
    size: cython.Py_ssize_t = image.size
    if size == 0:
        return 0.0, 0.0
    return means_of(image, max(1, cython.cast(cython.Py_ssize_t, sqrt(size)) // _SAMPLE_N), (1 << bits) - 1)


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
    counts: cython.ushort[::1]
    energy: cython.double[::1]  # of each window: mean square of the differences of pixels next to each other
    span: cython.double[::1]  # of its levels, without the tails

    def __init__(self, corners: Index, side: int, sample_n: int) -> None:
        are_pairs = corners.ndim == 2 and corners.shape[1] == 2
        if not (are_pairs and 1 < side <= IMAGE_SIDE_PX and 2 <= sample_n <= 64):
            raise ValueError(f"corners (m, 2), a side of 2 to {IMAGE_SIDE_PX}, sample_n of 2 to 64 wanted")
        self.corners = np.array(corners, np.int32, order="C")
        self.side, self.every, self.tail = side, max(1, round(side / sample_n)), sample_n
        self.levels, self.bytes = np.empty(max(side * side, len(corners))), np.empty(side * side, np.uint8)
        self.counts = np.empty(256, np.uint16)
        self.energy, self.span = np.zeros((2, len(corners)))

    def measure(self, image: Image, noise_energy: cython.double = 0.0) -> tuple[float, float]:
        """Medians over the windows: of the energy, less that of noise, over the square of the span, and of
        the span; NaN where there is no window.

        image   (h, w) uint8 or uint16
        Raises  ValueError: no such image, a window that is not within it
        """
        _check_image(image)
        n: cython.Py_ssize_t = self.corners.shape[0]
        rows: cython.Py_ssize_t = image.shape[0]
        columns: cython.Py_ssize_t = image.shape[1]
        for w in range(n):
            x, y = self.corners[w, 0], self.corners[w, 1]
            if x < 0 or y < 0 or x + self.side > columns or y + self.side > rows:
                raise ValueError("a window that is not within the image")
        if image.itemsize == 1:
            self._measure_bytes(image)
        else:
            self._measure(image)
        for w in range(n):
            self.levels[w] = max(self.span[w], 1.0)
        span = median(self.levels, n)
        for w in range(n):
            self.levels[w] = (self.energy[w] - noise_energy) / max(self.span[w], 1.0) ** 2
        return median(self.levels, n), span

    @cython.cfunc
    def _measure(self, image: cython.const[cython.ushort][:, :]) -> cython.void:
        m: cython.Py_ssize_t = 1 + (self.side - 1) // self.every
        n: cython.Py_ssize_t = m * m
        k: cython.Py_ssize_t
        levels: cython.double[::1] = self.levels
        for w in range(self.corners.shape[0]):
            energy = 0.0
            k = 0
            for y in range(m):
                for x in range(m):
                    column, row = self.corners[w, 0] + self.every * x, self.corners[w, 1] + self.every * y
                    level: cython.double = image[row, column]
                    dx = level - levels[k - 1] if x else 0.0
                    dy = level - levels[k - m] if y else 0.0
                    energy += dx * dx + dy * dy
                    levels[k] = level
                    k += 1
            self.energy[w] = energy / (m * (m - 1))
            low = select_kth(levels, n, n // self.tail)
            self.span[w] = select_kth(levels, n, n - 1 - n // self.tail) - low

    @cython.cfunc
    def _measure_bytes(self, image: cython.const[cython.uchar][:, :]) -> cython.void:
        """The same in whole numbers, of which a vector holds many."""
        m: cython.Py_ssize_t = 1 + (self.side - 1) // self.every
        n: cython.Py_ssize_t = m * m
        step: cython.short  # 16 bits, of which one vector operation adds up the products
        energy: cython.int
        own: cython.uchar[::1] = self.bytes
        every = self.every
        is_dense: cython.bint = every == 1 and image.strides[1] == 1
        for w in range(self.corners.shape[0]):
            energy = 0  # 32 bits hold 16,000 squares
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
            self.energy[w] = cython.cast(cython.double, energy) / (m * (m - 1))
            self.span[w] = self._span(n)

    @cython.cfunc
    def _span(self, n: cython.Py_ssize_t) -> cython.double:
        """The span of `bytes`, by counting."""
        below: cython.Py_ssize_t
        low: cython.Py_ssize_t = 0
        high: cython.Py_ssize_t = 255
        counts: cython.ushort[::1] = self.counts
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
