"""Templates of a pin: disc, slopes and their norms at every subpixel offset, for `centroids`.

Rules
- Radii come in kinds 5 % apart: a template that is 2.5 % off in radius is still symmetric, so it costs a
  little noise (1 %) and no bias.
- 16-bit integers, scaled so that no sum over a window overflows 32 bits. Those of d, tx and ty sum to zero,
  as the exact ones do: a level that all pixels share changes no sum.
- Only the support circle is kept, row after row without gaps: half of the square round it is outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import erfc

import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Index, Mask

PHASES = 4  # subpixel offsets along each axis
LANES = 16  # bytes: a window's rows are copied in multiples of it
BLOCK = 32  # a plane's length is a multiple of it: loops have no remainder
HALF_MAX = 39  # px, half width of a window
RADIUS_MAX_PX = 34  # largest pin that fits such a window with its edge and surroundings
STEP_MAX = 4095  # a pixel against the window's middle, levels: 12 bits; brighter images lose their last bits

#: Of one phase, in this order:
#: x, y                   px, the offset
#: by_d, by_tx, by_ty     least-squares coefficient of d, tx, ty over the sum with its integers
#: d2, tx2, ty2           sums over the support of d^2, tx^2, ty^2
#: u_d, v_d, u_tx, v_ty   of u d, v d, u tx, v ty; u and v are columns and rows from the support's middle
#: inv_u2, inv_v2         reciprocals of the sums of u^2, v^2 less their shares of d and of tx or ty
#: tx_u, ty_v             u_tx / tx2, v_ty / ty2
#: spread, spread_x, _y   variance of a coordinate over that of the noise in units of the disc, and what is
#:                        added where the slope of the surroundings along x, y is estimated
#: pixels, inv_pixels     of the support
#: freedom, inv_freedom   degrees of freedom that six unknowns leave
#: radius                 px
#: unit_d, unit_t         value of one unit of the integers
NORM = np.dtype(
    [
        (name, np.float64)
        for name in (
            "x", "y", "by_d", "by_tx", "by_ty", "d2", "tx2", "ty2", "u_d", "v_d", "u_tx", "v_ty", "inv_u2",
            "inv_v2", "tx_u", "ty_v", "spread", "spread_x", "spread_y", "pixels", "inv_pixels", "freedom",
            "inv_freedom", "radius", "unit_d", "unit_t",
        )
    ]
)  # fmt: skip

Shorts = NDArray[np.int16]
Norms = NDArray[np.void]


@dataclass(frozen=True)
class TemplateSet:
    """Templates of k kinds of pins.

    half          (k,) px; a kind's window is the square of 2 half + 1 round its middle
    spans         of each kind (r, 3) int32: of each row of its support, first column and row against the
                  window's middle, and number of pixels
    first, plane  (k,) where a kind begins in `values`, and the length of each of its planes there: the
                  pixels of its spans, then zeros
    values        int16; a kind is the support, u, v, then d, tx, ty of each phase
    norms         (k, PHASES^2) NORM
    """

    half: tuple[int, ...]
    spans: tuple[Index, ...]
    first: tuple[int, ...]
    plane: tuple[int, ...]
    values: Shorts
    norms: Norms


@lru_cache(maxsize=8)  # while pins are searched for, every frame has the same pattern
def templates_of(radii: tuple[float, ...], edge_px: float, pitch_px: float) -> TemplateSet:
    """Templates of discs of these radii whose edge is blurred by `edge_px` (sigma), `pitch_px` apart."""
    parts = [_templates(radius, edge_px, pitch_px) for radius in radii]
    sizes = [planes.size for _, _, planes, _ in parts]
    return TemplateSet(
        half=tuple(half for half, *_ in parts),
        spans=tuple(spans for _, spans, *_ in parts),
        first=tuple(int(first) for first in np.cumsum([0, *sizes[:-1]])),
        plane=tuple(planes.shape[2] for _, _, planes, _ in parts),
        values=np.concatenate([planes.ravel() for _, _, planes, _ in parts]),
        norms=np.stack([norm for *_, norm in parts]).view(np.recarray),
    )


_erfc = np.vectorize(erfc, otypes=[np.float64])


@lru_cache(maxsize=64)
def _templates(radius: float, edge_px: float, pitch_px: float) -> tuple[int, Index, Shorts, Norms]:
    """Half width, spans, planes (17, 3, pixels of the spans, padded) and norms (16,) of one radius.

    The first three planes are the support and the columns and rows in it; then for each phase the disc, made
    orthogonal to a constant, and its slopes in x and y, made orthogonal to both.
    """
    support = min(
        radius + 3.0 * edge_px + 0.5, max(radius + 1.5 * edge_px, 0.85 * pitch_px - radius - 1.5 * edge_px)
    )
    half = min(int(np.ceil(support + 0.5)), HALF_MAX)
    offset = (np.arange(PHASES) + 0.5) / PHASES - 0.5
    grid = np.arange(-half, half + 1, dtype=np.float64)
    columns, rows = np.meshgrid(grid, grid)
    u = columns - np.tile(offset, PHASES)[:, None, None]
    v = rows - np.repeat(offset, PHASES)[:, None, None]
    r = np.hypot(u, v)
    one = (np.hypot(columns, rows) <= support).astype(np.float64)[None]
    disc = one * 0.5 * _erfc((r - radius) / (np.sqrt(2.0) * edge_px))
    slope = one * np.exp(-0.5 * ((r - radius) / edge_px) ** 2) / np.maximum(r, 1e-9)
    slope /= edge_px * np.sqrt(2.0 * np.pi)
    d = disc - one * _dot(disc, one) / _dot(one, one)
    tx, ty, px, py = (_freed(p, one, d) for p in (slope * u, slope * v, columns * one, rows * one))
    scale = (0.99 * _scale(d), 0.99 * min(_scale(tx), _scale(ty)))
    pixels, d2, tx2, ty2 = _dot(one, one), _dot(d, d), _dot(tx, tx), _dot(ty, ty)
    u_tx, v_ty = _dot(tx, px), _dot(ty, py)
    u2, v2 = _dot(px, px) - u_tx**2 / tx2, _dot(py, py) - v_ty**2 / ty2
    freedom = np.where(pixels > 8, pixels - 6, 2)
    norm = {
        "x": np.tile(offset, PHASES), "y": np.repeat(offset, PHASES),
        "by_d": 1.0 / (scale[0] * d2), "by_tx": 1.0 / (scale[1] * tx2), "by_ty": 1.0 / (scale[1] * ty2),
        "d2": d2, "tx2": tx2, "ty2": ty2,
        "u_d": _dot(columns, d), "v_d": _dot(rows, d), "u_tx": u_tx, "v_ty": v_ty,
        "inv_u2": 1.0 / u2, "inv_v2": 1.0 / v2, "tx_u": u_tx / tx2, "ty_v": v_ty / ty2,
        "spread": 0.5 / tx2 + 0.5 / ty2,
        "spread_x": 0.5 * u_tx**2 / (u2 * tx2**2), "spread_y": 0.5 * v_ty**2 / (v2 * ty2**2),
        "pixels": pixels, "inv_pixels": 1.0 / pixels, "freedom": freedom, "inv_freedom": 1.0 / freedom,
        "radius": radius, "unit_d": 1.0 / scale[0], "unit_t": 1.0 / scale[1],
    }  # fmt: skip
    inside = one[0] > 0
    n = np.count_nonzero(inside)
    planes = np.zeros((PHASES * PHASES + 1, 3, -(-n // BLOCK) * BLOCK), np.int16)
    planes[0, :, :n] = np.stack([one[0], columns, rows])[:, inside]
    planes[1:, :, :n] = _whole(np.stack([d * scale[0], tx * scale[1], ty * scale[1]], axis=1)[:, :, inside])
    norms = np.zeros(PHASES * PHASES, NORM)
    for name in NORM.names or ():
        norms[name] = np.asarray(norm[name], np.float64).ravel()
    return half, _spans(inside), planes, norms


def _spans(inside: Mask) -> Index:
    """First column, row and length of each row of a support; the middle of the square is (0, 0)."""
    rows = np.flatnonzero(inside.any(axis=1))
    first, length = inside[rows].argmax(axis=1), inside[rows].sum(axis=1)
    half = len(inside) // 2
    return np.stack([first - half, rows - half, length], axis=1).astype(np.int32)


def _whole(rows: Array) -> Array:
    """Rows of numbers whose sums are zero, rounded to integers whose sums are.

    The integers of a row that were rounded furthest in the direction of their surplus go to the other side.
    """
    whole: Array = np.rint(rows)
    surplus = whole.sum(axis=-1, keepdims=True)
    direction = np.sign(surplus)
    furthest = np.argsort((rows - whole) * direction, axis=-1, kind="stable")
    rank = np.argsort(furthest, axis=-1, kind="stable")
    whole -= direction * (rank < np.abs(surplus))
    return whole


def _scale(plane: Array) -> float:
    """The largest factor with which neither the integers nor their sum over any window overflow."""
    return float(
        min(
            32767.0 / np.abs(plane).max(),
            (2.0**31 - 1.0) / (STEP_MAX * np.abs(plane).sum(axis=(1, 2)).max()),
        )
    )


def _freed(plane: Array, one: Array, d: Array) -> Array:
    """`plane` less its share of `one` and of `d`, which are orthogonal."""
    return plane - one * _dot(plane, one) / _dot(one, one) - d * _dot(plane, d) / _dot(d, d)


def _dot(a: Array, b: Array) -> Array:
    product: Array = (a * b).sum(axis=(1, 2), keepdims=True)
    return product
