r"""Geometry of a fingertip: a dome of skin with pins on its inside, imaged by a camera on its axis.

                 z out of the skin
                      ^   .-'''-.      skin: sphere of radius `dome_radius_mm`, centre at the origin
                        .'  |||  '.    pins: levers of `pin_length_mm` along the skin's inner normal
                       / \     / \
            rim ------|-----------|--- clamped at polar angle `rim_deg`
                            o          camera at z = -camera_distance_mm, looking along +z

Rules
- `xyz_mm` is the tip's frame: x right and y down as in the image, z out of the skin, origin at the
  centre of the dome's sphere (on the tip's axis).
- Layouts are regular as the camera sees them ("hexagonal projection" of the paper), so the pins sit
  where the camera's rays through a regular pattern meet the sphere of the pins' tips.
"""

from dataclasses import dataclass
from functools import cached_property
from math import radians, sin

import numpy as np

from edge.geometry.layout import pin_layout
from edge.types import Array


@dataclass(frozen=True)
class Tip:
    """One fingertip. Defaults: the 40 mm dome of the TacTip family, pins of 2 mm (paper, "Methods").

    The elastic figures were set so that a flat press moves the pins as on the published 420x420 frames
    (mean outward motion of rings 20..50..80..110..140..170 px from the centre, frame of 2.8 mm depth
    and < 3 deg tilt: 3.9 8.3 10.8 10.3 7.7 4.9 px; here 3.5 8.4 8.8 5.5 4.2 3.5 px), and 2 mm of shear
    at 3 mm depth moves the mean of all pins by 6 px (there: 5 px for 2.3 mm).

    n_pins, kind        see `edge.geometry.layout.pin_layout`
    dome_radius_mm      radius of the skin's sphere
    rim_deg             polar angle at which the skin is clamped
    pins_deg            polar angle of the outermost pins
    pin_length_mm       lever from the skin to the white cap that the camera sees
    pin_radius_mm       radius of the cap
    camera_distance_mm  from the dome's centre back to the camera
    skin_mm             length below which the skin's own stiffness smooths the surface
    layer_mm            thickness of an elastic layer (of the gel's modulus) between tool and gel
    reach_mm            distance over which the finite gel lets a force fade
    clamp_mm            height above the rim over which the clamp has an effect
    closed              share of the pressed-in volume that comes out elsewhere on the dome; 1: sealed
    shear_modulus_kpa   of gel and skin together; sets force only, not shape
    friction            Coulomb's coefficient between skin and tool
    """

    n_pins: int = 331
    kind: str = "rings"
    dome_radius_mm: float = 20.0
    rim_deg: float = 82.0
    pins_deg: float = 68.0
    pin_length_mm: float = 2.0
    pin_radius_mm: float = 0.6
    camera_distance_mm: float = 40.0
    skin_mm: float = 1.5
    layer_mm: float = 0.3
    reach_mm: float = 20.0
    clamp_mm: float = 2.0
    closed: float = 0.95
    shear_modulus_kpa: float = 20.0
    friction: float = 1.0

    def __post_init__(self) -> None:
        pin_layout(self.kind, self.n_pins)  # refuses what makes no pattern
        for name in ("pin_length_mm", "pin_radius_mm", "skin_mm", "layer_mm", "reach_mm", "clamp_mm"):
            if not getattr(self, name) > 0:
                raise ValueError(f"tip: {name} = {getattr(self, name)}; must be > 0")
        if not 0 < self.closed <= 1:
            raise ValueError(f"tip: closed = {self.closed}; must be above 0, at most 1")
        if not 0 < self.pins_deg < self.rim_deg < 90:
            raise ValueError(
                f"tip: pins_deg = {self.pins_deg}, rim_deg = {self.rim_deg}; 0 < pins < rim < 90"
            )
        if not self.pin_length_mm < self.dome_radius_mm < self.camera_distance_mm:
            raise ValueError("tip: pin_length_mm < dome_radius_mm < camera_distance_mm must hold")
        if self.n_pins * self.pin_radius_mm**2 > (self.dome_radius_mm * sin(radians(self.pins_deg))) ** 2:
            raise ValueError(f"tip: pin_radius_mm = {self.pin_radius_mm}; the pins would cover one another")

    @cached_property
    def rays(self) -> Array:
        """(n, 2) direction of each pin's tip as seen from the camera, (x/z, y/z)."""
        theta = np.deg2rad(self.pins_deg)
        r = self.dome_radius_mm - self.pin_length_mm
        widest = r * np.sin(theta) / (self.camera_distance_mm + r * np.cos(theta))
        return np.asarray(pin_layout(self.kind, self.n_pins) * widest)

    @cached_property
    def normals(self) -> Array:
        """(n, 3) outward normal of the skin at each pin's root."""
        m2 = (self.rays**2).sum(axis=1)
        d, r = self.camera_distance_mm, self.dome_radius_mm - self.pin_length_mm
        along = (d + np.sqrt(d * d - (1 + m2) * (d * d - r * r))) / (1 + m2)
        tips = np.column_stack([self.rays * along[:, None], along - d])
        return np.asarray(tips / r)

    @cached_property
    def roots_mm(self) -> Array:
        """(n, 3) where each pin is rooted in the skin."""
        return np.asarray(self.normals * self.dome_radius_mm)

    @cached_property
    def tips_mm(self) -> Array:
        """(n, 3) white cap of each pin, untouched."""
        return np.asarray(self.normals * (self.dome_radius_mm - self.pin_length_mm))

    def mobility(self, xyz_mm: Array) -> Array:
        """(n,) 0 at the clamped rim and below, towards 1 on top: how free the skin is to move there."""
        height = xyz_mm[..., 2] - self.dome_radius_mm * np.cos(np.deg2rad(self.rim_deg))
        return np.asarray(1 - np.exp(-np.maximum(height, 0) / self.clamp_mm))
