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
    from cython.cimports.edge.geometry.select import select_kth
    from cython.cimports.edge.pins.rejection import Answer
    from cython.cimports.libc.math import HUGE_VAL, NAN, isnan
else:
    from math import inf as HUGE_VAL  # noqa: N812
    from math import isnan
    from math import nan as NAN  # noqa: N812

    from edge.geometry.select import select_kth

    Answer = cython.struct(
        x=cython.double, y=cython.double, sigma=cython.double, amplitude=cython.double, fit=cython.double
    )

#: Pins are compared in their order along (1, slant), turned and scaled: along x, whole columns of a lattice
#: would come together.
_SLANT = cython.declare(cython.double, 0.3)


@cython.cclass
class CentroidFilter:
    """Rejects among the n pins of one tip.

    rest_amplitude       (n,) float64, levels
    fit_min              share of its window's variation that the disc has to explain
    amplitude_share_min  of the amplitude at rest, after the common gain
    clash_px             two centroids nearer than this lie on one blob
    """

    def __init__(
        self, rest_amplitude: Array, fit_min: float, amplitude_share_min: float, clash_px: float
    ) -> None:
        self.rest_amplitude = np.array(rest_amplitude, np.float64)
        self.n = self.rest_amplitude.shape[0]
        self.fit_min = fit_min
        self.amplitude_share_min = amplitude_share_min
        self.clash_slanted = clash_px * (1.0 + _SLANT * _SLANT) ** 0.5
        self.ratio = np.empty(self.n)
        self.order = np.arange(self.n, dtype=np.int32)
        self.along = np.empty(self.n)
        self.x, self.y = np.empty(self.n), np.empty(self.n)  # slanted, of the pins in that order

    def reject(self, found: Answer[::1], predicted: cython.const[cython.double][:, ::1]) -> cython.void:
        """NaN in x, y, sigma of the pins that do not count.

        found      (n,) as `centroids.ANSWER`; written
        predicted  (n, 2) px
        """
        i: cython.Py_ssize_t
        m: cython.Py_ssize_t = 0
        for i in range(self.n):
            if found[i].fit > self.fit_min:
                self.ratio[m] = found[i].amplitude / self.rest_amplitude[i]
                m += 1
        gain: cython.double = select_kth(self.ratio, m, m // 2) if m else 1.0
        least: cython.double = self.amplitude_share_min * gain
        for i in range(self.n):
            if not (found[i].fit > self.fit_min) or found[i].amplitude < least * self.rest_amplitude[i]:
                _forget(found, i)
        self._sort(found)
        self._reject_clashes(found, predicted)

    def _sort(self, found: Answer[::1]) -> cython.void:
        """`order` by `along`, lost pins last. It is kept from image to image, so it is nearly sorted
        already.
        """
        along: cython.double[::1] = self.along
        order: cython.int[::1] = self.order
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        who: cython.int
        for i in range(self.n):
            along[i] = HUGE_VAL if isnan(found[i].x) else found[i].x + _SLANT * found[i].y
        for i in range(1, self.n):
            who = order[i]
            j = i
            while j > 0 and along[order[j - 1]] > along[who]:
                order[j] = order[j - 1]
                j -= 1
            order[j] = who

    def _reject_clashes(
        self, found: Answer[::1], predicted: cython.const[cython.double][:, ::1]
    ) -> cython.void:
        """Of two pins on one blob the one that moved further is lost."""
        x: cython.double[::1] = self.x
        y: cython.double[::1] = self.y
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        m: cython.Py_ssize_t = 0  # of the pins that are not lost, which come first in order
        dx: cython.double
        dy: cython.double
        clash: cython.double = self.clash_slanted
        while m < self.n and self.along[self.order[m]] < HUGE_VAL:
            x[m] = self.along[self.order[m]]
            y[m] = found[self.order[m]].y - _SLANT * found[self.order[m]].x
            m += 1
        for i in range(m):
            for j in range(i + 1, m):
                dx = x[j] - x[i]
                if dx > clash:
                    break
                dy = y[j] - y[i]  # NaN where one is lost by now
                if dx * dx + dy * dy <= clash * clash:
                    self._reject_one(found, predicted, i, j)

    def _reject_one(
        self,
        found: Answer[::1],
        predicted: cython.const[cython.double][:, ::1],
        i: cython.Py_ssize_t,
        j: cython.Py_ssize_t,
    ) -> cython.void:
        """The i-th or the j-th in order: the one that moved further."""
        if not _went2(found, predicted, self.order[i]) > _went2(found, predicted, self.order[j]):
            i = j
        _forget(found, self.order[i])
        self.y[i] = NAN


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
@cython.nogil
def _forget(found: Answer[::1], i: cython.Py_ssize_t) -> cython.void:
    found[i].x = NAN
    found[i].y = NAN
    found[i].sigma = NAN


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
@cython.nogil
def _went2(
    found: Answer[::1], predicted: cython.const[cython.double][:, ::1], i: cython.Py_ssize_t
) -> cython.double:
    """Squared distance from the prediction, px2."""
    dx: cython.double = found[i].x - predicted[i, 0]
    dy: cython.double = found[i].y - predicted[i, 1]
    return dx * dx + dy * dy
