from typing import Any

import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Index, Mask

Singles = NDArray[np.float32]
Shorts = NDArray[np.int16]

def motion(xy: Array, rest: Array, sigma: Array, seen: Mask, out: Array) -> tuple[float, float, float, int]:
    """Motion since rest into `out`; its mean x and y over the seen pins, their mean sigma, their number."""

def ring_peak(value: Array, columns: int, ring: Index) -> tuple[float, int]:
    """Highest mean over a ring, or length of the median where there are two columns, and the ring's row;
    NaN where nothing is known."""

def coherent(
    xy: Array,
    rest: Array,
    ring: Index,
    slope: Array,
    scratch: Array,
    limit: float,
    anywhere: float,
    first: int,
) -> bool:
    """Whether the skin grows by more than the limit in that row's ring, or by more than the other limit in
    any, when each pin moves as its ring's median."""

def typical_size(value: Array, scratch: Array) -> float:
    """Median of the sizes of the finite values; NaN for none."""

def centred(motion: Array, scratch: Array, out: Array) -> None:
    """Each column less the median of its finite values."""

def modes(
    re: Array, im: Array, gram: Array, inverse: Array, motion: Array, seen: Mask, work: Array, out: Array
) -> None:
    """Least squares over the seen pins; complex numbers as pairs."""

def roughness(xy: Array, rest: Array, seen: Mask, near: Index, weight: Array, scratch: Array) -> float:
    """Robust noise of the seen pins' motion against their neighbours'."""

def heights(
    change: Array,
    motion: tuple[Array, Array, Index, Array],
    rows: Shorts,
    steps: Singles,
    work: Shorts,
    growth: Singles,
    heights: Singles,
    level: float,
) -> float:
    """Gaps closed into `growth`, the surface into `heights`; the sum of its compressed part."""

def stretch(
    xy: Array, rest: Array, rows: Shorts, steps: Singles, work: Shorts, bent: Singles, stretch: Singles
) -> tuple[float, float]:
    """Divergence of the motion's surface; step of the motion in `work`, and divergence of its even part."""

def contacts(
    relief: Singles,
    threshold: Singles,
    gain: Singles,
    grid: tuple[Index, Singles, Index, Index, int],
    rules: Array,
    pins: tuple[Singles, Array, Array, Mask],
    local: tuple[Index, Array, Array],
    fine: tuple[Any, ...],
    out: Array,
    ridge: Array,
) -> tuple[int, int, int]:
    """Contacts into `out`: x, y, peak, area, angle, elongation, ridge points; how many, how many points,
    and whether a sharper field was asked for."""

def maxima(grid: Singles, width: int, place: Index, mark: Index, stack: Index) -> None:
    """Marks maxima with 2."""

def contact_pins(change: Array, least: float, unit: Array, out: Index) -> int:
    """Rows of the pins in the contact's ellipse into `out`; how many."""

def torsion(rest: Array, motion: Array, pins: Index, n: int) -> float:
    """Rotation of these pins about their middle."""

def slip_sums(
    now: Array, before: Array, unit: Array, pins: Index, n: int, ridge: float
) -> tuple[int, float, float]:
    """Pins that count, sum of their steps' squares, and what a plane leaves of it."""
