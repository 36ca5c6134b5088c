r"""A layer of gel on a rigid plate: the skin of the third contact simulator, with dots on it, or pins.

       o   o   o   o    dots on the surface z = h; they move with it, there is no lever
      ---------------
          gel, h        bonded to the plate at z = 0; the camera looks through both
      ===============

A tool is a pressure of Hertz's shape, and friction in proportion to it. All amplitudes are solved for at
once, so that under each tool's middle the surface lies at the tool's depth and has gone along with its shear,
as far as Coulomb's friction allows. Displacement is exact for these tractions: with Fourier's exp(i k x),

    2 G u = grad(f + z g) - 4 (1 - nu) g e_z,   f and g sums of exp(k z) and exp(-k z),

four constants for each |k| from the plate (u = 0) and the surface (traction); traction across k gives
tanh(k h) / (G k). A layer that hardly compresses bulges round a tool: dots move outwards there.

Source  Johnson, Contact Mechanics, chapter 5.8 (layers); Barber, Elasticity (Papkovich, Neuber)
"""

from collections.abc import Sequence
from functools import cache

import numpy as np
from scipy.ndimage import map_coordinates

from edge.types import Array
from tests.bench.flat_gel import FlatGel
from tests.bench.half_space import FRICTION, POISSON, Ball, Bar, Surface

THICKNESS_MM = 4.0
SIDE_MM, POINTS = 64.0, 256  # of the periodic square in which the layer is solved


class LayerPins(FlatGel):
    """Pins under a layer's surface; `seed` decides how they differ."""

    def skin(self, xy_mm: Array, tools: Sequence[Ball | Bar]) -> Surface:
        """The layer's."""
        return displace(xy_mm, tools)


class SurfaceDots(LayerPins):
    """A square grid of dots, 144 are 12 x 12."""

    LAYOUT = "square"

    def caps_mm(self, tools: Sequence[Ball | Bar] = ()) -> Array:
        """(n, 3) where the dots are under these tools."""
        skin = self.skin(self.roots_mm, tools)
        return np.column_stack([self.roots_mm + skin.along_mm, -skin.w_mm])


def displace(xy_mm: Array, tools: Sequence[Ball | Bar]) -> Surface:
    """Displacement of the surface at (n, 2) mm under all tools at once."""
    if not tools:
        return Surface(np.zeros((len(xy_mm), 2)), np.zeros(len(xy_mm)), np.zeros((len(xy_mm), 2)))
    middles = np.array([(tool.x_mm, tool.y_mm) for tool in tools])
    pressed = [_response(_pressure(tool), np.array([0.0, 0.0, -1.0])) for tool in tools]
    at_middles = -np.array([_at(field, middles)[:, 2] for field in pressed]).T
    depth, touches = np.array([tool.depth_mm for tool in tools]), np.ones(len(tools), np.bool_)
    size = np.zeros(len(tools))
    while touches.any():  # a tool that would have to pull hangs over the others' dent
        size[:] = 0.0
        size[touches] = np.linalg.solve(at_middles[np.ix_(touches, touches)], depth[touches])
        if (size >= 0.0).all():
            break
        touches &= size >= 0.0
    total = sum(load * field for load, field in zip(size, pressed, strict=True))
    for tool, load, middle in zip(tools, size, middles, strict=True):
        if isinstance(tool, Ball) and np.hypot(*tool.shear_mm) > 0.0:
            shear_mm = float(np.hypot(*tool.shear_mm))
            way = np.array([*tool.shear_mm, 0.0]) / shear_mm
            dragged = _response(_pressure(tool), way)
            sticks = shear_mm / float(_at(dragged, middle[None])[0, :3] @ way)
            total = total + min(sticks, FRICTION * load) * dragged
    found = _at(np.asarray(total), xy_mm)
    return Surface(found[:, :2], -found[:, 2], -found[:, 3:])


def _pressure(tool: Ball | Bar) -> Array:
    """(POINTS, POINTS) [y, x], Hertz's of unit height in the middle; radius that of a half-space."""
    line = (np.arange(POINTS) - POINTS // 2) * SIDE_MM / POINTS
    x, y = np.meshgrid(line - tool.x_mm, line - tool.y_mm)
    a = np.sqrt(tool.radius_mm * tool.depth_mm)
    if isinstance(tool, Ball):
        return np.asarray(np.sqrt(np.maximum(1.0 - (x * x + y * y) / a**2, 0.0)), np.float64)
    cos, sin = np.cos(tool.angle_rad), np.sin(tool.angle_rad)
    along, across = 2.0 * (cos * x + sin * y) / tool.length_mm, (cos * y - sin * x) / a
    return np.asarray(np.sqrt(np.maximum(1.0 - along**2 - across**2, 0.0)), np.float64)


def _response(pressure: Array, way: Array) -> Array:
    """(5, POINTS, POINTS) displacement of the surface under a traction along `way`, and how fast it rises
    along x and y; shear modulus 1.
    """
    kx, ky, k, c = _waves()
    load = np.fft.fft2(pressure)
    load[0, 0] = 0.0  # the mean of the traction moves nothing that is seen
    nx, ny = kx / k, ky / k
    in_plane, across = nx * way[0] + ny * way[1], nx * way[1] - ny * way[0]
    along = load * (c[0, 0] * in_plane + 1j * c[0, 1] * way[2])
    crosswise = load * across * np.tanh(k * THICKNESS_MM) / k
    up = load * (-1j * c[1, 0] * in_plane + c[1, 1] * way[2])
    fields = np.stack([along * nx - crosswise * ny, along * ny + crosswise * nx, up])
    rises = np.stack([1j * kx * up, 1j * ky * up])
    return np.asarray(np.fft.ifft2(np.concatenate([fields, rises])).real, np.float64)


@cache
def _waves() -> tuple[Array, Array, Array, Array]:
    """Wave numbers along x and y, their length: (POINTS, POINTS); the compliance there: (2, 2, ...)."""
    wave = 2.0 * np.pi * np.fft.fftfreq(POINTS, SIDE_MM / POINTS)
    kx, ky = np.meshgrid(wave, wave)
    k = np.hypot(kx, ky)
    k[0, 0] = wave[1]  # any but zero
    steps = np.linspace(k.min(), k.max(), 1000)
    table = _compliance(steps)
    c = [[np.interp(k, steps, table[:, i, j]) for j in range(2)] for i in range(2)]
    return kx, ky, k, np.array(c)


def _compliance(k: Array) -> Array:
    """(m, 2, 2) displacement along k, over i, and upwards, by traction likewise, at wave numbers (m,)."""
    h, nu = THICKNESS_MM, POISSON
    fade, one = np.exp(-k * h), np.ones_like(k)

    def rows(z: float, up: Array, down: Array) -> tuple[Array, Array]:
        """2 u and the traction at z of f and g = exp(k (z - h)), exp(-k z): values up, down."""
        f, df = (up, down), (k * up, -k * down)
        u = [k * f[0], k * f[1], k * z * f[0], k * z * f[1]]
        w = [*df, z * df[0] - (3.0 - 4.0 * nu) * f[0], z * df[1] - (3.0 - 4.0 * nu) * f[1]]
        shear = [
            *(k * d for d in df),
            *(k * (z * d - (1.0 - 2.0 * nu) * v) for d, v in zip(df, f, strict=True)),
        ]
        normal = [
            *(k * k * v for v in f),
            *(k * k * z * v - 2.0 * (1.0 - nu) * d for d, v in zip(df, f, strict=True)),
        ]
        return np.stack([np.stack(u), np.stack(w)]), np.stack([np.stack(shear), np.stack(normal)])

    held = rows(0.0, fade, one)[0]
    moved, pulled = rows(h, one, fade)
    system = np.moveaxis(np.concatenate([held, pulled]), 2, 0)
    loads = np.zeros((len(k), 4, 2))
    loads[:, 2, 0] = loads[:, 3, 1] = 1.0
    return np.asarray(0.5 * np.moveaxis(moved, 2, 0) @ np.linalg.solve(system, loads), np.float64)


def _at(field: Array, xy_mm: Array) -> Array:
    """(n, m) of fields (m, POINTS, POINTS) at (n, 2) mm."""
    place = xy_mm.T[::-1] * POINTS / SIDE_MM + POINTS // 2
    return np.column_stack([map_coordinates(part, place, order=3, mode="grid-wrap") for part in field])
