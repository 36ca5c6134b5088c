"""The sums of `first_order` for uncompiled runs; `area_sums.pxd` has them in C.

Both give the same but for rounding.
"""

from __future__ import annotations

from edge.types import Array, Index


def area_sums(
    start: Index,
    near: Index,
    slope: Array,
    motion: Array,
    rest: Array,
    most: Array,
    first: int,
    n: int,
    area: Array,
) -> int:
    """Areas of cells from `first` up to n, until one has moved too much.

    start    (pins + 1,) int32 in the next two: neighbours of the first pin, of the second, ...; even
    near     (k,) int32, twice the neighbour's row
    slope    (k, 2) px, of the area over a neighbour's motion
    motion   (points, 2) px
    rest     (pins,) px2, areas at rest
    most     (pins,) px2, of the sum of the squared motions of the neighbours against the pin
    area     (pins,) px2, written as far as they are summed
    Returns  the cell that has moved too much; n if none has
    """
    for i in range(first, n):
        at = slice(start[i], start[i + 1])
        by = motion[near[at] // 2] - motion[i]
        area[i] = rest[i] + (slope[at] * by).sum()
        if not (by * by).sum() <= most[i]:
            return i
    return n
