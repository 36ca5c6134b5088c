"""Images with the types of the code under test, from OpenCV's functions, whose types are wider."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray


def read_grey(path: Path) -> NDArray[np.uint8]:
    """The image in a file, in 8 bits."""
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    assert image is not None, path
    return grey(image)


def grey(image: NDArray[Any]) -> NDArray[np.uint8]:
    """An image that is known to have 8 bits."""
    assert image.dtype == np.uint8
    return image
