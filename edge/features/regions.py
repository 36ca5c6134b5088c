"""Which peaks make one contact, and the region of the grid that belongs to each contact.

    peaks --prominence--> contacts --nearest peak, level--> regions --moments--> middle, axes, direction, area

Rules
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
from edge.features.peaks import PEAKS_MAX
from edge.types import Array, Heights

if cython.compiled:
    from cython.cimports.edge.features.peaks import PeakFinder
    from cython.cimports.libc.math import atan2, hypot, isfinite, sqrt
else:
    from math import atan2, hypot, isfinite, sqrt

    from edge.features.peaks import PeakFinder

#: The size of the tables of contacts: as many as a sample can count.
CONTACTS_MAX = 14

_CONTACTS_MAX = cython.declare(cython.Py_ssize_t, CONTACTS_MAX)
_NONE = cython.declare(cython.int, -1)
_NOISE = cython.declare(cython.int, -2)
#: Smallest variance across a region, in squared steps: below it the ratio of the axes is rounding.
_VARIANCE_MIN = cython.declare(cython.double, 1e-9)


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
        j: cython.Py_ssize_t
        first: cython.Py_ssize_t
        depth: cython.float
        valley: cython.float
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
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
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
        j: cython.Py_ssize_t
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
        j: cython.Py_ssize_t
        for j in range(self._n_peaks):
            if self._contact[j] == k:
                self._contact[j] = cython.cast(cython.int, i)
            elif self._contact[j] > k:
                self._contact[j] -= 1
        self.n_contacts -= 1
        self._measure()

    def nearest_point(self, x: cython.double, y: cython.double) -> int:
        """Place in the padded grid of the point nearest to a place, px, of those with a height; -1: none."""
        p: cython.Py_ssize_t
        at: cython.Py_ssize_t
        nearest: cython.Py_ssize_t = -1
        dx: cython.double
        dy: cython.double
        least: cython.double = np.inf
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
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        k: cython.Py_ssize_t
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
        at: cython.Py_ssize_t = self._at[self._highest(i)]
        k: cython.Py_ssize_t
        step: cython.Py_ssize_t
        top: cython.double = cython.cast(cython.double, self._grid[at])
        height: cython.double = top
        low: cython.double
        high: cython.double
        curvature: cython.double
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
        j: cython.Py_ssize_t
        n: cython.Py_ssize_t = 0
        for j in range(self._n_peaks):
            if self._contact[j] == i:
                self._ridge[n, 0] = self.x0 + self.step_px * self._column[self._at[j]]
                self._ridge[n, 1] = self.y0 + self.step_px * self._row[self._at[j]]
                n += 1
        found: Array = self._ridge_array[:n].copy()
        return found

    def _highest(self, i: cython.Py_ssize_t) -> int:
        """Which peak is the highest of contact i."""
        j: cython.Py_ssize_t = 0
        while self._contact[j] != i:
            j += 1
        return j

    def _drop_peaks(self, dropped: cython.int) -> None:
        """Remove the peaks that are marked so instead of with a contact."""
        j: cython.Py_ssize_t
        left: cython.Py_ssize_t = 0
        for j in range(self._n_peaks):
            if self._contact[j] != dropped:
                self._at[left] = self._at[j]
                self._height[left] = self._height[j]
                self._contact[left] = self._contact[j]
                left += 1
        self._n_peaks = left

    def _measure(self) -> None:
        """Collect each contact's region, and find its shape."""
        i: cython.Py_ssize_t
        self._collect()
        for i in range(self.n_contacts):
            self._find_shape(i)

    def _collect(self) -> None:
        """Sums over each region's active points, weighted by the height above its edge."""
        i: cython.Py_ssize_t
        k: cython.Py_ssize_t
        p: cython.Py_ssize_t
        at: cython.Py_ssize_t
        h: cython.float
        w: cython.double
        x: cython.double
        y: cython.double
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
        j: cython.Py_ssize_t
        nearest: cython.Py_ssize_t = 0
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
        w: cython.double = self._sums[i, 0]
        x: cython.double = self._sums[i, 1] / w
        y: cython.double = self._sums[i, 2] / w
        # 1/12: a grid point represents a square of one step.
        xx: cython.double = self._sums[i, 3] / w - x * x + 1.0 / 12.0
        xy: cython.double = self._sums[i, 4] / w - x * y
        yy: cython.double = self._sums[i, 5] / w - y * y + 1.0 / 12.0
        mean: cython.double = 0.5 * (xx + yy)
        half: cython.double = hypot(0.5 * (xx - yy), xy)
        self.middle[i, 0] = self.x0 + self.step_px * x
        self.middle[i, 1] = self.y0 + self.step_px * y
        # A uniform ellipse's semi-axis is two standard deviations.
        self.semi_axis[i] = 2.0 * sqrt(mean + half) * self.step_px
        self.direction[i] = 0.5 * atan2(2.0 * xy, xx - yy)
        self.elongation[i] = sqrt((mean + half) / max(mean - half, _VARIANCE_MIN))
