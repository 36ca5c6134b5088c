"""The interface of a rig.

Rules
- A pose is where the tool is against the untouched tip, in the tip's frame: mm and degrees, x right and
  y down in the image. Depth is from first touch; a negative depth is that far clear of it.
- `move` returns when the rig stands still; `frame` gives a picture taken after that.
- A frame's truth is the rig's own data; `capture` adds the requested pose.
"""

from dataclasses import dataclass
from typing import Protocol

from calib.sim.mechanics import Tool
from edge.types import Frame


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose of the tool against the tip; fields as in `calib.sim.ToolPose`."""

    x_mm: float = 0.0
    y_mm: float = 0.0
    depth_mm: float = 0.0
    tilt_x_deg: float = 0.0
    tilt_y_deg: float = 0.0
    shear_x_mm: float = 0.0
    shear_y_mm: float = 0.0
    twist_deg: float = 0.0


CLEAR = Pose(depth_mm=-2.0)  # clear of the tip by 2 mm: further than skin can stick


class Rig(Protocol):
    """Moves a tool and takes pictures."""

    name: str

    def mount(self, tool: Tool) -> None:
        """Use this tool from now on. Raises RigError: not possible on this rig."""

    def move(self, pose: Pose) -> None:
        """Go there and stand still. Raises RigError: out of travel, or the rig reports a fault."""

    def frame(self) -> Frame:
        """A picture taken after the last move. Raises RigError: the camera has ended."""

    def close(self) -> None:
        """Lift off the tip and close everything."""
