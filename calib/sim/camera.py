"""Where a point of the tip falls in the image: a pinhole on the tip's axis, and radial distortion.

Rules
- `xy_img`: px, x right, y down, pixel centres on integers. Radial distortion is Brown's, in ray units:
  ray' = ray (1 + k1 r2 + k2 r4), r2 = |ray|^2. Negative k1 is a barrel, as of a wide-angle lens.
"""

from dataclasses import dataclass, field

import numpy as np

from calib.sim.tip import Tip
from edge.types import Array


@dataclass(frozen=True)
class Camera:
    """A camera behind one tip.

    tip             the tip that it images
    size_px         (width, height)
    pins_radius_px  radius of the outermost pins' circle; 0: 0.38 of the image's smaller side, as in the
                    published 640x480 frames
    centre_px       offset of the tip's axis from the image's middle
    roll_deg        image turned about the axis
    k1, k2          radial distortion
    """

    tip: Tip = field(default_factory=Tip)
    size_px: tuple[int, int] = (640, 480)
    pins_radius_px: float = 0.0
    centre_px: tuple[float, float] = (0.0, 0.0)
    roll_deg: float = 0.0
    k1: float = -0.08
    k2: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.pins_radius_px <= max(self.size_px):
            raise ValueError(f"camera: pins_radius_px = {self.pins_radius_px}; give 0 to {max(self.size_px)}")

    @property
    def centre_img(self) -> Array:
        """(2,) px, where the tip's axis meets the image."""
        w, h = self.size_px
        return np.array([(w - 1) / 2 + self.centre_px[0], (h - 1) / 2 + self.centre_px[1]])

    @property
    def radius_px(self) -> float:
        """Radius of the circle of the outermost pins."""
        return self.pins_radius_px or 0.38 * min(self.size_px)

    @property
    def focal_px(self) -> float:
        widest = np.hypot(*self.tip.rays.T).max(keepdims=True)
        return float(self.radius_px / (widest * self._distortion(widest**2))[0])

    def _distortion(self, r2: Array) -> Array:
        return 1 + self.k1 * r2 + self.k2 * r2 * r2

    def project(self, xyz_mm: Array) -> Array:
        """(n, 2) px of points in the tip's frame."""
        ray = xyz_mm[:, :2] / (xyz_mm[:, 2:] + self.tip.camera_distance_mm)
        ray = ray * self._distortion((ray**2).sum(axis=1))[:, None]
        a = np.deg2rad(self.roll_deg)
        turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        return np.asarray(self.focal_px * ray @ turn.T + self.centre_img)

    def scale_px(self, xyz_mm: Array) -> Array:
        """(n,) px per mm across the line of sight, at each point."""
        depth = xyz_mm[:, 2] + self.tip.camera_distance_mm
        r2 = (xyz_mm[:, :2] ** 2).sum(axis=1) / depth**2
        return np.asarray(self.focal_px * self._distortion(r2) / depth)
