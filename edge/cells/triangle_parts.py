"""Parts of a mesh's triangles, for uncompiled runs; `triangle_parts.c` has them in C, for vectors.

Both give the same to the last bit.
"""

import numpy as np

from edge.types import Array, Index


def measure(
    tail: Index, x: Array, y: Array, n: int, sliver: float, bound: float, tolerance: float, parts: Array,
    area: Array, unsure: Index,
) -> int:  # fmt: skip
    """Write the parts of the first n triangles, and add those to the areas of triangles that are certain.

    tail    (3 t,) corners a, b, c of each triangle
    x, y    coordinates of the points
    n       even, as the number of a mesh's triangles is
    sliver  twice a triangle's area over the sum of its squared edges, up to which it has no parts: they are
            0, and the bound of their error is infinite
    bound   of the parts' error over q (1 + q) S, as `mesh` says
    parts   (t, 4) written: of the edges ab, bc and ca the cotangent of the angle that faces the edge times
            its squared length, and the bound of their error
    tolerance  this share of each part of a certain triangle is above the bound
    area    of each point; a part counts for both ends of its edge
    unsure  (t,) written: the triangles that are not certain
    Returns  how many these are
    """
    corners = np.asarray(tail)[: 3 * n].reshape(n, 3)
    (ax, bx, cx), (ay, by, cy) = np.asarray(x)[corners].T, np.asarray(y)[corners].T
    abx, aby, bcx, bcy, acx, acy = bx - ax, by - ay, cx - bx, cy - by, cx - ax, cy - ay
    cross = abx * acy - aby * acx
    ab2, bc2, ca2 = abx * abx + aby * aby, bcx * bcx + bcy * bcy, acx * acx + acy * acy
    sum2 = ab2 + bc2 + ca2
    plain = cross > sliver * sum2
    inverse = 1.0 / np.where(plain, cross, 1.0)
    q = 0.5 * sum2 * inverse
    found = (
        (bcx * acx + bcy * acy) * inverse * ab2,
        (acx * abx + acy * aby) * inverse * bc2,
        -(abx * bcx + aby * bcy) * inverse * ca2,
    )
    parts[:n, :3] = np.where(plain, found, 0.0).T
    parts[:n, 3] = np.where(plain, bound * q * (1.0 + q) * sum2, np.inf)
    ab, bc, ca, error = np.asarray(parts)[:n].T
    certain = (error < tolerance * ab) & (error < tolerance * bc) & (error < tolerance * ca)
    np.add.at(np.asarray(area), corners[certain], np.stack([ab + ca, ab + bc, bc + ca], axis=1)[certain])
    found_n = int(n - certain.sum())
    unsure[:found_n] = np.flatnonzero(~certain)
    return found_n
