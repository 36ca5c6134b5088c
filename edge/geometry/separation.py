"""Whether points that were compared and stood apart still do, by how far each has moved since. A kernel;
other kernels import it through `separation.pxd`.

Idea: two points approach each other by no more than both of them move. While none has moved by half of the
smallest gap, no pair need be compared.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.limits import POINTS_MAX


@cython.cclass
class Separation:
    """Of n points that move. Raises ValueError: too many."""

    def __init__(self, n: int) -> None:
        if not 0 <= n <= POINTS_MAX:
            raise ValueError(f"n: 0 to {POINTS_MAX} are wanted, not {n}")
        self.n = n
        self.at = np.full((n, 2), np.nan)  # when they were compared
        self.far2 = 0.0

    def holds(self, xy: cython.const[cython.double][:, ::1]) -> cython.bint:
        """Whether no two points can have come too near to each other.

        xy       (n, 2) px; NaN: not there, near to none
        Returns  False: they are to be compared; so is a point that was not there then
        """
        i: cython.Py_ssize_t
        x: cython.double
        y: cython.double
        for i in range(self.n):
            x = xy[i, 0] - self.at[i, 0]
            y = xy[i, 1] - self.at[i, 1]
            if not x * x + y * y < self.far2 and xy[i, 0] == xy[i, 0]:
                return False
        return True

    def renew(self, xy: cython.const[cython.double][:, ::1], gap: cython.double) -> cython.void:
        """They were compared; `gap`, px: the least distance of two, less what would be too near."""
        self.at[:, :] = xy
        self.far2 = 0.25 * gap * gap if gap > 0.0 else 0.0
