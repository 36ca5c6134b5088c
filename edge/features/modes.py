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
"""

import math

import numpy as np

from edge.types import Array, Complex, Mask, Rest

#: Highest degree; a calibration file names its inputs by these modes, so it is part of the format.
DEGREE = 5
#: Powers (a, b) of z and conj(z).
MODE_POWERS = tuple((a, degree - a) for degree in range(DEGREE + 1) for a in range(degree, -1, -1))
#: Places where (b, a) stands.
MODE_MIRROR = tuple(MODE_POWERS.index((b, a)) for a, b in MODE_POWERS)
MODE_NAMES = tuple(f"c{a}{b}" for a, b in MODE_POWERS)
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


class Modes:
    """Fits the modes of one tip by least squares; of_all (21, n), from the motion of all its pins."""

    def __init__(self, rest: Rest) -> None:
        self._basis = mode_basis(rest)
        n, k = self._basis.shape
        unresolved = np.where(self._basis.any(axis=0), 0.0, n)
        self._ridge = np.diag(unresolved) + INDEPENDENT_REL * n * np.eye(k)
        self.of_all = self._solution(self._basis)

    def fit(self, motion: Array, seen: Mask) -> Complex:
        """Least-squares coefficients over the seen pins.

        motion   (n, 2) float64 px, finite where seen
        seen     (n,) bool
        Returns  (21,) complex128 px, terms `MODE_NAMES`
        """
        return np.asarray(self._solution(self._basis[seen]) @ (motion[seen] @ [1.0, 1j]))

    def _solution(self, basis: Complex) -> Complex:
        """(21, m) coefficients from the motion of the pins with these rows of the basis."""
        gram = basis.conj().T @ basis + self._ridge
        return np.conj(basis @ np.linalg.inv(gram)).T
