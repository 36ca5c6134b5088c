"""One frame's fields on the surface's grid: heights through the area changes, divergence of the motion, and
their blend.

    area change --> heights -----.
                                  >-- contact field, in which contacts are looked for
    motion ------> divergence ---'

Rules
- A lost pin's cell changes as the skin between its neighbours does: by the determinant of the motion's
  gradient.
- With a fixed boundary the areas sum to a constant and so does the plain integral. The volume is therefore
  that of the compressed (positive) part. Rectified noise has a positive mean: heights below the noise's
  threshold count as zero, those above twice the threshold in full (firm shrinkage; Gao and Bruce,
  WaveShrink with firm shrinkage, Statistica Sinica 7, 1997), so that an untouched tip has volume zero and a
  pressed one no bias.
- The contact field is a blend. The divergence is sharp, while a cell's area averages over two pitches; but
  areas are less noisy where pins are poorly seen.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.features.params import PARAMS, FeatureParams
from edge.features.quantized_operator import QuantizedOperator
from edge.geometry.lattice import slope_stencil
from edge.types import Array

if cython.compiled:
    from cython.cimports.edge.geometry.plane import solve_plane
    from cython.cimports.libc.math import isnan
else:
    from math import isnan

    from edge.geometry.plane import solve_plane


@cython.cclass
class ContactField:
    """Fields of one frame of one tip; n pins, k points of the grid. All arrays are good until the next frame.

    area_change    (n,) float32, of the last `interpolate`, gaps filled
    heights        (k,) float32, the surface through them
    detrended      (2 n,) float32 px, the motion of the last `find_divergence` less its plane
    plane_divergence  float, the plane's share of `divergence`
    divergence     (k,) float32, relative change of area, to first order
    blend          (k,) float32, of both: the contact field

    rest_xy, pitch_px  (n, 2) px, and their pitch
    interpolator   (k, n): heights from the area changes
    divergences    (k, 2 n): divergence from the motion, x and y of the first pin, of the second, ...
    Raises         ValueError: sizes that do not fit
    """

    area_change = cython.declare(cython.float[::1], visibility="readonly")
    heights = cython.declare(cython.float[::1], visibility="readonly")
    detrended = cython.declare(cython.float[::1], visibility="readonly")
    divergence = cython.declare(cython.float[::1], visibility="readonly")
    blend = cython.declare(cython.float[::1], visibility="readonly")
    plane_divergence = cython.declare(cython.float, visibility="readonly")
    _n: cython.Py_ssize_t
    _interpolator: QuantizedOperator
    _divergences: QuantizedOperator
    _rest: cython.double[:, ::1]
    _ring: cython.int[:, ::1]
    _slope: cython.double[:, :, ::1]
    _gram: cython.double[:, ::1]  # (3, 5), a plane's equations for all pins; right sides zero
    _g: cython.double[:, ::1]  # scratch
    _divergence_rel: cython.float  # shares of the blend
    _heights_rel: cython.float

    def __init__(
        self,
        rest_xy: Array,
        pitch_px: float,
        interpolator: Array,
        divergences: Array,
        params: FeatureParams = PARAMS,
    ) -> None:
        n, k = len(rest_xy), len(interpolator)
        if rest_xy.shape != (n, 2) or interpolator.shape != (k, n) or divergences.shape != (k, 2 * n):
            raise ValueError(
                f"interpolator (k, {n}) and divergences (k, {2 * n}) are wanted for {n} pins (n, 2), not "
                f"{interpolator.shape}, {divergences.shape}, {rest_xy.shape}"
            )
        self._n = n
        self._rest = np.array(rest_xy, np.float64, order="C")
        self._ring, self._slope = slope_stencil(rest_xy, pitch_px)
        self._interpolator, self._divergences = (
            QuantizedOperator(interpolator),
            QuantizedOperator(divergences),
        )
        self.area_change, self.heights = self._interpolator.values, self._interpolator.result
        self.detrended, self.divergence = self._divergences.values, self._divergences.result
        self.blend = np.empty(k, np.float32)
        self.plane_divergence = 0.0
        self._gram, self._g = np.zeros((3, 5)), np.empty((3, 5))
        self._divergence_rel, self._heights_rel = params.divergence_rel, 1.0 - params.divergence_rel
        self._sum_gram()

    def interpolate(
        self,
        area_change: cython.const[cython.double][::1],
        xy: cython.const[cython.double][:, ::1],
        threshold: cython.float,
    ) -> float:
        """`heights` through the area changes, and the integral of their compressed part.

        area_change  (n,) float64, relative; NaN where lost
        xy           (n, 2) float64 px, where the pins are; finite
        threshold    heights below it are noise
        Returns      sum over the grid's points of the heights that count
        Raises       ValueError: sizes that do not fit
        """
        if area_change.shape[0] != self._n or xy.shape[0] != self._n or xy.shape[1] != 2:
            raise ValueError(f"area_change ({self._n},) and xy ({self._n}, 2) are wanted")
        i: cython.Py_ssize_t
        for i in range(self._n):
            self.area_change[i] = area_change[i]
            if isnan(area_change[i]):
                self.area_change[i] = self._area_change_between(xy, i)
        self._interpolator.apply()
        return self._compressed(threshold)

    def find_divergence(self, xy: cython.const[cython.double][:, ::1]) -> None:
        """`divergence` of the motion since rest.

        xy       (n, 2) float64 px, where the pins are; finite
        Raises   ValueError: sizes that do not fit
        """
        if xy.shape[0] != self._n or xy.shape[1] != 2:
            raise ValueError(f"xy ({self._n}, 2) is wanted")
        self._detrend(xy)
        self._divergences.apply()
        p: cython.Py_ssize_t
        for p in range(self.divergence.shape[0]):
            self.divergence[p] += self.plane_divergence

    def find_blend(self) -> None:
        """`blend` of the frame's heights and divergence."""
        p: cython.Py_ssize_t
        for p in range(self.blend.shape[0]):
            self.blend[p] = self._divergence_rel * self.divergence[p] + self._heights_rel * self.heights[p]

    @cython.cfunc
    @cython.exceptval(check=False)
    def _area_change_between(
        self, xy: cython.const[cython.double][:, ::1], i: cython.Py_ssize_t
    ) -> cython.float:
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
        return cython.cast(cython.float, (1.0 + xx) * (1.0 + yy) - xy_ * yx - 1.0)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _compressed(self, threshold: cython.float) -> cython.double:
        """Sum of the heights after firm shrinkage."""
        p: cython.Py_ssize_t
        ramp: cython.float
        total: cython.double = 0.0
        for p in range(self.heights.shape[0]):
            ramp = self.heights[p] - threshold
            if ramp > 0.0:
                total += cython.cast(cython.double, min(ramp + ramp, self.heights[p]))
        return total

    @cython.cfunc
    @cython.exceptval(check=False)
    def _sum_gram(self) -> cython.void:
        """The plane's equations for all pins, about the first one."""
        i: cython.Py_ssize_t
        x: cython.double
        y: cython.double
        for i in range(self._n):
            x = self._rest[i, 0] - self._rest[0, 0]
            y = self._rest[i, 1] - self._rest[0, 1]
            self._gram[0, 0] += 1.0
            self._gram[0, 1] += x
            self._gram[0, 2] += y
            self._gram[1, 1] += x * x
            self._gram[1, 2] += x * y
            self._gram[2, 2] += y * y

    @cython.cfunc
    @cython.exceptval(check=False)
    def _detrend(self, xy: cython.const[cython.double][:, ::1]) -> cython.void:
        """Motion less its plane: the plane's divergence is constant and added later, and the smaller values
        quantize more finely.
        """
        g: cython.double[:, ::1] = self._g
        i: cython.Py_ssize_t
        x: cython.double
        y: cython.double
        dx: cython.double
        dy: cython.double
        g[:, :] = self._gram
        for i in range(self._n):
            x = self._rest[i, 0] - self._rest[0, 0]
            y = self._rest[i, 1] - self._rest[0, 1]
            dx = xy[i, 0] - self._rest[i, 0]
            dy = xy[i, 1] - self._rest[i, 1]
            g[0, 3] += dx
            g[1, 3] += x * dx
            g[2, 3] += y * dx
            g[0, 4] += dy
            g[1, 4] += x * dy
            g[2, 4] += y * dy
        solve_plane(g)
        for i in range(self._n):
            x = self._rest[i, 0] - self._rest[0, 0]
            y = self._rest[i, 1] - self._rest[0, 1]
            dx = xy[i, 0] - self._rest[i, 0]
            dy = xy[i, 1] - self._rest[i, 1]
            self.detrended[2 * i] = dx - g[0, 3] - g[1, 3] * x - g[2, 3] * y
            self.detrended[2 * i + 1] = dy - g[0, 4] - g[1, 4] * x - g[2, 4] * y
        self.plane_divergence = g[1, 3] + g[2, 4]
