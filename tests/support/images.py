"""Images with the types of the code under test, from OpenCV's functions, whose types are wider."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def grey(image: NDArray[Any]) -> NDArray[np.uint8]:
    """An image that is known to have 8 bits."""
    assert image.dtype == np.uint8
    return image
