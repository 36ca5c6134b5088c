"""Templates of a pin: disc, slopes and their norms at every subpixel offset, for `centroids`.

Rules
- Radii come in kinds 5 % apart: a template that is 2.5 % off in radius is still symmetric, so it costs a
  little noise (1 %) and no bias.
- 8-bit integers, so that products of two pixels fit 16 bits. Those of d, tx and ty sum to zero, as the exact
  ones do: a level that all pixels share changes no sum.
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
LANES = 16  # bytes: a window's rows are copied in multiples of it
BLOCK = 32  # a plane's length is a multiple of it: loops have no remainder
PLANES = len(("d", "tx", "ty", "u", "v"))  # BLOCK numbers of each follow each other
#: The largest number of a template, and half width of a window, px: two levels times it, or four less their
#: middle, fit 16 bits.
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


@dataclass(frozen=True)
class TemplateSet:
    """Templates of k kinds of pins.

    side          px: pixels of windows are sums of blocks of the image, side x side, 1 or `SIDE`; the middle
                  one begins (side - 1) // 2 before the pixel that a window is round
    half          (k,) such pixels; a kind's window is the square of 2 half + 1 round its middle
    spans         of each kind (r, 3) int32: of each row of its support, first column and row against the
                  window's middle, and number of pixels
    first         (k,) where a kind begins in `values`
    plane         (k,) length of each of its planes there: the pixels of its spans, then zeros
    values        int8; a kind is (PHASES^2, plane / BLOCK, PLANES, BLOCK)
    norms         (k, PHASES^2, len(NORM)) float64
    """

    side: int
    half: tuple[int, ...]
    spans: tuple[Index, ...]
    first: tuple[int, ...]
    plane: tuple[int, ...]
    values: Bytes
    norms: Array


@lru_cache(maxsize=8)  # while pins are searched for, every frame has the same pattern
def templates_of(radii: tuple[float, ...], edge_px: float, pitch_px: float, side: int = 1) -> TemplateSet:
    """Templates of discs of these radii whose edge is blurred by `edge_px` (sigma), `pitch_px` apart."""
    parts = [_templates(radius, edge_px, pitch_px, side) for radius in radii]
    return TemplateSet(
        side=side,
        half=tuple(part.half for part in parts),
        spans=tuple(part.spans for part in parts),
        first=tuple(int(begin) for begin in np.cumsum([0, *(part.values.size for part in parts[:-1])])),
        plane=tuple(part.values.shape[1] * BLOCK for part in parts),
        values=np.concatenate([part.values.ravel() for part in parts]),
        norms=np.stack([part.norms for part in parts]),
    )


def radius_max_px(edge_px: float) -> float:
    """The largest disc that a window holds with its edge, where others stand as close as they may."""
    return HALF_MAX - 0.5 - _tight(0.0, edge_px)


def _tight(radius: float, edge_px: float) -> float:
    """The least radius of a support."""
    return radius + 1.5 * edge_px


class _Kind(NamedTuple):
    """Templates of one radius: half width, spans, values (16, plane / 32, 5, 32), norms (16, 24)."""

    half: int
    spans: Index
    values: Bytes
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
    inside = one[0] > 0
    n = np.count_nonzero(inside)
    exact = np.stack([d, tx, ty], axis=1)[:, :, inside]
    size = np.abs(exact)  # no sum of its integers may overflow 32 bits
    most = np.maximum(size.max(axis=(0, 2)), size.sum(axis=2).max(axis=0) * (STEP_MAX * HALF_MAX / 2.0**30))
    scale = (HALF_MAX - 1) / np.array([most[0], *2 * [most[1:].max()]])
    whole = _whole(exact * scale[:, None], np.argsort(exact[:, :1], axis=-1).astype(np.int32))
    values = np.zeros((PHASES * PHASES, PLANES, -(-n // BLOCK) * BLOCK), np.int8)
    values[:, :3, :n], values[:, 3:, :n] = whole, np.stack([columns, rows])[:, inside]
    by_d, by_tx, by_ty = (np.sqrt((exact**2).sum(axis=-1)) / (exact * whole).sum(axis=-1)).T
    freedom = max(n - 6.0, 2.0)
    norm = _norms(d, tx, ty, px, py) | {
        "by_d": by_d, "by_tx": by_tx, "by_ty": by_ty, "unit_d": 1.0 / scale[0], "unit_t": 1.0 / scale[1],
        "by_level": 1.0, "by_square": 1.0, "inv_pixels": 1.0 / n, "freedom": freedom, "radius": radius,
        "inv_freedom": 1.0 / freedom, "step_max": side * max(half - 2, 2) / 2,
    }  # fmt: skip
    norms = np.stack([np.broadcast_to(norm[name], PHASES * PHASES) for name in NORM], axis=1)
    blocks = values.reshape(PHASES * PHASES, PLANES, -1, BLOCK).swapaxes(1, 2)
    return _Kind(half, _spans(inside), blocks, norms)


def _norms(d: Array, tx: Array, ty: Array, px: Array, py: Array) -> dict[str, Array]:
    """The part of NORM that depends on the phase alone; px, py: columns and rows, orthogonal to 1 and d."""
    columns, rows = (np.arange(side) - side // 2 for side in d.shape[:0:-1])
    d2, tx2, ty2 = _dot(d, d), _dot(tx, tx), _dot(ty, ty)
    u_d, u_tx, v_d, v_ty = _dot(columns, d), _dot(px, tx), _dot(rows[:, None], d), _dot(py, ty)
    of_d, of_tx, of_ty = np.sqrt(d2), np.sqrt(tx2), np.sqrt(ty2)
    of_u, of_v = np.sqrt(_dot(px, px) - u_tx**2 / tx2), np.sqrt(_dot(py, py) - v_ty**2 / ty2)
    norm = {
        "by_u": 1.0 / of_u, "by_v": 1.0 / of_v, "inv_d": 1.0 / of_d, "x_d": of_d / of_tx, "y_d": of_d / of_ty,
        "x_u": u_tx * of_d / (of_u * tx2), "y_v": v_ty * of_d / (of_v * ty2),
        "d_u": -u_d / (of_d * of_u), "tx_u": -u_tx / (of_tx * of_u),
        "d_v": -v_d / (of_d * of_v), "ty_v": -v_ty / (of_ty * of_v), "d2": d2,
    }  # fmt: skip
    return {name: numbers.ravel() for name, numbers in norm.items()}


def _spans(inside: Mask) -> Index:
    """First column, row and length of each row of a support; the middle of the square is (0, 0)."""
    rows = np.flatnonzero(inside.any(axis=1))
    first, length = inside[rows].argmax(axis=1), inside[rows].sum(axis=1)
    half = len(inside) // 2
    return np.stack([first - half, rows - half, length], axis=1).astype(np.int32)


def _whole(rows: Array, order: Index) -> Array:
    """Rows of numbers whose sums are zero, rounded to integers whose sums are.

    What rounding leaves goes to the next one in this order: sums with the levels of the disc hardly change.
    """
    sums = np.rint(np.cumsum(np.take_along_axis(rows, order, axis=-1), axis=-1))
    whole = np.empty_like(rows)
    np.put_along_axis(whole, np.broadcast_to(order, rows.shape), np.diff(sums, prepend=0.0), axis=-1)
    return whole


def _freed(plane: Array, one: Array, d: Array) -> Array:
    """`plane` less its share of `one` and of `d`, which are orthogonal."""
    return plane - one * _dot(plane, one) / _dot(one, one) - d * _dot(plane, d) / _dot(d, d)


def _dot(a: Array, b: Array) -> Array:
    product: Array = (a * b).sum(axis=(1, 2), keepdims=True)
    return product
