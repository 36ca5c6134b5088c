"""The steps of `centroids` from the sums over windows, for uncompiled runs; `steps.pxd` has them in C.

Both compute the same operations in the same order and give exactly the same.
"""

from __future__ import annotations

import numpy as np

from edge.pins.templates import NORM
from edge.types import Array, Index


def take_steps(
    who: Index, n: int, at: Index, middle: Array, sums: Array, norms: Array, predicted: Array, first: bool,
    near2: float, far2: float, reach2: float, noise2: float, gain: float, xy: Array, sigma: Array,
    amplitude: Array, fit: Array,
) -> int:  # fmt: skip
    """One step of each of n pins whose windows are within the image.

    who        the pins; those that have to go on are put first
    at, middle, sums  of `place` and `sum_windows`; like `who` with space for more, as four are taken at once
    norms      (m, len(NORM))
    predicted  (p, 2) px, of all pins
    first      it is their first step: if it is the last as well, it was so short that they are within reach
    near2      px2: a step this short is the last
    far2       px2: of a longer one the slopes alone are enough
    reach2     px2: a pin further from its prediction is lost: `amplitude` and `fit` are 0
    noise2     levels2, of a pixel
    gain       levels of the image over those that were summed
    xy, sigma, amplitude, fit  of `CentroidKernel`, written
    Returns    how many have to go on
    """
    i = who[:n].copy()
    a, tx, ty, level, u, v, square, inv_pixels = sums[:n].T
    x, y = middle[:, :n]
    of_phase = norms[at[:n], NORM.index("inv_d") : NORM.index("d2")].T
    inv_d, x_d, y_d, x_u, y_v, d_u, tx_u, d_v, ty_v, freedom, inv_freedom, radius, step_max = of_phase
    with np.errstate(all="ignore"):
        inverse, a2 = 1.0 / a, a * a
        # The step times |d| A, as if the surroundings had no slope.
        ex, ey = tx * x_d, ty * y_d
        far = ex * ex + ey * ey > far2 * a2
        # What the slope of the surroundings explains besides. It is shrunk by its uncertainty: where it is
        # within its own noise, leaving it out costs nothing and saves a fifth of the noise.
        su, sv = u + d_u * a, v + d_v * a
        gu, gv = su + tx_u * tx, sv + ty_v * ty
        gu2, gv2 = gu * gu, gv * gv
        energy = square - level * level * inv_pixels
        rest = energy - a2 - tx * tx - ty * ty - gu2 - gv2
        variance = np.where(rest > 0.0, rest, 0.0) * inv_freedom + 1.0 / 12.0
        limit = 4.0 * variance
        keep_x = np.where((gu2 > limit) & ~far, 1.0 - limit / gu2, 0.0)
        keep_y = np.where((gv2 > limit) & ~far, 1.0 - limit / gv2, 0.0)
        ex, ey = ex - keep_x * gu * x_u, ey - keep_y * gv * y_v
        seen = a > 0.0
        on = (ex * ex + ey * ey >= near2 * a2) & seen
        ex, ey = ex * inverse, ey * inverse
        length = np.sqrt(ex * ex + ey * ey)
        shorten = np.where(length > step_max, step_max / length, 1.0)
        xy[i, 0], xy[i, 1] = x + shorten * ex, y + shorten * ey

        # Variation that the slope of the surroundings explains does not count against the disc.
        left = energy - gu * su - gv * sv
        has, inv_left = (left > 0.0) & seen, 1.0 / left
        # The share m of it that the disc does not explain either counts as radius x m^2 (docs/tuning.md).
        missing = rest - freedom * (noise2 + 1.0 / 12.0)
        m = np.where((missing > 0.0) & has, missing * inv_left, 0.0)
        hidden = radius * m * m
        spread = x_d * x_d + y_d * y_d + keep_x * (x_u * x_u) + keep_y * (y_v * y_v)
        noise = 0.5 * variance * spread * inverse * inverse
        sigma[i] = np.sqrt(noise + hidden * hidden)
        amplitude[i] = np.where(seen, a * inv_d * gain, 0.0)
        fit[i] = np.where(has, a2 * inv_left, 0.0)
        dx, dy = (xy[i] - predicted[i]).T
        beyond = dx * dx + dy * dy > reach2
    if first:
        beyond &= on
    amplitude[i[beyond]] = fit[i[beyond]] = 0.0
    on &= ~beyond
    who[: on.sum()] = i[on]
    return int(on.sum())
