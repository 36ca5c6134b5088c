"""Contacts in, frames with truth out.

Rules
- Frame k of a simulator is a function of (seed, k, contacts now, contacts before): the same calls give
  the same bytes, and skipping frames does not change the others' noise.
- `Frame.truth` is JSON-able and complete: tools, places, forces, and where each pin is.
"""

from dataclasses import asdict
from functools import lru_cache
from typing import Any

import numpy as np

from calib.sim.camera import Camera
from calib.sim.mechanics import Deformation, ToolPose, deform
from calib.sim.render import Appearance, Renderer
from edge.limits import RATE_MIN_HZ
from edge.types import Array, Clock, Frame

POSES_KEPT = 64  # a step of a protocol shows the same pose ten times; 64 is a loop of a scripted source


class Simulator:
    """A tip, a camera and light; `frame(contacts)` is the camera's present image.

    camera    images `camera.tip`
    seed      of the sensor's noise
    rate_hz   stamps the frames
    exposure  share of a frame's time during which the shutter is open; > 0 blurs what moves
    """

    def __init__(
        self,
        camera: Camera | None = None,
        appearance: Appearance | None = None,
        seed: int = 0,
        rate_hz: float = 60.0,
        exposure: float = 0.0,
    ) -> None:
        if seed < 0:
            raise ValueError(f"seed = {seed}; give 0 or more")
        if rate_hz < RATE_MIN_HZ:
            raise ValueError(f"rate_hz = {rate_hz}; give {RATE_MIN_HZ:g} or more")
        self.camera = camera or Camera()
        self.appearance = appearance or Appearance()
        self.seed = seed
        self.rate_hz = rate_hz
        self.exposure = exposure
        self.sequence = 0
        self._renderer = Renderer(self.camera, self.appearance)
        self._before: Deformation | None = None
        self._deform = lru_cache(maxsize=POSES_KEPT)(lambda c: deform(self.camera.tip, c))

    def frame(self, contacts: tuple[ToolPose, ...] = ()) -> Frame:
        """The next frame, with these contacts."""
        now = self._deform(contacts)
        rng = np.random.default_rng([self.seed, self.sequence])
        image, xy = self._renderer.image(now, rng, self._before, self.exposure, self.sequence)
        frame = Frame(
            image=image,
            capture_ns=round(self.sequence * 1e9 / self.rate_hz),
            sequence=self.sequence,
            clock=Clock.DEVICE,
            bits=self.appearance.bits,
            truth=self.truth(contacts, now, xy),
        )
        self._before = now
        self.sequence += 1
        return frame

    def truth(self, contacts: tuple[ToolPose, ...], now: Deformation, xy: Array) -> dict[str, Any]:
        """The truth of a frame.

        contacts       one dict a tool: its kind and pose (mm, deg), fields of `ToolPose` and `Tool`
        places_mm      [[x, y], ...] of each place of contact on the tip (two for tool "two")
        places_img     [[x, y], ...] px of a pin that is rooted there, untouched
        forces_n, areas_mm2   of each place
        drags_n, torques_nmm  friction on the skin and its torque about the normal, of each place
        slip, slid_mm  of each place: share of its area that slides, and how far the tool slid over it
        depth_mm, shear_mm, twist_deg   of the first contact; 0 where nothing touches
        pins_img       [[x, y], ...] px, row i is pin i
        visible        [bool, ...]
        """
        w, h = self.camera.size_px
        visible = np.asarray(((xy > -0.5) & (xy < [w - 0.5, h - 0.5])).all(axis=1))
        visible[sorted(self.appearance.dead)] = False
        first = contacts[0] if contacts and contacts[0].depth_mm > 0 else ToolPose()
        return {
            "contacts": [asdict(c) for c in contacts if c.depth_mm > 0],
            "places_mm": np.round(now.places_mm + 0.0, 6).tolist(),
            "places_img": np.round(self._places_img(now.places_mm), 4).tolist(),
            "forces_n": np.round(now.forces_n, 6).tolist(),
            "drags_n": np.round(now.drags_n + 0.0, 6).tolist(),
            "torques_nmm": np.round(now.torques_nmm + 0.0, 5).tolist(),
            "areas_mm2": np.round(now.areas_mm2, 4).tolist(),
            "slip": np.round(now.slip, 4).tolist(),
            "slid_mm": np.round(now.slid_mm, 5).tolist(),
            "depth_mm": first.depth_mm,
            "shear_mm": [first.shear_x_mm, first.shear_y_mm],
            "tilt_deg": [first.tilt_x_deg, first.tilt_y_deg],
            "twist_deg": first.twist_deg,
            "pins_img": np.round(xy, 5).tolist(),
            "visible": visible.tolist(),
        }

    def _places_img(self, places_mm: Array) -> Array:
        tip = self.camera.tip
        r = tip.dome_radius_mm
        up = np.sqrt(r * r - (places_mm**2).sum(axis=1))
        return self.camera.project(np.column_stack([places_mm, up]) * (1 - tip.pin_length_mm / r))
