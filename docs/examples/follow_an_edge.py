"""Follow an edge: tactile servoing by the contact's place and direction.

    python docs/examples/follow_an_edge.py

A simulated finger moves along the bent rim of a plate by touch alone. The contact stays in the middle of the
finger, the skin stays pressed in by 1.5 mm, and each step goes along the edge.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from calib.sim import Simulator, Tool, ToolPose
from edge import Fingertip, Frame

STEP_MM, DEPTH_MM = 0.8, 1.5


@dataclass
class Plate:
    """Its rim is y = 6 sin(x / 12), mm."""

    finger: Simulator

    def rim(self, x_mm: float) -> float:
        return 6.0 * math.sin(x_mm / 12.0)

    def touch(self, x_mm: float, y_mm: float, z_mm: float) -> Frame:
        """What the camera sees with the finger's axis there, pressed down by z."""
        angle = math.atan(0.5 * math.cos(x_mm / 12.0))
        off = (self.rim(x_mm) - y_mm) * math.cos(angle)  # square to the rim
        place = (-off * math.sin(angle), off * math.cos(angle))
        bar = ToolPose(Tool("edge", radius_mm=1.5, angle_deg=math.degrees(angle)), *place, depth_mm=z_mm)
        return self.finger.frame((bar,))


def follow(steps: int = 60) -> Iterator[tuple[float, float, float]]:
    """Where the finger is, x mm, its distance from the rim, mm, and the depth that it reads, mm."""
    plate = Plate(Simulator())
    tip = Fingertip([plate.finger.frame().image for _ in range(8)], "example:sim")
    x_mm, y_mm, z_mm, along = 0.0, 1.5, DEPTH_MM, 0.0
    for _ in range(steps):
        frame = plate.touch(x_mm, y_mm, z_mm)
        touch = tip.read(frame.image, frame.capture_ns / 1e9)
        if touch.features is None or not touch.features.contacts:
            raise SystemExit("the edge is lost")
        seen = touch.features.contacts[0].orientation_rad
        along = along if math.isnan(seen) else seen  # round: go on as before
        off_x, off_y, depth_mm = touch.reading.contacts[0]
        square = 0.6 * (off_y * math.cos(along) - off_x * math.sin(along))
        yield x_mm, y_mm - plate.rim(x_mm), depth_mm
        x_mm += STEP_MM * math.cos(along) - square * math.sin(along)
        y_mm += STEP_MM * math.sin(along) + square * math.cos(along)
        z_mm += 0.5 * (DEPTH_MM - depth_mm)


if __name__ == "__main__":
    for x, off, depth in follow():
        print(f"x {x:6.2f} mm   off the rim {off:5.2f} mm   depth {depth:4.2f} mm")
