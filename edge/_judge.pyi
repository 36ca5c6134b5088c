from edge.types import Array, Image, Index

def levels(image: Image, step: int, top: int, /) -> tuple[int, int, int]:
    """Of every step-th pixel of every step-th row: their sum, how many reach `top`, how many there are."""

def windows(image: Image, corners: Index, side: int, out: Array, /) -> float:
    """Energy of the gradient and span of the levels without the outer twentieths, of each window; mean level.

    corners  (m, 2) int32, x and y of each window's first pixel
    out      (m, 2), written
    Raises   ValueError: a window that leaves the image
    """

def far(now: Array, before: Array | None, limit: float, /) -> int:
    """How many of the points (n, 2) lie further apart than `limit`; before None: are longer. NaN does not."""

def middle_length(vectors: Array, scratch: Array, /) -> float:
    """Median length of the vectors (n, 2) that are finite, 0 for none; scratch (n,)."""
