"""Where each known pin is now, from its neighbourhood alone.

Idea
- A pin is a blurred disc. The templates that a least-squares fit of that disc needs (the disc and its slope
  in x and y) are made once, for the radii at hand and for 4 x 4 subpixel offsets; `edge._centroid` then
  answers each pin with a few dot products. See there for the estimator.

Rules
- Radii come in kinds 5 % apart: a template that is 2.5 % off in radius is still symmetric, so it costs a
  little noise (1 %) and no bias.
- Buffers are made once. What `refine` returns is a copy and stays good.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfc

from edge import _centroid
from edge.types import Array, Image, Pins, Rest

PHASES = 4
_LANES = 8
_BLOCK = 32  # as in _centroid.c: planes are padded to a multiple of it
_HALF_MAX = 39
_STEP_MAX = 4095  # a pixel against the window's middle, grey levels; brighter images lose their last bits
_GAIN_MAX = 2.5  # how much brighter than at rest the pins may become before they saturate
_KIND_STEP = 1.05
# How much of the window's variation the disc has to explain, and how much of its usual light (after the gain
# common to all pins) a pin must keep.
FIT_MIN = 0.25
AMPLITUDE_SHARE_MIN = 0.25
_REACH_PITCHES = 0.6
_CLASH_RADII = 1.1


Shorts = NDArray[np.int16]


class Refiner:
    """Reads the pins of `rest` in image after image, each near where it is predicted."""

    def __init__(self, rest: Rest) -> None:
        n = len(rest)
        pattern = rest.pattern
        radius = np.asarray(rest.pins.radius_px, np.float64)
        kinds, kind_of = np.unique(np.rint(np.log(radius) / np.log(_KIND_STEP)), return_inverse=True)
        self._kind_of = np.ascontiguousarray(kind_of, np.int32)
        self._kinds, self._templates, self._norms = _tables(
            tuple(_KIND_STEP**kinds), pattern.edge_px, pattern.pitch_px
        )
        self._radius = radius
        self._rest_amplitude = np.ascontiguousarray(rest.pins.brightness, np.float64)
        self._limits = np.array(
            [
                FIT_MIN,
                AMPLITUDE_SHARE_MIN,
                _REACH_PITCHES * pattern.pitch_px,
                _CLASH_RADII * radius.min(),
                pattern.noise**2,
                max(0.0, np.ceil(np.log2(_GAIN_MAX * pattern.brightness / _STEP_MAX))),
            ]
        )
        self._order = np.arange(n, dtype=np.int32)
        self._scratch = np.empty(n)
        self._out = np.empty((n, 5))

    def refine(self, image: Image, xy_img_predicted: Array) -> Pins:
        """Centroid of each pin near its prediction; row i is pin i, NaN where there is none.

        image             (h, w) uint8 or uint16
        xy_img_predicted  (n, 2) float64, px; within half a pitch of the truth; NaN gives NaN
        """
        predicted = np.ascontiguousarray(xy_img_predicted, np.float64)
        _centroid.refine(
            image,
            predicted,
            self._kind_of,
            self._kinds,
            self._templates,
            self._norms,
            self._rest_amplitude,
            self._limits,
            self._order,
            self._scratch,
            self._out,
        )
        out = self._out
        return Pins(out[:, :2].copy(), out[:, 2].copy(), self._radius, out[:, 3].copy())

    @property
    def fit(self) -> Array:
        """(n,) share of the window's variation that the disc explained in the last image."""
        return self._out[:, 4].copy()


@lru_cache(maxsize=8)  # recovery detects frame after frame with the same pattern
def _tables(
    radii: tuple[float, ...], edge_px: float, pitch_px: float
) -> tuple[NDArray[np.int64], Shorts, Array]:
    """Kinds (k, 4) int64, templates int16 and norms (k, 16, 22) as `_centroid.refine` wants them."""
    kinds, parts, norms = [], [], []
    first = 0
    for radius in radii:
        half, stride, planes, norm = _templates(radius, edge_px, pitch_px)
        kinds.append((half, stride, first, planes[0].size))
        first += planes.size
        parts.append(planes.ravel())
        norms.append(norm)
    return np.array(kinds, np.int64), np.concatenate(parts), np.array(norms)


@lru_cache(maxsize=64)
def _templates(radius: float, edge_px: float, pitch_px: float) -> tuple[int, int, Shorts, Array]:
    """Half width, row stride, planes (17, 3, rows * stride, padded) and norms (16, 22) of one radius.

    The first three planes are the support and the columns and rows in it; then for each phase the disc freed
    of a constant, and its slopes in x and y freed of both.
    """
    support = min(
        radius + 3.0 * edge_px + 0.5, max(radius + 1.5 * edge_px, 0.85 * pitch_px - radius - 1.5 * edge_px)
    )
    half = min(int(np.ceil(support + 0.5)), _HALF_MAX)
    size = 2 * half + 1
    stride = -(-size // _LANES) * _LANES
    offset = (np.arange(PHASES) + 0.5) / PHASES - 0.5
    grid = np.arange(-half, half + 1, dtype=np.float64)
    columns, rows = np.meshgrid(grid, grid)
    u = columns - np.tile(offset, PHASES)[:, None, None]
    v = rows - np.repeat(offset, PHASES)[:, None, None]
    r = np.hypot(u, v)
    one = (np.hypot(columns, rows) <= support).astype(np.float64)[None]
    disc = one * 0.5 * erfc((r - radius) / (np.sqrt(2.0) * edge_px))
    slope = one * np.exp(-0.5 * ((r - radius) / edge_px) ** 2) / np.maximum(r, 1e-9)
    slope /= edge_px * np.sqrt(2.0 * np.pi)
    d = disc - one * _dot(disc, one) / _dot(one, one)
    tx, ty, px, py = (_freed(p, one, d) for p in (slope * u, slope * v, columns * one, rows * one))
    scale = (0.99 * _scale(d), 0.99 * min(_scale(tx), _scale(ty)))
    norm = [
        _dot(one, one), _dot(d, d), _dot(tx, tx), _dot(ty, ty),
        _dot(tx, px), _dot(ty, py), _dot(px, px), _dot(py, py),
        _dot(columns, one) / _dot(one, one), _dot(rows, one) / _dot(one, one),
        _dot(columns, d) / _dot(d, d), _dot(rows, d) / _dot(d, d),
        radius, 1.0 / scale[0], 1.0 / scale[1],
    ]  # fmt: skip
    pixels, _, tx2, ty2, tx_u, ty_v, u2, v2 = map(np.asarray, norm[:8])
    divisors = (*norm[:4], tx2 * u2 - tx_u**2, ty2 * v2 - ty_v**2, np.where(pixels > 8, pixels - 6, 2))
    norm += [1.0 / divisor for divisor in divisors]
    planes = np.zeros((PHASES * PHASES + 1, 3, -(-size * stride // _BLOCK) * _BLOCK), np.int16)
    rows_of = planes[:, :, : size * stride].reshape(-1, 3, size, stride)[..., :size]
    rows_of[0] = np.stack([one[0], columns * one[0], rows * one[0]])
    rows_of[1:] = np.rint(np.stack([d * scale[0], tx * scale[1], ty * scale[1]], axis=1))
    columns_of_norms = [
        np.broadcast_to(np.asarray(value, np.float64).ravel(), PHASES * PHASES) for value in norm
    ]
    return half, stride, planes, np.stack(columns_of_norms, axis=1)


def _scale(plane: Array) -> float:
    """The largest factor that keeps the integers and their sum with any window within their range."""
    return float(
        min(
            32767.0 / np.abs(plane).max(),
            (2.0**31 - 1.0) / (_STEP_MAX * np.abs(plane).sum(axis=(1, 2)).max()),
        )
    )


def _freed(plane: Array, one: Array, d: Array) -> Array:
    """`plane` less its share of `one` and of `d`, which are orthogonal."""
    return plane - one * _dot(plane, one) / _dot(one, one) - d * _dot(plane, d) / _dot(d, d)


def _dot(a: Array, b: Array) -> Array:
    product: Array = (a * b).sum(axis=(1, 2), keepdims=True)
    return product
