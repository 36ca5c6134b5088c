# cython: infer_types=True
"""Contacts of a frame, from the contact field to their places.

    contact field --peaks, prominence--> regions, each a contact
    --seen pins--> no guesses --fits--> close pairs separated, bars joined --pins round it--> place

Rules
- A contact's place is the mean of its pins' present positions, weighted by area change. A shear shifts both
  the pattern of area changes and the pins; in this mean the two errors nearly cancel.
- What a shear adds shows in first moments about the middle: of the divergence, which a press makes
  symmetrical, and of the curl, which a press does not make at all. A shear makes both, as large (of an even
  spread: exactly), so that a calibration can take the one off the other.
- Cells of lost pins are interpolated from others: where most pins are lost, a contact is only a guess.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

import cython
import numpy as np

from edge.features.params import CONTACTS_MAX, PARAMS, FeatureParams
from edge.features.several import Fits, FittedContacts
from edge.features.surface import Surface
from edge.types import Array, ContactRegion, FittedContact, Mask

if cython.compiled:
    from cython.cimports.edge.features.pin_motion import PinNoise
    from cython.cimports.edge.features.regions import PeakFinder, Regions
    from cython.cimports.libc.math import NAN, hypot, isnan
else:
    from math import hypot, isnan
    from math import nan as NAN  # noqa: N812

    from edge.features.pin_motion import PinNoise
    from edge.features.regions import PeakFinder, Regions

_UNKNOWN = np.full(2, np.nan)


class ContactFinder:
    """Finds the contacts on the grid of one tip's surface, among its n pins. Good until the next frame:

    surface, field, peaks, regions, fitted  the steps on the way to the contacts
    place  (CONTACTS_MAX, 2) float64 px
    divergence_moment, curl_moment  (CONTACTS_MAX, 2) float64 px, first moments over the sum of the
                                    divergence; that of the curl is turned by a right angle

    xy        (n, 2) float64 px, into which where the pins are is written in each frame; finite
    """

    def __init__(self, surface: Surface, xy: Array, params: FeatureParams = PARAMS) -> None:
        """Raises ValueError: xy of another size."""
        if xy.shape != surface.rest_img.shape:
            raise ValueError(f"xy {surface.rest_img.shape} is wanted, not {xy.shape}")
        pitch_px, self.surface, self.field = surface.pitch_px, surface, surface.field
        self.peaks = PeakFinder(surface.inside)
        x0, y0 = float(surface.x_img[0]), float(surface.y_img[0])
        self.regions = Regions(self.peaks, x0, y0, surface.step_px, params)
        self.fitted = FittedContacts(surface, self.regions, params)
        self._pin_noise = PinNoise(surface.rest_img, pitch_px)
        self._rest = surface.rest_img
        self._xy = self._xy_array = xy
        self._field_noise = surface.divergence_noise
        points_n = len(self.field.points)
        self._near, self._weight = np.zeros(points_n, np.int32), np.zeros(points_n)
        self._kept = np.zeros(CONTACTS_MAX, np.uint8)
        self._tables = np.zeros((3, CONTACTS_MAX, 2))
        self.place, self.divergence_moment, self.curl_moment = self._tables
        self._middles = np.asarray(self.regions.middle)
        self._n_before = 0
        self._visibility_radius_px = params.close_pitch * pitch_px
        self._place_radius_px = params.place_radius_pitch * pitch_px
        self._place_radius_axis = params.place_radius_axis
        self._contact_sigma, self._min_area_change = params.contact_sigma, params.min_area_change
        self._min_oriented_elongation = params.min_oriented_elongation

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
        n = regions.n_contacts
        if n != self._n_before:  # with other regions it is another scene
            self.forget()
        self._n_before = n
        direction = NAN
        if n == 2:
            direction = self.fitted.join(self._xy_array, seen, wanted=fits <= n)
        elif n == 1 and regions.elongation[0] >= self._min_oriented_elongation:
            direction = self.fitted.split(self._xy_array, seen)
        elif n == 1 and self.peaks.n_peaks > 1:
            self.fitted.split_round(self._xy_array, seen, regions.ridge(0))
        self.find_places()
        if moments:
            self.find_moments()
        fitted = self.fitted.fit(self._xy_array, seen) if regions.n_contacts >= fits else []
        contacts = [self._describe(0, direction, moments, fitted)]
        for i in range(1, regions.n_contacts):
            contacts.append(self._describe(i, NAN, moments, fitted))
        return tuple(contacts)

    def _look_closer(self, seen: Mask, sigma_px: float) -> None:
        """Merge several regions by the noise of a pin, from its neighbours in this frame and from rest; drop
        those with few seen pins around.
        """
        mask: cython.const[cython.uchar][::1] = seen
        if mask.shape[0] != self._rest.shape[0]:
            raise ValueError(f"seen ({self._rest.shape[0]},) is wanted")
        noise_px = hypot(self._pin_noise.sigma_px(self._xy, mask), sigma_px)
        if self.regions.merge(self._field_noise, noise_px) > 1:
            self.drop_guesses(mask)

    def _describe(
        self, i: cython.Py_ssize_t, direction: float, moments: bool, fitted: list[FittedContact]
    ) -> ContactRegion:
        """Contact i, whose direction is known from a fit, or NaN."""
        elongation = self.regions.elongation[i]
        if isnan(direction) and elongation >= self._min_oriented_elongation:
            direction = self.regions.direction[i]
        return ContactRegion(
            self._tables[0, i].copy(),
            self.regions.peak_height(i),
            self.regions.area_px2(i),
            direction,
            elongation,
            self.regions.ridge(i),
            self._middles[i].copy(),
            self._tables[1, i].copy() if moments else _UNKNOWN,
            self._tables[2, i].copy() if moments else _UNKNOWN,
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

    def find_places(self) -> None:
        """`place` of each contact: the mean of the pins nearest to its middle, weighted by area change."""
        n_contacts = self.regions.n_contacts
        for i in range(n_contacts):
            self._find_place(i, n_contacts)

    def find_moments(self) -> None:
        """`divergence_moment` and `curl_moment` of each contact, over the points nearest to its middle."""
        for i in range(self.regions.n_contacts):
            self._find_moments(i, self._find_near(i))

    def _find_near(self, i: cython.Py_ssize_t) -> int:
        """The active points round contact i and their weights; how many."""
        n = 0
        n_contacts = self.regions.n_contacts
        radius = self._radius_px(i)
        points: cython.double[:, ::1] = self.field.points
        for k in range(self.field.n_active):
            p = self.field.active[k]
            dx = points[p, 0] - self.regions.middle[i, 0]
            dy = points[p, 1] - self.regions.middle[i, 1]
            d2 = dx * dx + dy * dy
            if d2 >= radius * radius:
                continue
            if self._is_nearer_to_another(points[p, 0], points[p, 1], d2, i, n_contacts):
                continue
            self._near[n] = p
            self._weight[n] = 1.0 - d2 / (radius * radius)
            n += 1
        return n

    def _find_moments(self, i: cython.Py_ssize_t, n: cython.Py_ssize_t) -> None:
        total: cython.double = 0.0
        divergence_x: cython.double = 0.0
        divergence_y: cython.double = 0.0
        curl_x: cython.double = 0.0
        curl_y: cython.double = 0.0
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

    def _find_place(self, i: cython.Py_ssize_t, n_contacts: cython.Py_ssize_t) -> None:
        xy: cython.const[cython.double][:, ::1] = self._xy
        area_change: cython.float[::1] = self.field.area_change
        total: cython.double = 0.0
        x: cython.double = 0.0
        y: cython.double = 0.0
        radius = self._radius_px(i)
        limit = radius * radius
        for p in range(xy.shape[0]):
            dx = xy[p, 0] - self.regions.middle[i, 0]
            dy = xy[p, 1] - self.regions.middle[i, 1]
            d2 = dx * dx + dy * dy
            if not (area_change[p] > 0.0 and d2 < limit):
                continue
            if self._is_nearer_to_another(xy[p, 0], xy[p, 1], d2, i, n_contacts):
                continue
            w = cython.cast(cython.double, area_change[p]) * (1.0 - d2 / limit)
            total += w
            x += w * xy[p, 0]
            y += w * xy[p, 1]
        self.place[i, 0] = x / total if total > 0.0 else self.regions.middle[i, 0]
        self.place[i, 1] = y / total if total > 0.0 else self.regions.middle[i, 1]

    def _is_nearer_to_another(
        self, x: float, y: float, d2: float, i: cython.Py_ssize_t, n_contacts: cython.Py_ssize_t
    ) -> bool:
        """Whether a place is nearer to another contact's middle than to that of i (squared: d2)."""
        for j in range(n_contacts):
            dx = x - self.regions.middle[j, 0]
            dy = y - self.regions.middle[j, 1]
            if j != i and dx * dx + dy * dy < d2:
                return True
        return False
