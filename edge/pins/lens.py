"""Pins without the lens's distortion: the only place where it is removed, and put back.

        image -> search, windows -> pins as seen -> corrected -> everything after this stage
                      ^                                            |
                      +-------------- as seen <--- predictions ----+

Images are never changed. A pattern that has a lens (`PinPattern.lens`) is a corrected one: its circle, pitch
and glints are those of the corrected pins; sizes and levels of a pin are always as seen. Without a lens
nothing here runs.
"""

from dataclasses import replace

import cv2
import numpy as np

from edge.errors import NoPins
from edge.geometry import lens as geometry
from edge.geometry.lattice import pitch_of
from edge.types import Array, Lens, PinPattern, Pins, Rest


def corrected_pins(pins: Pins, lens: Lens) -> Pins:
    """Pins at their places without distortion."""
    sigma = pins.sigma_px * geometry.magnification(lens, pins.xy_img)
    return replace(pins, xy_img=geometry.corrected(lens, pins.xy_img), sigma_px=sigma)


def corrected_rest(rest: Rest, lens: Lens) -> Rest:
    """A rest frame as seen, without distortion. Raises NoPins: the lens is of another image size."""
    if lens.size_px != rest.pattern.size_px:
        made, now = ("{}x{}".format(*size) for size in (lens.size_px, rest.pattern.size_px))
        raise NoPins(f"the lens was measured at {made}, the images are {now}; give the lens at that size")
    pins = corrected_pins(rest.pins, lens)
    glints = np.array(rest.pattern.glints_img, np.float64).reshape(-1, 2)
    return Rest(pins, _of_places(rest.pattern, pins.xy_img, geometry.corrected(lens, glints), lens))


def rest_as_seen(rest: Rest) -> Rest:
    """The rest frame as the camera sees it."""
    lens = rest.pattern.lens
    if lens is None:
        return rest
    xy = geometry.seen(lens, rest.xy_img)
    sigma = rest.pins.sigma_px / geometry.magnification(lens, xy)
    glints = np.array(rest.pattern.glints_img, np.float64).reshape(-1, 2)
    pattern = _of_places(rest.pattern, xy, geometry.seen(lens, glints), None)
    return Rest(replace(rest.pins, xy_img=xy, sigma_px=sigma), pattern)


def pattern_as_seen(pattern: PinPattern) -> PinPattern:
    """The pattern as the camera sees it, without its pins: its circle is the one round the circle as seen."""
    lens = pattern.lens
    if lens is None:
        return pattern
    turn = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    circle = pattern.centre_img + pattern.tip_radius_px * np.column_stack([np.cos(turn), np.sin(turn)])
    centre, radius_px = _circle(geometry.seen(lens, circle))
    middle = geometry.seen(lens, np.asarray(pattern.centre_img)[None])
    glints = geometry.seen(lens, np.array(pattern.glints_img, np.float64).reshape(-1, 2))
    return replace(
        pattern,
        lens=None,
        centre_img=centre,
        tip_radius_px=radius_px,
        pitch_px=pattern.pitch_px / float(geometry.magnification(lens, middle)[0]),
        glints_img=_pairs(glints),
    )


def _of_places(pattern: PinPattern, xy: Array, glints: Array, lens: Lens | None) -> PinPattern:
    """The pattern of pins at these places."""
    centre, radius_px = _circle(xy)
    return replace(
        pattern,
        lens=lens,
        centre_img=centre,
        tip_radius_px=radius_px + pattern.pin_radius_px,
        pitch_px=pitch_of(xy),
        glints_img=_pairs(glints),
    )


def _circle(xy: Array) -> tuple[Array, float]:
    (x, y), radius_px = cv2.minEnclosingCircle(xy.astype(np.float32))
    return np.array([x, y]), float(radius_px)


def _pairs(xy: Array) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in xy)
