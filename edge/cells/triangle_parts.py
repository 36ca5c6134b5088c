"""What `mesh` adds up of each triangle, for uncompiled runs; `triangle_parts.pxd` has it in C.

Both compute the same operations in the same order, as `Mesh._parts` does, and give exactly the same.
"""

from __future__ import annotations

import numpy as np

from edge.types import Array, Index


def sum_certain(
    tail: Index,
    x: Array,
    y: Array,
    n: int,
    sliver: float,
    bound: float,
    tolerance: float,
    area: Array,
    uncertain: Index,
) -> int:
    """Add the certain parts of the first n triangles to the areas of their corners.

    tail         (3 n + 9 or more,) corners, triangle after triangle; of points that exist
    x, y         of the points
    sliver       share of the squared sides that twice the area must be above
    bound        of the error, over q (1 + q) times the squared sides
    tolerance    share of a part that the error is below where the part is certain
    area         of the points, added to
    uncertain    (n + 1 or more,), written: the triangles with a part that is not certain, ascending
    Returns      their number
    """
    corner = tail[: 3 * n].reshape(n, 3)
    (ax, bx, cx), (ay, by, cy) = x[corner].T, y[corner].T
    abx, aby, bcx, bcy, cax, cay = bx - ax, by - ay, cx - bx, cy - by, ax - cx, ay - cy
    cross = aby * cax - abx * cay
    ab2, bc2, ca2 = abx * abx + aby * aby, bcx * bcx + bcy * bcy, cax * cax + cay * cay
    sum2 = ab2 + bc2 + ca2
    with np.errstate(all="ignore"):
        inverse = 1.0 / cross
        q = 0.5 * sum2 * inverse
        part = np.stack(
            [
                -(bcx * cax + bcy * cay) * inverse * ab2,
                -(cax * abx + cay * aby) * inverse * bc2,
                -(abx * bcx + aby * bcy) * inverse * ca2,
            ]
        )
        error = np.where(cross > sliver * sum2, bound * q * (1.0 + q) * sum2, np.inf)
        is_certain = error < tolerance * part
    ab, bc, ca = np.where(is_certain, part, 0.0)
    np.add.at(area, corner.ravel(), np.stack([ab + ca, ab + bc, bc + ca], axis=1).ravel())
    found = np.flatnonzero(~is_certain.all(axis=0))
    uncertain[: len(found)] = found
    return len(found)
