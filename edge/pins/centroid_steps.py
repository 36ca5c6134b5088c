"""Sums over pins' windows, and the least-squares steps from them, for uncompiled runs.

`centroid_steps.c` has both in C, for vectors. The sums are of integers, and exactly alike; so are the steps
to the last bit where the processor rounds products.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from edge.pins.templates import BLOCK, NORM, PHASES
from edge.types import Array, Image, Index

Shorts = NDArray[np.int16]
LANES = BLOCK  # bytes copied at once
UNROLL = LANES // BLOCK  # pieces

#: Columns of what is known of one kind of pins:
#: first_span, end_span  its rows in the spans of all kinds
#: first_step, end_step  and in their steps
#: first, first_uv, plane  as in `TemplateSet`
#: pixels           of its support
KIND = np.dtype(
    [
        (name, np.intp)
        for name in (
            "first_span", "end_span", "first_step", "end_step", "first", "first_uv", "plane", "pixels",
        )
    ]
)  # fmt: skip

#: The part of an 8-bit image that is fetched into the cache before windows are read: its rows in the order
#: of memory. Reading the pins of an image that lies in memory takes 1.35 times as long so as of one in the
#: cache, twice with the rows of each window fetched on their own, 3.3 times without. That is with 331 pins,
#: 640 x 480, 2 or 3 times the mean number of rows, 2 or 3 windows ahead. It is 2.1 times with the mean, or
#: with as many rows as there are, and 1.5 times with 1 window ahead.
#: row, end, stride  bytes: the next row, the first that is not wanted, and from row to row
#: first, beyond     bytes: what is wanted of each
#: rows              for four windows at most
#: ahead             bytes: as far beyond the middle of the window in hand
FETCH = np.dtype([(name, np.intp) for name in ("row", "end", "stride", "first", "beyond", "rows", "ahead")])


class PinReading(NamedTuple):
    """The data that all windows of an image and all steps share.

    image    of 8 bits; of another one any, and stride is 0
    fetch    (1,) `FETCH`; here of no use
    kinds    `KIND` of each kind of pins
    steps    of each piece of a row, LANES bytes or 8 blocks: where it begins, bytes from the window's middle,
             and its first of `pixels`; the next one overwrites what is too many
    values, uv, norms  of the templates
    pixels   takes a window's spans, one after the other
    sums     (8,): I d, I tx, I ty, I, I u, I v, I^2 and 1 of a window, each times its factor in `norms`
    predicted           (n, 2) px
    inner    phases: least x and y of pins whose windows are within the image, least beyond
    norm_of  (n,) the row of each pin's first phase in `norms`
    stride   bytes from row to row of the image
    side     px: pixels are sums of blocks of side x side of the image's; the middle of one is between four
    reach2   px2: farther from its prediction a pin is lost
    noise2, gain        levels^2 of the camera's noise; factor of the levels
    dark     sums are those of 255 - I
    xy, sigma, amplitude, fit  of `CentroidKernel`; written
    """

    image: Image
    fetch: NDArray[np.void]
    kinds: NDArray[np.void]
    steps: Index
    values: Shorts
    uv: NDArray[np.int8]
    norms: Array
    pixels: NDArray[np.uint8]
    sums: Array
    predicted: Array
    inner: Array
    norm_of: Index
    stride: int
    side: int
    reach2: float
    noise2: float
    gain: float
    dark: bool
    xy: Array
    sigma: Array
    amplitude: Array
    fit: Array


reading_of = PinReading


def _sum_window(reading: PinReading, begin: int, norm: int) -> None:
    """Write `sums` of one window.

    begin  byte of the image where the middle of the window is
    norm   row of its kind's phase in `norms`
    """
    image, _, kinds, all_steps, values, uv, norms, _, sums = reading[:9]
    side = reading.side
    (rows, columns), stride = image.shape, image.strides[0]
    memory = np.lib.stride_tricks.as_strided(image, (stride * (rows - 1) + columns,), (1,))
    k = kinds[norm // PHASES**2]
    n, first_uv, size = k["plane"], k["first_uv"], LANES if side == 1 else BLOCK // side
    first = k["first"] + 3 * n * (norm % PHASES**2)
    level = np.zeros(n + size, np.int64)
    for step, to in all_steps[k["first_step"] : k["end_step"]]:
        pixels = memory[begin + step + stride * np.arange(side)[:, None] + np.arange(side * size)]
        level[to : to + size] = pixels.reshape(side, size, side).sum(axis=(0, 2), dtype=np.int64)
    level[k["pixels"] :] = 0
    level = level[:n]
    d, tx, ty = values[first : first + 3 * n].astype(np.int64).reshape(3, n) @ level
    u, v = uv[first_uv : first_uv + 2 * n].astype(np.int64).reshape(2, n) @ level
    sums[:8] = np.array([d, tx, ty, level.sum(), u, v, level @ level, 1], np.float64) * norms[norm, :8]
    if reading.dark:  # the sums of the other templates are 0
        most = 255.0 * side * side
        white = most * k["pixels"]
        square, total = sums[6] + most * (white - 2.0 * sums[3]), white - sums[3]
        sums[:6] *= -1.0
        sums[3], sums[6] = total, square


#: Columns of `NORM`: `centroid_steps.c` counts them likewise.
(
    INV_D, X_D, Y_D, X_U, Y_V, D_U, TX_U, D_V, TY_V, FREEDOM, INV_FREEDOM, RADIUS, LONGEST, D2, UNIT_D,
    UNIT_T,
) = map(NORM.index, NORM[NORM.index("inv_d") :])  # fmt: skip


def take_step(
    reading: PinReading, i: int, norm: int, x: float, y: float, near2: float, far2: float, first: bool
) -> bool:
    """Take the step of pin i, of whose window the sums are. Returns that it has to go on.

    norm   row of its norms
    x, y   px, where the step begins: the place of the template
    near2  px2: a step this short is the last
    far2   px2: of a longer one the slopes alone are enough
    first  it is its first step
    """
    reading.amplitude[i] = reading.fit[i] = 0
    a, tx, ty, level, u, v, square, inv_pixels = map(float, reading.sums[:8])
    if not a > 0.0:
        return False
    norms = [float(number) for number in reading.norms[norm]]
    x_d, y_d, x_u, y_v = norms[X_D], norms[Y_D], norms[X_U], norms[Y_V]
    inverse, a2 = 1.0 / a, a * a
    # The step times |d| A, as if the surroundings had no slope.
    ex, ey = tx * x_d, ty * y_d
    is_near = ex * ex + ey * ey <= far2 * a2
    # The slope of the surroundings explains this besides. It is shrunk by its uncertainty: where it is
    # within its own noise, leaving it out costs nothing and saves a fifth of the noise.
    su, sv = u + norms[D_U] * a, v + norms[D_V] * a
    gu, gv = su + norms[TX_U] * tx, sv + norms[TY_V] * ty
    gu2, gv2 = gu * gu, gv * gv
    energy = square - level * level * inv_pixels
    rest = energy - a2 - tx * tx - ty * ty - gu2 - gv2
    found = max(rest, 0.0) * norms[INV_FREEDOM]
    # The residual beyond the noise is alike in all pixels of a block.
    variance = (
        found - (1.0 - 1.0 / (reading.side * reading.side)) * max(found - reading.noise2, 0.0) + 1.0 / 12.0
    )
    limit = 4.0 * variance
    keep_x = 1.0 - limit / gu2 if is_near and gu2 > limit else 0.0
    keep_y = 1.0 - limit / gv2 if is_near and gv2 > limit else 0.0
    ex -= keep_x * gu * x_u
    ey -= keep_y * gv * y_v
    goes_on = ex * ex + ey * ey >= near2 * a2
    ex *= inverse
    ey *= inverse
    # Variation that the slope of the surroundings explains does not count against the disc.
    left = energy - gu * su - gv * sv
    spread = x_d * x_d + y_d * y_d + keep_x * (x_u * x_u) + keep_y * (y_v * y_v)
    noise = 0.5 * variance * spread * inverse * inverse
    reading.sigma[i] = sigma_of(noise, rest, norms[FREEDOM], left, reading.noise2, norms[RADIUS])
    reading.xy[i] = x + ex, y + ey
    # A first step that is the last one is so short that it is within reach.
    if (goes_on or not first) and not _is_within_reach(reading, i, norms[LONGEST], (x, y), (ex, ey)):
        return False
    reading.amplitude[i] = a * norms[INV_D] * reading.gain
    reading.fit[i] = a2 / left if left > 0.0 else 0.0
    return goes_on


def take_steps(reading: PinReading, who: Index, n: int, near2: float, far2: float, first: bool) -> int:
    """Take a step of each of n pins whose window is within the image.

    who      these pins; written: twice each that has to go on, and 1 if it has taken this step
    near2, far2, first  as of `take_step`
    Returns  how many have to go on
    """
    asked, to_middle = 0, 0.0 if reading.side > 1 else 2.0
    for i in map(int, who[:n]):
        x4, y4 = (PHASES * float(at) + to_middle for at in (reading.predicted if first else reading.xy)[i])
        taken = reading.inner[0] <= x4 < reading.inner[2] and reading.inner[1] <= y4 < reading.inner[3]
        if taken:
            x, y = int(x4), int(y4)
            norm = int(reading.norm_of[i]) + y % PHASES * PHASES + x % PHASES
            _sum_window(reading, y // PHASES * reading.stride + x // PHASES, norm)
            start = 0.25 * (x - to_middle) + 0.125, 0.25 * (y - to_middle) + 0.125
            if not take_step(reading, i, norm, *start, near2, far2, first):
                continue
        who[asked] = 2 * i + taken
        asked += 1
    return asked


def sigma_of(
    noise_variance: float, rest: float, freedom: float, energy: float, noise2: float, radius: float
) -> float:
    """Sigma of a coordinate, px: the noise left by the fit, plus the bias that a blob unlike a disc may hide.

    The share m of the variation that the disc does not explain counts as radius x m^2 (docs/tuning.md).
    """
    missing = rest - freedom * (noise2 + 1.0 / 12.0)
    m = missing / energy if missing > 0 and energy > 0 else 0.0
    hidden = radius * m * m
    return sqrt(noise_variance + hidden * hidden)


def _is_within_reach(
    reading: PinReading, i: int, longest: float, start: tuple[float, float], step: tuple[float, float]
) -> bool:
    """Shorten a step that is too long; whether it ends near enough to the prediction."""
    length = sqrt(step[0] * step[0] + step[1] * step[1])
    if length > longest:
        share = longest / length
        reading.xy[i] = start[0] + share * step[0], start[1] + share * step[1]
    dx, dy = (float(d) for d in reading.xy[i] - reading.predicted[i])
    return dx * dx + dy * dy <= reading.reach2
