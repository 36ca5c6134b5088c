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

if cython.compiled:
    from cython.cimports.edge.geometry.pin_loops import all_near
    from cython.cimports.libc.math import sqrt
else:
    from math import sqrt

    from edge.geometry.pin_loops import all_near


@cython.cclass
class Separation:
    """Of n points that move. Raises ValueError: too many."""

    def __init__(self, n: int) -> None:
        if not 0 <= n <= POINTS_MAX:
            raise ValueError(f"n: 0 to {POINTS_MAX} are wanted, not {n}")
        self.n = n
        self.at = np.full((n, 2), np.nan, np.float32)  # when they were compared
        self.far2 = 0.0

    def holds(self, xy: cython.const[cython.double][:, ::1]) -> cython.bint:
        """Whether no two points can have come too near to each other.

        xy       (n, 2) px; NaN: not there, near to none
        Returns  False: they are to be compared; so is a point that was not there then
        """
        return all_near(xy, self.at, self.far2)

    def renew(self, xy: cython.const[cython.double][:, ::1], gap: cython.double) -> cython.void:
        """They were compared; `gap`, px: the least distance of two, less what would be too near."""
        at: cython.float[:, ::1] = self.at
        i: cython.Py_ssize_t
        x: cython.double
        y: cython.double
        off2: cython.double = 0.0  # px2, by rounding
        for i in range(self.n):
            at[i, 0] = cython.cast(cython.float, xy[i, 0])
            at[i, 1] = cython.cast(cython.float, xy[i, 1])
            x = xy[i, 0] - at[i, 0]
            y = xy[i, 1] - at[i, 1]
            if x * x + y * y > off2:
                off2 = x * x + y * y
        far: cython.double = 0.5 * gap - sqrt(off2)
        self.far2 = far * far if far > 0 else 0.0
