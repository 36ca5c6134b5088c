"""The widening of a polynomial's sigma for uncompiled runs; `spread_sums.pxd` has it in C.

Both add in the same order, in single precision, and give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.types import Array


def sum_squares(
    spread: NDArray[np.int16],
    first: int,
    end: int,
    step: NDArray[np.float32],
    first_term: int,
    terms: Array,
    n: int,
) -> float:
    """Squared length of a complex factor times a polynomial's terms.

    spread      (k, 8) whole steps: of four rows of the factor, term by term, real, then imaginary parts
    first, end  the polynomial's part of them
    step        of all terms; first_term: the polynomial's first
    terms       (n or more, 2) values of its n terms, real and imaginary part
    """
    total = 0.0
    scaled = terms[:n].astype(np.float32) * step[first_term : first_term + n, None]
    for rows in spread[first:end].reshape(-1, n, 8).astype(np.float32):
        by_re, by_im = (np.add.accumulate(rows * part[:, None], axis=0)[-1] for part in scaled.T)
        for re, im in zip(by_re[:4] - by_im[4:], by_im[:4] + by_re[4:], strict=True):
            total += float(re) ** 2 + float(im) ** 2
    return total
