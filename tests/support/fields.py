"""Hexagonal and square tips, motion fields with known truth, and plain scipy Voronoi areas of them."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Cells, ContactRegion, PinPattern, Pins, Rest, Tracks
from tests.bench.reference import cell_areas
from tests.support import layouts

SIZE = (640, 480)
CENTRE = np.array([319.3, 241.7])
SIGMA_PX = 0.05  # of a pin in one image


def hexagon(rings: int, pitch: float) -> Array:
    """Centred hexagonal numbers: 6 rings 127 pins, 10 rings 331."""
    return layouts.hexagonal(rings, pitch) - layouts.CENTRE


def make_rest(xy: Array, pitch: float) -> Rest:
    n = len(xy)
    radius = 0.3 * pitch
    reach = float(np.hypot(*(xy - CENTRE).T).max()) + radius
    pattern = PinPattern(radius, pitch, CENTRE.copy(), reach, 20.0, 150.0, 2.0, SIZE)
    # Rest positions are means of many frames.
    return Rest(Pins(xy, np.full(n, 0.1 * SIGMA_PX), np.full(n, radius), np.full(n, 150.0)), pattern)


def tip(pins: int = 331) -> Rest:
    rings, pitch = {127: (6, 32.0), 331: (10, 19.0), 61: (4, 45.0)}[pins]
    return make_rest(hexagon(rings, pitch) + CENTRE, pitch)


def areas(xy: Array, rest: Rest) -> Array:
    """Voronoi cells bounded by three dense rings of fixed points outside of the tip."""
    p = rest.pattern
    reach = p.tip_radius_px - p.pin_radius_px
    turn = np.linspace(0.0, 2.0 * np.pi, int(2.0 * np.pi * reach / (0.5 * p.pitch_px)), endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    hull = np.vstack([CENTRE + (reach + k * 0.9 * p.pitch_px) * ring for k in (1, 2, 3)])
    return cell_areas(xy, hull)


@lru_cache
def _rest_areas(xy: bytes, pitch: float) -> Array:
    points = np.frombuffer(xy).reshape(-1, 2)
    return areas(points, make_rest(points, pitch))


def frame(rest: Rest, xy: Array, lost: NDArray[np.int64] | None = None) -> tuple[Tracks, Cells]:
    """Tracks and cells of pins at xy; lost pins are tessellated where they are but reported as NaN."""
    seen = np.ones(len(xy), dtype=np.bool_)
    if lost is not None:
        seen[lost] = False
    gone = np.where(seen, 0.0, np.nan)
    tracks = Tracks.of(xy + gone[:, None], np.full(len(xy), SIGMA_PX) + gone, seen)
    none = np.empty((0, 3), dtype=np.int32)
    at_rest = _rest_areas(rest.xy_img.tobytes(), rest.pattern.pitch_px)
    return tracks, Cells(areas(xy, rest) + gone, at_rest, xy, none, np.empty((0, 2)))


def clamp(rest: Rest) -> Array:
    """1 in the middle of the tip, falling to 0 at its rim: the skin is held there."""
    r = np.hypot(*(rest.xy_img - CENTRE).T) / rest.pattern.tip_radius_px
    share: Array = 1.0 - r**4
    return share


def push(rest: Rest, at: tuple[float, float], width: float, height: float) -> Array:
    """Motion away from a point: u = height r exp(-r^2 / 2 width^2); its divergence, the area change, is
    2 height at the point and falls off smoothly. at, width in px from the centre."""
    d = rest.xy_img - CENTRE - np.array(at)
    g = height * np.exp(-0.5 * (d**2).sum(axis=1) / width**2)
    motion: Array = d * g[:, None]
    return motion


def plane(rest: Rest, radius: float, height: float, soft: float) -> Array:
    """A flat contact: areas increase in a ring of this radius. Radial motion with slope only there."""
    d = rest.xy_img - CENTRE
    r = np.hypot(*d.T)
    # Divergence of a radial field f(r) is f' + f/r; f = height r^3 / radius^2 inside, falling outside.
    f = height * r * (r / radius) ** 2 / (1.0 + np.exp((r - radius) / soft))
    motion: Array = d / np.maximum(r, 1e-9)[:, None] * f[:, None]
    return motion


def bar(rest: Rest, angle: float, length: float, width: float, height: float) -> Array:
    """A long contact through the centre: motion away from its line, fading beyond its ends."""
    d = rest.xy_img - CENTRE
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    s, t = d @ along, d @ across
    fade = 1.0 / (1.0 + np.exp((np.abs(s) - 0.5 * length) / width))
    return np.outer(height * t * np.exp(-0.5 * t**2 / width**2) * fade, across)


def contact_region(
    place: tuple[float, float],
    peak: float,
    area_px2: float,
    along_rad: float = np.nan,
    elongation: float = 1.0,
) -> ContactRegion:
    """A contact of one peak, without shear."""
    at, none = np.array(place), np.zeros(2)
    return ContactRegion(at, at, peak, area_px2, along_rad, elongation, at[None], at, none, none.copy())
