"""Where a lens moves points of an image to, and back. OpenCV's models.

    corrected   from the place that the camera sees to the place behind a lens without distortion
    seen        back

Both are px of the same image: focal length and centre stay as they are.
"""

import cv2
import numpy as np

from edge.types import Array, Lens

EXACT_PX = 1e-6  # a thousandth of what centroids are good to
STEPS_MAX = 20  # a step doubles the exact digits: more are needed where the lens folds the image over


def corrected(lens: Lens, xy_img: Array) -> Array:
    """(n, 2) px without distortion; NaN stays NaN."""
    xy = np.array(xy_img, np.float64)
    for _ in range(STEPS_MAX):  # Newton's method
        (a, b), (c, d) = (
            (seen(lens, xy + half) - seen(lens, xy - half)).T for half in ((0.5, 0.0), (0.0, 0.5))
        )
        x, y = (xy_img - seen(lens, xy)).T
        step = np.column_stack([d * x - c * y, a * y - b * x]) / (a * d - b * c)[:, None]
        xy += step
        if not np.any(np.abs(step) > EXACT_PX):
            break
    return xy


def seen(lens: Lens, xy_img: Array) -> Array:
    """(n, 2) px as the camera sees points of a picture without distortion; NaN stays NaN."""
    known = np.isfinite(xy_img[:, 0])
    xy = np.full(xy_img.shape, np.nan)
    if known.any():
        matrix, distortion = _arrays(lens)
        rays = (xy_img[known] - lens.centre_px) / lens.focal_px
        if lens.model == "fisheye":
            found = cv2.fisheye.distortPoints(rays[:, None], matrix, distortion)
        else:
            forward = np.column_stack([rays, np.ones(len(rays))])
            found = cv2.projectPoints(forward, np.zeros(3), np.zeros(3), matrix, distortion)[0]
        xy[known] = found[:, 0]
    return xy


def magnification(lens: Lens, xy_img: Array) -> Array:
    """(n,) by which `corrected` enlarges what is at these places of the camera's image."""
    east, west, south, north = (
        corrected(lens, xy_img + step) for step in ((0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5))
    )
    (a, b), (c, d) = (east - west).T, (south - north).T
    return np.asarray(np.sqrt(np.abs(a * d - b * c)))


def _arrays(lens: Lens) -> tuple[Array, Array]:
    """Camera matrix and coefficients, as OpenCV takes them."""
    (fx, fy), (cx, cy) = lens.focal_px, lens.centre_px
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]), np.array(lens.distortion)
