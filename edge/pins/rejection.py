"""Which centroids count: those of spots that look like their pin, each on a blob of its own. Compiled; runs
uncompiled too.

- The disc must explain enough of its window, and be bright enough beside the pin at rest. Illumination may
  have changed for all pins at once: brightness is compared after the gain that they share.
- No blob is assigned to two pins: of a pair closer than their clash distance the one that moved further from
  its prediction is lost.
"""

# mypy: disable-error-code="untyped-decorator,valid-type,attr-defined"

from __future__ import annotations

import cython
import numpy as np

from edge.types import Array

if cython.compiled:
    from cython.cimports.edge.geometry.neighbours import Separation
    from cython.cimports.edge.geometry.select import select_kth
    from cython.cimports.libc.math import HUGE_VAL, NAN, isnan, sqrt
else:
    from math import inf as HUGE_VAL  # noqa: N812
    from math import isnan, sqrt
    from math import nan as NAN  # noqa: N812

    from edge.geometry.neighbours import Separation
    from edge.geometry.select import select_kth

#: Pins are compared in their order along (1, slant), turned and scaled: along x, whole columns of a lattice
#: would come together.
_SLANT = cython.declare(cython.double, 0.3)


@cython.cclass
class CentroidFilter:
    """Rejects among the n pins of one tip.

    rest_amplitude  (n,) float64, levels
    share_min       of its window's variation that the disc has to explain, and of the amplitude at rest that
                    is left after the common gain
    clash_px        two centroids nearer than this lie on one blob
    """

    def __init__(self, rest_amplitude: Array, share_min: float, clash_px: float) -> None:
        self.rest_amplitude = np.array(rest_amplitude, np.float64)
        self.n = self.rest_amplitude.shape[0]
        self.share_min = share_min
        self.scale = (1.0 + _SLANT * _SLANT) ** 0.5
        self.clash_slanted = clash_px * self.scale
        self.ratio = np.empty(self.n)
        self.order = np.arange(self.n, dtype=np.int32)
        self.along = np.empty(self.n)
        self.x, self.y = np.empty(self.n), np.empty(self.n)  # slanted, of the pins in that order
        self.separation = Separation(self.n)

    def reject(
        self,
        xy: cython.double[:, ::1],
        sigma: cython.double[::1],
        amplitude: cython.const[cython.double][::1],
        fit: cython.const[cython.double][::1],
        predicted: cython.const[cython.double][:, ::1],
    ) -> cython.void:
        """NaN in xy and sigma of the pins that do not count.

        xy, sigma, amplitude, fit  of `CentroidKernel`; xy and sigma are written
        predicted                  (n, 2) px
        """
        i: cython.Py_ssize_t
        m: cython.Py_ssize_t = 0
        gain: cython.double
        low: cython.double = HUGE_VAL
        high: cython.double = 0.0
        for i in range(self.n):
            if fit[i] > self.share_min:
                gain = amplitude[i] / self.rest_amplitude[i]
                low = gain if gain < low else low
                high = gain if gain > high else high
                self.ratio[m] = gain
                m += 1
            else:
                xy[i, 0] = xy[i, 1] = sigma[i] = NAN
        if not low > self.share_min * high:  # else none is too dim, whatever the gain
            self._reject_dim(xy, sigma, amplitude, m)
        if not self.separation.holds(xy):
            self._sort(xy)
            self._reject_clashes(xy, sigma, predicted)

    def _reject_dim(
        self,
        xy: cython.double[:, ::1],
        sigma: cython.double[::1],
        amplitude: cython.const[cython.double][::1],
        m: cython.Py_ssize_t,
    ) -> cython.void:
        """The pins that are too dim beside the gain, the median of the first m of `ratio`, are lost."""
        i: cython.Py_ssize_t
        gain: cython.double = select_kth(self.ratio, m, m // 2) if m else 1.0
        least: cython.double = self.share_min * gain
        for i in range(self.n):
            if amplitude[i] < least * self.rest_amplitude[i]:
                xy[i, 0] = xy[i, 1] = sigma[i] = NAN

    def _sort(self, xy: cython.const[cython.double][:, ::1]) -> cython.void:
        """`order` by `along`, lost pins last. It is kept from image to image, so it is nearly sorted
        already.
        """
        along: cython.double[::1] = self.along
        order: cython.int[::1] = self.order
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        who: cython.int
        for i in range(self.n):
            along[i] = HUGE_VAL if isnan(xy[i, 0]) else xy[i, 0] + _SLANT * xy[i, 1]
        for i in range(1, self.n):
            who = order[i]
            j = i
            while j > 0 and along[order[j - 1]] > along[who]:
                order[j] = order[j - 1]
                j -= 1
            order[j] = who

    def _reject_clashes(
        self,
        xy: cython.double[:, ::1],
        sigma: cython.double[::1],
        predicted: cython.const[cython.double][:, ::1],
    ) -> cython.void:
        """Of two pins on one blob the one that moved further is lost."""
        x: cython.double[::1] = self.x
        y: cython.double[::1] = self.y
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        m: cython.Py_ssize_t = 0  # of the pins that are not lost, which come first in order
        dx: cython.double
        dy: cython.double
        distance2: cython.double
        clash: cython.double = self.clash_slanted
        nearest2: cython.double = HUGE_VAL  # of two that do not clash
        while m < self.n and self.along[self.order[m]] < HUGE_VAL:
            x[m] = self.along[self.order[m]]
            y[m] = xy[self.order[m], 1] - _SLANT * xy[self.order[m], 0]
            m += 1
        for i in range(m):
            for j in range(i + 1, m):
                dx = x[j] - x[i]
                if dx * dx > nearest2:
                    break
                dy = y[j] - y[i]  # NaN where one is lost by now
                distance2 = dx * dx + dy * dy
                if distance2 <= clash * clash:
                    self._reject_one(xy, sigma, predicted, i, j)
                elif distance2 < nearest2:
                    nearest2 = distance2
        self.separation.renew(xy, (sqrt(nearest2) - clash) / self.scale)

    def _reject_one(
        self,
        xy: cython.double[:, ::1],
        sigma: cython.double[::1],
        predicted: cython.const[cython.double][:, ::1],
        i: cython.Py_ssize_t,
        j: cython.Py_ssize_t,
    ) -> cython.void:
        """The i-th or the j-th in order: the one that moved further."""
        if not _went2(xy, predicted, self.order[i]) > _went2(xy, predicted, self.order[j]):
            i = j
        self.y[i] = NAN
        i = self.order[i]
        xy[i, 0] = xy[i, 1] = sigma[i] = NAN


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
@cython.nogil
def _went2(
    xy: cython.const[cython.double][:, ::1],
    predicted: cython.const[cython.double][:, ::1],
    i: cython.Py_ssize_t,
) -> cython.double:
    """Squared distance from the prediction, px2."""
    dx: cython.double = xy[i, 0] - predicted[i, 0]
    dy: cython.double = xy[i, 1] - predicted[i, 1]
    return dx * dx + dy * dy
