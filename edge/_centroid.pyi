import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Image, Index

def refine(
    image: Image,
    predicted: Array,
    kind_of: Index,
    kinds: NDArray[np.int64],
    templates: NDArray[np.int16],
    norms: Array,
    rest_amplitude: Array,
    limits: Array,
    order: Index,
    scratch: Array,
    out: Array,
) -> None: ...
