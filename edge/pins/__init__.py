"""Where the pins are in an image.

    learn_pattern    radius, pitch, circle, brightness and blur of the pins, from one image
    detect           all pins of an image, in no order; without a pattern it is learnt from that image
    take_rest        the untouched tip, from several images: row i defines pin i
    CentroidRefiner  where each pin of the rest is now, read from its neighbourhood alone: the hot path

Rules
- Nothing is configured: size, spacing and brightness come from the image.
- Detection (`blobs`, `pattern`, `partial`, `detect`) may read every pixel; `refine` reads windows only.
  Both end in the same estimator (`centroids`), so a pin has one position whichever way it was found; which
  of the followed pins count is decided there, over all of them.
"""

from edge.pins.detect import detect, learn_pattern, to_grey
from edge.pins.refine import CentroidRefiner
from edge.pins.rest_frame import take_rest

__all__ = ["CentroidRefiner", "detect", "learn_pattern", "take_rest", "to_grey"]
