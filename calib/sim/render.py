"""The image of a tip: white discs on a dark skin or dark ones on a bright, ugly light, a real sensor.

A pin's cap is a disc seen obliquely, hence an ellipse; blur turns its edge into a Gaussian integral. That
profile is evaluated at the pixels' centres about the exact centre of the cap. It is band-limited by
the blur, so the intensity centroid is the true centre to better than 0.005 px for a blur of 0.5 px or more
(tests/calib/test_simulator.py measures it).

Rules
- Grey levels are on the 8-bit scale (0..255) for any `bits`; they are scaled when quantised.
- Light adds up linearly, then gain, then noise, then clipping and rounding: as in a real sensor.
- All random numbers come from the given generator.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from calib.sim.camera import Camera
from calib.sim.mechanics import Deformation
from edge.types import Array, Image

EDGE_SIGMAS = 3.5  # further out a disc's edge is under 0.0003 of its brightness
MOTION_STEPS = 7  # discs drawn along the path during the exposure
CAP_ROUNDNESS = 0.5  # caps are domed: this much of a cap's tilt does not show as flattening


@dataclass(frozen=True, slots=True)
class Blob:
    """A bright spot that is not a pin: reflection, speck, LED. `velocity_px` is per frame."""

    xy_img: tuple[float, float]
    radius_px: float = 6.0
    brightness: float = 200.0
    velocity_px: tuple[float, float] = (0.0, 0.0)


#: Beyond these there is no picture of a tip: levels of 12 bits, a blur that leaves no pin.
_MOST = {
    "skin": 4095.0,
    "pin": 4095.0,
    "blur_px": 20.0,
    "vignetting": 1.0,
    "rim": 4095.0,
    "leds": 100,
    "unevenness": 1.0,
    "gain": 100.0,
    "read_noise": 1000.0,
    "shot_noise": 100.0,
}


@dataclass(frozen=True)
class Appearance:
    """Light and sensor. The defaults are a clean, well lit tip; `ugly` gives a bad one.

    skin, pin            grey levels of the skin and, over it, of a pin
    dark_pins            pins are so much darker than the skin, not brighter
    blur_px              Gaussian blur of lens and demosaicing, one sigma; >= 0.5
    vignetting           loss of light in the image's corners, 0..1
    rim                  grey level of the bright ring outside of the skin; 0: none
    leds                 number of LED reflections along the rim
    blobs                specks and reflections, may move
    dead                 pins that are not visible
    unevenness           spread of the pins' brightness (one sigma, relative), fixed by the tip
    gain                 factor on all light, as of auto exposure
    read_noise           one sigma, grey levels
    shot_noise           variance per grey level; 0.04 is a small webcam's (measured below)
    bits                 8, 10 or 12
    """

    skin: float = 30.0
    pin: float = 150.0
    blur_px: float = 0.8
    vignetting: float = 0.15
    rim: float = 0.0
    leds: int = 0
    blobs: tuple[Blob, ...] = ()
    dead: frozenset[int] = field(default_factory=frozenset)
    unevenness: float = 0.05
    gain: float = 1.0
    read_noise: float = 1.0
    shot_noise: float = 0.04
    bits: int = 8
    dark_pins: bool = False

    def __post_init__(self) -> None:
        if self.bits not in (8, 10, 12):
            raise ValueError(f"bits = {self.bits}; must be 8, 10 or 12")
        if self.blur_px < 0.5:
            raise ValueError(f"blur_px = {self.blur_px}; under 0.5 a disc's centroid is not its centre")
        for name, most in _MOST.items():
            if not 0 <= getattr(self, name) <= most:
                raise ValueError(f"{name} = {getattr(self, name)}; give 0 to {most:g}")


def ugly(camera: Camera, seed: int = 0, dead_n: int = 2, glare_n: int = 6) -> Appearance:
    """All disturbances of the published recordings at once: bright rim, LEDs, glare between and on the
    pins, one reflection that wanders, specks, dim corners, uneven and dead pins, a noisy sensor."""
    rng = np.random.default_rng([seed, 7])
    w, h = camera.size_px
    r = camera.radius_px
    blobs = []
    for i in range(glare_n + 20):
        a, far = rng.uniform(0, 2 * np.pi), r * np.sqrt(rng.uniform(0, 1.3))
        x, y = camera.centre_img + far * np.array([np.cos(a), np.sin(a)])
        speck = i >= glare_n
        size = rng.uniform(0.5, 0.9) if speck else 0.04 * r * rng.uniform(0.5, 1.5)
        level = rng.uniform(60, 150) if speck else rng.uniform(80, 220)
        drift = (0.01 * r, 0.004 * r) if i == 0 else (0.0, 0.0)
        blobs.append(Blob((float(x), float(y)), float(size), float(level), drift))
    dead = rng.choice(len(camera.tip.rays), dead_n, replace=False)
    return Appearance(
        pin=110.0,
        blur_px=1.0 * min(w, h) / 480 + 0.3,
        vignetting=0.4,
        rim=190.0,
        leds=8,
        blobs=tuple(blobs),
        dead=frozenset(int(i) for i in dead),
        unevenness=0.2,
        read_noise=2.5,
        shot_noise=0.08,
    )


class Renderer:
    """Draws one tip through one camera. Keeps what does not change from frame to frame."""

    def __init__(self, camera: Camera, appearance: Appearance) -> None:
        self.camera = camera
        self.appearance = appearance
        n = len(camera.tip.rays)
        if appearance.dead and not 0 <= min(appearance.dead) <= max(appearance.dead) < n:
            raise ValueError(f"dead pins {sorted(appearance.dead)}; the tip has pins 0..{n - 1}")
        # Fixed by the tip: the same pins are brighter in every recording, for any seed.
        spread = np.random.default_rng(n).standard_normal(n) * appearance.unevenness
        self._pin_level = appearance.pin * np.clip(1 + spread, 0.3, 2)
        self._pin_level[sorted(appearance.dead)] = 0

    @cached_property
    def _shade(self) -> NDArray[np.float32]:
        """(h, w) share of light that arrives: vignetting, quadratic in the distance from the middle."""
        w, h = self.camera.size_px
        y, x = np.ogrid[:h, :w]
        r2 = ((x - w / 2) ** 2 + (y - h / 2) ** 2) / (w * w + h * h) * 4
        return np.asarray(1 - self.appearance.vignetting * r2, dtype=np.float32)

    @cached_property
    def _static(self) -> NDArray[np.float32]:
        """(h, w) grey levels of what never moves: skin, rim, LEDs."""
        w, h = self.camera.size_px
        cx, cy = self.camera.centre_img
        y, x = np.ogrid[:h, :w]
        r = np.hypot(x - cx, y - cy)
        out = np.full((h, w), self.appearance.skin, dtype=np.float32)
        edge = 1.13 * self.camera.radius_px + 2  # where the skin ends, just outside of the last pins
        if self.appearance.rim > 0:
            out += (
                self.appearance.rim
                * ndtr((r - 1.06 * edge) / 3)
                * np.exp(-np.maximum(r - 1.25 * edge, 0) / edge)
            )
        for i in range(self.appearance.leds):
            a = 2 * np.pi * (i + 0.3) / self.appearance.leds
            spot = Blob((cx + 1.08 * edge * np.cos(a), cy + 1.08 * edge * np.sin(a)), 0.06 * edge, 260)
            _add_blob(out, spot, 0)
        return out

    def image(
        self,
        now: Deformation,
        rng: np.random.Generator,
        before: Deformation | None = None,
        exposure: float = 0.0,
        sequence: int = 0,
    ) -> tuple[Image, Array]:
        """One frame, and where its pins truly are.

        before, exposure  pins move from `before` to `now` in one frame's time; the shutter is open for
                          the last `exposure` (0..1) of it. The truth is at mid-exposure.
        Returns  image (h, w), uint8 or uint16;  xy_img (n, 2) float64 px
        """
        cam, appearance = self.camera, self.appearance
        xy = cam.project(now.tips_mm)
        step = np.zeros_like(xy)
        if before is not None and exposure > 0:
            step = (xy - cam.project(before.tips_mm)) * exposure
            xy = xy - step / 2
        light = self._static.copy()
        self._add_pins(light, now, xy, step)
        for blob in appearance.blobs:
            _add_blob(light, blob, sequence)
        light *= self._shade
        light *= appearance.gain
        noise = rng.standard_normal(light.shape, dtype=np.float32)
        noise *= np.sqrt(appearance.read_noise**2 + appearance.shot_noise * appearance.gain * light)
        light += noise
        top = (1 << appearance.bits) - 1
        light *= top / 255
        np.rint(light, out=light)
        np.clip(light, 0, top, out=light)
        image: Image = light.astype(np.uint8) if appearance.bits == 8 else light.astype(np.uint16)
        return image, xy

    def _add_pins(self, light: NDArray[np.float32], now: Deformation, xy: Array, step: Array) -> None:
        cam, appearance = self.camera, self.appearance
        h, w = light.shape
        radius = cam.tip.pin_radius_mm * cam.scale_px(now.tips_mm)
        # Tilted by the angle between the pin's axis and the line of sight: short radially.
        sight = now.tips_mm + np.array([0, 0, cam.tip.camera_distance_mm])
        cos = np.abs((sight * now.axes).sum(axis=1)) / np.linalg.norm(sight, axis=1)
        short = CAP_ROUNDNESS + (1 - CAP_ROUNDNESS) * cos
        flat = now.axes[:, :2]
        a = np.deg2rad(cam.roll_deg)
        flat = flat @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
        flat = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-9)
        moving = float(np.abs(step).max(initial=0)) > 0.05
        shifts = ((np.arange(MOTION_STEPS) + 0.5) / MOTION_STEPS - 0.5) if moving else np.zeros(1)
        half = int(
            np.ceil(radius.max() + EDGE_SIGMAS * appearance.blur_px + np.abs(step).max(initial=0) / 2 + 0.5)
        )
        near = np.rint(xy).astype(np.intp)
        lit = (
            (self._pin_level > 0)
            & (near > -half).all(axis=1)
            & (near[:, 0] < w + half)
            & (near[:, 1] < h + half)
        )
        near = near[lit]
        offsets = np.arange(-half, half + 1)
        c, s = flat[lit, 0, None], flat[lit, 1, None]
        elongation = (short[lit] ** -2 - 1)[:, None, None].astype(np.float32)
        size = (radius[lit] / appearance.blur_px)[:, None, None].astype(np.float32)
        cover = np.zeros((len(near), len(offsets), len(offsets)), dtype=np.float32)
        for shift in shifts:
            centre = xy[lit] + shift * step[lit] - near
            dx = (offsets - centre[:, 0:1]) / appearance.blur_px
            dy = (offsets - centre[:, 1:2]) / appearance.blur_px
            # Distance in the ellipse's own measure: the axis' direction counts more.
            rho = _outer_sum(c * dx, s * dy)
            rho *= rho
            rho *= elongation
            rho += _outer_sum(dx * dx, dy * dy)
            np.sqrt(rho, out=rho)
            np.subtract(size, rho, out=rho)
            cover += ndtr(rho, out=rho)
        level = -self._pin_level if appearance.dark_pins else self._pin_level
        cover *= (level[lit] / len(shifts))[:, None, None].astype(np.float32)
        cols = near[:, 0:1] + offsets
        rows = near[:, 1:2] + offsets
        inside = ((cols >= 0) & (cols < w))[:, None, :] & ((rows >= 0) & (rows < h))[:, :, None]
        flat_index = rows[:, :, None] * w + cols[:, None, :]
        np.add.at(light.reshape(-1), flat_index[inside], cover[inside])


def _outer_sum(x: Array, y: Array) -> NDArray[np.float32]:
    """(n, k, k) x_j + y_i of each row."""
    return np.asarray(x.astype(np.float32)[:, None, :] + y.astype(np.float32)[:, :, None])


def render(camera: Camera, appearance: Appearance, now: Deformation, seed: int = 0) -> tuple[Image, Array]:
    """A single frame without motion: image and true pin places; see `Renderer.image`."""
    return Renderer(camera, appearance).image(now, np.random.default_rng(seed))


def _add_blob(light: NDArray[np.float32], blob: Blob, sequence: int) -> None:
    h, w = light.shape
    x = blob.xy_img[0] + sequence * blob.velocity_px[0]
    y = blob.xy_img[1] + sequence * blob.velocity_px[1]
    half = 3 * blob.radius_px + 1
    x0, x1 = max(int(x - half), 0), min(int(x + half) + 1, w)
    y0, y1 = max(int(y - half), 0), min(int(y + half) + 1, h)
    if x0 >= x1 or y0 >= y1:
        return
    gx = np.exp(-(((np.arange(x0, x1) - x) / blob.radius_px) ** 2))
    gy = np.exp(-(((np.arange(y0, y1) - y) / blob.radius_px) ** 2))
    light[y0:y1, x0:x1] += (blob.brightness * gy[:, None] * gx).astype(np.float32)
