"""The widening of a polynomial's sigma for uncompiled runs; `spread_sums.pxd` has it in C.

Both add in the same order, in single precision, and give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.types import Array


def sum_squares(spread: NDArray[np.float32], first: int, end: int, terms: Array, n: int) -> float:
    """Squared length of a complex factor times a polynomial's terms.

    spread      (k, 8) of four rows of the factor, term by term: real, then imaginary parts
    first, end  the polynomial's part of them
    terms       (n or more, 2) values of its n terms, real and imaginary part
    """
    total = 0.0
    single = terms[:n].astype(np.float32)
    for rows in spread[first:end].reshape(-1, n, 8):
        by_re, by_im = (np.add.accumulate(rows * part[:, None], axis=0)[-1] for part in single.T)
        for re, im in zip(by_re[:4] - by_im[4:], by_im[:4] + by_re[4:], strict=True):
            total += float(re) ** 2 + float(im) ** 2
    return total
