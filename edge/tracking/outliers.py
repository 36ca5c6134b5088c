"""Photometric outliers: pins whose brightness or centroid sigma is unlike their own at rest.

A kernel: compiled by Cython, and the same when it is not.

Idea: stray light beside a pin biases its centroid, and a speck may lie where a dark pin was. A pin with an
anomalous brightness or sigma is therefore accepted in two cases only:

- It moves with the others: its residual is small, or like those of the pins around it.
- It has moved itself: its residual is larger than stray light can make it, and has changed since the last
  frame by no more than a few times as much as those of the pins around it. A speck appears at once.

Anomalous is what differs from the gain or the sigma that all pins share by more than their scatter allows,
scaled by the pin's own ratio at rest (permanent glare is no anomaly).

Light that changes a pin's brightness by a share e moves its centroid by e radii. A disc of which a share m is
not explained is off by m radii at most, and its sigma counts m^2 radii.
"""

# mypy: disable-error-code="attr-defined,no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.geometry.select import SIGMA_OF_MAD
from edge.tracking.params import TrackingParams
from edge.types import Array, Mask, Pins

if cython.compiled:
    from cython.cimports.edge.geometry.select import select_kth
    from cython.cimports.edge.tracking.affine import Fit, LocalAffine
    from cython.cimports.libc.math import HUGE_VAL, fabs, sqrt
else:
    from math import fabs, sqrt
    from math import inf as HUGE_VAL  # noqa: N812

    from edge.geometry.select import select_kth
    from edge.tracking.affine import Fit, LocalAffine

#: Standard deviation of normal noise, in median absolute deviations.
_SIGMA_OF_MAD = cython.declare(cython.double, SIGMA_OF_MAD)
UNKNOWN = cython.declare(cython.double, -2)
UNSUPPORTED = cython.declare(cython.double, -1)


@cython.cclass
class PhotometricFilter:
    """Rejects the outliers among the n pins of one tip.

    at_rest         brightness, sigma and radius of each pin
    local_pitch_px  (n,) float64
    Raises          ValueError: arrays of another number of pins
    """

    def __init__(
        self, affine: LocalAffine, at_rest: Pins, local_pitch_px: Array, params: TrackingParams
    ) -> None:
        n = affine.n
        if len(at_rest) != n or len(local_pitch_px) != n:
            raise ValueError(
                f"arrays of {n} pins are wanted, not of {len(at_rest)} and {len(local_pitch_px)}"
            )
        constants = (at_rest.brightness, at_rest.sigma_px, at_rest.radius_px, np.asarray(local_pitch_px))
        if any(array.shape != (n,) for array in constants):
            raise ValueError(
                f"brightness, sigma_px, radius_px and local_pitch_px of {n} numbers each are wanted"
            )
        self.n = n
        self.affine = affine
        self.brightness_sigmas = params.brightness_sigmas
        self.brightness_change_min = params.brightness_change_min
        self.sigma_ratio_max = params.sigma_ratio_max
        self.residual_max = params.outlier_residual_max
        self.residual_max_search = params.outlier_residual_max_search
        self.residual_ratio = params.outlier_residual_ratio
        self.support_min = params.support_min
        self.median_halvings = params.median_halvings
        self.local_pitch = np.array(local_pitch_px, np.float64)
        self.radius = np.array(at_rest.radius_px, np.float64)
        self.rest_brightness = np.array(at_rest.brightness, np.float64)
        self.rest_sigma_ratio = np.maximum(at_rest.sigma_px / np.median(at_rest.sigma_px), 1.0)
        self.ratio, self.off, self.some = np.empty(n), np.empty(n), np.empty(n)
        self.unknown, self.values = np.full(n, np.nan), np.empty(n, np.float32)
        self.suspect, self.trusted = np.empty(n, np.uint8), np.empty(n, np.uint8)

    def accepted(self, pins: Pins, motion: Array, residual: Array, seen: Mask, searched: bool) -> Mask:
        """(n,) the seen pins that are no outliers.

        pins              of n; ignored where not seen
        motion, residual  (n, 2) px since rest, and off what the neighbours predict; likewise
        seen              (n,) bool
        searched          the pins come from a search: a large sigma does not count, a larger residual is
                          allowed
        Raises            ValueError: sizes that do not fit
        """
        n = self.n
        sizes = {len(pins.brightness), len(pins.sigma_px), len(motion), len(residual), len(seen)}
        if sizes != {n} or motion.shape != (n, 2) or residual.shape != (n, 2):
            raise ValueError(f"arrays of {n} pins are wanted, not of {sorted(sizes)}")
        is_seen = np.array(seen, np.bool_).view(np.uint8)
        self.filter(
            np.ascontiguousarray(pins.brightness, np.float64),
            np.ascontiguousarray(pins.sigma_px, np.float64),
            np.ascontiguousarray(motion, np.float64),
            np.ascontiguousarray(residual, np.float64),
            self.unknown,
            is_seen,
            searched,
        )
        return is_seen.view(np.bool_)

    def filter(
        self,
        brightness: cython.const[cython.double][::1],
        sigma: cython.const[cython.double][::1],
        motion: cython.const[cython.double][:, ::1],
        residual: cython.const[cython.double][:, ::1],
        innovation2: cython.const[cython.double][::1],
        seen: cython.uchar[::1],
        searched: cython.bint,
    ) -> cython.void:
        """`accepted` for arrays of the right size; updates seen.

        innovation2  (n,) px2, square of the change of each residual; NaN where it is not known
        """
        i: cython.Py_ssize_t
        limit: cython.double
        residual_max: cython.double = self.residual_max_search if searched else self.residual_max
        some_suspect: cython.bint = False
        for i in range(self.n):
            limit = residual_max * self.local_pitch[i]
            self.suspect[i] = seen[i] and (
                residual[i, 0] * residual[i, 0] + residual[i, 1] * residual[i, 1] > limit * limit
            )
            some_suspect |= self.suspect[i]
        if not some_suspect:
            return
        self._find_trusted(brightness, sigma, seen, HUGE_VAL if searched else self.sigma_ratio_max)
        for i in range(self.n):
            self.off[i] = UNKNOWN
        for i in range(self.n):
            if self.suspect[i] and not self.trusted[i]:
                seen[i] = self._has_moved(sigma[i], residual, innovation2, i) or self._fits(
                    motion, i, residual_max
                )

    def _find_trusted(
        self,
        brightness: cython.const[cython.double][::1],
        sigma: cython.const[cython.double][::1],
        seen: cython.const[cython.uchar][::1],
        sigma_ratio_max: cython.double,
    ) -> cython.void:
        """The seen pins, one at least, of normal brightness and sigma."""
        i: cython.Py_ssize_t
        change_max: cython.double
        sigma_max: cython.double
        m: cython.Py_ssize_t = 0
        for i in range(self.n):
            self.ratio[i] = brightness[i] / self.rest_brightness[i]
            self.values[m] = self.ratio[i]
            m += seen[i]
        gain: cython.double = _median(self.values, m, self.median_halvings)
        for i in range(m):
            self.values[i] = fabs(self.values[i] - cython.cast(cython.float, gain))
        change_max = self.brightness_sigmas * _SIGMA_OF_MAD * _median(self.values, m, self.median_halvings)
        change_max = max(change_max, self.brightness_change_min * gain)
        m = 0
        for i in range(self.n):
            self.values[m] = sigma[i]
            m += seen[i]
        sigma_max = sigma_ratio_max * _median(self.values, m, self.median_halvings)
        self.gain = gain
        for i in range(self.n):
            self.trusted[i] = (
                seen[i]
                and not fabs(self.ratio[i] - gain) > change_max
                and not sigma[i] > sigma_max * self.rest_sigma_ratio[i]
            )

    def _has_moved(
        self,
        sigma: cython.double,
        residual: cython.const[cython.double][:, ::1],
        innovation2: cython.const[cython.double][::1],
        i: cython.Py_ssize_t,
    ) -> cython.bint:
        """Whether a pin has moved itself: light cannot have done it, and a speck would have come at once."""
        by_light: cython.double = self.radius[i] * (self.ratio[i] / self.gain - 1)
        reach2: cython.double = by_light * by_light + self.radius[i] * sigma
        limit: cython.double = self.residual_max * self.local_pitch[i]
        m: cython.Py_ssize_t
        if not residual[i, 0] * residual[i, 0] + residual[i, 1] * residual[i, 1] > reach2:
            return False
        m = self._gather(innovation2, i)
        if m > 0:
            limit = max(limit, self.residual_ratio * sqrt(select_kth(self.some, m, m - 1)))
        return innovation2[i] < limit * limit  # NaN is false

    def _fits(
        self, motion: cython.const[cython.double][:, ::1], i: cython.Py_ssize_t, residual_max: cython.double
    ) -> cython.bint:
        """Whether a pin fits the trusted ones nearly as closely as two thirds of its trusted neighbours
        do."""
        own: cython.double = self._off_trusted(motion, i)
        limit: cython.double = residual_max * self.local_pitch[i]
        c: cython.Py_ssize_t
        at: cython.Py_ssize_t
        m: cython.Py_ssize_t
        if own < limit * limit:
            return True
        for c in range(self.affine.k):
            at = self.affine.near[i, c]
            if self.trusted[at] and self.affine.weight[i, c] > 0 and self.off[at] == UNKNOWN:
                self.off[at] = self._off_trusted(motion, at)
        m = self._gather(self.off, i)
        if m == 0:
            return True
        limit = self.residual_ratio
        return own < limit * limit * select_kth(self.some, m, 2 * m // 3)

    def _gather(self, square: cython.const[cython.double][::1], i: cython.Py_ssize_t) -> cython.Py_ssize_t:
        """Copy the values of a pin's trusted neighbours to `some`, without negative ones and NaN; returns how
        many."""
        c: cython.Py_ssize_t
        at: cython.Py_ssize_t
        m: cython.Py_ssize_t = 0
        for c in range(self.affine.k):
            at = self.affine.near[i, c]
            if self.trusted[at] and self.affine.weight[i, c] > 0 and square[at] >= 0:
                self.some[m] = square[at]
                m += 1
        return m

    def _off_trusted(
        self, motion: cython.const[cython.double][:, ::1], i: cython.Py_ssize_t
    ) -> cython.double:
        """Square of a pin's distance from where the trusted ones predict it, px2; negative: too few are
        near.
        """
        fit: Fit = self.affine.fit(motion, self.trusted, i)
        dx: cython.double = motion[i, 0] - fit.x
        dy: cython.double = motion[i, 1] - fit.y
        return UNSUPPORTED if fit.support < self.support_min else dx * dx + dy * dy


@cython.cfunc
@cython.exceptval(check=False)
@cython.nogil
def _median(v: cython.float[::1], n: cython.Py_ssize_t, halvings: cython.int) -> cython.double:
    """Median of the first n >= 1 values, to 2^-halvings of their range.

    By halving the range and counting: counts are vectorised, while a selection's branches are unpredictable.
    """
    low: cython.float = v[0]
    high: cython.float = v[0]
    half: cython.float
    i: cython.int
    m: cython.int = n
    below: cython.int
    _halving: cython.int
    for i in range(m):
        low = v[i] if v[i] < low else low
        high = v[i] if v[i] > high else high
    for _halving in range(halvings):
        half = cython.cast(cython.float, 0.5) * (low + high)
        below = 0
        for i in range(m):
            below += v[i] < half
        if below > m // 2:
            high = half
        else:
            low = half
    return cython.cast(cython.double, low)
