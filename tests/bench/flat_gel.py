r"""A flat gel with pins under its skin, and pictures of it: the tip of the second contact simulator.

       skin  -----.------.-----    a pin is a lever of PIN_MM at right angles to the skin under its base
                  |pin   |         (mean slope over the base); its cap is what the camera sees
                  o      o
                     [] camera     on the axis, HEIGHT_MM below the skin

The picture has the division model of a wide-angle lens, light that falls off by the fourth power of the
cosine, defocus, noise of photons and of reading. Caps differ a little in size, brightness and place.

Source  Fitzgibbon, Simultaneous linear estimation of multiple view geometry and lens distortion, CVPR
        2001 (division model); Ward-Cherrier et al., The TacTip family, Soft Robotics 5, 2018 (pins as
        levers)
"""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from edge.geometry.layout import pin_layout
from edge.types import Array, Image
from tests.bench.half_space import Ball, Bar, Surface, displace

RADIUS_MM = 17.0  # of the outermost pins
PIN_MM, BASE_MM = 1.5, 0.5  # lever of a pin, radius of its base
HEIGHT_MM = 35.0
SIZE_PX, RADIUS_PX = (640, 480), 190.0  # of the image, and of the outermost pins in it
DIVISION = -0.25  # of the lens, per squared ray: straight lines bend as a barrel
CAP_PITCHES = 0.26  # radius of a cap
SKIN, CAP = 22.0, 165.0  # grey levels in the middle
DEFOCUS_PX = 0.9
READ_NOISE, PHOTONS_PER_LEVEL = 1.2, 25.0
FLICKER = 0.02  # of the light, standard deviation
SPREAD_PITCHES, SPREAD_SIZE, SPREAD_LEVEL = 0.02, 0.03, 0.07  # of the caps
#: Points of a disc's base and their weights: exact for polynomials of the third degree.
_ANGLES = np.arange(6) * np.pi / 3.0
_BASE = np.vstack(
    [np.zeros((1, 2)), np.sqrt(2.0 / 3.0) * np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])]
)
_WEIGHTS = np.array([1 / 4, *[1 / 8] * 6])


class FlatGel:
    """One tip; `seed` decides how its caps differ."""

    LAYOUT = "hex"

    def __init__(self, n_pins: int, seed: int = 0) -> None:
        rng, self.n_pins = np.random.default_rng(seed), n_pins
        roots = RADIUS_MM * pin_layout(self.LAYOUT, n_pins)
        self.pitch_mm = float(np.hypot(*(roots[1:] - roots[0]).T).min())
        radius = CAP_PITCHES * self.pitch_mm * self._px_per_mm()
        self._level = (1.0 + SPREAD_LEVEL * rng.standard_normal(n_pins)) * (CAP - SKIN)
        x, y = np.meshgrid(*(np.arange(n) - (n - 1) / 2.0 for n in SIZE_PX))
        ray2 = (x * x + y * y) / (self._px_per_mm() * (HEIGHT_MM - PIN_MM)) ** 2
        self.roots_mm = roots + SPREAD_PITCHES * self.pitch_mm * rng.standard_normal(roots.shape)
        self._radius_px = radius * (1.0 + SPREAD_SIZE * rng.standard_normal(n_pins))
        self._falloff = (1.0 + ray2) ** -2.0

    @staticmethod
    def _px_per_mm() -> float:
        """At the untouched caps' height in the middle."""
        return float(
            RADIUS_PX / (_distorted(np.array([RADIUS_MM / (HEIGHT_MM - PIN_MM)]))[0] * (HEIGHT_MM - PIN_MM))
        )

    def skin(self, xy_mm: Array, tools: Sequence[Ball | Bar]) -> Surface:
        """How the skin is displaced at (n, 2) mm."""
        return displace(xy_mm, tools)

    def caps_mm(self, tools: Sequence[Ball | Bar] = ()) -> Array:
        """(n, 3) where the caps are under these tools."""
        points = (self.roots_mm[:, None] + BASE_MM * _BASE).reshape(-1, 2)
        skin = self.skin(points, tools)
        along, slope = (
            np.einsum("k,nkc->nc", _WEIGHTS, a.reshape(self.n_pins, len(_WEIGHTS), 2))
            for a in (skin.along_mm, skin.slope)
        )
        inwards = skin.w_mm.reshape(self.n_pins, -1) @ _WEIGHTS
        lever = PIN_MM / np.sqrt(1.0 + (slope**2).sum(axis=1))
        # The skin's outer normal leans towards the middle of a dent by the slope of its depth.
        return np.column_stack([self.roots_mm + along - lever[:, None] * slope, -inwards - lever])

    def project(self, caps_mm: Array) -> Array:
        """(n, 2) px."""
        ray = caps_mm[:, :2] / (caps_mm[:, 2:] + HEIGHT_MM)
        length = np.maximum(np.hypot(*ray.T), 1e-12)
        scale = self._px_per_mm() * (HEIGHT_MM - PIN_MM) * _distorted(length) / length
        return np.asarray(ray * scale[:, None] + (np.array(SIZE_PX) - 1) / 2.0, np.float64)

    def picture(self, tools: Sequence[Ball | Bar], rng: np.random.Generator) -> Image:
        """(480, 640) uint8."""
        caps = self.caps_mm(tools)
        nearer = (HEIGHT_MM - PIN_MM) / (HEIGHT_MM + caps[:, 2])
        light = np.full(SIZE_PX[::-1], SKIN, np.float32)
        for (x, y), radius, level in zip(
            self.project(caps), self._radius_px * nearer, self._level, strict=True
        ):
            _draw(light, x, y, radius, SKIN + level)
        lit = cv2.GaussianBlur(light * self._falloff.astype(np.float32), (0, 0), DEFOCUS_PX)
        mean = np.asarray(lit, np.float32) * np.float32(1.0 + FLICKER * rng.standard_normal())
        noise = np.sqrt(READ_NOISE**2 + mean / PHOTONS_PER_LEVEL)
        noisy = mean + noise * rng.standard_normal(mean.shape, np.float32)
        return np.asarray(np.clip(np.rint(noisy), 0, 255), np.uint8)


def _distorted(length: Array) -> Array:
    """Length of rays behind the lens: the root of r / (1 + DIVISION r^2) = length."""
    return np.asarray(
        (1.0 - np.sqrt(1.0 - 4.0 * DIVISION * length**2)) / (2.0 * DIVISION * length), np.float64
    )


def _draw(light: NDArray[np.float32], x: float, y: float, radius: float, level: float) -> None:
    """A disc of one level, its edge shared out by the distance of each pixel's middle."""
    half = int(np.ceil(radius)) + 1
    column, row = round(x), round(y)
    if not (half <= column < light.shape[1] - half and half <= row < light.shape[0] - half):
        raise ValueError(f"a cap at ({x:.0f}, {y:.0f}) px is out of the picture")
    line = np.arange(-half, half + 1)
    r = np.hypot(line[None, :] + (column - x), line[:, None] + (row - y))
    share = np.clip(radius + 0.5 - r, 0.0, 1.0)
    window = light[row - half : row + half + 1, column - half : column + half + 1]
    np.maximum(window, SKIN + share * (level - SKIN), out=window)
