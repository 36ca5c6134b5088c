"""Rigs: what holds a tool against the tip at a known pose, and looks.

base       Pose, and the protocol `Rig` that all of them follow
simulated  `calib.sim` behind it
gcode      a stage that speaks G-code (GRBL, Marlin), with a camera
manual     a person who is told what to do, with a camera
"""

from calib.rig.base import Pose, Rig, ask_here, open_rig

__all__ = ["Pose", "Rig", "ask_here", "open_rig"]
