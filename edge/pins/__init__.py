"""Where the pins are in an image.

    learn            pins of one image, in no order, and their pattern: size, pitch, circle, brightness, blur
    detect           all pins of a known pattern in an image, in no order
    take_rest        the untouched tip, from several images: row i defines pin i
    left_out         spots like pins that it takes for none
    CentroidRefiner  where each pin of the rest is now, read from its neighbourhood alone: the hot path

Nothing is configured: size, spacing and brightness come from the image. Detection may read every pixel, the
refiner reads windows only; both end in the same estimator (`centroids`), so a pin has one position whichever
way it was found.
"""

from edge.pins.detect import detect, learn, left_out, to_grey
from edge.pins.refine import CentroidRefiner
from edge.pins.rest_frame import take_rest

__all__ = ["CentroidRefiner", "detect", "learn", "left_out", "take_rest", "to_grey"]
