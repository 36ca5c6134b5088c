from typing import TypeAlias

from edge.types import Array, Index, Mask

Map: TypeAlias = tuple[Index, Array, Array, float]

def follow(
    frame: tuple[Array, Array, Array, Array, Array, Array, Mask],
    tip: tuple[Array, Array, Index, Index, Array, Index, Index, Array, Array, Array, Array],
    map: Map,
    scratch: Array,
    results: tuple[Array, Array, Mask, Array, Array],
) -> tuple[int, float]:
    """What is believed of the pins found; see the C file for the arrays."""

def doubt(
    light: Array,
    rest_look: Array,
    sigma: Array,
    bend: Array,
    motion: Array,
    step: Array,
    doubts: Array,
    map: Map,
    scratch: Array,
    seen: Mask,
) -> None:
    """Throw out what looks unlike itself and does not go with its neighbours; seen is written."""

Blobs: TypeAlias = tuple[Array, Index, int, float, float, float]

def predict(motion: Array, known: Mask, map: Map, value: Array, support: Array, gradient: Array) -> None:
    """Motion of each pin as its known neighbours have it; value, support and gradient are written."""

def match(at: Array, gate: Array, blobs: Blobs, blob: Index, square: Array, ours: Mask) -> None:
    """Nearest blob of each point, none given twice; blob, square and ours are written."""

def grow(
    motion: Array,
    known: Mask,
    blob: Index,
    map: Map,
    blobs: Blobs,
    rest: Array,
    gate: Array,
    least_support: float,
    sweeps: int,
) -> None:
    """Predict and match in turn, until nothing changes; motion, known and blob are written."""

def pieces(motion: Array, known: Mask, first: Index, second: Index, seam: Array, label: Index) -> None:
    """Which pins hang together; label is written."""

def disagree(motion: Array, known: Mask, ring: Index, pins: int, off: Array) -> None:
    """How far each motion is off the mean of the neighbours', of one hypothesis or many; off is written."""
