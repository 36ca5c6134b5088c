"""Relative area change of every pin's cell, lost ones included, and the volume of the compressed part.

    cells' areas --> area change --gaps filled--> of all n pins --> volume

Rules
- A lost pin's cell changes as the skin between its neighbours does: by the determinant of the motion's
  gradient.
- The volume is the paper's, the integral of the surface through the area changes. The pins' cells at rest
  tile the tip, so the sum over them is that integral; a grid adds nothing (docs/tuning.md, "Volume").
- With a fixed boundary the areas sum to a constant and so does the plain integral. The volume is therefore
  that of the compressed (positive) part. Rectified noise has a positive mean: changes below the noise's
  threshold count as zero, those above twice the threshold in full (firm shrinkage; Gao and Bruce,
  WaveShrink with firm shrinkage, Statistica Sinica 7, 1997), so that an untouched tip has volume zero and a
  pressed one no bias.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.geometry.lattice import slope_stencil
from edge.types import Array

if cython.compiled:
    from cython.cimports.libc.math import isnan
else:
    from math import isnan


@cython.final
@cython.cclass
class AreaChange:
    """Area changes of one frame of one tip with n pins; `values` (n,) float64, good until the next frame.

    rest_xy, pitch_px  (n, 2) px, and their pitch
    rest_area_px2      (n,) of each pin's cell at rest
    Raises             ValueError: sizes that do not fit
    """

    def __init__(self, rest_xy: Array, pitch_px: float, rest_area_px2: Array) -> None:
        n = len(rest_xy)
        if rest_xy.shape != (n, 2) or rest_area_px2.shape != (n,):
            raise ValueError(f"rest_xy (n, 2) and rest_area_px2 (n,) are wanted, not {rest_area_px2.shape}")
        self._n = n
        self._rest = np.ascontiguousarray(rest_xy, np.float64)
        self._rest_area = np.array(rest_area_px2, np.float64)
        self._inverse_area = 1.0 / rest_area_px2
        self._ring, self._slope = slope_stencil(rest_xy, pitch_px)
        self.values = np.zeros(n)

    def since_rest(self, area_px2: Array, out: Array) -> None:
        """Relative change of each cell's area, written to `out`; NaN where lost.

        area_px2, out  (n,) float64
        Raises         ValueError: another number of cells
        """
        if area_px2.shape[0] != self._n:
            raise ValueError(f"area_px2 ({self._n},) is wanted")
        i: cython.Py_ssize_t
        for i in range(self._n):
            out[i] = area_px2[i] * self._inverse_area[i] - 1.0

    def fill(self, change: Array, xy: Array) -> None:
        """`values`: the area changes, gaps filled.

        change  (n,) float64, relative; NaN where lost
        xy      (n, 2) float64 px, where the pins are; finite
        """
        i: cython.Py_ssize_t
        for i in range(self._n):
            self.values[i] = change[i]
            if isnan(change[i]):
                self.values[i] = self._between(xy, i)

    def volume(self, threshold: float) -> float:
        """Integral of the compressed part of `values`, px2; changes below the threshold are noise."""
        i: cython.Py_ssize_t
        ramp: cython.double
        total: cython.double = 0.0
        for i in range(self._n):
            ramp = self.values[i] - threshold
            if ramp > 0.0:
                total += self._rest_area[i] * min(ramp + ramp, self.values[i])
        return total

    def _between(self, xy: Array, i: cython.Py_ssize_t) -> float:
        """Area change at pin i by the motion of its ring: the determinant of the gradient, less 1."""
        j: cython.Py_ssize_t
        k: cython.Py_ssize_t
        x: cython.double
        y: cython.double
        xx: cython.double = 0.0
        xy_: cython.double = 0.0
        yx: cython.double = 0.0
        yy: cython.double = 0.0
        for k in range(self._ring.shape[1]):
            j = self._ring[i, k]
            x = xy[j, 0] - self._rest[j, 0]
            y = xy[j, 1] - self._rest[j, 1]
            xx += self._slope[i, 0, k] * x
            xy_ += self._slope[i, 1, k] * x
            yx += self._slope[i, 0, k] * y
            yy += self._slope[i, 1, k] * y
        return (1.0 + xx) * (1.0 + yy) - xy_ * yx - 1.0
