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

Where all pins are seen, or predicted, basis and sums are in single precision: an error of 1e-7 of the
motion. And they are real: mode (b, a) is the conjugate of mode (a, b), so that the sums of the latter's real
and imaginary part give the coefficients of both.

Terms of equal spin are made orthonormal over the rest pins (Gram-Schmidt, lowest degree first), which keeps
the spins and makes coefficients comparable; on a round layout terms of different spin are orthogonal anyway.

A kernel: compiled by Cython (see setup.py), and the same when it is not.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import math

import cython
import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Complex, Mask, Rest

if cython.compiled:
    from cython.cimports.libc.math import sqrt
else:
    from math import sqrt

#: Highest degree; a calibration file names its inputs by these modes, so it is part of the format.
DEGREE = 5
#: Powers (a, b) of z and conj(z).
MODE_POWERS = tuple((a, degree - a) for degree in range(DEGREE + 1) for a in range(degree, -1, -1))
#: Where (b, a) stands.
_MIRROR = tuple(MODE_POWERS.index((b, a)) for a, b in MODE_POWERS)
MODE_NAMES = tuple(f"c{a}{b}" for a, b in MODE_POWERS)
#: Padded length of a row of the basis: whole vectors.
ROW = cython.declare(cython.Py_ssize_t, 24)
#: A term of which less than this share is independent of the lower ones cannot be resolved: by the layout, it
#: is none; by the pins that are left, it stays bounded.
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


def _in_rows(basis: Complex) -> NDArray[np.float32]:
    """The basis (n, k) as (n, ROW): the real part where a >= b in a mode's powers, there the imaginary
    part of (b, a).
    """
    rows = np.zeros((len(basis), ROW), np.float32)
    for column, mirror in enumerate(_MIRROR):
        rows[:, column] = basis[:, column].real if column <= mirror else basis[:, mirror].imag
    return rows


@cython.final
@cython.cclass
class Modes:
    """Fits the modes of one tip by least squares."""

    def __init__(self, rest: Rest) -> None:
        basis = mode_basis(rest)
        n, k = basis.shape
        empty = np.where(np.any(basis, axis=0), 0.0, n)
        gram = basis.conj().T @ basis + np.diag(empty) + INDEPENDENT_REL * n * np.eye(k)
        self._n, self._k = n, k
        self._result_array = self._result = np.zeros(k, np.complex128)
        self._re, self._im = np.array(basis.real, order="C"), np.array(basis.imag, order="C")
        self._mirror = np.array(_MIRROR, np.int32)
        self._rows = _in_rows(basis @ np.linalg.inv(gram))
        self._sums = np.zeros((2, ROW), np.float32)
        self._gram_re, self._gram_im = np.array(gram.real, order="C"), np.array(gram.imag, order="C")
        self._factor_re, self._factor_im = np.empty((k, k)), np.empty((k, k))
        self._sum_re, self._sum_im = np.empty(k), np.empty(k)

    def fit(self, motion: Array, seen: Mask | None = None) -> Complex:
        """Least-squares coefficients over the seen pins.

        motion   (n, 2) float64 px, finite where seen
        seen     (n,) bool; None: all are
        Returns  (21,) complex128 px, terms `MODE_NAMES`
        Raises   ValueError: motion that is not finite
        """
        if seen is None or self._are_all(seen):
            self._fit_all(motion)
        else:
            self._sum_seen(motion, seen)
            self._subtract_lost(seen)
            if not self._solve():
                raise ValueError("modes: the equations have no solution")
        for j in range(self._k):
            self._result[j] = self._sum_re[j] + 1j * self._sum_im[j]
        result: Complex = self._result_array.copy()
        return result

    def _are_all(self, seen: Mask) -> bool:
        for i in range(self._n):  # noqa: SIM110
            if not seen[i]:
                return False
        return True

    def _fit_all(self, motion: Array) -> None:
        """Coefficients over all pins."""
        sums: cython.float[:, ::1] = self._sums
        m: cython.Py_ssize_t
        self._sum_all(motion)
        for j in range(self._k):  # of real part r and imaginary part i: r - i i, and r + i i of the conjugate
            m = self._mirror[j]
            if j == m:
                self._sum_re[j] = sums[0, j]
                self._sum_im[j] = sums[1, j]
            elif j < m:
                self._sum_re[j] = sums[0, j] + sums[1, m]
                self._sum_im[j] = sums[1, j] - sums[0, m]
                self._sum_re[m] = sums[0, j] - sums[1, m]
                self._sum_im[m] = sums[1, j] + sums[0, m]

    def _sum_all(self, motion: Array) -> None:
        """`_sums`, which stay in registers until all pins are in: ROW numbers each."""
        of_x: cython.float[24] = [0.0] * 24
        of_y: cython.float[24] = [0.0] * 24
        rows: cython.const[cython.float][:, ::1] = self._rows
        j: cython.Py_ssize_t
        for i in range(self._n):
            x = cython.cast(cython.float, motion[i, 0])
            y = cython.cast(cython.float, motion[i, 1])
            for j in range(24):
                of_x[j] += rows[i, j] * x
                of_y[j] += rows[i, j] * y
        for j in range(24):
            self._sums[0, j] = of_x[j]
            self._sums[1, j] = of_y[j]

    def _sum_seen(self, motion: Array, seen: Mask) -> None:
        """Sums over the seen pins of conj(basis) times motion."""
        for j in range(self._k):
            self._sum_re[j] = 0.0
            self._sum_im[j] = 0.0
        for i in range(self._n):
            if seen[i]:
                for j in range(self._k):
                    self._sum_re[j] += self._re[i, j] * motion[i, 0] + self._im[i, j] * motion[i, 1]
                    self._sum_im[j] += self._re[i, j] * motion[i, 1] - self._im[i, j] * motion[i, 0]

    def _subtract_lost(self, seen: Mask) -> None:
        """The equations of the seen pins: those of all, less those of the lost ones; lower triangle."""
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

    def _solve(self) -> bool:
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
