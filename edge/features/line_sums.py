"""The sums of `contact_fit` over a line's points for uncompiled runs; `line_sums.pxd` has them in C.

Both differ by rounding only.
"""

from __future__ import annotations

import numpy as np

from edge.types import Array


def line_sums(
    place: Array,
    n: int,
    middle_x: float,
    middle_y: float,
    half_x: float,
    half_y: float,
    i2: float,
    node: Array,
    weight: Array,
    derive: bool,
    sums: Array,
) -> None:
    """Sums of each of the first n pins over the line's points, with d = x - point, f = 1 / (1 + d^2 i2 / 2).

    place         (n or more, 2) float64, x of each pin
    middle, half  of the line, whose points are middle + node * half
    i2            one over the squared width
    node, weight  (points,) float64
    derive        False: only the first three
    sums          (14, n or more, a multiple of 4) float64, of weight times
                  0      f
                  1, 2   k = f^2 d, x and y
                  3-5    how that changes with d: xx, xy, yy
                  6-10   k and these, times node
                  11     f^2 d^2 i2
                  12-13  2 f^3 d^2 i2 d, x and y
                  Beyond n it is of no use
    """
    d = place[:n, None] - (middle_x, middle_y) - node[:, None] * (half_x, half_y)
    x, y = d[..., 0], d[..., 1]
    r2 = (x * x + y * y) * i2
    f = 1.0 / (1.0 + 0.5 * r2)
    g, g3 = f * f, 2.0 * f * f * f
    own = [f, g * x, g * y]
    if derive:
        along = [g * x, g * y, g - g3 * i2 * x * x, -g3 * i2 * x * y, g - g3 * i2 * y * y]
        own += [*along[2:], *(node * each for each in along), g * r2, g3 * r2 * x, g3 * r2 * y]
    sums[: len(own), :n] = np.array(own) @ weight
