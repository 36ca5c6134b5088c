# cython: infer_types=True
"""Peaks of a field on a grid, which of them make one contact, and the region that belongs to each contact.

    field --regional maxima--> peaks above the noise, highest first --prominence--> contacts
    contacts --nearest peak, level--> regions --moments--> middle, axes, direction, area

Rules
- Regional maxima with plateaus, as MATLAB's `imregionalmax` and `skimage.morphology.local_maxima` have them:
  connected grid points (8 neighbours) of one height, all of whose other neighbours are lower.
- The grid has a border of -inf, so that every point has eight neighbours and no search leaves it.
- Two peaks are one contact unless every path between them descends far enough: by a share of the
  lower one and by a multiple of the pins' noise there (topographic prominence). A second peak lower than that
  noise is none, however far away.
- The region of a contact is what lies above a share of its peak and is nearest to one of its peaks. A share
  rather than a fixed height, so that the region does not grow with the depth alone.
- Contacts are in the order of their highest peaks, CONTACTS_MAX at most.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.features.params import PARAMS, FeatureParams
from edge.types import Array, Heights, Index, Mask

if cython.compiled:
    from cython.cimports.libc.math import atan2, hypot, isfinite, sqrt
else:
    from math import atan2, hypot, isfinite, sqrt

#: The size of the tables of peaks.
PEAKS_MAX = 24

_PEAKS_MAX = cython.declare(cython.Py_ssize_t, PEAKS_MAX)
_NOTHING = cython.declare(cython.float, -np.inf)
_LOWEST = cython.declare(cython.float, float(np.finfo(np.float32).min))
# Marks of a point.
_UNKNOWN = cython.declare(cython.schar, 0)
_SLOPE = cython.declare(cython.schar, 1)
_TOP = cython.declare(cython.schar, 2)
_PLATEAU = cython.declare(cython.schar, 3)  # visited, not decided yet
_REACHED = cython.declare(cython.schar, 4)  # and upwards: reached from peak 0, 1, ...
#: The size of the tables of contacts: as many as a sample can count.
CONTACTS_MAX = 14

_CONTACTS_MAX = cython.declare(cython.Py_ssize_t, CONTACTS_MAX)
# A peak that belongs to no contact is marked with one of these.
_NONE = cython.declare(cython.int, -1)
_NOISE = cython.declare(cython.int, -2)
#: Smallest variance across a region, in squared steps: below it the ratio of the axes is rounding.
_VARIANCE_MIN = cython.declare(cython.double, 1e-9)


@cython.final
@cython.cclass
class PeakFinder:
    """Peaks on the points of a grid; k points. All arrays are good until the next field.

    width    points of a padded row: point p lies in column place[p] % width, row place[p] // width
    place    (k,) int32, where in the padded grid each point lies
    grid     (h * width,) float32, the field, -inf outside
    active   (k,) int32, the first n_active: points at which the field may be other than zero, ascending
    mark     (h * width,) int8, scratch
    n_peaks  of the last field; at (PEAKS_MAX,) int32, place of each, highest first;
             point (PEAKS_MAX,) int32, which of the k points it is; height (PEAKS_MAX,) float32

    inside   (rows, columns) bool: the k points, row by row
    """

    def __init__(self, inside: Mask) -> None:
        padded = np.pad(inside, 1)
        self.width = padded.shape[1]
        self.place = np.flatnonzero(padded).astype(np.int32)
        self.grid = np.full(padded.size, -np.inf, np.float32)
        self.mark, self._stack = np.zeros(padded.size, np.int8), np.empty(padded.size, np.int32)
        self.active = np.arange(len(self.place), dtype=np.int32)
        self.n_active = len(self.place)  # of no field yet: its first one is written everywhere
        self.at, self.point = np.zeros(PEAKS_MAX, np.int32), np.zeros(PEAKS_MAX, np.int32)
        self.height, self._level = np.zeros(PEAKS_MAX, np.float32), np.zeros(PEAKS_MAX, np.float32)
        self._all_points = np.arange(len(self.place), dtype=np.int32)
        self.n_peaks = 0
        w = self.width
        self._around = np.array([-w - 1, -w, -w + 1, -1, 1, w - 1, w, w + 1], np.int32)

    def set_field(self, field: Heights, active: Index | None = None, n_active: cython.Py_ssize_t = 0) -> None:
        """The field (k,) float32 at the points, row by row.

        active   (n_active or more,) int32, points, ascending; elsewhere the field is zero. None: nowhere
        """
        place: cython.int[::1] = self.place
        grid: cython.float[::1] = self.grid
        mine: cython.int[::1] = self.active
        if active is None:
            active, n_active = self._all_points, place.shape[0]
        for i in range(self.n_active):
            grid[place[mine[i]]] = 0.0
        for i in range(n_active):
            mine[i] = active[i]
            grid[place[active[i]]] = field[active[i]]
        self.n_active = n_active

    def mark_maxima(self) -> Mask:
        """(k,) bool, which points are regional maxima."""
        self.mark[:] = _UNKNOWN
        return np.array([self._is_maximum(place) for place in self.place], np.bool_)

    def find(self, noise: Heights, noise_factor: cython.float, least: cython.float) -> cython.Py_ssize_t:
        """Find the peaks, of the active points, above noise_factor times the noise there, and above `least`.

        noise    (k,) float32
        Returns  number of peaks, PEAKS_MAX at most
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

    def first_connected(self, j: cython.Py_ssize_t, level: cython.float) -> cython.Py_ssize_t:
        """The first, and so highest, peak that peak j is connected with at or above a level; j itself if none
        before it.
        """
        self._search(j, level, False)
        for i in range(j):
            if self.mark[self.at[i]] == _REACHED + j:
                return i
        return j

    def is_connected(self, j: cython.Py_ssize_t, level: cython.float) -> cython.bint:
        """Whether peak j is connected at or above a level with any peak before it, all of which were asked
        about. Sooner than `first_connected`: it ends where another search has been.
        """
        self.mark[self.at[0]], self._level[0] = _REACHED, self.height[0]
        return j > 0 and self._search(j, level, True)

    def _search(self, j: cython.Py_ssize_t, given: cython.float, soon: cython.bint) -> cython.bint:
        """Mark what is connected with peak j at or above a level; soon: until a search from a peak before it
        is met that was not below this level. Whether one was.
        """
        i = 0
        n = 1
        reached: cython.schar = _REACHED + cython.cast(cython.schar, j)
        # The border is -inf: no search reaches it.
        level: cython.float = _LOWEST if given < _LOWEST else given
        self._level[j] = level
        self._stack[0] = self.at[j]
        self.mark[self.at[j]] = reached
        while i < n:
            for d in range(8):
                to = self._stack[i] + self._around[d]
                if self.grid[to] >= level and self.mark[to] != reached:
                    other = self.mark[to] - _REACHED
                    if soon and 0 <= other < j and (self._level[other] >= level or self._is_peak(to, j)):
                        return True
                    self.mark[to] = reached
                    self._stack[n] = to
                    n += 1
            i += 1
        return False

    def _is_peak(self, place: cython.int, n: cython.Py_ssize_t) -> cython.bint:
        """Whether one of the first n peaks lies there."""
        for i in range(n):  # noqa: SIM110
            if self.at[i] == place:
                return True
        return False

    def _insert(self, p: cython.Py_ssize_t, h: cython.float) -> cython.void:
        """Insert point p into the list of peaks; of equal heights the first comes first."""
        i = self.n_peaks
        if i < _PEAKS_MAX:
            self.n_peaks += 1
        elif h > self.height[_PEAKS_MAX - 1]:
            i = _PEAKS_MAX - 1
        else:
            return
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
        verdict: cython.schar = _TOP
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


@cython.final
@cython.cclass
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
        table = PEAKS_MAX + CONTACTS_MAX  # the split test may turn one contact into two
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
        self._found_at, self._found_point, self._found_height = peaks.at, peaks.point, peaks.height
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
        self._peaks.forget_searches()
        self.n_contacts = 0
        for j in range(self._n_peaks):
            self._at[j] = self._found_at[j]
            self._height[j] = self._found_height[j]
            first = j
            depth = 0.0
            if j > 0:
                valley = pins * noise[self._found_point[j]]
                depth = max(self._shallow_rel * self._height[j], valley)
                if self.n_contacts > 1:
                    first = self._peaks.first_connected(j, self._height[j] - depth)
                elif self._peaks.is_connected(j, self._height[j] - depth):
                    first = 0
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

    def keep(self, kept: Array) -> None:
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

    def split(self, i: cython.Py_ssize_t, first: cython.Py_ssize_t, second: cython.Py_ssize_t) -> None:
        """Replace the peaks of contact i by two places of the padded grid: one stays i, the other is a new
        contact.

        To be followed by `sort`. Raises ValueError: no such contact or place, or too many contacts
        """
        found: cython.bint = False
        if not 0 <= i < self.n_contacts < _CONTACTS_MAX:
            raise ValueError(
                f"i: a contact of 0 to {self.n_contacts - 1} is wanted, of fewer than {_CONTACTS_MAX}"
            )
        if not (0 <= first < self._grid.shape[0] and 0 <= second < self._grid.shape[0]):
            raise ValueError(f"first, second: places of 0 to {self._grid.shape[0] - 1} are wanted")
        for j in range(self._n_peaks):
            if self._contact[j] == i:
                if not found:
                    self._at[j] = cython.cast(cython.int, first)
                    self._height[j] = self._grid[first]
                else:
                    self._contact[j] = _NONE
                found = True
        self._drop_peaks(_NONE)
        self._at[self._n_peaks] = cython.cast(cython.int, second)
        self._height[self._n_peaks] = self._grid[second]
        self._contact[self._n_peaks] = cython.cast(cython.int, self.n_contacts)
        self._n_peaks += 1
        self.n_contacts += 1

    def join(self, i: cython.Py_ssize_t, k: cython.Py_ssize_t) -> None:
        """Make one contact of i and k, and measure the regions.

        Raises ValueError: no such contacts, or the same
        """
        if not 0 <= i < k < self.n_contacts:
            raise ValueError(
                f"i, k: two contacts of 0 to {self.n_contacts - 1} are wanted, the first one first"
            )
        for j in range(self._n_peaks):
            if self._contact[j] == k:
                self._contact[j] = cython.cast(cython.int, i)
            elif self._contact[j] > k:
                self._contact[j] -= 1
        self.n_contacts -= 1
        self._measure()

    def nearest_point(self, x: cython.double, y: cython.double) -> int:
        """Place in the padded grid of the point nearest to a place, px, of those with a height; -1: none."""
        nearest = -1
        least = np.inf
        for p in range(self._place.shape[0]):
            at = self._place[p]
            dx = self.x0 + self.step_px * self._column[at] - x
            dy = self.y0 + self.step_px * self._row[at] - y
            if dx * dx + dy * dy < least:
                least = dx * dx + dy * dy
                nearest = at
        return nearest

    def sort(self) -> None:
        """Put the contacts in the order of their highest peaks again, and measure their regions."""
        for i in range(1, self.n_contacts):
            j = i
            while j > 0 and self._height[self._highest(j)] > self._height[self._highest(j - 1)]:
                for k in range(self._n_peaks):
                    if self._contact[k] == j:
                        self._contact[k] = cython.cast(cython.int, j - 1)
                    elif self._contact[k] == j - 1:
                        self._contact[k] = cython.cast(cython.int, j)
                j -= 1
        self._measure()

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
