"""The points of a frame to tessellate: the pins, missing ones predicted, and the points round them.

A kernel (`CONTRIBUTING.md`, "Kernels"): compiled by Cython, and the same when it is not.

Rules
- A missing pin stands where the motion of the seen ones makes it most likely to be (`edge.cells.missing`).
  The motion off that prediction changes little from frame to frame: what is left of the last frame's motion
  is subtracted from all pins before they predict, and added again.
- The points round the pins move as the rim pins do (`edge.cells.boundary.RimMotion`).
- The rim pins' weights are in single precision: 1e-7 of their motion beside the affine one.
- One pin's motion is subtracted from all before sums are formed, so that an origin far away costs no digits.
"""

# mypy: disable-error-code="attr-defined,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.cells.boundary import RimMotion
from edge.geometry.neighbours import short_rows
from edge.types import Array, Index


@cython.final
@cython.cclass
class FramePoints:
    """Places the points of one tip's frames.

    rest_xy      (n, 2) float64, px; the pins at rest
    rim_motion   how the b points round the tip follow its r rim pins
    around_rest  (b, 2) float64, px; those points at rest
    xy_img       (n + b, 2) float64, px; where all of them are in this frame
    area_px2     (n,) float64; of the pins' cells, which `Mesh.follow` writes
    Raises       ValueError: sizes that do not fit, a rim pin that does not exist
    """

    def __init__(self, rest_xy: Array, rim_motion: RimMotion, around_rest: Array) -> None:
        rim, rim_terms, fit, terms, near, weight = rim_motion
        n, r, b = len(rest_xy), len(rim), len(around_rest)
        sizes = (rest_xy.shape, around_rest.shape, rim_terms.shape, fit.shape, terms.shape)
        wanted = ((n, 2), (b, 2), (r, 3), (3, r), (b, 3))
        if sizes != wanted or near.shape != weight.shape or near.ndim != 2 or len(near) > b:
            raise ValueError(
                f"rest_xy, around_rest, rim_terms, fit, terms: {wanted} and near, weight: (up to {b}, k) are "
                f"wanted, not {sizes} and {near.shape}, {weight.shape}"
            )
        if r < 1 or rim.min() < 0 or rim.max() >= n:
            raise ValueError(f"rim: 1 or more pins of 0 to {n - 1} are wanted")
        if near.size and (near.min() < 0 or near.max() >= r):
            raise ValueError(f"near: rim pins of 0 to {r - 1} are wanted")
        self.n_pins = n
        self.xy_img = self.points = np.concatenate([rest_xy, around_rest]).astype(np.float64, order="C")
        self.area_px2 = self.area = np.empty(n)
        self.rest = np.ascontiguousarray(rest_xy, np.float64)
        self.rim = np.array(rim, np.int32)
        self.rim_terms = np.array(rim_terms, np.float64, order="C")
        self.fit = np.array(fit, np.float64, order="C")
        self.terms = np.array(terms, np.float64, order="C")
        self.near = short_rows(2 * near)
        self.weight = np.array(weight, np.float32, order="C")
        self.around_rest = np.array(around_rest, np.float64, order="C")
        self.residual = np.zeros(2 * r)
        self.motion = np.zeros(2 * n)
        self.left = np.zeros(2 * n)
        self.pull = np.zeros(2 * n)
        self.set_missing(np.empty(0, np.int32), np.empty((0, 2 * n)), np.empty((0, 0)))

    def set_missing(self, missing: Index, rows: Array, inverse: Array) -> None:
        """Which pins are missing from now on.

        missing   (m,) int32, ascending; fewer than there are pins
        rows      (2 m, 2 n) float64, their rows of the precision of the pins' motion
        inverse   (2 m, 2 m) float64, the inverse of their own block of it
        Raises    ValueError: sizes that do not fit, no such pin
        """
        n, m = self.n_pins, len(missing)
        if rows.shape != (2 * m, 2 * n) or inverse.shape != (2 * m, 2 * m):
            raise ValueError(
                f"rows {(2 * m, 2 * n)} and inverse {(2 * m, 2 * m)} are wanted for {m} missing pins of {n}, "
                f"not {rows.shape}, {inverse.shape}"
            )
        wanted = np.array(missing, np.int32)
        if m >= n or (m and (wanted.min() < 0 or wanted.max() >= n or (np.diff(wanted) <= 0).any())):
            raise ValueError(f"missing: fewer than {n} pins of 0 to {n - 1}, ascending, are wanted")
        self.n_missing = m
        self.missing = wanted
        self.rows = np.array(rows, np.float64, order="C")
        self.inverse = np.array(inverse, np.float64, order="C")

    def place(self, xy: cython.const[cython.double][:, ::1], autocorrelation: cython.double) -> cython.int:
        """Write `xy_img` of one frame, where that of the last frame is, if that counts.

        xy               (n, 2) float64, px; rows of missing pins are not used
        autocorrelation  of the pins' motion off that of their neighbours with that of the last frame; 0: this
                         frame alone counts
        Raises           ValueError: sizes that do not fit
        """
        n: cython.Py_ssize_t = self.n_pins
        out: cython.double[:, ::1] = self.points
        if xy.shape[0] != n or xy.shape[1] != 2:
            raise ValueError(f"xy ({n}, 2) is wanted")
        i: cython.Py_ssize_t
        if self.n_missing:
            for i in range(n):
                self.left[2 * i] = self.left[2 * i + 1] = 0.0
                if autocorrelation > 0.0:
                    self.left[2 * i] = autocorrelation * (out[i, 0] - self.rest[i, 0])
                    self.left[2 * i + 1] = autocorrelation * (out[i, 1] - self.rest[i, 1])
        for i in range(n):
            out[i, 0] = xy[i, 0]
            out[i, 1] = xy[i, 1]
        if self.n_missing:
            self._fill_missing(out)
        self._carry_around(out)
        return 0

    def _fill_missing(self, points: cython.double[:, ::1]) -> cython.void:
        """Put each missing pin to its conditional mean, given the seen ones and what is left of the last
        frame.
        """
        n: cython.Py_ssize_t = self.n_pins
        m: cython.Py_ssize_t = self.n_missing
        i: cython.Py_ssize_t
        k: cython.Py_ssize_t
        first: cython.Py_ssize_t = 0
        while first < m and self.missing[first] == first:
            first += 1
        left: cython.double[::1] = self.left
        shift_x: cython.double = points[first, 0] - self.rest[first, 0] - left[2 * first]
        shift_y: cython.double = points[first, 1] - self.rest[first, 1] - left[2 * first + 1]
        for i in range(n):
            self.motion[2 * i] = points[i, 0] - self.rest[i, 0] - left[2 * i] - shift_x
            self.motion[2 * i + 1] = points[i, 1] - self.rest[i, 1] - left[2 * i + 1] - shift_y
        for k in range(m):
            i = self.missing[k]
            self.motion[2 * i] = self.motion[2 * i + 1] = 0.0
        for k in range(2 * m):
            self.pull[k] = _dot(self.rows, k, self.motion, 2 * n)
        for k in range(m):
            i = self.missing[k]
            left[2 * i] += self.rest[i, 0] + shift_x - _dot(self.inverse, 2 * k, self.pull, 2 * m)
            left[2 * i + 1] += self.rest[i, 1] + shift_y - _dot(self.inverse, 2 * k + 1, self.pull, 2 * m)
            points[i, 0] = left[2 * i]
            points[i, 1] = left[2 * i + 1]

    def _carry_around(self, points: cython.double[:, ::1]) -> cython.void:
        """Move the points round the tip with the rim pins."""
        rest: cython.const[cython.double][:, ::1] = self.rest
        rim: cython.int[::1] = self.rim
        fit: cython.double[:, ::1] = self.fit
        rim_terms: cython.double[:, ::1] = self.rim_terms
        terms: cython.double[:, ::1] = self.terms
        around: cython.double[:, ::1] = self.around_rest
        near: cython.ushort[:, ::1] = self.near
        weights: cython.float[:, ::1] = self.weight
        residual: cython.double[::1] = self.residual
        n: cython.Py_ssize_t = self.n_pins
        i: cython.Py_ssize_t = rim[0]
        k: cython.Py_ssize_t
        j: cython.Py_ssize_t
        shift_x: cython.double = points[i, 0] - rest[i, 0]
        shift_y: cython.double = points[i, 1] - rest[i, 1]
        x: cython.double
        y: cython.double
        weight: cython.double
        # Coefficients of the affine terms, and the residual.
        x0: cython.double = 0.0
        x1: cython.double = 0.0
        x2: cython.double = 0.0
        y0: cython.double = 0.0
        y1: cython.double = 0.0
        y2: cython.double = 0.0
        for k in range(rim.shape[0]):
            i = rim[k]
            x = points[i, 0] - rest[i, 0] - shift_x
            y = points[i, 1] - rest[i, 1] - shift_y
            residual[2 * k] = x
            residual[2 * k + 1] = y
            x0 += fit[0, k] * x
            x1 += fit[1, k] * x
            x2 += fit[2, k] * x
            y0 += fit[0, k] * y
            y1 += fit[1, k] * y
            y2 += fit[2, k] * y
        for k in range(rim.shape[0]):
            residual[2 * k] -= x0 * rim_terms[k, 0] + x1 * rim_terms[k, 1] + x2 * rim_terms[k, 2]
            residual[2 * k + 1] -= y0 * rim_terms[k, 0] + y1 * rim_terms[k, 1] + y2 * rim_terms[k, 2]
        for k in range(around.shape[0]):
            x = x0 * terms[k, 0] + x1 * terms[k, 1] + x2 * terms[k, 2]
            y = y0 * terms[k, 0] + y1 * terms[k, 1] + y2 * terms[k, 2]
            if k < near.shape[0]:
                for j in range(near.shape[1]):
                    i = near[k, j]
                    weight = weights[k, j]
                    x += weight * residual[i]
                    y += weight * residual[i + 1]
            points[n + k, 0] = around[k, 0] + shift_x + x
            points[n + k, 1] = around[k, 1] + shift_y + y


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
def _dot(
    rows: cython.double[:, ::1], k: cython.Py_ssize_t, b: cython.double[::1], n: cython.Py_ssize_t
) -> cython.double:
    """Row k times b, in four independent sums, which the processor runs in parallel."""
    s0: cython.double = 0.0
    s1: cython.double = 0.0
    s2: cython.double = 0.0
    s3: cython.double = 0.0
    i: cython.Py_ssize_t = 0
    while i + 4 <= n:
        s0 += rows[k, i] * b[i]
        s1 += rows[k, i + 1] * b[i + 1]
        s2 += rows[k, i + 2] * b[i + 2]
        s3 += rows[k, i + 3] * b[i + 3]
        i += 4
    while i < n:
        s0 += rows[k, i] * b[i]
        i += 1
    return (s0 + s1) + (s2 + s3)
