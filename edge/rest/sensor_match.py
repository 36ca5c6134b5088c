"""Which known sensor a rest frame shows, and what follows: the scale, and whether pins are missing.

A sensor is recognised by its layout, which is laid over the pin in the middle and its neighbours, where
perspective and lens hardly distort, and grows outwards: pins that have a site predict where the next sites
are, and a free pin there takes the site. On the right layout the predictions are good to a few hundredths
of a pitch, through a fisheye too; on a wrong one they are as good as chance. The first neighbours must
stand as the layout has them, but for rotation and zoom: a sheared hexagonal lattice is a square one. A
sensor without a known layout can only be named.

Many sensors share a square grid. So the number of pins has to be the sensor's too, and of a grid that the
image cuts, the pins reach all its borders, with as many pitches across as the sensor's own image has.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from edge.errors import DegenerateLayout
from edge.geometry.lattice import N_RING, inside_hull
from edge.geometry.layout import LAYOUTS, pin_layout
from edge.geometry.neighbours import nearest_of
from edge.geometry.thin_plate import thin_plate_operators
from edge.rest.tip_match import SHARED_MIN
from edge.sensors import KnownSensor
from edge.types import Array, Complex, Rest

_SYMMETRY = {"hex": 6, "rings": 6, "square": 4}
#: Pitches. A prediction that says nothing is wrong by 0.5 / sqrt(2) in the median: uniform in half a pitch.
CLEAR = 0.5 * 0.5 / 2**0.5


@dataclass(frozen=True, slots=True)
class LayoutMatch:
    """A layout laid over the pins of a rest frame."""

    pins_on: float  # share of the pins that have a site
    sites_filled: float  # share of the layout's sites that have a pin; of a grid's sites among the pins
    residual: float  # pitches, 95 % quantile of the pins' distance from where their neighbours predict them
    pitch_px: float  # distance of neighbouring pins in the middle


def match_layout(rest: Rest, layout: str, count: int = 0) -> LayoutMatch:
    """The best placing of a layout over the pins; a square grid has as many sites as the pins need."""
    z = np.asarray(rest.xy_img @ (1, 1j))
    sites = _sites(layout, count, np.ptp(rest.xy_img, axis=0).max() / rest.pattern.pitch_px)
    # A layout's middle pin is one of the seven next to the middle of those that are seen; of a grid any is.
    from_centre = np.argsort(np.abs(z - complex(*rest.pattern.centre_img)))
    best = LayoutMatch(0.0, 0.0, np.inf, rest.pattern.pitch_px)
    for k in from_centre[: 1 if layout == "square" else 1 + N_RING]:
        ring = np.argsort(np.abs(z - z[k]))[1 : 1 + _SYMMETRY[layout]]
        pitch = float(np.median(np.abs(z[ring] - z[k])))
        site_of, error = _grow((z - z[k]) / pitch, sites, layout)
        on = site_of >= 0
        filled = np.zeros(len(sites), bool)
        filled[site_of[on]] = True
        # A grid's sites count inside the hull of those that have a pin, its border included.
        own = inside_hull(_xy(sites[filled]), _xy(sites)) if layout == "square" else np.ones(len(sites), bool)
        match = LayoutMatch(
            float(on.mean()), float(filled[own].mean()), float(np.quantile(error[on], 0.95)), pitch
        )
        if (match.pins_on, -match.residual) > (best.pins_on, -best.residual):
            best = match
    return best


def _sites(layout: str, count: int, width: float) -> Complex:
    """Sites at unit pitch, the middle one at 0; a grid of one and a half times the width of the pins."""
    if layout == "square":
        half = np.ceil(0.75 * width)
        line = np.arange(-half, half + 1)
        return np.asarray((line[:, None] + 1j * line).ravel())
    z = np.asarray(pin_layout(layout, count) @ (1, 1j))
    return np.asarray(z / np.sort(np.abs(z))[1])


def _grow(z: Complex, sites: Complex, layout: str) -> tuple[NDArray[np.integer], Array]:
    """Each pin's site, -1: none; and how far the pins on sites next to it predict it wrongly, pitches."""
    site_of = np.full(len(z), -1)
    error = np.full(len(z), np.inf)
    middle = np.argsort(np.abs(sites))[: 1 + _SYMMETRY[layout]]
    first = np.argsort(np.abs(z))[: 1 + _SYMMETRY[layout]]
    turn = _first_turn(z[first], sites[middle], _SYMMETRY[layout])
    _assign(z, middle, turn * sites[middle], site_of, error)
    if np.median(error[first[1:]]) > CLEAR:
        site_of[first[1:]] = -1
        return site_of, error
    for _ in range(2 * int(np.abs(sites).max()) + 2):  # a round adds a ring
        on = np.flatnonzero(site_of >= 0)
        free = np.setdiff1d(np.arange(len(sites)), site_of[on])
        known = _xy(sites[site_of[on]])
        near = free[nearest_of(known, _xy(sites[free]))[0][:, 0] < 1.2]
        if len(near) == 0:
            break
        try:
            placed = _predicted(known, z[on], _xy(sites[near]))
        except DegenerateLayout:  # too few, or on a line: no prediction
            break
        taken = _assign(z, near, placed, site_of, error)
        if len(taken) == 0 or np.median(error[taken]) > CLEAR:
            break
    return site_of, error


def _predicted(known: Array, at: Complex, sites: Array) -> Complex:
    """Where sites are, by splines through the places of their nearest neighbours."""
    rows = nearest_of(known, sites, 2 * N_RING)[1]
    return np.array(
        [
            (thin_plate_operators(known[row], site[None])[0] @ at[row])[0]
            for row, site in zip(rows, sites, strict=True)
        ]
    )


def _xy(z: Complex) -> Array:
    return np.column_stack([z.real, z.imag])


def _assign(
    z: Complex, near: NDArray[np.integer], placed: Complex, site_of: NDArray[np.integer], error: Array
) -> list[int]:
    """Give sites to the free pins next to where they are placed; returns these pins."""
    free = np.flatnonzero(site_of < 0)
    if len(free) == 0:
        return []
    away, row = nearest_of(_xy(z[free]), _xy(placed))
    distance, pin = away[:, 0], free[row[:, 0]]
    taken = []
    for k in np.argsort(distance, kind="stable"):
        if distance[k] < 0.5 and site_of[pin[k]] < 0:
            site_of[pin[k]], error[pin[k]] = near[k], distance[k]
            taken.append(int(pin[k]))
    return taken


def _first_turn(first: Complex, middle: Complex, symmetry: int) -> complex:
    """The rotation that lays the middle sites over the first pins best."""
    turns = np.exp(2j * np.pi / symmetry * np.arange(60) / 60)
    apart = np.abs((first / turns[:, None])[..., None] - middle).min(axis=2)
    return complex(turns[(apart**2).mean(axis=1).argmin()])


@dataclass(frozen=True, slots=True)
class SensorMatch:
    """A sensor, and how its layout lies over the pins."""

    sensor: KnownSensor
    match: LayoutMatch


def layout_of(rest: Rest) -> tuple[str, LayoutMatch] | None:
    """The regular layout that all pins stand in; None: in none."""
    found = []
    for layout in LAYOUTS:
        try:
            match = match_layout(rest, layout, len(rest))
        except ValueError:  # that many pins make no whole pattern of this kind
            continue
        if _fits(match):
            found.append((layout, match))
    return min(found, key=lambda one: one[1].residual, default=None)


def recognise(rest: Rest, sensors: Sequence[KnownSensor]) -> SensorMatch | None:
    """The sensor that a rest frame looks like; None: like none of them."""
    kind = "dark" if rest.pattern.dark else "bright"
    candidates = [s for s in sensors if s.pins.polarity in (None, kind)]
    found = [SensorMatch(s, match) for s in candidates if (match := _match(s, rest)) is not None]
    return min(found, key=lambda one: (one.match.residual, -len(one.sensor.sources)), default=None)


def _match(sensor: KnownSensor, rest: Rest) -> LayoutMatch | None:
    """How a sensor's layout lies over the pins; None: it does not, or the sensor's is not known."""
    layout, count = sensor.pins.layout, sensor.pins.count or 0
    if layout is None or (layout != "square" and not count):
        return None
    if not _same_view(sensor, rest):
        return None
    match = match_layout(rest, layout, count)
    return match if _fits(match) else None


def _same_view(sensor: KnownSensor, rest: Rest) -> bool:
    """Whether number of pins, borders and pitch over the image's size are the sensor's, as far as known."""
    count, pattern = sensor.pins.count, rest.pattern
    if count is not None:
        most = (count**0.5 + 2) ** 2 if sensor.cut else count  # a row more at each border
        if not SHARED_MIN * count <= len(rest) <= most / SHARED_MIN:
            return False
    if not sensor.cut:
        return True
    size = np.array(pattern.size_px)
    free = np.minimum(rest.xy_img.min(axis=0), size - 1 - rest.xy_img.max(axis=0))
    if free.max() > pattern.pitch_px + pattern.pin_radius_px:
        return False
    camera, pitch_mm = sensor.camera, sensor.pins.pitch_mm
    if camera.size_px is None or camera.mm_per_px is None or pitch_mm is None:
        return True
    across = np.array(camera.size_px) * camera.mm_per_px / pitch_mm
    ratio = (size / pattern.pitch_px) / across
    return bool(ratio.min() >= SHARED_MIN and ratio.max() <= 1 / SHARED_MIN)


def _fits(match: LayoutMatch) -> bool:
    return match.pins_on >= SHARED_MIN and match.sites_filled >= SHARED_MIN and match.residual < CLEAR


def mm_per_px(sensor: KnownSensor, rest: Rest) -> float | None:
    """Scale at the middle of the pins; None: no pitch in mm is known, or the pins are not in the layout."""
    match = None if sensor.pins.pitch_mm is None else _match(sensor, rest)
    return None if match is None or sensor.pins.pitch_mm is None else sensor.pins.pitch_mm / match.pitch_px
