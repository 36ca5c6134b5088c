"""Noise of a pin, measured from the pins' motion: behind glare it is 3 to 10 times what their sigmas
claim.

Idea: over two pitches the motion of the skin is nearly a quadratic of the rest place. A pin's
residual from the quadratic through its two rings is its error.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.geometry.lattice import residual_stencil
from edge.geometry.neighbours import weighted_rows
from edge.geometry.select import SIGMA_OF_MAD
from edge.types import Array

if cython.compiled:
    from cython.cimports.edge.geometry.neighbours import weighted_sums
    from cython.cimports.edge.geometry.select import median
    from cython.cimports.libc.math import fabs
else:
    from math import fabs

    from edge.geometry.neighbours import weighted_sums
    from edge.geometry.select import median

#: Standard deviation of normal noise over the median of its size.
_SIGMA_OF_MAD = cython.declare(cython.double, SIGMA_OF_MAD)


@cython.cclass
class PinNoise:
    """Measures the noise of the n pins of one tip."""

    _rest: cython.const[cython.double][:, ::1]
    _start: cython.int[::1]
    _near: cython.ushort[::1]
    _weight: cython.float[::1]
    _motion: cython.float[::1]  # (2 n,), single precision: its error is 1e-6 px
    _residual: cython.float[::1]
    _sizes: cython.double[::1]

    def __init__(self, rest_xy: Array, pitch_px: float) -> None:
        self._rest = np.ascontiguousarray(rest_xy, np.float64)
        self._start, self._near, self._weight = weighted_rows(*residual_stencil(rest_xy, pitch_px))
        self._motion, self._residual = np.zeros((2, 2 * len(rest_xy)), np.float32)
        self._sizes = np.empty(2 * len(rest_xy))

    def sigma_px(
        self, xy: cython.const[cython.double][:, ::1], seen: cython.const[cython.uchar][::1]
    ) -> float:
        """Noise of one coordinate of a pin: robust to a few outliers.

        xy       (n, 2) float64 px, where the pins are; finite
        seen     (n,) bool
        Returns  px, one sigma; 0 where no pin is seen
        Raises   ValueError: sizes that do not fit
        """
        n: cython.Py_ssize_t = self._rest.shape[0]
        if xy.shape[0] != n or xy.shape[1] != 2 or seen.shape[0] != n:
            raise ValueError(f"xy ({n}, 2) and seen ({n},) are wanted")
        i: cython.Py_ssize_t
        n_sizes: cython.Py_ssize_t = 0
        motion: cython.float[::1] = self._motion
        residual: cython.float[::1] = self._residual
        sizes: cython.double[::1] = self._sizes
        for i in range(n):
            motion[2 * i] = cython.cast(cython.float, xy[i, 0] - self._rest[i, 0])
            motion[2 * i + 1] = cython.cast(cython.float, xy[i, 1] - self._rest[i, 1])
        weighted_sums(self._start, self._near, self._weight, motion, residual)
        for i in range(n):
            if seen[i]:
                sizes[n_sizes] = fabs(residual[2 * i])
                sizes[n_sizes + 1] = fabs(residual[2 * i + 1])
                n_sizes += 2
        return _SIGMA_OF_MAD * median(sizes, n_sizes) if n_sizes else 0.0
