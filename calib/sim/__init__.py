"""The simulated fingertip: known truth for everything that reads it.

tip        geometry and pin layout
mechanics  indenters against the tip -> where each pin is, what the contact is
camera     where a pin falls in the image
render     the image: discs, light, noise
simulator  all of it together: contacts in, `edge.types.Frame` with truth out
"""

from calib.sim.camera import Camera
from calib.sim.mechanics import Deformation, Tool, ToolPose, deform
from calib.sim.render import Appearance, Blob, render, ugly
from calib.sim.simulator import Simulator
from calib.sim.tip import Tip

__all__ = [
    "Appearance",
    "Blob",
    "Camera",
    "Deformation",
    "Simulator",
    "Tip",
    "Tool",
    "ToolPose",
    "deform",
    "render",
    "ugly",
]
