"""What `mesh` measures of each triangle, for uncompiled runs; `triangle_parts.pxd` has it in C.

Both compute the same operations in the same order, as `Mesh._measure_plain` does, and give exactly the same.
"""

from __future__ import annotations

import numpy as np

from edge.types import Array, Index


def measure_fours(
    tail: Index, x: Array, y: Array, n: int, sliver: float, bound: float, part: Array, error: Array
) -> bool:
    """`Mesh._measure_plain` of the first n triangles, but for up to three that are over after the last four.

    tail         (3 n,) corners, triangle after triangle
    x, y         of the points
    sliver       share of the squared sides that twice the area must be above
    bound        of the error, over q (1 + q) times the squared sides
    part, error  (3 n,) and (n,), written; of a sliver the parts are of no use, the error is infinite
    Returns      there is no sliver
    """
    n -= n % 4
    corner = tail[: 3 * n].reshape(n, 3)
    (ax, bx, cx), (ay, by, cy) = x[corner].T, y[corner].T
    abx, aby, bcx, bcy, cax, cay = bx - ax, by - ay, cx - bx, cy - by, ax - cx, ay - cy
    cross = aby * cax - abx * cay
    ab2, bc2, ca2 = abx * abx + aby * aby, bcx * bcx + bcy * bcy, cax * cax + cay * cay
    sum2 = ab2 + bc2 + ca2
    plain = cross > sliver * sum2
    with np.errstate(all="ignore"):
        inverse = 1.0 / cross
        q = 0.5 * sum2 * inverse
        ab = -(bcx * cax + bcy * cay) * inverse * ab2
        bc = -(cax * abx + cay * aby) * inverse * bc2
        ca = -(abx * bcx + aby * bcy) * inverse * ca2
        error[:n] = np.where(plain, bound * q * (1.0 + q) * sum2, np.inf)
    part[: 3 * n] = np.column_stack([ab, bc, ca]).ravel()
    return bool(plain.all())
