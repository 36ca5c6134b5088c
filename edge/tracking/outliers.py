"""Photometric outliers: pins whose brightness or centroid sigma is unlike their own at rest.

A kernel: compiled by Cython, and the same when it is not.

Idea: stray light beside a pin biases its centroid, and a speck may lie where a dark pin was. A pin with an
anomalous brightness or sigma is therefore accepted only with a small residual, or if light can move it by
less than its neighbours' prediction is wrong: pins come close near a contact, and each one's light falls
into the other's window. The limits come from the frame itself: from the gain that all pins share and the
scatter of the others, scaled by the pin's own ratio at rest (permanent glare is no anomaly).
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
    from cython.cimports.libc.math import HUGE_VAL, fabs
else:
    from math import fabs
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

    at_rest         how bright each pin is at rest, and its sigma
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
        if (
            at_rest.brightness.shape != (n,)
            or at_rest.sigma_px.shape != (n,)
            or np.shape(local_pitch_px) != (n,)
        ):
            raise ValueError(f"brightness, sigma_px and local_pitch_px of {n} numbers each are wanted")
        self.n = n
        self.affine = affine
        self.ratio = params.outlier_ratio
        self.brightness_change_min = params.brightness_change_min
        self.sigma_ratio_max = params.sigma_ratio_max
        self.support_min = params.support_min
        self.most2 = np.square(params.outlier_residual_max * local_pitch_px)
        self.rest_brightness = np.array(at_rest.brightness, np.float64)
        self.radius = np.array(at_rest.radius_px, np.float64)
        self.rest_sigma_ratio = np.maximum(at_rest.sigma_px / np.median(at_rest.sigma_px), 1.0)
        self.off, self.values = np.empty(n), np.empty(n)
        self.suspect, self.trusted = np.empty(n, np.uint8), np.empty(n, np.uint8)

    def accepted(self, pins: Pins, motion: Array, residual: Array, seen: Mask, searched: bool) -> Mask:
        """(n,) the seen pins that are no outliers.

        pins              of n; ignored where not seen
        motion, residual  (n, 2) px since rest, and off what the neighbours predict; likewise
        seen              (n,) bool
        searched          the pins come from a search: a large sigma does not count
        Raises            ValueError: sizes that do not fit
        """
        n = self.n
        sizes = {len(pins.brightness), len(pins.sigma_px), len(motion), len(residual), len(seen)}
        if sizes != {n} or motion.shape != (n, 2) or residual.shape != (n, 2):
            raise ValueError(f"arrays of {n} pins are wanted, not of {sorted(sizes)}")
        is_seen = np.array(seen, np.bool_).view(np.uint8)
        if self.find_suspects(residual.astype(np.float32).ravel(), is_seen):
            self.filter(
                np.ascontiguousarray(pins.brightness, np.float64),
                np.ascontiguousarray(pins.sigma_px, np.float64),
                np.ascontiguousarray(motion, np.float64),
                is_seen,
                searched,
            )
        return is_seen.view(np.bool_)

    def find_suspects(
        self,
        residual: cython.const[cython.float][::1],
        seen: cython.const[cython.uchar][::1],
    ) -> cython.bint:
        """The seen pins whose residual is so large that they must not be outliers; whether there are any."""
        most2: cython.double[::1] = self.most2
        suspect: cython.uchar[::1] = self.suspect
        i: cython.Py_ssize_t
        x: cython.double
        y: cython.double
        some: cython.uchar = 0
        for i in range(self.n):
            x = residual[2 * i]
            y = residual[2 * i + 1]
            suspect[i] = (x * x + y * y > most2[i]) & seen[i]
            some |= suspect[i]
        return some != 0

    def filter(
        self,
        brightness: cython.const[cython.double][::1],
        sigma: cython.const[cython.double][::1],
        motion: cython.const[cython.double][:, ::1],
        seen: cython.uchar[::1],
        searched: cython.bint,
    ) -> cython.void:
        """`accepted` where `find_suspects` found any, for arrays of the right size; updates seen."""
        i: cython.Py_ssize_t
        gain: cython.double
        change: cython.double
        gain = self._find_trusted(brightness, sigma, seen, HUGE_VAL if searched else self.sigma_ratio_max)
        for i in range(self.n):
            self.off[i] = UNKNOWN
        for i in range(self.n):
            if self.suspect[i] and not self.trusted[i]:
                # Light moves a disc by its radius times the share that is not the disc's, at most; sigma is
                # the radius times the square of the share that the disc does not explain.
                change = self.radius[i] * (brightness[i] / (gain * self.rest_brightness[i]) - 1.0)
                seen[i] = self._fits(motion, i, change * change + self.radius[i] * sigma[i])

    def _find_trusted(
        self,
        brightness: cython.const[cython.double][::1],
        sigma: cython.const[cython.double][::1],
        seen: cython.const[cython.uchar][::1],
        sigma_ratio_max: cython.double,
    ) -> cython.double:
        """The seen pins, one at least, of normal brightness and sigma; returns the gain that all share."""
        off: cython.double[::1] = self.off
        values: cython.double[::1] = self.values
        at_rest: cython.double[::1] = self.rest_brightness
        sigma_ratio: cython.double[::1] = self.rest_sigma_ratio
        trusted: cython.uchar[::1] = self.trusted
        i: cython.Py_ssize_t
        gain: cython.double
        change_max: cython.double
        sigma_max: cython.double
        m: cython.Py_ssize_t = 0
        for i in range(self.n):
            off[i] = brightness[i] / at_rest[i]
            values[m] = off[i]
            m += seen[i]
        gain = select_kth(values, m, m // 2)
        for i in range(m):
            values[i] = fabs(values[i] - gain)
        change_max = self.ratio * _SIGMA_OF_MAD * select_kth(values, m, m // 2)
        change_max = max(change_max, self.brightness_change_min * gain)
        m = 0
        for i in range(self.n):
            values[m] = sigma[i]
            m += seen[i]
        sigma_max = sigma_ratio_max * select_kth(values, m, m // 2)
        for i in range(self.n):
            trusted[i] = (
                seen[i] & (not fabs(off[i] - gain) > change_max) & (not sigma[i] > sigma_max * sigma_ratio[i])
            )
        return gain

    def _fits(
        self,
        motion: cython.const[cython.double][:, ::1],
        i: cython.Py_ssize_t,
        light2: cython.double,
    ) -> cython.bint:
        """Whether a pin fits the trusted ones nearly as closely as two thirds of its trusted neighbours do,
        or light can have moved it by less than those are off.

        light2  square of how far light can have moved its centroid, px2
        """
        own: cython.double = self._off_trusted(motion, i)
        ratio2: cython.double = self.ratio * self.ratio
        c: cython.Py_ssize_t
        at: cython.Py_ssize_t
        m: cython.Py_ssize_t = 0
        above: cython.Py_ssize_t = 0
        if own < self.most2[i]:
            return True
        own = min(own, ratio2 * light2)
        for c in range(self.affine.k):
            at = self.affine.near[i, c]
            if not self.trusted[at] or not self.affine.weight[i, c] > 0:
                continue
            if self.off[at] == UNKNOWN:
                self.off[at] = self._off_trusted(motion, at)
            if self.off[at] >= 0:
                above += own < ratio2 * self.off[at]
                m += 1
        return m == 0 or m - above <= 2 * m // 3

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
