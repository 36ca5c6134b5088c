# cython: infer_types=True
"""Peaks of a field on a grid, and the contacts that they make, each a region.

A probe makes one peak, a long edge a chain of them, a flat surface a ring or a rough plateau. Peaks with no
real valley between them are one contact.

Rules
- Peaks are regional maxima with plateaus, as MATLAB's `imregionalmax` and `skimage.morphology.local_maxima`
  have them: connected grid points (8 neighbours) of one height, all of whose other neighbours are lower.
- The grid of the peaks has a border of -inf: every point has eight neighbours, and no search leaves it.
- Two peaks are one contact unless every path between them descends far enough: by a share of the
  lower one and by a multiple of the pins' noise there (topographic prominence). A second peak lower than that
  noise is none, however far away.
- The region of a contact is what lies above a share of its peak and is nearest to one of its peaks. A share
  rather than a fixed height, so that the region does not grow with the depth alone.
- Contacts are in the order of their highest peaks, CONTACTS_MAX at most.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

import cython
import numpy as np
from numpy.typing import NDArray

from edge.features.params import CONTACTS_MAX, PARAMS, FeatureParams
from edge.types import Array, Heights, Index, Mask

if cython.compiled:
    from cython.cimports.libc.math import atan2, hypot, isfinite, sqrt
else:
    from math import atan2, hypot, isfinite, sqrt

_NOTHING = cython.declare(cython.float, -np.inf)
_LOWEST = cython.declare(cython.float, float(np.finfo(np.float32).min))
# Marks of a point.
_UNKNOWN = cython.declare(cython.int, 0)
_SLOPE = cython.declare(cython.int, 1)
_TOP = cython.declare(cython.int, 2)
_PLATEAU = cython.declare(cython.int, 3)  # visited, not decided yet
_REACHED = cython.declare(cython.int, 4)  # and upwards: reached from peak 0, 1, ...
_CONTACTS_MAX = cython.declare(cython.Py_ssize_t, CONTACTS_MAX)
# A peak that belongs to no contact is marked with one of these.
_NONE = cython.declare(cython.int, -1)
_NOISE = cython.declare(cython.int, -2)
#: Smallest variance across a region, in squared steps: below it the ratio of the axes is rounding.
_VARIANCE_MIN = cython.declare(cython.double, 1e-9)


class PeakFinder:
    """Peaks on the points of a grid; k points. All arrays are good until the next field.

    width    points of a padded row: point p lies in column place[p] % width, row place[p] // width
    place    (k,) int32, where in the padded grid each point lies
    grid     (h * width,) float32, the field, -inf outside
    active   (k,) int32, the first n_active: points at which the field may be other than zero, ascending
    mark     (h * width,) int32, scratch
    n_peaks  of the last field; at (k,) int32, place of each, highest first;
             point (k,) int32, which of the k points it is; height (k,) float32

    inside   (rows, columns) bool: the k points, row by row
    """

    def __init__(self, inside: Mask) -> None:
        padded = np.pad(inside, 1)
        self.width = padded.shape[1]
        self.place = np.flatnonzero(padded).astype(np.int32)
        self.grid = np.full(padded.size, -np.inf, np.float32)
        self.mark, self._stack = np.zeros(padded.size, np.int32), np.empty(padded.size, np.int32)
        self.active = np.arange(len(self.place), dtype=np.int32)
        self.n_active = len(self.place)  # of no field yet: its first one is written everywhere
        self.at, self.point = np.zeros_like(self.place), np.zeros_like(self.place)
        self.height = np.zeros(len(self.place), np.float32)
        self.n_peaks = 0
        w = self.width
        self._around = np.array([-w - 1, -w, -w + 1, -1, 1, w - 1, w, w + 1], np.int32)

    def set_field(self, field: Heights, active: Index, n_active: cython.Py_ssize_t) -> None:
        """The field (k,) float32 at the points, row by row.

        active   (n_active or more,) int32, points, ascending; elsewhere the field is zero
        """
        place: cython.int[::1] = self.place
        grid: cython.float[::1] = self.grid
        mine: cython.int[::1] = self.active
        for i in range(self.n_active):
            grid[place[mine[i]]] = 0.0
        for i in range(n_active):
            mine[i] = active[i]
            grid[place[active[i]]] = field[active[i]]
        self.n_active = n_active

    def find(self, noise: Heights, noise_factor: cython.float, least: cython.float) -> cython.Py_ssize_t:
        """Find the peaks, of the active points, above noise_factor times the noise there, and above `least`.

        noise    (k,) float32
        Returns  number of peaks
        """
        place: cython.int[::1] = self.place
        grid: cython.float[::1] = self.grid
        self.mark[:] = _UNKNOWN
        self.n_peaks = 0
        for i in range(self.n_active):
            p = self.active[i]
            h = grid[place[p]]
            # The height first: most points lie below the noise, and their neighbours need not be read.
            if h > least and h > noise[p] * noise_factor and self._is_maximum(place[p]):
                self._insert(p, h)
        return self.n_peaks

    def forget_searches(self) -> cython.void:
        """What is asked next does not depend on what was asked before. Each peak is asked about once."""
        self.mark[:] = _UNKNOWN

    def first_connected(
        self, j: cython.Py_ssize_t, given: cython.float, any_will_do: cython.bint
    ) -> cython.Py_ssize_t:
        """The first, and so highest, of the peaks before j that is connected with it at or above a level; j:
        none.

        any_will_do  return 0 as soon as any of them is met
        """
        i = 0
        n = 1
        reached: cython.int = _REACHED + cython.cast(cython.int, j)
        # The border is -inf: no search reaches it.
        level: cython.float = _LOWEST if given < _LOWEST else given
        self._stack[0] = self.at[j]
        self.mark[self.at[j]] = reached
        while i < n:
            for d in range(8):
                to = self._stack[i] + self._around[d]
                if self.grid[to] >= level and self.mark[to] != reached:
                    if any_will_do and self._is_peak(to, j):
                        return 0
                    self.mark[to] = reached
                    self._stack[n] = to
                    n += 1
            i += 1
        for i in range(j):
            if self.mark[self.at[i]] == reached:
                return i
        return j

    def _is_peak(self, place: cython.int, n: cython.Py_ssize_t) -> cython.bint:
        """Whether one of the first n peaks lies there."""
        for i in range(n):  # noqa: SIM110
            if self.at[i] == place:
                return True
        return False

    def _insert(self, p: cython.Py_ssize_t, h: cython.float) -> cython.void:
        """Insert point p into the list of peaks; of equal heights the first comes first."""
        i = self.n_peaks
        self.n_peaks += 1
        while i > 0 and self.height[i - 1] < h:
            self.height[i] = self.height[i - 1]
            self.at[i] = self.at[i - 1]
            self.point[i] = self.point[i - 1]
            i -= 1
        self.height[i] = h
        self.at[i] = self.place[p]
        self.point[i] = p

    def _is_maximum(self, here: cython.Py_ssize_t) -> cython.bint:
        """Whether a place is a regional maximum; it, or the plateau it is on, is marked _TOP or _SLOPE."""
        h: cython.float = self.grid[here]
        equal: cython.bint = False
        if self.mark[here] != _UNKNOWN:
            return self.mark[here] == _TOP
        self.mark[here] = _TOP
        for d in range(8):
            other = self.grid[here + self._around[d]]
            if other > h or h == _NOTHING:
                self.mark[here] = _SLOPE
                return False
            equal = equal or other == h
        if equal:
            self._mark_plateau(here)
        return self.mark[here] == _TOP

    def _mark_plateau(self, start: cython.Py_ssize_t) -> cython.void:
        """All connected points of one height are _TOP if nothing round them is higher, else _SLOPE."""
        h: cython.float = self.grid[start]
        i = 0
        n = 1
        verdict: cython.int = _TOP
        self._stack[0] = cython.cast(cython.int, start)
        self.mark[start] = _PLATEAU
        while i < n:
            for d in range(8):
                to = self._stack[i] + self._around[d]
                if self.grid[to] > h:
                    verdict = _SLOPE
                elif self.grid[to] == h and self.mark[to] != _PLATEAU:
                    self.mark[to] = _PLATEAU
                    self._stack[n] = to
                    n += 1
            i += 1
        for i in range(n):
            self.mark[self._stack[i]] = verdict


class Regions:
    """Contacts of one frame: their peaks, and the moments of their regions. Good until the next frame.

    n_contacts   of the frame
    middle       (CONTACTS_MAX, 2) float64 px, centre of gravity of each region
    semi_axis    (CONTACTS_MAX,) float64 px, the long one
    elongation   (CONTACTS_MAX,) float64, long over short axis
    direction    (CONTACTS_MAX,) float64 rad, of the long axis, from x towards y
    x0, y0, step_px  place of the padded grid's first column and row, and the distance of its points

    peaks        of the field
    x0, y0, step_px  place of the field's first column and row, and the distance of its points
    """

    def __init__(
        self, peaks: PeakFinder, x0: float, y0: float, step_px: float, params: FeatureParams = PARAMS
    ) -> None:
        table = len(peaks.place) + 1  # the only peak of all may become two
        self.n_contacts, self._n_peaks = 0, 0
        self.middle = np.zeros((CONTACTS_MAX, 2))
        self.semi_axis, self.elongation = np.zeros(CONTACTS_MAX), np.zeros(CONTACTS_MAX)
        self.direction = np.zeros(CONTACTS_MAX)
        self._n_points, self._level = np.zeros(CONTACTS_MAX, np.intp), np.zeros(CONTACTS_MAX, np.float32)
        self._sums = np.zeros((CONTACTS_MAX, 6))
        self._at, self._contact = np.zeros(table, np.int32), np.zeros(table, np.int32)
        self._height = np.zeros(table, np.float32)
        self._ridge_array = self._ridge = np.empty((table, 2))
        self._peaks = peaks
        self._grid, self._place, self._active = peaks.grid, peaks.place, peaks.active
        row, column = np.divmod(np.arange(len(peaks.grid), dtype=np.int32), peaks.width)
        self._row, self._column = row.astype(np.int16), column.astype(np.int16)
        self.x0, self.y0, self.step_px = x0 - step_px, y0 - step_px, step_px
        self._shallow_rel = params.shallow_rel
        self._min_prominence_sigma = 2.0 * params.contact_sigma

    def merge(self, noise: Heights, noise_px: float) -> int:
        """Group the peaks into contacts by prominence, and measure their regions.

        noise     (k,) float32, noise of the field at each point per px of a pin's
        noise_px  of a pin; not used for a single peak
        Returns   number of contacts
        """
        depth: cython.float
        pins: cython.float = self._min_prominence_sigma * noise_px
        self._n_peaks = self._peaks.n_peaks
        if self._n_peaks > 1:
            self._peaks.forget_searches()
        self.n_contacts = 0
        for j in range(self._n_peaks):
            self._at[j] = self._peaks.at[j]
            self._height[j] = self._peaks.height[j]
            first = j
            depth = 0.0
            if j > 0:
                valley = pins * noise[self._peaks.point[j]]
                depth = max(self._shallow_rel * self._height[j], valley)
                first = self._peaks.first_connected(j, self._height[j] - depth, self.n_contacts == 1)
            if depth > self._height[j]:
                self._contact[j] = _NOISE
            elif first < j:
                self._contact[j] = self._contact[first]
            elif self.n_contacts < _CONTACTS_MAX:
                self._contact[j] = cython.cast(cython.int, self.n_contacts)
                self.n_contacts += 1
            else:
                self._contact[j] = _NONE
        self._drop_peaks(_NOISE)
        self._measure()
        return self.n_contacts

    def keep(self, kept: NDArray[np.uint8]) -> None:
        """Drop the contacts that are not kept, (n_contacts or more,) uint8; the others take over their
        points.
        """
        n: cython.int = 0
        for i in range(self.n_contacts):
            for j in range(self._n_peaks):
                if self._contact[j] == i:
                    self._contact[j] = n if kept[i] else _NONE
            n += 1 if kept[i] else 0
        self.n_contacts = n
        self._drop_peaks(_NONE)
        self._measure()

    def split(self, x0: cython.double, y0: cython.double, x1: cython.double, y1: cython.double) -> bool:
        """Make two contacts of the only one, with their peaks at the grid's points nearest to two places, px;
        False: that is one point.
        """
        first = self._nearest_point(x0, y0)
        second = self._nearest_point(x1, y1)
        if first == second:
            return False
        self._at[0], self._at[1] = cython.cast(cython.int, first), cython.cast(cython.int, second)
        self._height[0], self._height[1] = self._grid[first], self._grid[second]
        self._contact[0] = 1 if self._height[1] > self._height[0] else 0
        self._contact[1] = 1 - self._contact[0]
        self._n_peaks = self.n_contacts = 2
        self._measure()
        return True

    def join(self) -> None:
        """Make one contact of the only two."""
        for j in range(self._n_peaks):
            self._contact[j] = 0
        self.n_contacts = 1
        self._measure()

    def _nearest_point(self, x: cython.double, y: cython.double) -> int:
        """Place in the padded grid of the point nearest to a place, px."""
        nearest = self._place[0]
        least: cython.double = np.inf
        for p in range(self._place.shape[0]):
            at = self._place[p]
            dx = self.x0 + self.step_px * self._column[at] - x
            dy = self.y0 + self.step_px * self._row[at] - y
            if dx * dx + dy * dy < least:
                least = dx * dx + dy * dy
                nearest = at
        return nearest

    def area_px2(self, i: cython.Py_ssize_t) -> float:
        """Area of contact i's region, px2."""
        return self._n_points[i] * self.step_px * self.step_px

    def peak_height(self, i: cython.Py_ssize_t) -> float:
        """Height of contact i's highest peak, interpolated between the grid's points by a parabola along each
        axis.
        """
        at = self._at[self._highest(i)]
        top = cython.cast(cython.double, self._grid[at])
        height = top
        for k in range(2):
            step = self._peaks.width if k == 0 else 1
            low = cython.cast(cython.double, self._grid[at - step])
            high = cython.cast(cython.double, self._grid[at + step])
            curvature = 2.0 * top - low - high
            if low > top or high > top:
                continue  # no maximum of this field: one of the two of a split contact
            if curvature > 0.0 and isfinite(curvature):
                height += (high - low) * (high - low) / (8.0 * curvature)
        return height

    def ridge(self, i: cython.Py_ssize_t) -> Array:
        """(m, 2) float64 px, all peaks of contact i."""
        n = 0
        for j in range(self._n_peaks):
            if self._contact[j] == i:
                self._ridge[n, 0] = self.x0 + self.step_px * self._column[self._at[j]]
                self._ridge[n, 1] = self.y0 + self.step_px * self._row[self._at[j]]
                n += 1
        found: Array = self._ridge_array[:n].copy()
        return found

    def _highest(self, i: cython.Py_ssize_t) -> int:
        """Which peak is the highest of contact i."""
        j = 0
        while self._contact[j] != i:
            j += 1
        return j

    def _drop_peaks(self, dropped: cython.int) -> None:
        """Remove the peaks that are marked so instead of with a contact."""
        left = 0
        for j in range(self._n_peaks):
            if self._contact[j] != dropped:
                self._at[left] = self._at[j]
                self._height[left] = self._height[j]
                self._contact[left] = self._contact[j]
                left += 1
        self._n_peaks = left

    def _measure(self) -> None:
        """Collect each contact's region, and find its shape."""
        self._collect()
        for i in range(self.n_contacts):
            self._find_shape(i)

    def _collect(self) -> None:
        """Sums over each region's active points, weighted by the height above its edge."""
        lowest: cython.float = (
            np.inf if self.n_contacts == 0 else self._shallow_rel * self._height[self._highest(0)]
        )
        for i in range(self.n_contacts):
            self._level[i] = self._shallow_rel * self._height[self._highest(i)]
            lowest = min(lowest, self._level[i])
            self._n_points[i] = 0
            for p in range(6):
                self._sums[i, p] = 0.0
        for k in range(self._peaks.n_active):
            at = self._place[self._active[k]]
            h = self._grid[at]
            if not h > lowest:
                continue
            i = self._contact[self._nearest(at)]
            if i < 0 or not h > self._level[i]:
                continue
            w = cython.cast(cython.double, h - self._level[i])
            x = self._column[at]
            y = self._row[at]
            self._n_points[i] += 1
            self._sums[i, 0] += w
            self._sums[i, 1] += w * x
            self._sums[i, 2] += w * y
            self._sums[i, 3] += w * x * x
            self._sums[i, 4] += w * x * y
            self._sums[i, 5] += w * y * y

    def _nearest(self, at: cython.Py_ssize_t) -> int:
        """Which peak is nearest to a place; of equals the first, and the first where there is one contact."""
        nearest = 0
        least: cython.int = 2147483647
        dx: cython.int
        dy: cython.int
        if self.n_contacts == 1:
            return 0
        for j in range(self._n_peaks):
            dx = self._column[at] - self._column[self._at[j]]
            dy = self._row[at] - self._row[self._at[j]]
            if dx * dx + dy * dy < least:
                least = dx * dx + dy * dy
                nearest = j
        return nearest

    def _find_shape(self, i: cython.Py_ssize_t) -> None:
        """Middle and axes of a region from its sums."""
        w = self._sums[i, 0]
        x = self._sums[i, 1] / w
        y = self._sums[i, 2] / w
        # 1/12: a grid point represents a square of one step.
        xx = self._sums[i, 3] / w - x * x + 1.0 / 12.0
        xy = self._sums[i, 4] / w - x * y
        yy = self._sums[i, 5] / w - y * y + 1.0 / 12.0
        mean = 0.5 * (xx + yy)
        half = hypot(0.5 * (xx - yy), xy)
        self.middle[i, 0] = self.x0 + self.step_px * x
        self.middle[i, 1] = self.y0 + self.step_px * y
        # A uniform ellipse's semi-axis is two standard deviations.
        self.semi_axis[i] = 2.0 * sqrt(mean + half) * self.step_px
        self.direction[i] = 0.5 * atan2(2.0 * xy, xx - yy)
        self.elongation[i] = sqrt((mean + half) / max(mean - half, _VARIANCE_MIN))
