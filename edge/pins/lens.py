"""Pins without the lens's distortion: the only place where it is removed, and put back.

        image -> search, windows -> pins as seen -> corrected -> everything after this stage
                      ^                                            |
                      +-------------- as seen <--- predictions ----+

Images are never changed. A pattern that has a lens (`PinPattern.lens`) is a corrected one: its circle, pitch
and glints are those of the corrected pins; sizes and levels of a pin are always as seen. Without a lens
nothing here runs. Models and coefficients are OpenCV's; focal length and centre stay as they are.
"""

from dataclasses import replace

import cv2
import numpy as np

from edge.errors import NoPins
from edge.geometry.lattice import pitch_of
from edge.geometry.layout import circle_of
from edge.types import Array, Lens, PinPattern, Pins, Rest

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
        (fx, fy), (cx, cy) = lens.focal_px, lens.centre_px
        matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        distortion = np.array(lens.distortion)
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


def corrected_pins(pins: Pins, lens: Lens) -> Pins:
    """Pins at their places without distortion."""
    sigma = pins.sigma_px * magnification(lens, pins.xy_img)
    return replace(pins, xy_img=corrected(lens, pins.xy_img), sigma_px=sigma)


def corrected_rest(rest: Rest, lens: Lens) -> Rest:
    """A rest frame as seen, without distortion. Raises NoPins: the lens is of another image size."""
    if lens.size_px != rest.pattern.size_px:
        made, now = ("{}x{}".format(*size) for size in (lens.size_px, rest.pattern.size_px))
        raise NoPins(f"the lens was measured at {made}, the images are {now}; give the lens at that size")
    pins = corrected_pins(rest.pins, lens)
    glints = np.array(rest.pattern.glints_img, np.float64).reshape(-1, 2)
    return replace(
        rest, pins=pins, pattern=_of_places(rest.pattern, pins.xy_img, corrected(lens, glints), lens)
    )


def rest_as_seen(rest: Rest) -> Rest:
    """The rest frame as the camera sees it."""
    lens = rest.pattern.lens
    if lens is None:
        return rest
    xy = seen(lens, rest.xy_img)
    sigma = rest.pins.sigma_px / magnification(lens, xy)
    glints = np.array(rest.pattern.glints_img, np.float64).reshape(-1, 2)
    pattern = _of_places(rest.pattern, xy, seen(lens, glints), None)
    return Rest(replace(rest.pins, xy_img=xy, sigma_px=sigma), pattern)


def pattern_as_seen(pattern: PinPattern) -> PinPattern:
    """The pattern as the camera sees it, without its pins: its circle is the one round the circle as seen."""
    lens = pattern.lens
    if lens is None:
        return pattern
    turn = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    circle = pattern.centre_img + pattern.tip_radius_px * np.column_stack([np.cos(turn), np.sin(turn)])
    centre, radius_px = circle_of(seen(lens, circle), 0.0)
    middle = seen(lens, np.asarray(pattern.centre_img)[None])
    glints = seen(lens, np.array(pattern.glints_img, np.float64).reshape(-1, 2))
    return replace(
        pattern,
        lens=None,
        centre_img=centre,
        tip_radius_px=radius_px,
        pitch_px=pattern.pitch_px / float(magnification(lens, middle)[0]),
        glints_img=_pairs(glints),
    )


def _of_places(pattern: PinPattern, xy: Array, glints: Array, lens: Lens | None) -> PinPattern:
    """The pattern of pins at these places."""
    centre, tip_radius_px = circle_of(xy, pattern.pin_radius_px)
    return replace(
        pattern,
        lens=lens,
        centre_img=centre,
        tip_radius_px=tip_radius_px,
        pitch_px=pitch_of(xy),
        glints_img=_pairs(glints),
    )


def _pairs(xy: Array) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in xy)
