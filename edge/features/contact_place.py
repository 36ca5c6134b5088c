"""The pins round a contact: its present place, whether its cells' areas increased, how many pins are seen.

Rules
- A contact's place is the mean of its pins' present positions, weighted by area change. A shear shifts both
  the pattern of area changes and the pins; in this mean the two errors nearly cancel.
- Near a peak the areas must have increased. At the rim, where the surface has pins on one side only, the
  noise of a single pin tilts the surface and makes a maximum; but no area has increased there.
- Cells of lost pins are interpolated from others: where most pins are lost, a contact is only a guess.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.features.contact_field import ContactField
from edge.features.params import PARAMS, FeatureParams
from edge.features.peaks import PEAKS_MAX, PeakFinder
from edge.features.regions import CONTACTS_MAX, Regions
from edge.types import Array

if cython.compiled:
    from cython.cimports.libc.math import exp
else:
    from math import exp

_INFINITY = cython.declare(cython.double, float("inf"))


@cython.cclass
class ContactPlace:
    """Places of one frame's contacts among the n pins of one tip.

    place    (CONTACTS_MAX, 2) float64 px, of `find_places`; good until the next frame
    """

    place = cython.declare(cython.double[:, ::1], visibility="readonly")
    _peaks: PeakFinder
    _peak_at: cython.int[::1]
    _near: cython.double[::1]  # area change near each peak, share of visible pins round each contact
    _kept: cython.uchar[::1]
    _rest: cython.double[:, ::1]
    _area_change: cython.float[::1]  # of the frame's field
    _regions: Regions
    _middle: cython.double[:, ::1]
    _semi_axis: cython.double[::1]
    _pitch_px: cython.double
    _near_max: cython.double  # squared distance from a peak within which pins count, pitches
    _min_peak_rel: cython.double
    _min_visible_rel: cython.double
    _visibility_radius_px: cython.double
    _place_radius_px: cython.double
    _place_radius_axis: cython.double

    def __init__(
        self,
        rest_xy: Array,
        pitch_px: float,
        field: ContactField,
        peaks: PeakFinder,
        regions: Regions,
        params: FeatureParams = PARAMS,
    ) -> None:
        if rest_xy.shape != (len(field.area_change), 2):
            raise ValueError(f"rest_xy ({len(field.area_change)}, 2) is wanted, not {rest_xy.shape}")
        self.place = np.zeros((CONTACTS_MAX, 2))
        self._rest = np.array(rest_xy, np.float64, order="C")
        self._area_change = field.area_change
        self._regions, self._middle, self._semi_axis = regions, regions.middle, regions.semi_axis
        self._pitch_px, self._near_max = pitch_px, params.peak_radius_pitch**2
        self._peaks, self._peak_at = peaks, peaks.at
        self._near, self._kept = np.zeros(PEAKS_MAX), np.zeros(PEAKS_MAX, np.uint8)
        self._min_peak_rel, self._min_visible_rel = params.min_peak_rel, params.min_visible_rel
        self._visibility_radius_px = params.visibility_radius_pitch * pitch_px
        self._place_radius_px = params.place_radius_pitch * pitch_px
        self._place_radius_axis = params.place_radius_axis

    def drop_peaks_without_area_change(self) -> None:
        """Drop from `peaks` those near which the area change is below a share of the largest."""
        j: cython.Py_ssize_t
        n_peaks: cython.Py_ssize_t = self._peaks.n_peaks
        width: cython.int = self._peaks.width
        x0: cython.double = self._regions.x0
        y0: cython.double = self._regions.y0
        step_px: cython.double = self._regions.step_px
        most: cython.double = -_INFINITY
        for j in range(n_peaks):
            self._near[j] = self.area_change_near(
                x0 + step_px * (self._peak_at[j] % width), y0 + step_px * (self._peak_at[j] // width)
            )
            most = max(most, self._near[j])
        for j in range(n_peaks):  # under shear even the largest may be negative
            self._kept[j] = self._near[j] >= min(self._min_peak_rel * most, most)
        self._peaks.keep(self._kept)

    def drop_guesses(self, seen: cython.const[cython.uchar][::1]) -> None:
        """Drop from `regions` the contacts with few seen pins around, unless no other is left.

        seen     (n,) bool. Raises ValueError: another number of pins
        """
        i: cython.Py_ssize_t
        n_contacts: cython.Py_ssize_t = self._regions.n_contacts
        n_known: cython.Py_ssize_t = 0
        for i in range(n_contacts):
            self._kept[i] = (
                self.visible_share(seen, self._middle[i, 0], self._middle[i, 1]) >= self._min_visible_rel
            )
            n_known += self._kept[i]
        if 0 < n_known < n_contacts:
            self._regions.keep(self._kept)

    @cython.ccall
    def area_change_near(self, x: cython.double, y: cython.double) -> cython.double:
        """Mean area change of the cells within about a pitch of a place at rest, px; 0 of none."""
        i: cython.Py_ssize_t
        dx: cython.double
        dy: cython.double
        d2: cython.double
        w: cython.double
        total: cython.double = 0.0
        weight: cython.double = 0.0
        scale: cython.double = -1.0 / (self._pitch_px * self._pitch_px)
        for i in range(self._rest.shape[0]):
            dx = self._rest[i, 0] - x
            dy = self._rest[i, 1] - y
            d2 = (dx * dx + dy * dy) * scale
            if d2 >= -self._near_max:
                w = exp(d2)
                total += w * cython.cast(cython.double, self._area_change[i])
                weight += w
        return total / weight if weight > 0.0 else 0.0

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

    def find_places(self, xy: cython.const[cython.double][:, ::1]) -> None:
        """`place` of each contact: the mean of the pins nearest to its middle, weighted by area change.

        xy       (n, 2) float64 px, where the pins are; finite
        Raises   ValueError: sizes that do not fit
        """
        if xy.shape[0] != self._rest.shape[0] or xy.shape[1] != 2:
            raise ValueError(f"xy ({self._rest.shape[0]}, 2) is wanted")
        i: cython.Py_ssize_t
        n_contacts: cython.Py_ssize_t = self._regions.n_contacts
        for i in range(n_contacts):
            self._find_place(xy, i, n_contacts)

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
        radius: cython.double = max(self._place_radius_axis * self._semi_axis[i], self._place_radius_px)
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
