"""A G-code stage and a camera as a rig.

Rules
- The tool leaves a touched tip along its normal: another place, tilt or twist is approached clear of the tip,
  and pressing comes before shearing, so that friction always has the same history.
- The stage has X, Y, Z and perhaps A (twist). It cannot tilt; such poses raise an error.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calib.errors import RigError
from calib.rig.base import CLEAR, Pose
from calib.rig.camera import SettledCamera
from calib.rig.manual import describe_tool
from calib.rig.stage import GcodeStage
from calib.sim.mechanics import Tool, turn_z_to
from edge.types import Array, Frame, FrameSource


def axes_of(pose: Pose, tool: Tool, dome_radius_mm: float) -> dict[str, float]:
    """X, Y, Z of the tool (and A, its twist) at a pose; all 0 where it touches on the axis.

    A ball that is to touch the dome at a place is positioned along the dome's normal there and moves along
    it; shear is perpendicular to it. A bar does so across its direction. Z increases away from the tip.
    """
    angle = np.deg2rad(tool.angle_deg)
    across = np.array([-np.sin(angle), np.cos(angle)])
    asked = np.array([pose.x_mm, pose.y_mm])
    place: Array = {"flat": 0 * asked, "edge": across * (across @ asked)}.get(tool.kind, asked)
    lean = place / dome_radius_mm
    if np.hypot(*lean) >= 1:
        raise RigError(
            f"stage: place ({pose.x_mm:g}, {pose.y_mm:g}) mm is off the dome of {dome_radius_mm:g} mm"
        )
    normal = np.array([*lean, np.sqrt(1 - lean @ lean)])
    ball = 0.0 if tool.kind == "flat" else tool.radius_mm
    frame = turn_z_to(normal)
    reach = dome_radius_mm + ball
    xyz = normal * (reach - pose.depth_mm) + pose.shear_x_mm * frame[0] + pose.shear_y_mm * frame[1]
    mm = {"X": float(xyz[0]), "Y": float(xyz[1]), "Z": float(xyz[2] - reach)}
    return mm | ({"A": pose.twist_deg} if pose.twist_deg else {})


class GcodeRig:
    """A G-code stage and a camera.

    ask  shows a line and returns when the person has changed the tool
    """

    def __init__(self, stage: GcodeStage, source: FrameSource, ask: Callable[[str], None]) -> None:
        self.name = f"gcode:{stage.config.stage.port}"
        self._stage = stage
        try:
            self._camera = SettledCamera(source)
        except RigError:
            stage.close()
            raise
        self._ask = ask
        self._tool: Tool | None = None
        self._at = CLEAR

    def mount(self, tool: Tool) -> None:
        if tool != self._tool:
            self._lift()
            self._ask(f"Mount {describe_tool(tool)}, touching the tip on its axis at the stage's Z `at`")
        self._tool = tool

    def move(self, pose: Pose) -> None:
        if pose.tilt_x_deg or pose.tilt_y_deg:
            raise RigError("stage: it cannot tilt; leave tilt_x_deg and tilt_y_deg at 0")
        if pose.twist_deg and "A" not in self._stage.letters:
            raise RigError("stage: it cannot twist; configure axes.A, or leave twist_deg at 0")
        if pose.depth_mm <= 0:
            self._lift()
        else:
            if not self._can_slide_to(pose):
                self._approach(pose)
            self._go(pose)
        self._camera.moved()

    def frame(self) -> Frame:
        return self._camera.frame()

    def close(self) -> None:
        try:
            self._lift()
        finally:
            self._stage.close()
            self._camera.close()

    def _can_slide_to(self, pose: Pose) -> bool:
        """Deeper without shear, or sheared further at the same depth: the contact is continued."""
        now = self._at
        unsheared = replace(pose, shear_x_mm=0.0, shear_y_mm=0.0, twist_deg=0.0)
        deeper = (
            pose == unsheared
            and now == replace(pose, depth_mm=now.depth_mm)
            and pose.depth_mm >= now.depth_mm
        )
        on = replace(now, shear_x_mm=0.0, shear_y_mm=0.0, twist_deg=0.0)
        length, before = np.hypot(pose.shear_x_mm, pose.shear_y_mm), np.hypot(now.shear_x_mm, now.shear_y_mm)
        straight = abs(pose.shear_x_mm * now.shear_y_mm - pose.shear_y_mm * now.shear_x_mm) < 1e-9
        onward = pose.shear_x_mm * now.shear_x_mm + pose.shear_y_mm * now.shear_y_mm >= 0
        further = on == unsheared and length >= before and straight and onward
        return now.depth_mm > 0 and (deeper or further)

    def _approach(self, pose: Pose) -> None:
        """Over the place, then down along the normal, without shear."""
        self._lift()
        flat = replace(pose, shear_x_mm=0.0, shear_y_mm=0.0, twist_deg=0.0)
        over = self._axes(replace(flat, depth_mm=-self._stage.config.stage.clear_mm))
        top = max(over["Z"], self._stage.config.stage.clear_mm)
        self._stage.go(Z=top)
        self._stage.go(**{**over, "Z": top, **({"A": 0.0} if "A" in self._stage.letters else {})})
        self._stage.go(**over)
        self._go(flat)

    def _axes(self, pose: Pose) -> dict[str, float]:
        return axes_of(pose, self._tool or Tool(), self._stage.config.stage.dome_radius_mm)

    def _go(self, pose: Pose) -> None:
        self._stage.go(**self._axes(pose))
        self._at = pose

    def _lift(self) -> None:
        """Lift off the tip along the normal, keeping the shear."""
        if self._at.depth_mm > 0:
            clear = replace(self._at, depth_mm=-self._stage.config.stage.clear_mm)
            self._stage.go(**self._axes(clear))
            self._at = clear
