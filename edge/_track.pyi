from edge.types import Array, Index, Mask

def follow(
    frame: tuple[Array, Array, Array, Array, Array, Mask],
    tip: tuple[Array, Array, Index, Index, Array, Index, Index, Array, Array],
    scratch: Array,
    results: tuple[Array, Array, Mask, Array, Array],
) -> tuple[int, float]:
    """What is believed of the pins found; see the C file for the arrays."""
