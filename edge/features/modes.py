"""The pins' motion as a few numbers with known behaviour under rotation.

The motion is written as a complex number d = dx + i dy, a pin's place on the tip's unit disc as
z = x + i y. A vector polynomial of degree D is then the sum over a + b <= D of

    d(z) = sum c_ab z^a conj(z)^b          (D+1)(D+2)/2 complex coefficients

with c_00 translation, Re c_10 expansion, Im c_10 rotation, c_01 pure shear, and so on.

Why complex: when tip and touch are rotated together by an angle t, c_ab is multiplied by exp(i s t) with
the `spin` s = 1 - a + b, and so is a product of coefficients with the sum of their spins. A round tip has no
preferred direction, so a shear (spin 1) can depend only on products of spin 1, a depth only on products of
spin 0. That leaves a tenth of the terms of an unrestricted polynomial: few calibration frames are enough, and
the direction is right all the way round.

Terms of equal spin are made orthonormal over the rest pins (Gram-Schmidt, lowest degree first), which keeps
the spins and makes coefficients comparable; on a round layout terms of different spin are orthogonal anyway.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import math

import cython
import numpy as np

from edge.features.params import PARAMS, FeatureParams
from edge.types import Array, Complex, Rest

if cython.compiled:
    from cython.cimports.libc.math import sqrt
else:
    from math import sqrt

#: Highest degree; a calibration file names its inputs by these modes, so it is part of the format.
DEGREE = 5
#: Powers (a, b) of z and conj(z).
MODE_POWERS = tuple((a, degree - a) for degree in range(DEGREE + 1) for a in range(degree, -1, -1))
MODE_NAMES = tuple(f"c{a}{b}" for a, b in MODE_POWERS)
#: Padded length of a row of the basis, and pins of a block: even numbers of independent sums, which the
#: processor runs in parallel.
ROW, BLOCK = 22, 4
#: A term of which less than this share is independent of the lower ones cannot be resolved by the layout.
INDEPENDENT_REL = 1e-6


def mode_basis(rest: Rest) -> Complex:
    """(n, 21) the modes at the pins at rest; zero where the layout cannot resolve the term (too few pins)."""
    xy = (rest.xy_img - rest.pattern.centre_img) / rest.pattern.tip_radius_px
    z = xy[:, 0] + 1j * xy[:, 1]
    basis = np.column_stack([z**a * np.conj(z) ** b for a, b in MODE_POWERS])
    n = len(basis)
    by_spin: dict[int, list[int]] = {}
    for column, (a, b) in enumerate(MODE_POWERS):
        lower = by_spin.setdefault(1 - a + b, [])
        v = basis[:, column]
        length = float(np.linalg.norm(v))
        for _ in range(2):  # twice is enough (Giraud et al. 2005)
            v = v - basis[:, lower] @ (basis[:, lower].conj().T @ v) / n
        left = float(np.linalg.norm(v))
        if left > INDEPENDENT_REL * length:
            basis[:, column] = v * (math.sqrt(n) / left)
            lower.append(column)
        else:
            basis[:, column] = 0.0
    return basis


def _in_blocks(basis: Complex) -> Array:
    """The basis (n, k) flat, of each four pins: a row re and a row im of the first, of the second, ..."""
    n, k = basis.shape
    rows = np.zeros((-(-n // BLOCK) * BLOCK, 2, ROW))
    rows[:n, 0, :k], rows[:n, 1, :k] = basis.real, basis.imag
    return rows.ravel()


@cython.cclass
class Modes:
    """Fits the modes of one tip by least squares."""

    _n: cython.Py_ssize_t
    _k: cython.Py_ssize_t  # modes
    _re: cython.double[:, ::1]  # (n, k), the basis
    _im: cython.double[:, ::1]
    _blocks: cython.double[::1]  # the same, as `_in_blocks` lays it out
    _solved_blocks: cython.double[::1]  # basis times inverse Gram matrix: the sums are the coefficients
    _motion: cython.double[:, ::1]  # (n filled up to whole blocks, 2), zero where not seen
    _gram_re: cython.double[:, ::1]  # (k, k), of all pins
    _gram_im: cython.double[:, ::1]
    _factor_re: cython.double[:, ::1]  # (k, k), scratch
    _factor_im: cython.double[:, ::1]
    _sum: cython.double[::1]  # a row re and a row im: the sums, which become the coefficients
    _sum_re: cython.double[::1]  # (k,), the same memory
    _sum_im: cython.double[::1]

    def __init__(self, rest: Rest, params: FeatureParams = PARAMS) -> None:
        basis = mode_basis(rest)
        n, k = basis.shape
        empty = np.where(np.any(basis, axis=0), 0.0, n)
        gram = basis.conj().T @ basis + np.diag(empty) + params.modes_ridge * np.eye(k)
        self._n, self._k = n, k
        self._re, self._im = np.array(basis.real, order="C"), np.array(basis.imag, order="C")
        self._blocks = _in_blocks(basis)
        self._solved_blocks = _in_blocks(basis @ np.linalg.inv(gram))
        self._motion = np.zeros((-(-n // BLOCK) * BLOCK, 2))
        self._gram_re, self._gram_im = np.array(gram.real, order="C"), np.array(gram.imag, order="C")
        sums = np.zeros(2 * ROW)
        self._factor_re, self._factor_im = np.empty((k, k)), np.empty((k, k))
        self._sum, self._sum_re, self._sum_im = sums, sums[:k], sums[ROW : ROW + k]

    def fit(
        self,
        motion: cython.const[cython.double][:, ::1],
        seen: cython.const[cython.uchar][::1],
    ) -> Complex:
        """Least-squares coefficients over the seen pins.

        motion   (n, 2) float64 px, finite where seen
        seen     (n,) bool
        Returns  (21,) complex128 px, terms `MODE_NAMES`
        Raises   ValueError: sizes that do not fit, motion that is not finite
        """
        n: cython.Py_ssize_t = self._n
        j: cython.Py_ssize_t
        if motion.shape[0] != n or motion.shape[1] != 2 or seen.shape[0] != n:
            raise ValueError(f"motion ({n}, 2) and seen ({n},) are wanted")
        if self._take(motion, seen):
            self._sum_up(self._solved_blocks)
        else:
            self._sum_up(self._blocks)
            self._subtract_lost(seen)
            if not self._solve():
                raise ValueError("modes: the equations have no solution")
        result = np.empty(self._k, np.complex128)
        out: cython.doublecomplex[::1] = result
        for j in range(self._k):
            out[j] = self._sum_re[j] + 1j * self._sum_im[j]
        return result

    @cython.cfunc
    @cython.exceptval(check=False)
    def _take(
        self, motion: cython.const[cython.double][:, ::1], seen: cython.const[cython.uchar][::1]
    ) -> cython.bint:
        """Copy the seen pins' motion; whether these are all."""
        i: cython.Py_ssize_t
        everyone: cython.bint = True
        for i in range(self._n):
            if seen[i]:
                self._motion[i, 0] = motion[i, 0]
                self._motion[i, 1] = motion[i, 1]
            else:
                self._motion[i, 0] = 0.0
                self._motion[i, 1] = 0.0
                everyone = False
        return everyone

    @cython.cfunc
    @cython.exceptval(check=False)
    def _sum_up(self, b: cython.double[::1]) -> cython.void:
        """Sums over the pins of conj(basis) times motion, four pins at a time.

        A quarter of the loads and stores of a frame; and constant offsets within one array, so that the C
        compiler vectorises over neighbouring modes: 40,000 instructions for 331 pins, 91,000 pin by pin.
        """
        s: cython.double[::1] = self._sum
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        o: cython.Py_ssize_t = 0
        x0: cython.double
        y0: cython.double
        x1: cython.double
        y1: cython.double
        x2: cython.double
        y2: cython.double
        x3: cython.double
        y3: cython.double
        for j in range(44):
            s[j] = 0.0
        for i in range(0, self._motion.shape[0], 4):
            x0 = self._motion[i, 0]
            y0 = self._motion[i, 1]
            x1 = self._motion[i + 1, 0]
            y1 = self._motion[i + 1, 1]
            x2 = self._motion[i + 2, 0]
            y2 = self._motion[i + 2, 1]
            x3 = self._motion[i + 3, 0]
            y3 = self._motion[i + 3, 1]
            for j in range(22):
                s[j] = (
                    s[j]
                    + (b[o + j] * x0 + b[o + 22 + j] * y0)
                    + (b[o + 44 + j] * x1 + b[o + 66 + j] * y1)
                    + (b[o + 88 + j] * x2 + b[o + 110 + j] * y2)
                    + (b[o + 132 + j] * x3 + b[o + 154 + j] * y3)
                )
                s[22 + j] = (
                    s[22 + j]
                    + (b[o + j] * y0 - b[o + 22 + j] * x0)
                    + (b[o + 44 + j] * y1 - b[o + 66 + j] * x1)
                    + (b[o + 88 + j] * y2 - b[o + 110 + j] * x2)
                    + (b[o + 132 + j] * y3 - b[o + 154 + j] * x3)
                )
            o += 176

    @cython.cfunc
    @cython.exceptval(check=False)
    def _subtract_lost(self, seen: cython.const[cython.uchar][::1]) -> cython.void:
        """The equations of the seen pins: those of all, less those of the lost ones; lower triangle."""
        i: cython.Py_ssize_t
        r: cython.Py_ssize_t
        c: cython.Py_ssize_t
        p: cython.double
        q: cython.double
        for r in range(self._k):
            for c in range(r + 1):
                self._factor_re[r, c] = self._gram_re[r, c]
                self._factor_im[r, c] = self._gram_im[r, c]
        for i in range(self._n):
            if seen[i]:
                continue
            for r in range(self._k):  # conj(b_r) b_c
                p = self._re[i, r]
                q = self._im[i, r]
                for c in range(r + 1):
                    self._factor_re[r, c] -= p * self._re[i, c] + q * self._im[i, c]
                    self._factor_im[r, c] -= p * self._im[i, c] - q * self._re[i, c]

    @cython.cfunc
    @cython.exceptval(check=False)
    def _solve(self) -> cython.bint:
        """Cholesky: the sums become the solution of the equations in `_factor`; False if there is none."""
        k: cython.Py_ssize_t = self._k
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        m: cython.Py_ssize_t
        re: cython.double
        im: cython.double
        for j in range(k):
            for i in range(j, k):
                re = self._factor_re[i, j]
                im = self._factor_im[i, j]
                for m in range(j):  # row i times conj(row j)
                    re -= self._factor_re[i, m] * self._factor_re[j, m]
                    re -= self._factor_im[i, m] * self._factor_im[j, m]
                    im -= self._factor_im[i, m] * self._factor_re[j, m]
                    im += self._factor_re[i, m] * self._factor_im[j, m]
                if i == j:
                    if not re > 0.0:
                        return False
                    self._factor_re[j, j] = sqrt(re)
                    self._factor_im[j, j] = 0.0
                else:
                    self._factor_re[i, j] = re / self._factor_re[j, j]
                    self._factor_im[i, j] = im / self._factor_re[j, j]
        for i in range(k):
            re = self._sum_re[i]
            im = self._sum_im[i]
            for m in range(i):
                re -= self._factor_re[i, m] * self._sum_re[m] - self._factor_im[i, m] * self._sum_im[m]
                im -= self._factor_re[i, m] * self._sum_im[m] + self._factor_im[i, m] * self._sum_re[m]
            self._sum_re[i] = re / self._factor_re[i, i]
            self._sum_im[i] = im / self._factor_re[i, i]
        for j in range(k):
            i = k - 1 - j
            re = self._sum_re[i]
            im = self._sum_im[i]
            for m in range(i + 1, k):  # conj of column i
                re -= self._factor_re[m, i] * self._sum_re[m] + self._factor_im[m, i] * self._sum_im[m]
                im -= self._factor_re[m, i] * self._sum_im[m] - self._factor_im[m, i] * self._sum_re[m]
            self._sum_re[i] = re / self._factor_re[i, i]
            self._sum_im[i] = im / self._factor_re[i, i]
        return True
