"""Pins rendered with known truth: blurred discs, integrated over pixels, on a background of one's choice."""

import numpy as np
from scipy.special import erfc

from edge.types import Array, Image, PinPattern, Rest
from tests.support import layouts

#: Places within a pixel and their weights (Gauss and Legendre): exact for polynomials of the fifth degree.
NODES = ((-np.sqrt(0.15), 5 / 18), (0.0, 8 / 18), (np.sqrt(0.15), 5 / 18))


def hexagon(rings: int, pitch_px: float, centre: tuple[float, float]) -> Array:
    """Hexagonal layout of 3 r (r + 1) + 1 pins: 127 for 6 rings, 331 for 10; jittered."""
    xy = layouts.hexagonal(rings, pitch_px) - layouts.CENTRE + np.array(centre)
    jittered: Array = xy + np.random.default_rng(331).uniform(-0.5, 0.5, xy.shape)
    return jittered


def draw(
    size_px: tuple[int, int],
    xy_img: Array,
    radius_px: float,
    blur_px: float,
    brightness: float,
    ground: float,
) -> Array:
    """(h, w) float64 grey levels without noise."""
    width, height = size_px
    image = np.full((height, width), float(ground))
    reach = int(np.ceil(radius_px + 6 * blur_px + 1))
    for x, y in xy_img:
        x0, y0 = round(x) - reach, round(y) - reach
        rows = np.arange(max(y0, 0), min(y0 + 2 * reach + 1, height))
        columns = np.arange(max(x0, 0), min(x0 + 2 * reach + 1, width))
        disc = np.zeros((len(rows), len(columns)))
        for dy, weight_y in NODES:
            for dx, weight_x in NODES:
                r = np.hypot(columns[None, :] + dx - x, rows[:, None] + dy - y)
                disc += weight_x * weight_y * 0.5 * erfc((r - radius_px) / (np.sqrt(2.0) * blur_px))
        image[np.ix_(rows, columns)] += brightness * disc
    return image


def expose(image: Array, noise: float, rng: np.random.Generator, bits: int = 8) -> Image:
    """The sensor's image: noise, rounding, clipping."""
    noisy = np.rint(image + rng.normal(0.0, noise, image.shape)) if noise else np.rint(image)
    levels = np.clip(noisy, 0, 2**bits - 1)
    return levels.astype(np.uint8) if bits == 8 else levels.astype(np.uint16)


def known_rest(
    xy_img: Array,
    radius_px: float,
    blur_px: float,
    brightness: float,
    noise: float,
    pitch_px: float,
    size: tuple[int, int],
) -> Rest:
    """The rest frame of a known tip, without detection."""
    pattern = PinPattern(
        pin_radius_px=radius_px,
        pitch_px=pitch_px,
        centre_img=xy_img.mean(axis=0),
        tip_radius_px=float(np.ptp(xy_img[:, 0]) / 2 + radius_px),
        background=0.0,
        brightness=brightness,
        noise=noise,
        size_px=size,
        edge_px=float(np.hypot(blur_px, 12**-0.5)),  # a pixel is a box of one pixel: variance 1/12
    )
    return Rest(layouts.pins_at(xy_img, radius_px, brightness), pattern)


def cramer_rao_px(radius_px: float, blur_px: float, brightness: float, noise: float) -> float:
    """Smallest possible sigma of one coordinate for an unbiased estimator of this disc's place."""
    step = 0.01
    right = draw((81, 81), np.array([[40 + step, 40.0]]), radius_px, blur_px, brightness, 0.0)
    left = draw((81, 81), np.array([[40 - step, 40.0]]), radius_px, blur_px, brightness, 0.0)
    slope = (right - left) / (2 * step)
    return float(np.hypot(noise, 12**-0.5) / np.sqrt((slope**2).sum()))
