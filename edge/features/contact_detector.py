# cython: infer_types=True
"""Is the tip in contact? Decided by the cells' area changes and their noise, which is learnt while it is
untouched.

Idea: in a contact the areas of neighbouring cells increase together. Under noise they do not: the area that
one cell gains by its pin's jitter is lost by its neighbours. So the mean area change over a ring (a pin and
its six neighbours) is compared with its noise. A contact also moves neighbouring pins alike; a reflection
shifts only one or two. So the areas must still have increased when each pin's motion is replaced by the
median of its ring.

Rules
- If there are areas, they decide: a camera that shakes in its mount moves all pins, but changes no area.
  Without cells (no area was asked for) the motion about its own median decides.
- The medians are computed only if the means exceed the limit, first where the area change is highest: in a
  contact that costs a hundredth of the whole scan. There the limit is lower, as of one place. A frame that
  fails here counts as untouched.
- The noise is predicted from the pins' own sigma until untouched frames have given a better value, of cells
  and of rings' means each: skin that creeps back from the last touch moves neighbours alike, and no mean over
  them averages that out. The learnt value stays within `noise_ratio_max` of the prediction, so that a slow
  touch cannot raise its own limit.
- Until that is learnt, a frame whose cells scatter less than is expected, with the error that so many may
  have, is judged by their scatter: of a recording of stills the first one after the rest may be a press.
- A mean over fewer cells averages out less noise and is scaled down accordingly.
- While a contact lasts, the slope of the ring medians where the areas had increased most tells by itself that
  it does, if it is above what begins one; and while nothing touches, that slope at all pins tells that no
  areas could say otherwise. Neither needs areas. They are needed of the untouched frames that noise is learnt
  from: the first ones, then one of as many as a ring has pins.
- Hysteresis: a contact that is there ends below `contact_sigma`, the level of one place. To begin it must be
  the highest of n rings, and that may be noise as rarely: a higher level (6.0 of 331 pins, 5.9 of 127).
"""

import cython
import numpy as np
from cython.cimports.libc.math import fabs, hypot, isfinite, isnan, sqrt

from edge.features.params import CELL_NOISE, MEDIAN_NOISE, PARAMS, RING_NOISE, largest_noise
from edge.geometry.lattice import N_RING, slope_stencil
from edge.geometry.neighbours import short_rows
from edge.types import Array, Rest

if cython.compiled:
    from cython.cimports.edge.geometry.select import median, sigma_of
else:
    from edge.geometry.select import median, sigma_of

NAN = cython.declare(cython.double, float("nan"))


class ContactDetector:
    """Decides frame by frame whether the n pins of one tip are in contact."""

    def __init__(self, rest: Rest) -> None:
        ring, slope = slope_stencil(rest.xy_img, rest.pattern.pitch_px)
        n, width = ring.shape
        self._n, self._width = n, width
        self._rest = np.ascontiguousarray(rest.xy_img, np.float64)
        self._ring, self._slope = short_rows(ring), slope
        self._pitch_px = rest.pattern.pitch_px
        self._rest_noise = sqrt(2.0) * float(np.median(rest.pins.sigma_px)) / self._pitch_px
        self._noise_ratio = self._ring_noise_ratio = 1.0
        self._untouched_n = 0
        self._in_contact = False
        self._peak_row, self._begins = 0, np.inf
        self._root = np.sqrt(np.arange(width + 1) / width)
        self._middle = np.full((n, 2), np.nan)
        self._ring_x, self._ring_y = np.empty(width), np.empty(width)
        self._values, self._ring_values = np.empty(n), np.empty(n)
        self._cell_noise, self._ring_noise, self._median_noise = CELL_NOISE, RING_NOISE, MEDIAN_NOISE
        self._clear_sigma = PARAMS.contact_sigma
        self._raise_sigma = hypot(PARAMS.contact_sigma, largest_noise(n))
        self._min_ring_known = width // 2 + 1
        self._noise_ratio_max = PARAMS.noise_ratio_max
        self._noise_frames_n = PARAMS.noise_frames_n
        self._rounding = 8.0 * float(np.finfo(np.float32).eps)  # of sums over a ring: 11 times half of it
        of_x, of_y = np.abs(slope).sum(axis=2).T
        self._most_sum, self._most_product = float((of_x + of_y).max()), float((of_x * of_y).max())
        self._blocks_n = blocks_n = -(-n // 32) if width == N_RING + 1 else 0
        missing = max(0, 32 * blocks_n - n)
        self._twice = short_rows(2 * np.pad(ring, ((0, missing), (0, 0)), "edge"))
        self._users = np.argsort(ring, axis=None, kind="stable").astype(np.int32) // width
        self._first_user = np.searchsorted(np.sort(ring, axis=None), np.arange(n + 1)).astype(np.int32)
        self._is_bent = np.zeros(n, np.uint8)
        self._motion, self._medians = np.zeros((2, 2 * (n + missing)), np.float32)

    def forget(self) -> None:
        """Nothing is learnt, and nothing touches."""
        self._noise_ratio = self._ring_noise_ratio = 1.0
        self._untouched_n = 0
        self._in_contact = False

    def cell_noise(self, sigma_px: float) -> float:
        """One-sigma noise of a single cell's relative area change."""
        return self._cell_noise / self._pitch_px * sigma_px * self._noise_ratio

    def by_area(self, area_change: Array, xy: Array, sigma_px: float) -> bool:
        """Decide on one frame's area changes, and learn from them if nothing touches.

        area_change  (n,) float64, relative; NaN where lost
        xy           (n, 2) float64, px, where the pins are; finite
        sigma_px     noise of one coordinate of a pin's motion since rest
        """
        predicted = sigma_px / self._pitch_px
        noise = self._ring_noise * predicted * self._ring_noise_ratio
        limit = self._limit_sigma() * noise
        self._begins = self._raise_sigma * noise
        if self._in_contact and self._goes_on(area_change, xy, limit):
            return True
        highest = self._highest_mean(area_change)
        if isnan(highest):
            return self._in_contact  # a dark frame is no evidence
        self._in_contact = highest > limit and self._is_coherent(xy, limit)
        if not self._in_contact and self._untouched_n < self._noise_frames_n:
            limit *= self._quietness(area_change)
            self._in_contact = highest > limit and self._is_coherent(xy, limit)
        if not self._in_contact:
            if self._learns_next():
                self._learn(area_change, predicted)
            self._untouched_n += 1
        return self._in_contact

    def known(self, xy: Array, mean: Array, sigma_px: float, if_touched: bool, if_untouched: bool) -> int:
        """Whether something touches, by the motion of the pins, as `by_area` would say; -1: areas decide.

        xy        (n, 2) float64, px, where the pins are; finite
        mean      (2,) px, their mean motion since rest
        sigma_px  noise of one coordinate of a pin's motion since rest
        if_touched, if_untouched  whether areas are needed all the same while something touches, or nothing
        """
        if if_touched if self._in_contact else if_untouched:
            return -1
        if self._in_contact:
            self._forget_medians(self._peak_row)
            return 1 if self._median_area_change(xy, self._peak_row) > self._begins else -1
        if self._blocks_n == 0 or self._learns_next():
            return -1
        noise = self._ring_noise * sigma_px / self._pitch_px * self._ring_noise_ratio
        if not self._are_below(xy, mean, self._clear_sigma * noise):
            return -1
        self._untouched_n += 1
        return 0

    def _learns_next(self) -> bool:
        """Whether noise is learnt from the next untouched frame."""
        return self._untouched_n < self._noise_frames_n or self._untouched_n % self._width == 0

    def _are_below(self, xy: Array, mean: Array, limit: float) -> bool:
        """Whether no `_median_area_change` of this frame is above a limit.

        Medians are in single precision. An area change is the sum of the two slopes and a product of them
        less one of the cross slopes; these are taken to be as large as they may be anywhere, and so are the
        slopes of small medians, if that is below the limit.
        """
        most: cython.double = 0.0
        total: cython.double
        motion: cython.float[::1] = self._motion
        medians: cython.float[::1] = self._medians
        is_bent: cython.uchar[::1] = self._is_bent
        largest: cython.float[64] = [0.0] * 64
        own: cython.float[448] = [0.0] * 448
        for i in range(self._n):
            motion[2 * i] = cython.cast(cython.float, xy[i, 0] - self._rest[i, 0] - mean[0])
            motion[2 * i + 1] = cython.cast(cython.float, xy[i, 1] - self._rest[i, 1] - mean[1])
        for block in range(self._blocks_n):
            for i in range(32):  # the values of the pins of a block of rings, ring by ring
                for k in range(7):
                    j = self._twice[32 * block + i, k]
                    own[64 * k + 2 * i], own[64 * k + 2 * i + 1] = motion[j], motion[j + 1]
            # Exchanges that leave the median of seven: Devillard, "Fast median search", 1998.
            for i in range(64):
                a, b, c, d = own[i], own[64 + i], own[128 + i], own[192 + i]
                e, f, g = own[256 + i], own[320 + i], own[384 + i]
                a, f = min(a, f), max(a, f)
                a, d = min(a, d), max(a, d)
                b, g = min(b, g), max(b, g)
                c, e = min(c, e), max(c, e)
                b = max(a, b)
                d, f = min(d, f), max(d, f)
                c, g = min(c, g), max(c, g)
                d, e = min(max(c, d), g), min(e, f)
                b, e = min(b, e), max(b, e)
                medians[64 * block + i] = d = min(max(b, d), e)
                largest[i] = max(largest[i], max(d, -d))
        for i in range(64):
            most = max(most, largest[i])
        sizes = self._most_sum * (most + fabs(mean[0]) + fabs(mean[1]))
        limit -= 2.0 * self._most_product * most * most + self._rounding * (sizes + self._rounding)
        is_bent[:] = False
        for i in range(self._n):
            if self._most_sum * max(fabs(medians[2 * i]), fabs(medians[2 * i + 1])) > limit:
                for user in range(self._first_user[i], self._first_user[i + 1]):
                    is_bent[self._users[user]] = True
        for i in range(self._n):
            if is_bent[i]:
                total = 0.0
                for k in range(7):
                    j = self._twice[i, k]
                    total += self._slope[i, 0, k] * medians[j] + self._slope[i, 1, k] * medians[j + 1]
                if not total <= limit:
                    return False
        return True

    def by_motion(self, xy: Array, sigma_px: float) -> bool:
        """Decide without areas: do pins move against each other beyond their noise?

        xy        (n, 2) float64, px, where the pins are; NaN where lost
        sigma_px  noise of one coordinate of a pin's motion since rest
        """
        shift_x = self._median_motion(xy, 0)
        shift_y = self._median_motion(xy, 1)
        if isnan(shift_x) or isnan(shift_y):
            return self._in_contact
        n = self._n
        highest: cython.double = 0.0
        self._middle[:, 0] = NAN  # those there are of another frame
        for i in range(n):
            known = self._ring_median(xy, i, shift_x, shift_y)
            if known >= self._min_ring_known:
                size = hypot(self._middle[i, 0], self._middle[i, 1]) * self._root[known]
                if size > highest:
                    highest = size
        limit = self._limit_sigma() * self._median_noise * sigma_px / sqrt(self._width)
        self._in_contact = highest > limit
        return self._in_contact

    def _limit_sigma(self) -> float:
        return self._clear_sigma if self._in_contact else self._raise_sigma

    def _highest_mean(self, area_change: Array) -> float:
        """Highest mean over a ring, scaled down where not all of it is known; NaN if no cell is known."""
        highest = 0.0  # times the pins of a ring
        nothing: cython.bint = True
        ring: cython.ushort[:, ::1] = self._ring
        width = self._width
        self._peak_row = 0
        for i in range(self._n):
            total: cython.double = self._ring_sum(area_change, i)
            if isnan(total):
                total = 0.0
                known = 0
                for k in range(width):
                    j = ring[i, k]
                    if not isnan(area_change[j]):
                        total += area_change[j]
                        known += 1
                nothing &= known == 0
                if known == 0 or known < self._min_ring_known:
                    continue
                total = total / known * self._root[known] * self._width
            else:
                nothing = False
            if total > highest:
                highest = total
                self._peak_row = i
        return NAN if nothing else highest / self._width

    def _ring_sum(self, values: Array, i: cython.Py_ssize_t) -> float:
        """Sum of the values over ring i. A loop whose length is known to the compiler takes half as long."""
        total: cython.double = 0.0
        if self._width == 7:
            for k in range(7):
                total += values[self._ring[i, k]]
        else:
            for k in range(self._width):
                total += values[self._ring[i, k]]
        return total

    def _goes_on(self, area_change: Array, xy: Array, limit: float) -> bool:
        """Whether the ring that had the highest mean shows by itself that the contact goes on."""
        if not self._ring_sum(area_change, self._peak_row) > limit * self._width:
            return False
        self._forget_medians(self._peak_row)
        return self._median_area_change(xy, self._peak_row) > limit

    def _forget_medians(self, i: cython.Py_ssize_t) -> None:
        """Forget those that `_median_area_change` of pin i reads, which are of another frame."""
        for k in range(self._width):
            self._middle[self._ring[i, k], 0] = NAN

    def _is_coherent(self, xy: Array, limit: float) -> bool:
        """Whether the area still grows by enough when each pin moves as the median of its ring does.

        The ring of the highest mean is tried first, then all of them.
        """
        at_peak = self._clear_sigma / self._raise_sigma * limit
        self._middle[:, 0] = NAN  # those there are of another frame
        for i in range(self._width):
            if self._median_area_change(xy, self._ring[self._peak_row, i]) > at_peak:
                return True
        for i in range(self._n):  # noqa: SIM110 (no generators in a kernel)
            if self._median_area_change(xy, i) > limit:
                return True
        return False

    def _median_area_change(self, xy: Array, i: cython.Py_ssize_t) -> float:
        """Area change at pin i by the slope of the ring medians round it."""
        xx = xy_ = yx = yy = 0.0
        for k in range(self._width):
            j = self._ring[i, k]
            if isnan(self._middle[j, 0]):
                self._ring_median(xy, j, 0.0, 0.0)
            xx += self._slope[i, 0, k] * self._middle[j, 0]
            xy_ += self._slope[i, 1, k] * self._middle[j, 0]
            yx += self._slope[i, 0, k] * self._middle[j, 1]
            yy += self._slope[i, 1, k] * self._middle[j, 1]
        return (1.0 + xx) * (1.0 + yy) - xy_ * yx - 1.0

    def _ring_median(self, xy: Array, i: cython.Py_ssize_t, shift_x: float, shift_y: float) -> int:
        """Median of the motion, less a shift, over ring i, by component; how many of its pins are known."""
        known = 0
        for k in range(self._width):
            j = self._ring[i, k]
            x = xy[j, 0] - self._rest[j, 0] - shift_x
            y = xy[j, 1] - self._rest[j, 1] - shift_y
            if isnan(x):
                continue
            self._ring_x[known] = x
            self._ring_y[known] = y
            known += 1
        self._middle[i, 0] = median(self._ring_x, known)
        self._middle[i, 1] = median(self._ring_y, known)
        return known

    def _median_motion(self, xy: Array, component: cython.Py_ssize_t) -> float:
        """Median over the known pins; NaN where fewer than `min_ring_known` are."""
        known = 0
        for i in range(self._n):
            if isfinite(xy[i, component]):
                self._values[known] = xy[i, component] - self._rest[i, component]
                known += 1
        return median(self._values, known) if known >= self._min_ring_known else NAN

    def _quietness(self, area_change: Array) -> float:
        """Scatter of this frame's cells, with the error that it may have, over that of pins seen as at rest.

        At most 1. Pins that are seen worse in this frame raise the limit all the same.
        """
        known: cython.Py_ssize_t = 0
        for i in range(self._n):
            if isfinite(area_change[i]):
                self._values[known] = fabs(area_change[i])
                known += 1
        if known == 0 or not self._rest_noise > 0.0:
            return 1.0
        highest = 1.0 + self._clear_sigma / sqrt(2.0 * known)
        ratio = highest * sigma_of(self._values, known) / (self._cell_noise * self._rest_noise)
        return min(max(ratio, 1.0 / self._noise_ratio_max) / self._noise_ratio, 1.0)

    def _learn(self, area_change: Array, predicted: float) -> None:
        """Move the learnt noise towards that of this untouched frame; `predicted`: the pins' own, pitches."""
        known: cython.Py_ssize_t = 0
        known_rings: cython.Py_ssize_t = 0
        # The first frames take as many rings as hold each cell about once, in turn; later ones, all. Their
        # spread is about zero rather than about the median: drift is noise too.
        every = self._width if self._untouched_n < self._noise_frames_n else 1
        frames = self._width / every  # that this one stands for
        i = (self._untouched_n + 1) % every
        while i < self._n:
            total: cython.double = self._ring_sum(area_change, i)
            if isfinite(area_change[i]):
                self._values[known] = fabs(area_change[i])
                known += 1
            if isfinite(total):
                self._ring_values[known_rings] = fabs(total) / self._width
                known_rings += 1
            i += every
        self._noise_ratio = self._moved(
            self._noise_ratio, self._values, known, self._cell_noise * predicted, frames
        )
        self._ring_noise_ratio = self._moved(
            self._ring_noise_ratio, self._ring_values, known_rings, self._ring_noise * predicted, frames
        )

    def _moved(
        self, learnt: float, sizes: Array, n: cython.Py_ssize_t, predicted: float, frames: float
    ) -> float:
        """A learnt ratio, moved towards that of the first n sizes to predicted noise as of so many frames."""
        ratio = 1.0
        if n == 0:
            return learnt
        if predicted > 0.0:
            ratio = sigma_of(sizes, n) / predicted
        ratio = min(max(ratio, 1.0 / self._noise_ratio_max), self._noise_ratio_max)
        return learnt + (ratio - learnt) * frames / self._noise_frames_n
