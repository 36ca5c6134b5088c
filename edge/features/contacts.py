# cython: infer_types=True
"""Contacts of a frame, from the peaks of the contact field to their places.

    peaks --prominence--> regions, each a contact
    --seen pins--> no guesses --fits--> close pairs separated, bars joined --pins round it--> place

A probe makes one peak, a long edge a chain of them, a flat surface a ring or a rough plateau. Peaks with no
real valley between them are one contact.

Rules
- Two peaks are one contact unless every path between them descends far enough: by a share of the
  lower one and by a multiple of the pins' noise there (topographic prominence). A second peak lower than that
  noise is none, however far away.
- A flat surface or a long edge grows cells at several places of its rim. Between two tools the skin comes
  back up, so that pins lean from each towards the middle between them; under one tool they do not.
- The region of a contact is what lies above a share of its peak and is nearest to one of its peaks. A share
  rather than a fixed height, so that the region does not grow with the depth alone.
- Contacts are in the order of their highest peaks, CONTACTS_MAX at most.
- A contact's place begins with the mean of its pins' present positions, weighted by area change. What a shear
  adds to it shows in first moments about the middle: of the divergence, which a press makes symmetrical, and
  of the curl, which a press does not make at all. A shear makes both, as large (of an even spread: exactly).
  So the place is the mean less the moment of the curl: dots on a surface are dragged along so far that cells
  grow beside the contact. A calibration has the parts, and weighs them itself.
- Cells of lost pins are interpolated from others: where most pins are lost, a contact is only a guess.
"""

import cython
import numpy as np
from cython.cimports.libc.math import atan2, fabs, hypot, isfinite, sqrt
from numpy.typing import NDArray

from edge.features.contact_field import PeakFinder
from edge.features.params import CONTACTS_MAX, PARAMS
from edge.features.pin_motion import PinNoise
from edge.features.several import Fits, FittedContacts
from edge.features.surface import Surface
from edge.geometry.copies import Copies
from edge.types import Array, ContactRegion, FittedContact, Heights, Mask

NAN = cython.declare(cython.double, float("nan"))
_CONTACTS_MAX = cython.declare(cython.Py_ssize_t, CONTACTS_MAX)
# A peak that belongs to no contact is marked with one of these.
_NONE = cython.declare(cython.int, -1)
_NOISE = cython.declare(cython.int, -2)
#: Smallest variance across a region, in squared steps: below it the ratio of the axes is rounding.
_VARIANCE_MIN = cython.declare(cython.double, 1e-9)
_UNKNOWN = np.full(2, np.nan)


class Regions:
    """Contacts of one frame: their peaks, and the moments of their regions. Good until the next frame.

    n_contacts   of the frame
    middle       (CONTACTS_MAX, 2) float64 px, centre of gravity of each region
    semi_axis    (CONTACTS_MAX,) float64 px, the long one
    elongation   (CONTACTS_MAX,) float64, long over short axis
    direction    (CONTACTS_MAX,) float64 rad, of the long axis, from x towards y
    x0, y0, step_px  place of the padded grid's first column and row, and the distance of its points;
                 given are those of the field's

    peaks        of the field
    """

    def __init__(self, peaks: PeakFinder, x0: float, y0: float, step_px: float) -> None:
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
        self._tops = [Copies(self._ridge_array[:1]) for _ in range(CONTACTS_MAX)]
        self._peaks = peaks
        self._grid, self._place, self._active = peaks.grid, peaks.place, peaks.active
        row, column = np.divmod(np.arange(len(peaks.grid), dtype=np.int32), peaks.width)
        self._row, self._column = row.astype(np.int16), column.astype(np.int16)
        self.x0, self.y0, self.step_px = x0 - step_px, y0 - step_px, step_px
        self._shallow_rel = PARAMS.shallow_rel
        self._min_prominence_sigma = 2.0 * PARAMS.contact_sigma

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
        """Drop the contacts that are not kept, (n_contacts or more,) uint8; the others take their points."""
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
        """Make two contacts of the only one, with peaks at the grid's points nearest to two places, px.

        Returns False where both places have the same point.
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

    def join(self, i: cython.Py_ssize_t, j: cython.Py_ssize_t) -> None:
        """Make one contact of two, i before j."""
        for p in range(self._n_peaks):
            if self._contact[p] == j:
                self._contact[p] = i
            elif self._contact[p] > j:
                self._contact[p] -= 1
        self.n_contacts -= 1
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
        """Height of contact i's highest peak, interpolated by a parabola along each axis of the grid."""
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
        top: Copies = self._tops[i]
        ridge: Array = top.take() if n == 1 else self._ridge_array[:n].copy()
        return ridge

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


class ContactFinder:
    """Finds the contacts on the grid of one tip's surface, among its n pins. Good until the next frame:

    surface, field, peaks, regions, fitted  the steps on the way to the contacts
    place  (CONTACTS_MAX, 2) float64 px
    divergence_moment, curl_moment  (CONTACTS_MAX, 2) float64 px, first moments over the sum of the
                                    divergence; that of the curl is turned by a right angle

    xy        (n, 2) float64 px, into which where the pins are is written in each frame; finite
    """

    def __init__(self, surface: Surface, xy: Array) -> None:
        """Raises ValueError: xy of another size."""
        if xy.shape != surface.rest_img.shape:
            raise ValueError(f"xy {surface.rest_img.shape} is wanted, not {xy.shape}")
        pitch_px, self.surface, self.field = surface.pitch_px, surface, surface.field
        self.peaks = PeakFinder(surface.inside)
        x0, y0 = float(surface.x_img[0]), float(surface.y_img[0])
        self.regions = Regions(self.peaks, x0, y0, surface.step_px)
        self.fitted = FittedContacts(surface, self.regions)
        self._pin_noise = PinNoise(surface.rest_img, pitch_px)
        self._rest, self._pitch_px = surface.rest_img, pitch_px
        self._shallow_rel = PARAMS.shallow_rel
        self._xy = self._xy_array = xy
        self._field_noise = surface.divergence_noise
        points_n = len(self.field.points)
        self._near, self._weight = np.zeros(points_n, np.int32), np.zeros(points_n)
        self._kept = np.zeros(CONTACTS_MAX, np.uint8)
        table = np.zeros((CONTACTS_MAX, 5, 2))
        self.place, self.divergence_moment, self.curl_moment = table[:, 1], table[:, 2], table[:, 3]
        self._table, self._copies = table, [[Copies(of_field) for of_field in row] for row in table]
        self._n_before = 0
        self._visibility_radius_px = PARAMS.close_pitch * pitch_px
        self._place_radius_px = PARAMS.place_radius_pitch * pitch_px
        self._place_radius_axis = PARAMS.place_radius_axis
        self._contact_sigma, self._min_area_change = PARAMS.contact_sigma, PARAMS.min_area_change
        self._min_oriented_elongation = PARAMS.min_oriented_elongation
        # A neighbour may cut a round region in half: half of a disc is so much longer than wide.
        half_disc = 1.0 / sqrt(1.0 - 64.0 / (9.0 * np.pi**2))
        self._min_cut_elongation = max(half_disc, self._min_oriented_elongation)
        # A contact of that elongation has such a region, if the region is blurred by the contact's width.
        self._min_fitted_elongation = sqrt(0.5 * (self._min_oriented_elongation**2 + 1.0))

    def forget(self) -> None:
        """The next frame does not follow the last one."""
        self.fitted.forget()

    def find(
        self, seen: Mask, sigma_px: float, moments: bool = True, fits: cython.int = Fits.ALL
    ) -> tuple[ContactRegion, ...]:
        """Contacts of the frame whose area changes were set in `field`, strongest first.

        seen      (n,) bool
        sigma_px  noise of one coordinate of a pin's motion since rest
        moments   False: they are not wanted, and NaN
        fits      the contacts that are wanted as fitted to the pins' motion
        Raises    ValueError: another number of pins
        Source    paper, "Contact Location and Multi-Contact Detection"
        """
        regions: Regions = self.regions
        self.field.find(self._xy)
        self.peaks.set_field(self.field.blend, self.field.active, self.field.n_active)
        if not self.peaks.find(self._field_noise, self._contact_sigma * sigma_px, self._min_area_change):
            if not self.peaks.find(self._field_noise, 0.0, 0.0):
                self.forget()
                return ()
            self.peaks.n_peaks = 1  # cells together show a touch where no point stands out: the highest is it
        if regions.merge(self._field_noise, 0.0) > 1:  # noise joins contacts, it parts none
            self._look_closer(seen, sigma_px)
        if regions.n_contacts > 1:
            self._unite(seen)
        n = regions.n_contacts
        if n != self._n_before:  # with other regions it is another scene
            self.forget()
        self._n_before = n
        direction = NAN
        if n == 2:
            direction = self.fitted.join(self._xy_array, seen, wanted=fits <= n)
        elif n == 1:
            is_long = regions.elongation[0] >= self._min_oriented_elongation
            may_be_long = regions.elongation[0] >= self._min_fitted_elongation
            if may_be_long or self.peaks.n_peaks > 1:
                ridge = regions.ridge(0)
                direction = self.fitted.split(
                    self._xy_array, seen, ridge, is_long=is_long, wanted=may_be_long
                )
        for i in range(regions.n_contacts):
            self._find_place(i)
        if moments:
            self.find_moments()
        fitted = self.fitted.fit(self._xy_array, seen) if regions.n_contacts >= fits else []
        for i in range(regions.n_contacts):
            for d in range(2):
                self._table[i, 0, d] = self.place[i, d] - (self.curl_moment[i, d] if moments else 0.0)
                self._table[i, 4, d] = regions.middle[i, d]
        if regions.n_contacts == 1:
            return (self._describe(0, direction, moments, fitted),)
        contacts = []
        for i in range(regions.n_contacts):
            is_long = regions.elongation[i] >= self._min_cut_elongation
            contacts.append(self._describe(i, regions.direction[i] if is_long else NAN, moments, fitted))
        return tuple(contacts)

    def _look_closer(self, seen: Mask, sigma_px: float) -> None:
        """Merge regions by the noise of a pin, of this frame and at rest; drop those with few seen pins."""
        mask: cython.const[cython.uchar][::1] = seen
        if mask.shape[0] != self._rest.shape[0]:
            raise ValueError(f"seen ({self._rest.shape[0]},) is wanted")
        noise_px = hypot(self._pin_noise.sigma_px(self._xy, mask), sigma_px)
        if self.regions.merge(self._field_noise, noise_px) > 1:
            self.drop_guesses(mask)

    def _unite(self, seen: Mask) -> None:
        """Make one contact of neighbours between which the skin does not come back up."""
        i = 1
        while i < self.regions.n_contacts:
            for j in range(i):
                if self._are_neighbours(i, j) and self._rise(seen, i, j) < -self._shallow_rel:
                    self.regions.join(j, i)
                    i = 0
                    break
            i += 1

    def _are_neighbours(self, i: cython.Py_ssize_t, j: cython.Py_ssize_t) -> bool:
        """Whether no third contact is nearer to both of them than they are to each other."""
        apart = self._distance(i, j)
        for k in range(self.regions.n_contacts):
            if k != i and k != j and max(self._distance(i, k), self._distance(j, k)) < apart:
                return False
        return True

    def _distance(self, i: cython.Py_ssize_t, j: cython.Py_ssize_t) -> float:
        """px, between the middles of two contacts."""
        middle = self.regions.middle
        return hypot(middle[i, 0] - middle[j, 0], middle[i, 1] - middle[j, 1])

    def _rise(self, seen: Mask, i: cython.Py_ssize_t, j: cython.Py_ssize_t) -> float:
        """Share of the motion along the way from i to j that leads to its middle, less that which leads away.

        It is interpolated from the seen pins within a pitch.
        Source  Franke and Nielson, "Smooth interpolation of large sets of scattered data", 1980
        """
        mask: cython.const[cython.uchar][::1] = seen
        x0, y0 = self.regions.middle[i, 0], self.regions.middle[i, 1]
        way_x, way_y = self.regions.middle[j, 0] - x0, self.regions.middle[j, 1] - y0
        half = cython.cast(cython.Py_ssize_t, self._distance(i, j) / (2.0 * self.regions.step_px)) + 1
        inwards = size = 0.0
        for k in range(2 * half):
            share = (k + 0.5) / (2.0 * half)
            total = motion = 0.0
            for p in range(self._rest.shape[0]):
                dx, dy = self._rest[p, 0] - x0 - share * way_x, self._rest[p, 1] - y0 - share * way_y
                near2 = (dx * dx + dy * dy) / (self._pitch_px * self._pitch_px)
                if near2 < 1.0 and mask[p]:
                    w = (1.0 / max(sqrt(near2), _VARIANCE_MIN) - 1.0) ** 2
                    total += w
                    motion += w * (self._xy[p, 0] - self._rest[p, 0]) * way_x
                    motion += w * (self._xy[p, 1] - self._rest[p, 1]) * way_y
            if total > 0.0:
                inwards += motion / total if k < half else -motion / total
                size += fabs(motion / total)
        return inwards / size if size > 0.0 else 0.0

    def _describe(
        self, i: cython.Py_ssize_t, direction: float, moments: bool, fitted: list[FittedContact]
    ) -> ContactRegion:
        """Contact i, whose direction is known, or NaN."""
        copies: Copies
        taken: list[Array] = []
        for copies in self._copies[i]:
            taken.append(copies.take())
        place, mean, divergence, curl, middle = taken
        return ContactRegion(
            place,
            mean,
            self.regions.peak_height(i),
            self.regions.area_px2(i),
            direction,
            self.regions.elongation[i],
            self.regions.ridge(i),
            middle,
            divergence if moments else _UNKNOWN,
            curl if moments else _UNKNOWN,
            fitted[i] if fitted else None,
        )

    def drop_guesses(self, seen: Mask) -> None:
        """Drop from `regions` the contacts with few seen pins around, (n,) bool, unless no other is left."""
        n_contacts = self.regions.n_contacts
        n_known = 0
        for i in range(n_contacts):
            share = self.visible_share(seen, self.regions.middle[i, 0], self.regions.middle[i, 1])
            self._kept[i] = 2.0 * share >= 1.0
            n_known += self._kept[i]
        if 0 < n_known < n_contacts:
            self.regions.keep(self._kept)

    def visible_share(self, seen: Mask, x: float, y: float) -> float:
        """Share of the pins round a place at rest, px, that are seen, (n,) bool; 0 where there is none."""
        n: cython.Py_ssize_t = 0
        n_seen: cython.Py_ssize_t = 0
        radius = self._visibility_radius_px
        for i in range(self._rest.shape[0]):
            dx = self._rest[i, 0] - x
            dy = self._rest[i, 1] - y
            if dx * dx + dy * dy <= radius * radius:
                n += 1
                n_seen += 1 if seen[i] else 0
        return cython.cast(cython.double, n_seen) / n if n else 0.0

    def find_moments(self) -> None:
        """`divergence_moment` and `curl_moment` of each contact, over the points nearest to its middle."""
        for i in range(self.regions.n_contacts):
            self._find_moments(i, self._find_near(i))

    def _find_near(self, i: cython.Py_ssize_t) -> int:
        """The active points round contact i and their weights; how many."""
        n = 0
        radius = self._radius_px(i)
        points: cython.double[:, ::1] = self.field.points
        for k in range(self.field.n_active):
            p = self.field.active[k]
            dx = points[p, 0] - self.regions.middle[i, 0]
            dy = points[p, 1] - self.regions.middle[i, 1]
            d2 = dx * dx + dy * dy
            if d2 >= radius * radius:
                continue
            if self._is_nearer_to_another(points[p, 0], points[p, 1], d2, i):
                continue
            self._near[n] = p
            self._weight[n] = 1.0 - d2 / (radius * radius)
            n += 1
        return n

    def _find_moments(self, i: cython.Py_ssize_t, n: cython.Py_ssize_t) -> None:
        total = divergence_x = divergence_y = curl_x = curl_y = 0.0
        points: cython.double[:, ::1] = self.field.points
        self.field.find_curl(self._near, n)
        for k in range(n):
            dx = points[self._near[k], 0] - self.regions.middle[i, 0]
            dy = points[self._near[k], 1] - self.regions.middle[i, 1]
            divergence = self._weight[k] * cython.cast(cython.double, self.field.divergence[self._near[k]])
            turning = self._weight[k] * cython.cast(cython.double, self.field.curl[k])
            total += max(divergence, 0.0)
            divergence_x += divergence * dx
            divergence_y += divergence * dy
            curl_x -= turning * dy
            curl_y += turning * dx
        scale = 1.0 / total if total > 0.0 else 0.0
        self.divergence_moment[i, 0] = scale * divergence_x
        self.divergence_moment[i, 1] = scale * divergence_y
        self.curl_moment[i, 0] = scale * curl_x
        self.curl_moment[i, 1] = scale * curl_y

    def _radius_px(self, i: cython.Py_ssize_t) -> float:
        """Round the middle of contact i, of what belongs to it."""
        return max(self._place_radius_axis * self.regions.semi_axis[i], self._place_radius_px)

    def _find_place(self, i: cython.Py_ssize_t) -> None:
        xy: cython.const[cython.double][:, ::1] = self._xy
        area_change: cython.float[::1] = self.field.area_change
        total = x = y = 0.0
        radius = self._radius_px(i)
        limit = radius * radius
        for p in range(xy.shape[0]):
            dx = xy[p, 0] - self.regions.middle[i, 0]
            dy = xy[p, 1] - self.regions.middle[i, 1]
            d2 = dx * dx + dy * dy
            if not (area_change[p] > 0.0 and d2 < limit):
                continue
            if self._is_nearer_to_another(xy[p, 0], xy[p, 1], d2, i):
                continue
            w = cython.cast(cython.double, area_change[p]) * (1.0 - d2 / limit)
            total += w
            x += w * xy[p, 0]
            y += w * xy[p, 1]
        self.place[i, 0] = x / total if total > 0.0 else self.regions.middle[i, 0]
        self.place[i, 1] = y / total if total > 0.0 else self.regions.middle[i, 1]

    def _is_nearer_to_another(self, x: float, y: float, d2: float, i: cython.Py_ssize_t) -> bool:
        """Whether a place is nearer to another contact's middle than to that of i (squared: d2)."""
        for j in range(self.regions.n_contacts):
            dx = x - self.regions.middle[j, 0]
            dy = y - self.regions.middle[j, 1]
            if j != i and dx * dx + dy * dy < d2:
                return True
        return False
