"""Loops over all n pins for uncompiled runs; `pin_loops.pxd` has them in C, for vectors.

Both compute the same operations in the same order and give exactly the same. Arrays are (n, 2) px of x and
y, or (n,), unless said otherwise; what a loop writes is its last argument.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Heights


def copy(a: Array, out: Array) -> None:
    """a."""
    out[:] = a


def subtract(a: Array, b: Array, out: Array) -> None:
    """a less b, of the first n points."""
    np.subtract(a[: len(out)], b[: len(out)], out=out)


def subtract_single(a: Array, b: Array, out: Heights) -> None:
    """a less b, in single precision."""
    out[:] = a - b


def extrapolate(now: Array, last: Array, share: float, out: Array) -> None:
    """Where pins are when a share of their last motion is repeated."""
    out[:] = now + share * (now - last)


def square_distances(a: Array, b: Array, unit2: Array, out: Array) -> None:
    """Squared distances of a from b, in squared units (n,) of each pin."""
    out[:] = _squares(a - b) / unit2


def subtract_prediction(found: Array, rest: Array, predicted: Heights, residual: Heights) -> None:
    """Motion since rest less the predicted one, in single precision."""
    residual[:] = found - rest - predicted


def within(
    residual: Heights,
    before: Heights,
    most2: Array,
    change: float,
    change2: Array,
    is_within: NDArray[np.uint8],
) -> bool:
    """Whether the square of a residual is below the pin's limit, px2, and that of its change from `before`
    below `change` of another; NaN is not.

    Returns  it is otherwise for one pin than `is_within` was
    """
    inside = (_squares(residual) < most2) & (
        _squares(residual.astype(np.float64) - before) < change * change2
    )
    changed = bool((inside != is_within).any())
    is_within[:] = inside
    return changed


def beyond(residual: Heights, most2: Array, seen: NDArray[np.uint8], is_beyond: NDArray[np.uint8]) -> bool:
    """Whether a pin is seen and the square of its residual above its limit, px2; returns whether one is."""
    is_beyond[:] = (_squares(residual) > most2) & (seen != 0)
    return bool(is_beyond.any())


def all_near(a: Array, b: Heights, far2: float) -> bool:
    """Whether all squared distances of a from b are below far2; NaN in a is, in b alone it is not."""
    return bool(((_squares(a - b) < far2) | np.isnan(a[:, 0])).all())


def _squares(xy: Array | Heights) -> Array:
    x, y = xy.astype(np.float64).T
    square: Array = x * x + y * y
    return square
