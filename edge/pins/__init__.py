"""Where the pins are in an image.

    learn_pattern   radius, pitch, circle, brightness and blur of the pins, from one image
    detect          all pins of an image, in no order; without a pattern it is learnt from that image
    take_rest       the untouched tip, from several images: row i defines pin i
    Refiner         where each pin of the rest is now, read from its neighbourhood alone: the hot path

Rules
- Nothing is configured: size, spacing and brightness come from the image.
- Detection (`_blobs`, `_pattern`, `_detect`) may look at every pixel; `Refiner` reads windows only. Both end
  in the same estimator (`edge._centroid`), so a pin has one position whichever way it was found.
"""

from edge.pins._detect import detect, inspect_image, learn_pattern, take_rest, to_grey
from edge.pins._refine import Refiner

__all__ = ["Refiner", "detect", "inspect_image", "learn_pattern", "take_rest", "to_grey"]
