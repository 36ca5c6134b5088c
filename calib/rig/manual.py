"""A person as a rig: follows instructions and confirms each."""

from collections.abc import Callable

from calib.rig.base import Pose
from calib.rig.camera import SettledCamera
from calib.sim.mechanics import Tool
from edge.types import Frame, FrameSource

# Text for each field of a pose, in the order of execution.
_INSTRUCTIONS = (
    ("x_mm", "x {:+.2f} mm"),
    ("y_mm", "y {:+.2f} mm"),
    ("tilt_x_deg", "tilt about x {:+.1f} deg"),
    ("tilt_y_deg", "tilt about y {:+.1f} deg"),
    ("depth_mm", "press {:.2f} mm"),
    ("shear_x_mm", "then shear x {:+.2f} mm"),
    ("shear_y_mm", "then shear y {:+.2f} mm"),
    ("twist_deg", "then twist {:+.1f} deg"),
)


def describe_tool(tool: Tool) -> str:
    return {
        "flat": "a flat surface",
        "sphere": f"a ball of {tool.radius_mm:g} mm radius",
        "edge": f"a bar with an edge of {tool.radius_mm:g} mm radius, at {tool.angle_deg:g} deg",
        "two": f"two balls of {tool.radius_mm:g} mm radius, {tool.distance_mm:g} mm apart, "
        f"at {tool.angle_deg:g} deg",
    }[tool.kind]


def describe_pose(pose: Pose) -> str:
    if pose.depth_mm <= 0:
        return "take the tool off the tip"
    instructions = [text.format(getattr(pose, name)) for name, text in _INSTRUCTIONS if getattr(pose, name)]
    return ", ".join(instructions)


class ManualRig:
    """source  live camera
    ask     shows a line and returns when the person confirms it
    """

    def __init__(self, source: FrameSource, ask: Callable[[str], None]) -> None:
        self.name = "manual"
        self._camera = SettledCamera(source)
        self._ask = ask

    def mount(self, tool: Tool) -> None:
        self._ask(f"Use {describe_tool(tool)}")

    def move(self, pose: Pose) -> None:
        self._ask(describe_pose(pose).capitalize())
        self._camera.moved()

    def frame(self) -> Frame:
        return self._camera.frame()

    def close(self) -> None:
        self._camera.close()
