# cython: infer_types=True
"""Counts over a frame's pins and image, for its faults: each is one pass over some hundred numbers.

A kernel (`CONTRIBUTING.md`, "Kernels"). Meaning and limits are explained by the callers. NaN marks a lost
pin; it does not count as far, and has no length.
"""

import cython
import numpy as np
from cython.cimports.libc.math import isnan, sqrt

from edge.limits import IMAGE_SIDE_PX
from edge.types import Array, Image, Index

if cython.compiled:
    from cython.cimports.edge.geometry.select import select_kth
else:
    from edge.geometry.select import select_kth

NAN = cython.declare(cython.double, float("nan"))

_LEVELS = np.dtype(np.uint8), np.dtype(np.uint16)


def sample_levels(image: Image, step: int, top: int) -> tuple[int, int, int]:
    """Sum of every step-th pixel of every step-th row, how many reach `top`, how many were sampled.

    image   (h, w) uint8 or uint16
    Raises  ValueError: no such image, a step below 1
    """
    _check_image(image)
    if step < 1:
        raise ValueError(f"a step of {step}: 1 or more is wanted")
    if image.itemsize == 1:
        return _sum_bytes(image, step, top)
    samples = image[::step, ::step]
    return int(samples.sum()), int(np.count_nonzero(samples >= top)), samples.size


@cython.cfunc
def _sum_bytes(
    image: cython.const[cython.uchar][:, :], step: cython.Py_ssize_t, top: cython.long
) -> tuple[int, int, int]:
    level: cython.long
    total: cython.longlong = 0
    full: cython.Py_ssize_t = 0
    rows: cython.Py_ssize_t = (image.shape[0] + step - 1) // step
    columns: cython.Py_ssize_t = (image.shape[1] + step - 1) // step
    for y in range(rows):
        for x in range(columns):
            level = cython.cast(cython.long, image[y * step, x * step])
            total += level
            full += level >= top
    return total, full, rows * columns


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
    for i in range(len(values)):
        value: cython.double = values[i]
        limit: cython.double = limits[i] if i < n else 1.0
        if value <= limit if i < below_n else value >= limit:
            bits |= one << i
    return bits


@cython.cclass
class PinCounts:
    """Counts over the pins of each frame.

    rest_img  (n, 2) float64, px: where they are at rest
    near      (n, k) int32: each pin itself, and its neighbours
    bad, new  (n,) uint8, of the last frame that was counted: pins that are bad, and were not so before
    Raises    ValueError: shapes do not fit, an index out of range
    """

    bad = cython.declare(cython.uchar[::1], visibility="readonly")
    new = cython.declare(cython.uchar[::1], visibility="readonly")
    rest_img: cython.const[cython.double][:, ::1]
    near: cython.const[cython.int][:, ::1]
    length2: cython.double[::1]
    last_px: cython.double[:, ::1]

    def __init__(self, rest_img: Array, near: Index) -> None:
        n = len(rest_img)
        if rest_img.shape != (n, 2) or near.ndim != 2 or len(near) != n:
            raise ValueError("places (n, 2) and neighbours (n, k) are wanted")
        if n and not 0 <= near.min() <= near.max() < n:
            raise ValueError(f"neighbours are rows of {n} pins")
        self.rest_img = np.array(rest_img, np.float64, order="C")
        self.near = np.array(near, np.int32, order="C")
        self.bad, self.new = np.zeros(n, np.uint8), np.zeros(n, np.uint8)
        self.length2, self.last_px = np.empty(n), np.zeros((n, 2))

    def seen(
        self,
        xy_img: cython.const[cython.double][:, ::1],
        sigma_px: cython.const[cython.double][::1],
        noisy_px: cython.double,
        far_px: cython.double,
    ) -> tuple[int, int, int, int, int, float]:
        """How many pins are seen, are bad, were not bad in the last frame, are bad with all their neighbours,
        stand further from rest than `far_px`; and the mean sigma of those that are seen, NaN of none.

        xy_img    (n, 2) px; NaN where lost
        sigma_px  (n,); a pin is bad unless this is at most `noisy_px`
        Raises    ValueError: shapes do not fit
        """
        if xy_img.shape[0] != self.rest_img.shape[0] or xy_img.shape[1] != 2:
            raise ValueError(f"places ({self.rest_img.shape[0]}, 2) are wanted")
        if sigma_px.shape[0] != self.rest_img.shape[0]:
            raise ValueError(f"{self.rest_img.shape[0]} sigmas are wanted")
        seen_n: cython.Py_ssize_t = 0
        bad_n: cython.Py_ssize_t = 0
        new_n: cython.Py_ssize_t = 0
        far_n: cython.Py_ssize_t = 0
        bad: cython.bint
        noise = 0.0
        # With local names the loop need not load them again after each number that it writes.
        rest_img: cython.const[cython.double][:, ::1] = self.rest_img
        is_bad: cython.uchar[::1] = self.bad
        is_new: cython.uchar[::1] = self.new
        for i in range(xy_img.shape[0]):
            dx = xy_img[i, 0] - rest_img[i, 0]
            dy = xy_img[i, 1] - rest_img[i, 1]
            far_n += dx * dx + dy * dy > far_px * far_px
            if not isnan(dx):
                seen_n += 1
                noise += sigma_px[i]
            bad = not sigma_px[i] <= noisy_px
            bad_n += bad
            is_new[i] = bad and not is_bad[i]
            new_n += is_new[i]
            is_bad[i] = bad
        mean_px = noise / seen_n if seen_n else NAN
        return seen_n, bad_n, new_n, self._holes() if bad_n else 0, far_n, mean_px

    @cython.cfunc
    def _holes(self) -> cython.Py_ssize_t:
        many: cython.Py_ssize_t = 0
        alone: cython.bint
        for i in range(self.near.shape[0]):
            alone = True
            for k in range(self.near.shape[1]):
                alone = alone and self.bad[self.near[i, k]] != 0
            many += alone
        return many

    def moved(
        self,
        motion_px: cython.const[cython.double][:, :],
        far_px: cython.double,
        least_px: cython.double,
        since_last: cython.bint,
    ) -> tuple[int, float]:
        """How many pins have moved further than `far_px`; and the median length of the motions, or of their
        changes since the last call, as numpy.nanmedian: 0 unless half of the lengths reach `least_px`.

        motion_px  (n, 2) since rest; NaN where lost
        Raises     ValueError: shapes do not fit
        """
        if motion_px.shape[0] != self.length2.shape[0] or motion_px.shape[1] != 2:
            raise ValueError(f"vectors ({self.length2.shape[0]}, 2) are wanted")
        m: cython.Py_ssize_t = 0
        far_n: cython.Py_ssize_t = 0
        long_n: cython.Py_ssize_t = 0
        for i in range(motion_px.shape[0]):
            dx: cython.double = motion_px[i, 0]
            dy: cython.double = motion_px[i, 1]
            square = dx * dx + dy * dy
            far_n += square > far_px * far_px
            if since_last:
                dx, dy = dx - self.last_px[i, 0], dy - self.last_px[i, 1]
                square = dx * dx + dy * dy
            self.last_px[i, 0], self.last_px[i, 1] = motion_px[i, 0], motion_px[i, 1]
            if not isnan(square):
                self.length2[m] = square
                m += 1
                long_n += square >= least_px * least_px
        if m == 0 or 2 * long_n < m:
            return far_n, 0.0
        middle = sqrt(select_kth(self.length2, m, m // 2))
        if m % 2 == 0:
            middle = 0.5 * (middle + sqrt(select_kth(self.length2, m, m // 2 - 1)))
        return far_n, middle


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
    image8: cython.const[cython.uchar][:, :]  # in hand, or
    image16: cython.const[cython.ushort][:, :]
    levels: cython.double[::1]
    counts: cython.Py_ssize_t[::1]

    def __init__(self, corners: Index, side: int, sample_n: int) -> None:
        if corners.ndim != 2 or corners.shape[1] != 2 or not 1 < side <= IMAGE_SIDE_PX or sample_n < 2:
            raise ValueError(
                f"corners (m, 2) and a side of 2 to {IMAGE_SIDE_PX}, sample_n of 2 or more, are wanted"
            )
        self.corners = np.array(corners, np.int32, order="C")
        self.side, self.every, self.tail = side, max(1, side // sample_n), sample_n
        self.levels = np.empty(side * side)
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
        wide: cython.bint = image.itemsize != 1
        if wide:
            self.image16 = image
        else:
            self.image8 = image
        return self._measure(out, wide)

    @cython.cfunc
    def _measure(self, out: cython.double[:, ::1], wide: cython.bint) -> cython.double:
        m: cython.Py_ssize_t = 1 + (self.side - 1) // self.every
        n: cython.Py_ssize_t = m * m
        k: cython.Py_ssize_t
        total = 0.0
        for w in range(self.corners.shape[0]):
            sum_ = 0.0
            energy = 0.0
            k = 0
            for y in range(m):
                for x in range(m):
                    column, row = self.corners[w, 0] + self.every * x, self.corners[w, 1] + self.every * y
                    self.levels[k] = self.image16[row, column] if wide else self.image8[row, column]
                    dx = self.levels[k] - self.levels[k - 1] if x else 0.0
                    dy = self.levels[k] - self.levels[k - m] if y else 0.0
                    energy += dx * dx + dy * dy
                    sum_ += self.levels[k]
                    k += 1
            out[w, 0] = energy / (m * (m - 1))
            out[w, 1] = self._span_wide(n) if wide else self._span(n)
            total += sum_ / n
        return total / self.corners.shape[0]

    @cython.cfunc
    def _span_wide(self, n: cython.Py_ssize_t) -> cython.double:
        low = select_kth(self.levels, n, n // self.tail)
        return select_kth(self.levels, n, n - 1 - n // self.tail) - low

    @cython.cfunc
    def _span(self, n: cython.Py_ssize_t) -> cython.double:
        """The same by counting: levels of 8 bits."""
        below: cython.Py_ssize_t
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
    if image.ndim != 2 or image.dtype not in _LEVELS:
        raise ValueError(f"an image (h, w) of uint8 or uint16 is wanted, not {image.shape} of {image.dtype}")
