"""What every rig can do, and how one is named on the command line.

Rules
- A pose is where the tool is against the untouched tip, in the tip's frame: mm and degrees, x right and
  y down in the image. Depth is from first touch; a negative depth is that far clear of it.
- `move` returns when the rig stands still; `frame` gives a picture taken after that.
- A frame's truth is what the rig knows; the pose that was asked for is added by `capture`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import click

from calib.errors import RigError
from calib.sim.mechanics import Tool
from edge.types import Frame


@dataclass(frozen=True, slots=True)
class Pose:
    """Of the tool against the tip; fields as in `calib.sim.Contact`."""

    x_mm: float = 0.0
    y_mm: float = 0.0
    depth_mm: float = 0.0
    tilt_x_deg: float = 0.0
    tilt_y_deg: float = 0.0
    shear_x_mm: float = 0.0
    shear_y_mm: float = 0.0
    twist_deg: float = 0.0


CLEAR = Pose(depth_mm=-2.0)  # clear of the tip by 2 mm: more than any skin sticks


class Rig(Protocol):
    """Moves a tool and takes pictures."""

    name: str

    def mount(self, tool: Tool) -> None:
        """From now on this tool presses. Raises RigError: the rig cannot have it."""

    def move(self, pose: Pose) -> None:
        """Go there and stand still. Raises RigError: out of travel, or the rig reports a fault."""

    def frame(self) -> Frame:
        """A picture taken after the last move. Raises RigError: the camera has ended."""

    def close(self) -> None:
        """Leave the tip untouched and let go of everything."""


def ask_here(text: str) -> None:
    click.prompt(text, default="", show_default=False, prompt_suffix=" - Enter when done ", err=True)


def open_rig(
    spec: str, camera: str = "v4l2:0", first_sequence: int = 0, ask: Callable[[str], None] = ask_here
) -> Rig:
    """Open a rig.

    spec            "sim", "sim:FILE.toml", "gcode:PORT", "gcode:FILE.toml" or "manual"
    camera          source of frames for rigs that have none of their own (see `edge.sources`)
    first_sequence  number of the next frame; a simulated rig continues its noise there
    ask             shows a line to the person at the rig, returns when it is done
    Raises          RigError: no such rig, or its file or port is wrong
    """
    kind, _, rest = spec.partition(":")
    if kind == "sim":
        from calib.rig.simulated import SimulatedRig, load_simulation

        return SimulatedRig(load_simulation(Path(rest) if rest else None), first_sequence)
    if kind == "gcode" and rest:
        from calib.rig.gcode import GcodeRig
        from calib.rig.stage import GcodeStage, load_stage
        from edge.sources import open_source

        config = load_stage(rest)
        source = open_source(camera)
        try:
            return GcodeRig(GcodeStage(config), source, ask)
        except RigError:
            source.close()
            raise
    if spec == "manual":
        from calib.rig.manual import ManualRig
        from edge.sources import open_source

        return ManualRig(open_source(camera), ask)
    raise RigError(f"rig {spec!r} is unknown; one of sim, sim:FILE.toml, gcode:PORT, gcode:FILE.toml, manual")
