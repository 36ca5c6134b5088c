"""The measurements of `image_quality` and `fault_detector`: each one pass over some hundred numbers.

A kernel (`CONTRIBUTING.md`, "Kernels"). Meaning and limits are explained by the callers. NaN marks a lost
pin; it does not count as far, and has no length.
"""

# mypy: disable-error-code="untyped-decorator,valid-type,no-any-return"

from __future__ import annotations

import cython
import numpy as np

from edge.limits import IMAGE_SIDE_PX
from edge.types import Image, Index

if cython.compiled:
    from cython.cimports.edge.geometry.select import select_kth
    from cython.cimports.libc.math import isnan, sqrt
else:
    from math import isnan, sqrt

    from edge.geometry.select import select_kth


def sample_levels(image: Image, step: int, top: int) -> tuple[int, int, int]:
    """Of every step-th pixel of every step-th row: the sum, how many reach `top`, how many were sampled.

    image   (h, w) uint8 or uint16
    Raises  ValueError: no such image, a step below 1
    """
    _check_image(image)
    if step < 1:
        raise ValueError(f"a step of {step}: 1 or more is wanted")
    return _sum_levels(np.array(image[::step, ::step], np.int32, order="C"), top)


@cython.cfunc
def _sum_levels(samples: cython.int[:, ::1], top: cython.long) -> tuple[int, int, int]:
    total: cython.longlong = 0
    full: cython.Py_ssize_t = 0
    x: cython.Py_ssize_t
    y: cython.Py_ssize_t
    for y in range(samples.shape[0]):
        for x in range(samples.shape[1]):
            total += samples[y, x]
            full += samples[y, x] >= top
    return total, full, samples.shape[0] * samples.shape[1]


def count_longer(vectors: cython.const[cython.double][:, :], limit: cython.double) -> int:
    """How many of the vectors (n, 2) are longer than `limit`."""
    if vectors.shape[1] != 2:
        raise ValueError("vectors (n, 2) are wanted")
    i: cython.Py_ssize_t
    many: cython.Py_ssize_t = 0
    for i in range(vectors.shape[0]):
        many += vectors[i, 0] * vectors[i, 0] + vectors[i, 1] * vectors[i, 1] > limit * limit
    return many


def count_apart(
    now: cython.const[cython.double][:, :], before: cython.const[cython.double][:, :], limit: cython.double
) -> int:
    """How many of the points (n, 2) lie further than `limit` from where they were."""
    if now.shape[1] != 2 or before.shape[0] != now.shape[0] or before.shape[1] != 2:
        raise ValueError("points (n, 2), now and before, are wanted")
    i: cython.Py_ssize_t
    many: cython.Py_ssize_t = 0
    dx: cython.double
    dy: cython.double
    for i in range(now.shape[0]):
        dx = now[i, 0] - before[i, 0]
        dy = now[i, 1] - before[i, 1]
        many += dx * dx + dy * dy > limit * limit
    return many


def median_length(vectors: cython.const[cython.double][:, :]) -> float:
    """Median length of the vectors (n, 2) without NaN, as numpy.nanmedian; 0 if there is none."""
    if vectors.shape[1] != 2:
        raise ValueError("vectors (n, 2) are wanted")
    square: cython.double
    i: cython.Py_ssize_t
    m: cython.Py_ssize_t = 0
    length2: cython.double[::1] = np.empty(vectors.shape[0])
    for i in range(vectors.shape[0]):
        square = vectors[i, 0] * vectors[i, 0] + vectors[i, 1] * vectors[i, 1]
        if not isnan(square):
            length2[m] = square
            m += 1
    if m == 0:
        return 0.0
    middle: cython.double = sqrt(select_kth(length2, m, m // 2))
    if m % 2 == 0:
        middle = 0.5 * (middle + sqrt(select_kth(length2, m, m // 2 - 1)))
    return middle


@cython.cclass
class FocusWindows:
    """Windows of an image in which the focus is measured.

    corners  (m, 2) int32, px: the first column and row of each
    side     px, of each
    tail     one in so many of the lowest levels, and of the highest, is not part of the span
    Raises   ValueError: no such windows
    """

    side: cython.Py_ssize_t
    tail: cython.Py_ssize_t
    corners: cython.int[:, ::1]
    rows: Index  # (m, side, 1) and
    columns: Index  # (m, 1, side): of all pixels in the windows
    levels: cython.double[::1]
    counts: cython.Py_ssize_t[::1]

    def __init__(self, corners: Index, side: int, tail: int) -> None:
        if corners.ndim != 2 or corners.shape[1] != 2 or not 1 < side <= IMAGE_SIDE_PX or tail < 2:
            raise ValueError(
                f"corners (m, 2) and a side of 2 to {IMAGE_SIDE_PX}, tail of 2 or more, are wanted"
            )
        self.corners = np.array(corners, np.int32, order="C")
        self.side, self.tail = side, tail
        steps = np.arange(side)
        self.rows = corners[:, 1, None, None] + steps[:, None]
        self.columns = corners[:, 0, None, None] + steps
        self.levels = np.empty(side * side)
        self.counts = np.empty(256, np.intp)

    def measure(self, image: Image, out: cython.double[:, ::1]) -> float:
        """Mean level of the windows; 0 where there is none.

        image   (h, w) uint8 or uint16
        out     (m, 2): of each window the mean square of its neighbours' differences, along x and y together,
                and the span of its levels without the tails; written
        Raises  ValueError: no such image, a window that is not within it
        """
        _check_image(image)
        w: cython.Py_ssize_t
        if out.shape[0] != self.corners.shape[0] or out.shape[1] != 2:
            raise ValueError(f"out ({self.corners.shape[0]}, 2) is wanted")
        for w in range(self.corners.shape[0]):
            if (
                self.corners[w, 0] < 0
                or self.corners[w, 1] < 0
                or self.corners[w, 0] + self.side > image.shape[1]
                or self.corners[w, 1] + self.side > image.shape[0]
            ):
                raise ValueError("a window that is not within the image")
        if self.corners.shape[0] == 0:
            return 0.0
        windows = np.array(image[self.rows, self.columns], np.float64, order="C")
        level: float = self._measure(windows, out, image.dtype != np.uint8)
        return level

    @cython.cfunc
    @cython.exceptval(check=False)
    def _measure(
        self, windows: cython.double[:, :, ::1], out: cython.double[:, ::1], wide: cython.bint
    ) -> cython.double:
        n: cython.Py_ssize_t = self.side * self.side
        w: cython.Py_ssize_t
        x: cython.Py_ssize_t
        y: cython.Py_ssize_t
        k: cython.Py_ssize_t
        sum_: cython.double
        energy: cython.double
        dx: cython.double
        dy: cython.double
        total: cython.double = 0
        for w in range(self.corners.shape[0]):
            sum_ = 0
            energy = 0
            k = 0
            for y in range(self.side):
                for x in range(self.side):
                    self.levels[k] = windows[w, y, x]
                    dx = self.levels[k] - self.levels[k - 1] if x else 0.0
                    dy = self.levels[k] - self.levels[k - self.side] if y else 0.0
                    energy += dx * dx + dy * dy
                    sum_ += self.levels[k]
                    k += 1
            out[w, 0] = energy / (self.side * (self.side - 1))
            out[w, 1] = self._span_wide(n) if wide else self._span(n)
            total += sum_ / n
        return total / self.corners.shape[0]

    @cython.cfunc
    @cython.exceptval(check=False)
    def _span_wide(self, n: cython.Py_ssize_t) -> cython.double:
        low: cython.double = select_kth(self.levels, n, n // self.tail)
        return select_kth(self.levels, n, n - 1 - n // self.tail) - low

    @cython.cfunc
    @cython.exceptval(check=False)
    def _span(self, n: cython.Py_ssize_t) -> cython.double:
        """The same by counting: levels of 8 bits."""
        i: cython.Py_ssize_t
        below: cython.Py_ssize_t = 0
        low: cython.Py_ssize_t = 0
        high: cython.Py_ssize_t = 255
        for i in range(256):
            self.counts[i] = 0
        for i in range(n):
            self.counts[cython.cast(cython.Py_ssize_t, self.levels[i])] += 1
        below = self.counts[low]
        while below <= n // self.tail:
            low += 1
            below += self.counts[low]
        below = self.counts[high]
        while below <= n // self.tail:
            high -= 1
            below += self.counts[high]
        return high - low


def _check_image(image: Image) -> None:
    if image.ndim != 2 or image.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"an image (h, w) of uint8 or uint16 is wanted, not {image.shape} of {image.dtype}")
