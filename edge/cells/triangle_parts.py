"""Parts of a mesh's triangles, for uncompiled runs; `triangle_parts.c` has them in C, for vectors.

Both give the same to the last bit.
"""

import numpy as np

from edge.types import Array, Index


def measure(
    tail: Index, x: Array, y: Array, n: int, sliver: float, bound: float, parts: Array, area: Array,
    unsure: Index,
) -> int:  # fmt: skip
    """Write the parts of the first n triangles, and add those to the areas of triangles that are certain.

    tail    (3 t,) corners a, b, c of each triangle
    x, y    coordinates of the points
    n       even, as the number of a mesh's triangles is
    sliver  four times a triangle's area over the sum of its squared edges, up to which it has no parts: they
            are 0, and the least certain one is infinite
    bound   of the least certain part over q (1 + q) S / 2, as `mesh` says
    parts   (t, 4) written: of the edges ab, bc and ca the cotangent of the angle that faces the edge times
            its squared length, and what a part that is certain is above; all are in a certain triangle
    area    of each point; a part counts for both ends of its edge
    unsure  (t,) written: the triangles that are not certain
    Returns  how many these are
    """
    corners = np.asarray(tail)[: 3 * n].reshape(n, 3)
    (ax, bx, cx), (ay, by, cy) = np.asarray(x)[corners].T, np.asarray(y)[corners].T
    abx, aby, bcx, bcy, acx, acy = bx - ax, by - ay, cx - bx, cy - by, cx - ax, cy - ay
    cross = abx * acy - aby * acx
    dot_a, dot_b, dot_c = abx * acx + aby * acy, -(abx * bcx + aby * bcy), acx * bcx + acy * bcy
    ab2, bc2, ca2 = dot_a + dot_b, dot_b + dot_c, dot_c + dot_a
    half2 = ab2 + dot_c
    plain = cross > sliver * half2
    inverse = np.where(plain, 1.0 / np.where(plain, cross, 1.0), 0.0)
    q = half2 * inverse
    found = (dot_c * inverse * ab2, dot_a * inverse * bc2, dot_b * inverse * ca2)
    parts[:n, :3] = np.transpose(found)
    parts[:n, 3] = np.where(plain, bound * q * (1.0 + q) * half2, np.inf)
    ab, bc, ca, least = np.asarray(parts)[:n].T
    certain = (least < ab) & (least < bc) & (least < ca)
    np.add.at(np.asarray(area), corners[certain], np.stack([ab + ca, ab + bc, bc + ca], axis=1)[certain])
    found_n = int(n - certain.sum())
    unsure[:found_n] = np.flatnonzero(~certain)
    return found_n
