"""What `mesh` measures of each triangle, for uncompiled runs; `triangle_parts.pxd` has it in C.

Both compute the same operations in the same order, as `Mesh._measure_plain` does, and give exactly the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Index


def measure_fours(
    tail: Index,
    x: Array,
    y: Array,
    n: int,
    sliver: float,
    bound: float,
    tolerance: float,
    part: Array,
    share: Array,
    error: Array,
    certain: NDArray[np.int64],
) -> bool:
    """`Mesh._measure_plain` of the first n triangles, but for up to three that are over after the last four.

    tail         (3 n,) corners, triangle after triangle
    x, y         of the points
    sliver       share of the squared sides that twice the area must be above
    bound        of the error, over q (1 + q) times the squared sides
    tolerance    share of a part that the error is below where the part is certain
    part         (3, n or more), written: of each edge; of a sliver it is of no use
    share        (3, n or more), written: of each corner, the certain parts of its two edges
    error        (n or more,), written; of a sliver it is infinite
    certain      (n or more,), written: bit k is set where the part of edge k is certain
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
        part[:, :n] = ab, bc, ca
        error[:n] = np.where(plain, bound * q * (1.0 + q) * sum2, np.inf)
        is_certain = error[:n] < tolerance * part[:, :n]
        ab, bc, ca = np.where(is_certain, part[:, :n], 0.0)
    share[:, :n] = ab + ca, ab + bc, bc + ca
    certain[:n] = is_certain[0] + 2 * is_certain[1] + 4 * is_certain[2]
    return bool(plain.all())


def sum_shares(
    tail: Index, share: Array, certain: NDArray[np.int64], n: int, area: Array, uncertain: Index
) -> int:
    """Add up the shares of the first n triangles.

    tail, share, certain  as above
    area       of the points, written
    uncertain  (n or more,) int32, written: the triangles with a part that is not certain, ascending
    Returns    how many these are
    """
    area[:] = 0.0
    np.add.at(area, tail[: 3 * n], share[:, :n].T.ravel())
    found = np.flatnonzero(certain[:n] != 7)  # a bit of each part
    uncertain[: len(found)] = found
    return len(found)
