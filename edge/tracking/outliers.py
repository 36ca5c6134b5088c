# cython: infer_types=True
"""The neighbours of a pin predict its motion, and tell whether it is an outlier.

A kernel: compiled by Cython, and the same when it is not.

LocalAffine: over two rings of neighbours the motion of the skin is nearly affine. The map is fitted to the
known neighbours of a pin, weighted by a Gaussian of their distance, and evaluated at the pin; the pin's own
motion does not enter.

PhotometricFilter: stray light beside a pin biases its centroid, and a speck may lie where a dark pin was. A
pin with a brightness or centroid sigma unlike its own at rest is therefore accepted only with a small
residual, or if light can move it by less than its neighbours' prediction is wrong: pins come close near a
contact, and each one's light falls into the other's window. The limits come from the frame itself: from the
gain that all pins share and the scatter of the others, scaled by the pin's own ratio at rest (permanent glare
is no anomaly).
"""

import cython
import numpy as np
from cython.cimports.libc.math import fabs

from edge.geometry.lattice import Lattice
from edge.geometry.neighbours import short_rows
from edge.geometry.select import SIGMA_OF_MAD
from edge.tracking.params import TrackingParams
from edge.types import Array, Mask, Pins

if cython.compiled:
    from cython.cimports.edge.geometry.select import select_kth
else:
    from edge.geometry.select import select_kth

    #: The predicted motion, px, and the sum of the neighbours' weights.
    Fit = cython.struct(x=cython.double, y=cython.double, support=cython.double)

HUGE_VAL = cython.declare(cython.double, float("inf"))

#: The normal equations of one pin: sums over its known neighbours of weight, offset and motion.
Sums = cython.struct(
    w=cython.double, x=cython.double, y=cython.double,
    xx=cython.double, xy=cython.double, yy=cython.double,
    mx=cython.double, my=cython.double,
    xmx=cython.double, xmy=cython.double, ymx=cython.double, ymy=cython.double,
)  # fmt: skip
#: Weight that keeps the equations solvable where no neighbour is known.
NO_NEIGHBOUR = cython.declare(cython.double, 1e-9)
#: Standard deviation of normal noise, in median absolute deviations.
_SIGMA_OF_MAD = cython.declare(cython.double, SIGMA_OF_MAD)
UNKNOWN = cython.declare(cython.double, -2)
UNSUPPORTED = cython.declare(cython.double, -1)


class LocalAffine:
    """The maps of the n pins of one tip.

    lattice  its near (n, k) int32, weight (n, k) >= 0 and offset (n, k, 2) in pitches are used
    ridge    on the gradient, in neighbours' weights: below three neighbours the map turns into a shift
    Raises   ValueError: sizes that do not fit, a neighbour that does not exist
    """

    def __init__(self, lattice: Lattice, ridge: float) -> None:
        n, k = lattice.near.shape
        if lattice.weight.shape != (n, k) or lattice.offset.shape != (n, k, 2):
            raise ValueError(
                f"weight {(n, k)} and offset {(n, k, 2)} are wanted, not {lattice.weight.shape} and "
                f"{lattice.offset.shape}"
            )
        if not n or not k or lattice.near.min() < 0 or lattice.near.max() >= n:
            raise ValueError(f"near: 1 or more neighbours of 0 to {n - 1} are wanted for each pin")
        self.n = n
        self.k = k
        self.near = short_rows(lattice.near)
        self.weight = np.array(lattice.weight, np.float32, order="C")
        self.offset = np.array(lattice.offset, np.float32, order="C")
        self.ridge = ridge

    def predict(self, motion: Array, known: Mask) -> tuple[Array, Array, Array]:
        """Motion of each pin as predicted by its known neighbours.

        motion   (n, 2) float64, px; ignored where not known
        known    (n,) bool
        Returns  (n, 2) motion, px; (n,) sum of the neighbours' weights; (n, 2, 2) gradient, px per pitch:
                 along x, along y
        Raises   ValueError: sizes that do not fit
        """
        moved: cython.const[cython.double][:, ::1] = np.ascontiguousarray(motion, np.float64)
        is_known: cython.const[cython.uchar][::1] = np.ascontiguousarray(known, np.bool_).view(np.uint8)
        n: cython.Py_ssize_t = self.n
        if moved.shape[0] != n or moved.shape[1] != 2 or is_known.shape[0] != n:
            raise ValueError(
                f"motion ({n}, 2) and known ({n},) are wanted, not {motion.shape} and {known.shape}"
            )
        predicted = values, supports, gradients = np.empty((n, 2)), np.empty(n), np.empty((n, 2, 2))
        value: cython.double[:, ::1] = values
        support: cython.double[::1] = supports
        gradient: cython.double[:, :, ::1] = gradients
        for i in range(n):
            s = _sums(self, moved, is_known, i)
            one = _solve(s)
            value[i, 0] = one.x
            value[i, 1] = one.y
            support[i] = one.support
            b = s.xy * s.y - s.x * s.yy
            c = s.x * s.xy - s.xx * s.y
            det = s.w * (s.xx * s.yy - s.xy * s.xy) + s.x * b + s.y * c
            e = s.x * s.y - s.w * s.xy
            f = s.w * s.yy - s.y * s.y
            g = s.w * s.xx - s.x * s.x
            gradient[i, 0, 0] = (b * s.mx + f * s.xmx + e * s.ymx) / det
            gradient[i, 0, 1] = (b * s.my + f * s.xmy + e * s.ymy) / det
            gradient[i, 1, 0] = (c * s.mx + e * s.xmx + g * s.ymx) / det
            gradient[i, 1, 1] = (c * s.my + e * s.xmy + g * s.ymy) / det
        return predicted

    def matrix(self) -> Array:
        """(n, n) `predict` where all pins are known, as one product; most of it is zero."""
        result = np.zeros((self.n, self.n))
        rows: cython.double[:, ::1] = result
        one: cython.double[:, ::1] = np.zeros((self.n, 2))
        known: cython.uchar[::1] = np.ones(self.n, np.uint8)
        for i in range(self.n):
            for c in range(self.k):  # of the others nothing reaches this pin
                at: cython.Py_ssize_t = self.near[i, c]
                one[at, 0] = 1.0
                rows[i, at] = self.fit(one, known, i).x
                one[at, 0] = 0.0
        return result

    def fit(
        self,
        motion: cython.const[cython.double][:, ::1],
        known: cython.const[cython.uchar][::1],
        i: cython.Py_ssize_t,
    ) -> Fit:
        """The motion that the known neighbours of pin i predict, and the sum of their weights."""
        return _solve(_sums(self, motion, known, i))


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
@cython.nogil
def _sums(
    affine: LocalAffine,
    motion: cython.const[cython.double][:, ::1],
    known: cython.const[cython.uchar][::1],
    i: cython.Py_ssize_t,
) -> Sums:
    at: cython.Py_ssize_t
    s: Sums = Sums(NO_NEIGHBOUR, 0, 0, affine.ridge, 0, affine.ridge, 0, 0, 0, 0, 0, 0)
    for c in range(affine.k):
        at = affine.near[i, c]
        weight = cython.cast(cython.double, affine.weight[i, c])
        if not known[at] or weight <= 0:
            continue
        u = cython.cast(cython.double, affine.offset[i, c, 0])
        v = cython.cast(cython.double, affine.offset[i, c, 1])
        x = weight * u
        y = weight * v
        s.w += weight
        s.x += x
        s.y += y
        s.xx += x * u
        s.xy += x * v
        s.yy += y * v
        s.mx += weight * motion[at, 0]
        s.my += weight * motion[at, 1]
        s.xmx += x * motion[at, 0]
        s.xmy += x * motion[at, 1]
        s.ymx += y * motion[at, 0]
        s.ymy += y * motion[at, 1]
    return s


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
@cython.nogil
def _solve(s: Sums) -> Fit:
    """Cramer's rule for the value at the pin itself, where the offset is zero."""
    a: cython.double = s.xx * s.yy - s.xy * s.xy
    b: cython.double = s.xy * s.y - s.x * s.yy
    c: cython.double = s.x * s.xy - s.xx * s.y
    det: cython.double = s.w * a + s.x * b + s.y * c
    return Fit((a * s.mx + b * s.xmx + c * s.ymx) / det, (a * s.my + b * s.xmy + c * s.ymy) / det, s.w)


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
        arrays = (at_rest.brightness, at_rest.sigma_px, at_rest.radius_px, local_pitch_px)
        if any(np.shape(a) != (n,) for a in arrays):
            raise ValueError(f"brightness, sigma_px, radius_px and local_pitch_px of {n} pins are wanted")
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
        self.off, self.values, self.gain = np.empty(n), np.empty(n), 1.0
        self.trusted = np.empty(n, np.uint8)

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
        brightness = np.ascontiguousarray(pins.brightness, np.float64)
        sigma = np.ascontiguousarray(pins.sigma_px, np.float64)
        if self.find_doubts(brightness, sigma, is_seen, searched):
            off, moved = residual.astype(np.float32).ravel(), np.ascontiguousarray(motion, np.float64)
            self.filter(brightness, sigma, off, moved, is_seen)
        return is_seen.view(np.bool_)

    def find_doubts(
        self,
        brightness: cython.const[cython.double][::1],
        sigma: cython.const[cython.double][::1],
        seen: cython.const[cython.uchar][::1],
        searched: cython.bint,
    ) -> cython.bint:
        """Find the seen pins, one at least, that are not trusted: of anomalous brightness or sigma; whether
        there are any.
        """
        off: cython.double[::1] = self.off
        values: cython.double[::1] = self.values
        at_rest: cython.double[::1] = self.rest_brightness
        sigma_ratio: cython.double[::1] = self.rest_sigma_ratio
        trusted: cython.uchar[::1] = self.trusted
        some: cython.uchar = 0
        sigmas: cython.double = self.ratio * _SIGMA_OF_MAD  # that count, in median absolute deviations
        sigma_ratio_max: cython.double = HUGE_VAL if searched else self.sigma_ratio_max
        m: cython.Py_ssize_t = 0
        within: cython.Py_ssize_t = 0
        low: cython.double = HUGE_VAL
        high: cython.double = 0.0
        narrowest: cython.double = HUGE_VAL
        widest: cython.double = 0.0
        for i in range(self.n):
            off[i] = HUGE_VAL
            if seen[i]:
                bright = brightness[i] / at_rest[i]
                wide = sigma[i] / sigma_ratio[i]
                off[i] = bright
                low = low if low < bright else bright
                high = high if high > bright else bright
                narrowest = narrowest if narrowest < sigma[i] else sigma[i]
                widest = widest if widest > wide else wide
                m += 1
        # No median is needed where half of the pins or more are so near to the dimmest one, as many to the
        # brightest and to the one with the largest sigma, that these are near enough to it.
        least = high / (1.0 + self.brightness_change_min)
        most = low / (1.0 - self.brightness_change_min)
        widest /= sigma_ratio_max
        are_narrow: cython.bint = narrowest >= widest or self._below(sigma, widest) <= m // 2
        are_alike: cython.bint = low >= least or self._below(off, least) <= m // 2
        if are_narrow and are_alike and (high <= most or self._below(off, most) > m // 2):
            return False
        m = 0
        for i in range(self.n):
            values[m] = off[i]
            m += seen[i]
        gain = select_kth(values, m, m // 2)
        change_max = self.brightness_change_min * gain
        for i in range(m):
            values[i] = fabs(values[i] - gain)
            within += sigmas * values[i] <= change_max
        if within <= m // 2:  # else the median is
            change_max = sigmas * select_kth(values, m, m // 2)
        sigma_max = HUGE_VAL
        if not are_narrow:
            m = 0
            for i in range(self.n):
                values[m] = sigma[i]
                m += seen[i]
            sigma_max = sigma_ratio_max * select_kth(values, m, m // 2)
        for i in range(self.n):
            trusted[i] = (
                seen[i] & (not fabs(off[i] - gain) > change_max) & (not sigma[i] > sigma_max * sigma_ratio[i])
            )
            some |= seen[i] ^ trusted[i]
        self.gain = gain
        return some != 0

    def _below(self, values: cython.const[cython.double][::1], limit: cython.double) -> cython.Py_ssize_t:
        """How many of the pins have less."""
        below: cython.Py_ssize_t = 0
        for i in range(self.n):
            below = below + 1 if values[i] < limit else below  # in vectors
        return below

    def filter(
        self,
        brightness: cython.const[cython.double][::1],
        sigma: cython.const[cython.double][::1],
        residual: cython.const[cython.float][::1],
        motion: cython.const[cython.double][:, ::1],
        seen: cython.uchar[::1],
    ) -> cython.void:
        """`accepted` where `find_doubts` found any, for arrays of the right size; updates seen."""
        x: cython.double
        y: cython.double
        for i in range(self.n):
            self.off[i] = UNKNOWN
        for i in range(self.n):
            if seen[i] and not self.trusted[i]:
                x = residual[2 * i]
                y = residual[2 * i + 1]
                if x * x + y * y > self.most2[i]:
                    # Light moves a disc by its radius times the share that is not the disc's, at most; sigma
                    # is the radius times the square of the share that the disc does not explain.
                    change = self.radius[i] * (brightness[i] / (self.gain * self.rest_brightness[i]) - 1.0)
                    seen[i] = self._fits(motion, i, change * change + self.radius[i] * sigma[i])

    def _fits(
        self, motion: cython.const[cython.double][:, ::1], i: cython.Py_ssize_t, light2: cython.double
    ) -> cython.bint:
        """Whether a pin fits the trusted ones nearly as closely as two thirds of its trusted neighbours do,
        or light can have moved it by less than those are off.

        light2  square of how far light can have moved its centroid, px2
        """
        own: cython.double = self._off_trusted(motion, i)
        ratio2: cython.double = self.ratio * self.ratio
        m: cython.Py_ssize_t = 0
        closer: cython.Py_ssize_t = 0  # neighbours, or not so much farther off
        left: cython.Py_ssize_t = self.affine.k
        if own < self.most2[i]:
            return True
        own = min(own, ratio2 * light2)
        for c in range(self.affine.k):
            left -= 1
            at = self.affine.near[i, c]
            if self.trusted[at] and self.affine.weight[i, c] > 0:
                if self.off[at] == UNKNOWN:
                    self.off[at] = self._off_trusted(motion, at)
                if self.off[at] >= 0:
                    closer += not own < ratio2 * self.off[at]
                    m += 1
            if closer + left <= 2 * (m + left) // 3:  # whatever those left are
                return True
            if closer > 2 * (m + left) // 3:
                return False
        return True

    def _off_trusted(
        self, motion: cython.const[cython.double][:, ::1], i: cython.Py_ssize_t
    ) -> cython.double:
        """Square of a pin's distance from where the trusted ones predict it, px2; negative: few are near."""
        fit: Fit = self.affine.fit(motion, self.trusted, i)
        dx: cython.double = motion[i, 0] - fit.x
        dy: cython.double = motion[i, 1] - fit.y
        return UNSUPPORTED if fit.support < self.support_min else dx * dx + dy * dy
