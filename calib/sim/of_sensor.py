"""A known sensor, simulated: `sim:...?sensor=NAME`.

Rules
- What the sensor's file states is taken from there: layout, number, pitch, size and polarity of the pins,
  lever, dome, image. What it leaves out is the simulator's own, so a calibration made here is of the
  simulated tip, not of the real one.
- A flat skin is the cap of a large sphere. Its grid is larger than the image, whose border cuts it.
"""

from dataclasses import replace
from math import asin, ceil, cos, degrees, radians, sin

import numpy as np
from scipy.optimize import brentq

from calib.sim.camera import Camera
from calib.sim.render import Appearance
from calib.sim.tip import Tip
from edge.geometry.layout import pin_layout
from edge.sensors import KnownSensor

PIN_RADIUS_PITCHES = 0.29  # 0.33 and 0.27 in the two sets of published images of the 331-pin tip
FLAT_RADIUS_MM = 60.0  # of the sphere: the corners of a view of 20 x 15 mm are 1.3 mm lower than its middle
FLAT_VIEW_MM = 20.0  # width of the view where no scale is known
FLAT_PITCH_MM = 1.5  # of the grid where none is known
FLAT_LEVER_MM = 0.05  # dots on the skin
FLAT_K1 = 14.7  # 4.5 % at the border of a view 20 mm wide, as in the published recording of a GelSight Mini
FLAT_DEPTH = 1 / 3  # of what scenes do to a dome, which is filled with gel: a pad is a few mm thick
FLAT_MARGIN_DEG = 6.0  # from the outermost pins to the clamped rim
DARK_PINS = Appearance(skin=170.0, pin=110.0, dark_pins=True)


def depth_factor(sensor: KnownSensor) -> float:
    """How deep scenes press this sensor, against a dome."""
    return FLAT_DEPTH if sensor.cut else 1.0


def appearance_of(sensor: KnownSensor, appearance: Appearance) -> Appearance:
    """This light on a skin with pins of the sensor's polarity."""
    if sensor.pins.polarity != "dark":
        return appearance
    return replace(appearance, skin=DARK_PINS.skin, pin=DARK_PINS.pin, dark_pins=True)


def camera_of(sensor: KnownSensor, size_px: tuple[int, int] = (0, 0)) -> Camera:
    """The simulated tip and its camera; size (0, 0): the sensor's own, else 640x480.

    Raises  ValueError: the sensor's file lacks what a simulation cannot do without
    """
    size_px = size_px if all(size_px) else sensor.camera.size_px or (640, 480)
    for key in ("layout",) if sensor.cut else ("layout", "count"):
        if getattr(sensor.pins, key) is None:
            raise ValueError(f"sensor {sensor.name} cannot be simulated: its file has no pins.{key}")
    return _flat(sensor, size_px) if sensor.cut else Camera(tip=_dome(sensor), size_px=size_px)


def _dome(sensor: KnownSensor) -> Tip:
    pins = sensor.pins
    assert pins.layout is not None
    assert pins.count is not None
    default = Tip()
    tip = Tip(
        n_pins=pins.count,
        kind=pins.layout,
        dome_radius_mm=sensor.tip.radius_mm or default.dome_radius_mm,
        pin_length_mm=pins.length_mm or default.pin_length_mm,
    )
    rings = float(1 / np.sort(np.hypot(*pin_layout(tip.kind, tip.n_pins).T))[1])
    r, d = tip.dome_radius_mm - tip.pin_length_mm, tip.camera_distance_mm

    def pitch_mm(pins_deg: float) -> float:
        """Scale in the plane of the topmost cap."""
        a = radians(pins_deg)
        return r * sin(a) / (d + r * cos(a)) / rings * (d + r)

    pins_deg = tip.pins_deg
    if pins.pitch_mm is not None:
        most = tip.rim_deg - 1.0
        if pitch_mm(most) < pins.pitch_mm:
            raise ValueError(
                f"sensor {sensor.name}: {pins.count} pins {pins.pitch_mm:g} mm apart leave the dome"
            )
        pins_deg = float(brentq(lambda deg: pitch_mm(deg) - pins.pitch_mm, 1.0, most))
    radius = pins.radius_mm or PIN_RADIUS_PITCHES * pitch_mm(pins_deg)
    return replace(tip, pins_deg=pins_deg, pin_radius_mm=radius)


def _flat(sensor: KnownSensor, size_px: tuple[int, int]) -> Camera:
    pins, own = sensor.pins, sensor.camera
    longer = max(size_px)
    scale = FLAT_VIEW_MM / longer  # mm a px
    if own.mm_per_px is not None and own.size_px is not None:
        scale = own.mm_per_px * max(own.size_px) / longer
    pitch = pins.pitch_mm or FLAT_PITCH_MM
    half = ceil(longer * scale / 2 / pitch)
    lever = pins.length_mm or FLAT_LEVER_MM
    r, d = FLAT_RADIUS_MM - lever, 2 * FLAT_RADIUS_MM
    widest = half * 2**0.5 * pitch / (d + r)  # ray to a corner of the grid

    def miss(deg: float) -> float:
        return r * sin(radians(deg)) / (d + r * cos(radians(deg))) - widest

    most = degrees(asin(min(0.9, d / (d + r))))
    if miss(most) < 0:
        raise ValueError(
            f"sensor {sensor.name}: a view of {longer * scale:.0f} mm is too wide to be simulated"
        )
    pins_deg = float(brentq(miss, 0.1, most))
    tip = Tip(
        n_pins=(2 * half + 1) ** 2,
        kind="square",
        dome_radius_mm=FLAT_RADIUS_MM,
        rim_deg=pins_deg + FLAT_MARGIN_DEG,
        pins_deg=pins_deg,
        pin_length_mm=lever,
        pin_radius_mm=pins.radius_mm or PIN_RADIUS_PITCHES * pitch,
        camera_distance_mm=d,
    )
    radius_px = half * 2**0.5 * pitch / scale * (1 + FLAT_K1 * widest**2)
    return Camera(tip=tip, size_px=size_px, pins_radius_px=radius_px, k1=FLAT_K1)
