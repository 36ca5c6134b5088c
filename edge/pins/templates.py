"""Templates of a pin: disc, slopes and their norms at every subpixel offset, for `centroids`.

Rules
- Radii come in kinds 5 % apart: a template that is 2.5 % off in radius is still symmetric, so it costs a
  little noise (1 %) and no bias.
- 16-bit integers, scaled so that no sum over a window overflows 32 bits. Those of d, tx and ty sum to zero,
  as the exact ones do: a level that all pixels share changes no sum.
- Only the support circle is kept, row after row without gaps: half of the square round it is outside.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import erfc, isqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Index, Mask

PHASES = 4  # subpixel offsets along each axis
FAR_PX = 2.0**0.5 / PHASES  # a phase's diagonal: a longer step goes beyond the middles of those next to it
BLOCK = 32  # a plane's length is a multiple of it: loops have no remainder
#: px, half width of a window: two levels times it, or four less their middle, fit 16 bits.
HALF_MAX = int(np.iinfo(np.int16).max // (2 << np.iinfo(np.uint8).bits))
STEP_MAX = 4095  # a pixel against the window's middle, levels: 12 bits; brighter images lose their last bits
SIDE = isqrt(STEP_MAX // np.iinfo(np.uint8).max)  # px, of the blocks that large pins are read by; C knows 4

#: One phase has these, in this order, which `centroid_steps.pxd` numbers. |p| is the root of
#: the sum of p^2 over the support, u and v are columns and rows from its middle, u' and v' these less their
#: shares of d and of tx or ty.
#: by_d, by_tx, by_ty  a sum with these integers times this is a component along d / |d|, tx / |tx|, ty / |ty|
#: by_u, by_v          1 / |u'|, 1 / |v'|
#: by_level, by_square  1: sums that stay whole numbers
#: inv_pixels          of the support
#: inv_d               1 / |d|
#: x_d, y_d            |d| / |tx|, |d| / |ty|
#: x_u, y_v            px: a component along u' or v' over that along d moves the pin by so much
#: d_u, tx_u, d_v, ty_v  times a component along d, tx, ty: what to add to u or v to have u' or v'
#: freedom, inv_freedom  degrees of freedom that six unknowns leave
#: radius, step_max    px
#: d2                  |d|^2
#: unit_d, unit_t      value of one unit of the integers
NORM = (
    "by_d", "by_tx", "by_ty", "by_level", "by_u", "by_v", "by_square", "inv_pixels",
    "inv_d", "x_d", "y_d", "x_u", "y_v", "d_u", "tx_u", "d_v", "ty_v", "freedom", "inv_freedom", "radius",
    "step_max", "d2", "unit_d", "unit_t",
)  # fmt: skip

Bytes = NDArray[np.int8]
Shorts = NDArray[np.int16]


@dataclass(frozen=True)
class TemplateSet:
    """Templates of k kinds of pins.

    side          px: pixels of windows are sums of blocks of the image, side x side, 1 or `SIDE`; the middle
                  one begins (side - 1) // 2 before the pixel that a window is round
    half          (k,) such pixels; a kind's window is the square of 2 half + 1 round its middle
    spans         of each kind (r, 3) int32: of each row of its support, first column and row against the
                  window's middle, and number of pixels
    first, first_uv  (k,) where a kind begins in `values`, and in `uv`
    plane         (k,) length of each of its planes there: the pixels of its spans, then zeros
    values        int16; a kind is d, tx, ty of each phase
    uv            int8; a kind is u, v
    norms         (k, PHASES^2, len(NORM)) float64
    """

    side: int
    half: tuple[int, ...]
    spans: tuple[Index, ...]
    first: tuple[int, ...]
    first_uv: tuple[int, ...]
    plane: tuple[int, ...]
    values: Shorts
    uv: Bytes
    norms: Array


@lru_cache(maxsize=8)  # while pins are searched for, every frame has the same pattern
def templates_of(radii: tuple[float, ...], edge_px: float, pitch_px: float, side: int = 1) -> TemplateSet:
    """Templates of discs of these radii whose edge is blurred by `edge_px` (sigma), `pitch_px` apart."""
    parts = [_templates(radius, edge_px, pitch_px, side) for radius in radii]
    return TemplateSet(
        side=side,
        half=tuple(part.half for part in parts),
        spans=tuple(part.spans for part in parts),
        first=_begins([part.values.size for part in parts]),
        first_uv=_begins([part.uv.size for part in parts]),
        plane=tuple(part.uv.shape[1] for part in parts),
        values=np.concatenate([part.values.ravel() for part in parts]),
        uv=np.concatenate([part.uv.ravel() for part in parts]),
        norms=np.stack([part.norms for part in parts]),
    )


def _begins(sizes: list[int]) -> tuple[int, ...]:
    """Where each part begins, one after the other."""
    return tuple(int(begin) for begin in np.cumsum([0, *sizes[:-1]]))


def radius_max_px(edge_px: float) -> float:
    """The largest disc that a window holds with its edge, where others stand as close as they may."""
    return HALF_MAX - 0.5 - _tight(0.0, edge_px)


def _tight(radius: float, edge_px: float) -> float:
    """The least radius of a support."""
    return radius + 1.5 * edge_px


class _Kind(NamedTuple):
    """Templates of one radius: half width, spans, values (16, 3, plane), uv (2, plane), norms (16, 24)."""

    half: int
    spans: Index
    values: Shorts
    uv: Bytes
    norms: Array


_erfc = np.vectorize(erfc, otypes=[np.float64])


@lru_cache(maxsize=64)
def _templates(radius: float, edge_px: float, pitch_px: float, side: int) -> _Kind:
    """The disc of each phase, orthogonal to a constant, and its slopes in x and y, orthogonal to both."""
    tight = _tight(radius, edge_px)
    support = min(radius + 3.0 * edge_px + 0.5, max(tight, 0.85 * pitch_px - tight))
    half = min(int(np.ceil(support / side + 0.5)), HALF_MAX // side)
    offset = (np.arange(PHASES) + 0.5) / PHASES - 0.5
    grid = np.arange(-half, half + 1, dtype=np.float64)
    columns, rows = np.meshgrid(grid, grid)
    one = (side * np.hypot(columns, rows) <= support + (side - 1) / 2).astype(np.float64)[None]
    pixels = np.arange(side * len(grid)) - (side * len(grid) - 1) / 2
    u = pixels - np.tile(offset, PHASES)[:, None, None]
    v = pixels[:, None] - np.repeat(offset, PHASES)[:, None, None]
    r = np.hypot(u, v)
    disc = 0.5 * _erfc((r - radius) / (np.sqrt(2.0) * edge_px))
    slope = np.exp(-0.5 * ((r - radius) / edge_px) ** 2) / np.maximum(r, 1e-9)
    slope /= edge_px * np.sqrt(2.0 * np.pi)
    planes = np.stack([disc, slope * u, slope * v]).reshape(3, -1, len(grid), side, len(grid), side)
    disc, *slopes = one * planes.mean(axis=(3, 5))
    d = disc - one * _dot(disc, one) / _dot(one, one)
    tx, ty, px, py = (_freed(p * one, one, d) for p in (*slopes, columns, rows))
    scale = (0.99 * _scale(d), 0.99 * min(_scale(tx), _scale(ty)))
    inside = one[0] > 0
    n = np.count_nonzero(inside)
    values = np.zeros((PHASES * PHASES, 3, -(-n // BLOCK) * BLOCK), np.int16)
    values[:, :, :n] = _whole(np.stack([d * scale[0], tx * scale[1], ty * scale[1]], axis=1)[:, :, inside])
    uv = np.zeros((2, values.shape[2]), np.int8)
    uv[:, :n] = np.stack([columns, rows])[:, inside]
    freedom = max(n - 6.0, 2.0)
    norm = _norms(d, tx, ty, px, py, scale) | {
        "by_level": 1.0, "by_square": 1.0, "inv_pixels": 1.0 / n, "freedom": freedom, "radius": radius,
        "inv_freedom": 1.0 / freedom, "step_max": side * max(half - 2, 2) / 2,
    }  # fmt: skip
    norms = np.stack([np.broadcast_to(norm[name], PHASES * PHASES) for name in NORM], axis=1)
    return _Kind(half, _spans(inside), values, uv, norms)


def _norms(
    d: Array, tx: Array, ty: Array, px: Array, py: Array, scale: tuple[float, float]
) -> dict[str, Array | float]:
    """The part of NORM that depends on the phase.

    px, py  columns and rows, orthogonal to 1 and d
    scale   of the integers of d, of tx and ty
    """
    columns, rows = (np.arange(side) - side // 2 for side in d.shape[:0:-1])
    d2, tx2, ty2 = _dot(d, d), _dot(tx, tx), _dot(ty, ty)
    u_d, u_tx, v_d, v_ty = _dot(columns, d), _dot(px, tx), _dot(rows[:, None], d), _dot(py, ty)
    of_d, of_tx, of_ty = np.sqrt(d2), np.sqrt(tx2), np.sqrt(ty2)
    of_u, of_v = np.sqrt(_dot(px, px) - u_tx**2 / tx2), np.sqrt(_dot(py, py) - v_ty**2 / ty2)
    norm = {
        "by_d": 1.0 / (scale[0] * of_d), "by_tx": 1.0 / (scale[1] * of_tx), "by_ty": 1.0 / (scale[1] * of_ty),
        "by_u": 1.0 / of_u, "by_v": 1.0 / of_v, "inv_d": 1.0 / of_d, "x_d": of_d / of_tx, "y_d": of_d / of_ty,
        "x_u": u_tx * of_d / (of_u * tx2), "y_v": v_ty * of_d / (of_v * ty2),
        "d_u": -u_d / (of_d * of_u), "tx_u": -u_tx / (of_tx * of_u),
        "d_v": -v_d / (of_d * of_v), "ty_v": -v_ty / (of_ty * of_v), "d2": d2,
    }  # fmt: skip
    return {name: numbers.ravel() for name, numbers in norm.items()} | {
        "unit_d": 1.0 / scale[0], "unit_t": 1.0 / scale[1]
    }  # fmt: skip


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
    size = np.abs(plane)
    return float(min(32767.0 / size.max(), (2.0**31 - 1.0) / (STEP_MAX * size.sum(axis=(1, 2)).max())))


def _freed(plane: Array, one: Array, d: Array) -> Array:
    """`plane` less its share of `one` and of `d`, which are orthogonal."""
    return plane - one * _dot(plane, one) / _dot(one, one) - d * _dot(plane, d) / _dot(d, d)


def _dot(a: Array, b: Array) -> Array:
    product: Array = (a * b).sum(axis=(1, 2), keepdims=True)
    return product
