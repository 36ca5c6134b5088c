"""The pins' motion as a few numbers with known behaviour under rotation.

The motion is written as a complex number d = dx + i dy, a pin's place on the tip's unit disc as
z = x + i y. A vector polynomial of degree D is then the sum over a + b <= D of

    d(z) = sum c_ab z^a conj(z)^b          (D+1)(D+2)/2 complex coefficients

with c_00 a common shift, Re c_10 growth, Im c_10 rotation, c_01 stretch, and so on.

Why complex: when tip and touch are turned together by an angle t, c_ab is multiplied by exp(i s t) with
the `spin` s = 1 - a + b, and so is a product of coefficients with the sum of their spins. A round tip does
not care how it is turned, so a shear (spin 1) can depend only on products of spin 1, a depth only on
products of spin 0. That leaves a tenth of the terms of an unrestricted polynomial: few calibration frames
are enough, and the direction comes out right all the way round.

Terms of equal spin are made orthonormal over the rest pins (Gram-Schmidt, lowest degree first), which
keeps the spins and makes coefficients comparable; terms of different spin are orthogonal on a round
layout by themselves.
"""

from __future__ import annotations

import math

import numpy as np

from edge import _features
from edge.types import Array, Complex, Mask, Rest

__all__ = ["DEGREE", "MODE_NAMES", "MODE_POWERS", "Modes"]

#: Highest degree; 5 is where depth and tilt on real recordings stop gaining.
DEGREE = 5
#: Powers (a, b) of z and conj(z).
MODE_POWERS = tuple((a, degree - a) for degree in range(DEGREE + 1) for a in range(degree, -1, -1))
MODE_NAMES = tuple(f"c{a}{b}" for a, b in MODE_POWERS)


class Modes:
    """The basis of one tip. Terms that the layout cannot carry (too few pins) have coefficient 0."""

    def __init__(self, rest: Rest) -> None:
        xy = (rest.xy_img - rest.pattern.centre_img) / rest.pattern.tip_radius_px
        z = xy[:, 0] + 1j * xy[:, 1]
        basis = np.column_stack([z**a * np.conj(z) ** b for a, b in MODE_POWERS])
        n, k = basis.shape
        kept = np.ones(k, dtype=np.bool_)
        by_spin: dict[int, list[int]] = {}
        for column, (a, b) in enumerate(MODE_POWERS):
            lower = by_spin.setdefault(1 - a + b, [])
            v = basis[:, column]
            size = float(np.linalg.norm(v))
            for _ in range(2):  # twice is enough (Giraud et al. 2005)
                v = v - basis[:, lower] @ (basis[:, lower].conj().T @ v) / n
            left = float(np.linalg.norm(v))
            kept[column] = left > 1e-6 * size
            basis[:, column] = v * (math.sqrt(n) / left) if kept[column] else 0.0
            if kept[column]:
                lower.append(column)
        self._re, self._im = np.ascontiguousarray(basis.real), np.ascontiguousarray(basis.imag)
        self._work = np.empty((k, 2 * k))
        self._gram = basis.conj().T @ basis + np.diag(np.where(kept, 0.0, n))
        # A weak ridge (a thousandth of a pin) keeps lost pins from letting high terms run away.
        self._gram += 1e-3 * np.eye(k)
        self._inverse = np.ascontiguousarray(np.linalg.inv(self._gram)).view(np.float64)

    def fit(self, motion: Array, seen: Mask) -> Complex:
        """Least-squares coefficients over the seen pins.

        motion   (n, 2) float64 px, contiguous, finite where seen
        Returns  (21,) complex128 px, terms `MODE_NAMES`
        """
        # Sums over the seen pins, and their equations solved: no BLAS, which would wake threads for it.
        result: Complex = np.empty(len(self._gram), dtype=np.complex128)
        _features.modes(
            self._re, self._im, self._gram.view(np.float64), self._inverse, motion, seen, self._work,
            result.view(np.float64),
        )  # fmt: skip
        return result
