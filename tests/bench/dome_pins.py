"""The dome of `calib.sim`, with its own mechanics and camera, under the tools of the other simulators."""

from collections.abc import Sequence

import numpy as np

from calib.sim import Appearance, Camera, Tip, Tool, ToolPose, deform
from calib.sim.render import Renderer
from edge.types import Array, Image
from tests.bench.half_space import Ball, Bar


class DomePins:
    """One tip; `seed` decides where its camera sits."""

    def __init__(self, n_pins: int, seed: int = 0) -> None:
        self._tip = Tip(n_pins=n_pins, kind="hex", pin_radius_mm=0.6 * (331 / n_pins) ** 0.5)
        x, y = np.random.default_rng(seed).normal(0.0, 2.0, 2).tolist()
        self._camera = Camera(tip=self._tip, centre_px=(x, y))
        self._renderer = Renderer(self._camera, Appearance())
        roots = self._tip.roots_mm
        self.pitch_mm = float(np.linalg.norm(roots[1:] - roots[0], axis=1).min())

    def caps_mm(self, tools: Sequence[Ball | Bar] = ()) -> Array:
        """(n, 3) where the caps are under these tools."""
        return deform(self._tip, tuple(_pose(tool) for tool in tools)).tips_mm

    def project(self, caps_mm: Array) -> Array:
        """(n, 2) px."""
        return self._camera.project(caps_mm)

    def picture(self, tools: Sequence[Ball | Bar], rng: np.random.Generator) -> Image:
        """(480, 640) uint8."""
        now = deform(self._tip, tuple(_pose(tool) for tool in tools))
        return self._renderer.image(now, rng)[0]


def _pose(tool: Ball | Bar) -> ToolPose:
    """A bar is straight here: its contact is as long as its depth makes it."""
    if isinstance(tool, Bar):
        edge = Tool("edge", tool.radius_mm, float(np.degrees(tool.angle_rad)))
        tilt = np.degrees(np.arcsin(np.array([-tool.y_mm, tool.x_mm]) / Tip.dome_radius_mm))
        return ToolPose(edge, tool.x_mm, tool.y_mm, tool.depth_mm, *tilt.tolist())
    sphere = Tool("sphere", tool.radius_mm)
    x, y = tool.shear_mm
    return ToolPose(sphere, tool.x_mm, tool.y_mm, tool.depth_mm, shear_x_mm=x, shear_y_mm=y)
