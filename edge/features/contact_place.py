"""The pins round a contact: its present place, how a shear shifts it, and how many of them are seen.

Rules
- A contact's place is the mean of its pins' present positions, weighted by area change. A shear shifts both
  the pattern of area changes and the pins; in this mean the two errors nearly cancel.
- What a shear adds shows in first moments about the middle: of the divergence, which a press makes
  symmetrical, and of the curl, which a press does not make at all. A shear makes both, as large (of an even
  spread: exactly), so that a calibration can take the one off the other.
- Cells of lost pins are interpolated from others: where most pins are lost, a contact is only a guess.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.features.contact_field import ContactField
from edge.features.params import PARAMS, FeatureParams
from edge.features.regions import CONTACTS_MAX, Regions
from edge.types import Array

if cython.compiled:
    from cython.cimports.edge.geometry.views import PointsView
else:
    from edge.geometry.views import PointsView


@cython.cclass
class ContactPlace:
    """Places of one frame's contacts among the n pins of one tip.

    place    (CONTACTS_MAX, 2) float64 px, of `find_places`; good until the next frame
    divergence_moment, curl_moment  (CONTACTS_MAX, 2) float64 px, of `find_moments`: over the sum of the
                                    divergence; that of the curl is turned by a right angle
    """

    place = cython.declare(cython.double[:, ::1], visibility="readonly")
    divergence_moment = cython.declare(cython.double[:, ::1], visibility="readonly")
    curl_moment = cython.declare(cython.double[:, ::1], visibility="readonly")
    _field: ContactField
    _points: cython.double[:, ::1]
    _xy_view: PointsView
    _active: cython.int[::1]
    _divergence: cython.float[::1]
    _near: cython.int[::1]  # grid points round a contact, and their weights
    _weight: cython.double[::1]
    _kept: cython.uchar[::1]
    _rest: cython.const[cython.double][:, ::1]
    _area_change: cython.float[::1]  # of the frame's field
    _regions: Regions
    _middle: cython.double[:, ::1]
    _semi_axis: cython.double[::1]
    _visibility_radius_px: cython.double
    _place_radius_px: cython.double
    _place_radius_axis: cython.double

    def __init__(
        self,
        rest_xy: Array,
        pitch_px: float,
        field: ContactField,
        regions: Regions,
        params: FeatureParams = PARAMS,
    ) -> None:
        if rest_xy.shape != (len(field.area_change), 2):
            raise ValueError(f"rest_xy ({len(field.area_change)}, 2) is wanted, not {rest_xy.shape}")
        self.place = np.zeros((CONTACTS_MAX, 2))
        self.divergence_moment, self.curl_moment = np.zeros((CONTACTS_MAX, 2)), np.zeros((CONTACTS_MAX, 2))
        self._xy_view = PointsView()
        self._field, self._points, self._active = field, field.points, field.active
        self._divergence = field.divergence
        self._near, self._weight = np.zeros(len(field.points), np.int32), np.zeros(len(field.points))
        self._rest = np.ascontiguousarray(rest_xy, np.float64)
        self._area_change = field.area_change
        self._regions, self._middle, self._semi_axis = regions, regions.middle, regions.semi_axis
        self._kept = np.zeros(CONTACTS_MAX, np.uint8)
        self._visibility_radius_px = params.close_pitch * pitch_px
        self._place_radius_px = params.place_radius_pitch * pitch_px
        self._place_radius_axis = params.place_radius_axis

    def drop_guesses(self, seen: cython.const[cython.uchar][::1]) -> None:
        """Drop from `regions` the contacts with few seen pins around, unless no other is left.

        seen     (n,) bool. Raises ValueError: another number of pins
        """
        i: cython.Py_ssize_t
        n_contacts: cython.Py_ssize_t = self._regions.n_contacts
        n_known: cython.Py_ssize_t = 0
        for i in range(n_contacts):
            self._kept[i] = 2.0 * self.visible_share(seen, self._middle[i, 0], self._middle[i, 1]) >= 1.0
            n_known += self._kept[i]
        if 0 < n_known < n_contacts:
            self._regions.keep(self._kept)

    @cython.ccall
    def visible_share(
        self, seen: cython.const[cython.uchar][::1], x: cython.double, y: cython.double
    ) -> cython.double:
        """Share of the pins round a place at rest, px, that are seen; 0 where there is none.

        seen     (n,) bool. Raises ValueError: another number of pins
        """
        if seen.shape[0] != self._rest.shape[0]:
            raise ValueError(f"seen ({self._rest.shape[0]},) is wanted")
        i: cython.Py_ssize_t
        n: cython.Py_ssize_t = 0
        n_seen: cython.Py_ssize_t = 0
        dx: cython.double
        dy: cython.double
        radius: cython.double = self._visibility_radius_px
        for i in range(self._rest.shape[0]):
            dx = self._rest[i, 0] - x
            dy = self._rest[i, 1] - y
            if dx * dx + dy * dy <= radius * radius:
                n += 1
                n_seen += 1 if seen[i] else 0
        return cython.cast(cython.double, n_seen) / n if n else 0.0

    def find_places(self, xy: Array) -> None:
        """`place` of each contact: the mean of the pins nearest to its middle, weighted by area change.

        xy       (n, 2) float64 px, where the pins are; finite
        Raises   ValueError: sizes that do not fit
        """
        at: cython.const[cython.double][:, ::1] = self._xy_view.of(xy)
        if at.shape[0] != self._rest.shape[0] or at.shape[1] != 2:
            raise ValueError(f"xy ({self._rest.shape[0]}, 2) is wanted")
        i: cython.Py_ssize_t
        n_contacts: cython.Py_ssize_t = self._regions.n_contacts
        for i in range(n_contacts):
            self._find_place(at, i, n_contacts)

    def find_moments(self) -> None:
        """`divergence_moment` and `curl_moment` of each contact, over the points nearest to its middle."""
        i: cython.Py_ssize_t
        for i in range(self._regions.n_contacts):
            self._find_moments(i, self._find_near(i))

    @cython.cfunc
    @cython.exceptval(check=False)
    def _find_near(self, i: cython.Py_ssize_t) -> cython.Py_ssize_t:
        """The active points round contact i and their weights; how many."""
        k: cython.Py_ssize_t
        p: cython.int
        dx: cython.double
        dy: cython.double
        d2: cython.double
        n: cython.Py_ssize_t = 0
        n_contacts: cython.Py_ssize_t = self._regions.n_contacts
        radius: cython.double = self._radius_px(i)
        for k in range(self._field.n_active):
            p = self._active[k]
            dx = self._points[p, 0] - self._middle[i, 0]
            dy = self._points[p, 1] - self._middle[i, 1]
            d2 = dx * dx + dy * dy
            if d2 >= radius * radius:
                continue
            if self._is_nearer_to_another(self._points[p, 0], self._points[p, 1], d2, i, n_contacts):
                continue
            self._near[n] = p
            self._weight[n] = 1.0 - d2 / (radius * radius)
            n += 1
        return n

    @cython.cfunc
    def _find_moments(self, i: cython.Py_ssize_t, n: cython.Py_ssize_t) -> cython.bint:
        k: cython.Py_ssize_t
        dx: cython.double
        dy: cython.double
        divergence: cython.double
        turning: cython.double
        total: cython.double = 0.0
        divergence_x: cython.double = 0.0
        divergence_y: cython.double = 0.0
        curl_x: cython.double = 0.0
        curl_y: cython.double = 0.0
        curl: cython.float[::1] = self._field.curl(self._near, n)
        for k in range(n):
            dx = self._points[self._near[k], 0] - self._middle[i, 0]
            dy = self._points[self._near[k], 1] - self._middle[i, 1]
            divergence = self._weight[k] * cython.cast(cython.double, self._divergence[self._near[k]])
            turning = self._weight[k] * cython.cast(cython.double, curl[k])
            total += max(divergence, 0.0)
            divergence_x += divergence * dx
            divergence_y += divergence * dy
            curl_x -= turning * dy
            curl_y += turning * dx
        scale: cython.double = 1.0 / total if total > 0.0 else 0.0
        self.divergence_moment[i, 0] = scale * divergence_x
        self.divergence_moment[i, 1] = scale * divergence_y
        self.curl_moment[i, 0] = scale * curl_x
        self.curl_moment[i, 1] = scale * curl_y
        return True

    @cython.cfunc
    @cython.exceptval(check=False)
    def _radius_px(self, i: cython.Py_ssize_t) -> cython.double:
        """Round the middle of contact i, of what belongs to it."""
        return max(self._place_radius_axis * self._semi_axis[i], self._place_radius_px)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _find_place(
        self, xy: cython.const[cython.double][:, ::1], i: cython.Py_ssize_t, n_contacts: cython.Py_ssize_t
    ) -> cython.void:
        p: cython.Py_ssize_t
        dx: cython.double
        dy: cython.double
        d2: cython.double
        w: cython.double
        total: cython.double = 0.0
        x: cython.double = 0.0
        y: cython.double = 0.0
        radius: cython.double = self._radius_px(i)
        limit: cython.double = radius * radius
        for p in range(xy.shape[0]):
            dx = xy[p, 0] - self._middle[i, 0]
            dy = xy[p, 1] - self._middle[i, 1]
            d2 = dx * dx + dy * dy
            if not (self._area_change[p] > 0.0 and d2 < limit):
                continue
            if self._is_nearer_to_another(xy[p, 0], xy[p, 1], d2, i, n_contacts):
                continue
            w = cython.cast(cython.double, self._area_change[p]) * (1.0 - d2 / limit)
            total += w
            x += w * xy[p, 0]
            y += w * xy[p, 1]
        self.place[i, 0] = x / total if total > 0.0 else self._middle[i, 0]
        self.place[i, 1] = y / total if total > 0.0 else self._middle[i, 1]

    @cython.cfunc
    @cython.exceptval(check=False)
    def _is_nearer_to_another(
        self,
        x: cython.double,
        y: cython.double,
        d2: cython.double,
        i: cython.Py_ssize_t,
        n_contacts: cython.Py_ssize_t,
    ) -> cython.bint:
        """Whether a place is nearer to another contact's middle than to that of i (squared: d2)."""
        j: cython.Py_ssize_t
        dx: cython.double
        dy: cython.double
        for j in range(n_contacts):
            dx = x - self._middle[j, 0]
            dy = y - self._middle[j, 1]
            if j != i and dx * dx + dy * dy < d2:
                return True
        return False
