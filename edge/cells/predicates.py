"""On which side of a line, and whether within a circle: with exact signs.

A floating-point value with an error bound decides where it can. Where it cannot, the determinant is summed
without rounding, as an expansion: a number as a sum of doubles that do not overlap, smallest first.

Source  Shewchuk, Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates, Discrete
        and Computational Geometry 18, 1997.
"""

# mypy: disable-error-code="untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.types import Array

if cython.compiled:
    from cython.cimports.libc.math import fabs, fma
else:
    from fractions import Fraction
    from math import fabs

    def fma(a: float, b: float, c: float) -> float:
        """a b + c, rounded once."""
        return float(Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c)))


# Error over the sum of the terms' magnitudes: 2 differences, a product, a sum, each half an ulp.
ORIENT_BOUND = cython.declare(cython.double, 4.0 * 2.0**-53)
# Error over the permanent of the 3 x 3 determinant: 10, and the rounding of the permanent.
INCIRCLE_BOUND = cython.declare(cython.double, 12.0 * 2.0**-53)
# Terms do not overlap and are at least 2 bits apart; doubles span 2098 bits.
MAX_TERMS = cython.declare(cython.Py_ssize_t, 1056)

# Expansions in the work space: three coordinates each, and intermediate results.
X = cython.declare(cython.Py_ssize_t, 0)
Y = cython.declare(cython.Py_ssize_t, 3)
LIFT = cython.declare(cython.Py_ssize_t, 6)
MINOR = cython.declare(cython.Py_ssize_t, 7)
DETERMINANT = cython.declare(cython.Py_ssize_t, 8)
N_EXPANSIONS = cython.declare(cython.Py_ssize_t, 9)


@cython.cclass
class Predicates:
    """Predicates on points whose coordinates may change between calls.

    x, y  (n,) float64; a product of four differences of coordinates must neither over- nor underflow
    """

    def __init__(self, x: Array, y: Array) -> None:
        if x.shape != y.shape:
            raise ValueError(f"x and y of one length are wanted, not {x.shape} and {y.shape}")
        self.x = x
        self.y = y
        self.term = np.zeros((N_EXPANSIONS, MAX_TERMS))
        self.n_terms = np.zeros(N_EXPANSIONS, np.intp)

    def orient(self, a: cython.Py_ssize_t, b: cython.Py_ssize_t, c: cython.Py_ssize_t) -> cython.double:
        """Above 0: points a, b, c turn counter-clockwise."""
        left: cython.double = (self.x[b] - self.x[a]) * (self.y[c] - self.y[a])
        right: cython.double = (self.y[b] - self.y[a]) * (self.x[c] - self.x[a])
        det: cython.double = left - right
        if fabs(det) > ORIENT_BOUND * (fabs(left) + fabs(right)):
            return det
        return self.orient_exact(a, b, c)

    def incircle(
        self, a: cython.Py_ssize_t, b: cython.Py_ssize_t, c: cython.Py_ssize_t, d: cython.Py_ssize_t
    ) -> cython.double:
        """Above 0: point d lies inside the circle through a, b, c, which turn counter-clockwise."""
        ax: cython.double = self.x[a] - self.x[d]
        ay: cython.double = self.y[a] - self.y[d]
        bx: cython.double = self.x[b] - self.x[d]
        by: cython.double = self.y[b] - self.y[d]
        cx: cython.double = self.x[c] - self.x[d]
        cy: cython.double = self.y[c] - self.y[d]
        bxcy: cython.double = bx * cy
        bycx: cython.double = by * cx
        cxay: cython.double = cx * ay
        cyax: cython.double = cy * ax
        axby: cython.double = ax * by
        aybx: cython.double = ay * bx
        a2: cython.double = ax * ax + ay * ay
        b2: cython.double = bx * bx + by * by
        c2: cython.double = cx * cx + cy * cy
        det: cython.double = a2 * (bxcy - bycx) + b2 * (cxay - cyax) + c2 * (axby - aybx)
        permanent: cython.double = (
            a2 * (fabs(bxcy) + fabs(bycx)) + b2 * (fabs(cxay) + fabs(cyax)) + c2 * (fabs(axby) + fabs(aybx))
        )
        if fabs(det) > INCIRCLE_BOUND * permanent:
            return det
        return self.incircle_exact(a, b, c, d)

    def orient_exact(self, a: cython.Py_ssize_t, b: cython.Py_ssize_t, c: cython.Py_ssize_t) -> cython.double:
        """As `orient`, without the filter; good to an ulp or two."""
        self._difference(X, self.x[b], self.x[a])
        self._difference(Y, self.y[b], self.y[a])
        self._difference(X + 1, self.x[c], self.x[a])
        self._difference(Y + 1, self.y[c], self.y[a])
        self.n_terms[DETERMINANT] = 0
        self._add_product(DETERMINANT, X, Y + 1, 1.0)
        self._add_product(DETERMINANT, Y, X + 1, -1.0)
        return self._value(DETERMINANT)

    def incircle_exact(
        self, a: cython.Py_ssize_t, b: cython.Py_ssize_t, c: cython.Py_ssize_t, d: cython.Py_ssize_t
    ) -> cython.double:
        """As `incircle`, without the filter; good to an ulp or two."""
        self._difference(X, self.x[a], self.x[d])
        self._difference(Y, self.y[a], self.y[d])
        self._difference(X + 1, self.x[b], self.x[d])
        self._difference(Y + 1, self.y[b], self.y[d])
        self._difference(X + 2, self.x[c], self.x[d])
        self._difference(Y + 2, self.y[c], self.y[d])
        self.n_terms[DETERMINANT] = 0
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        k: cython.Py_ssize_t
        for i in range(3):
            j = 0 if i == 2 else i + 1
            k = 2 if i == 0 else i - 1
            self.n_terms[LIFT] = 0
            self._add_product(LIFT, X + i, X + i, 1.0)
            self._add_product(LIFT, Y + i, Y + i, 1.0)
            self.n_terms[MINOR] = 0
            self._add_product(MINOR, X + j, Y + k, 1.0)
            self._add_product(MINOR, Y + j, X + k, -1.0)
            self._add_product(DETERMINANT, LIFT, MINOR, 1.0)
        return self._value(DETERMINANT)

    def _add(self, e: cython.Py_ssize_t, number: cython.double) -> cython.void:
        """Expansion e += number."""
        kept: cython.Py_ssize_t = 0
        i: cython.Py_ssize_t
        y: cython.double
        total: cython.double
        virtual: cython.double
        low: cython.double
        for i in range(self.n_terms[e]):
            y = self.term[e, i]
            total = number + y
            virtual = total - number
            low = (number - (total - virtual)) + (y - virtual)
            if low != 0.0:
                self.term[e, kept] = low
                kept += 1
            number = total
        if number != 0.0 and kept < MAX_TERMS:
            self.term[e, kept] = number
            kept += 1
        self.n_terms[e] = kept

    def _difference(self, e: cython.Py_ssize_t, a: cython.double, b: cython.double) -> cython.void:
        """Expansion e = a - b."""
        high: cython.double = a - b
        virtual: cython.double = a - high
        low: cython.double = (a - (high + virtual)) + (virtual - b)
        n: cython.Py_ssize_t = 0
        if low != 0.0:
            self.term[e, n] = low
            n += 1
        if high != 0.0:
            self.term[e, n] = high
            n += 1
        self.n_terms[e] = n

    def _add_product(
        self, out: cython.Py_ssize_t, a: cython.Py_ssize_t, b: cython.Py_ssize_t, sign: cython.double
    ) -> cython.void:
        """Expansion out += sign a b."""
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        product: cython.double
        for i in range(self.n_terms[a]):
            for j in range(self.n_terms[b]):
                product = self.term[a, i] * self.term[b, j]
                self._add(out, sign * fma(self.term[a, i], self.term[b, j], -product))
                self._add(out, sign * product)

    def _value(self, e: cython.Py_ssize_t) -> cython.double:
        """The expansion as a double: exact in sign, in value to an ulp or two."""
        total: cython.double = 0.0
        i: cython.Py_ssize_t
        for i in range(self.n_terms[e]):
            total += self.term[e, i]
        return total
