"""Rigs: devices that hold a tool against the tip at a known pose and take images. Opened by `open_rig(spec)`.

base       Pose, and the protocol `Rig` that all of them follow
simulated  `calib.sim` behind it
gcode      a stage that speaks G-code (GRBL, Marlin), with a camera
manual     a person who follows instructions, with a camera
"""

from collections.abc import Callable
from pathlib import Path

import click

from calib.errors import RigError
from calib.rig.base import Pose, Rig

__all__ = ["Pose", "Rig", "ask_here", "open_rig"]


def ask_here(text: str) -> None:
    click.prompt(text, default="", show_default=False, prompt_suffix=" - Enter when done ", err=True)


def open_rig(
    spec: str, camera: str = "v4l2:0", first_sequence: int = 0, ask: Callable[[str], None] = ask_here
) -> Rig:
    """Open a rig.

    spec            "sim", "sim:FILE.toml", "sim:SENSOR" (a known one: `edge.sensors`), "gcode:PORT",
                    "gcode:FILE.toml" or "manual"
    camera          source of frames for rigs that have none of their own (see `edge.sources`)
    first_sequence  number of the next frame; a simulated rig continues its noise there
    ask             shows a line to the person at the rig, returns when it is done
    Raises          RigError: no such rig, or its file or port is wrong
    """
    kind, _, rest = spec.partition(":")
    if kind == "sim":
        from calib.rig.simulated import SimulatedRig, load_simulation, simulation_of

        if rest and not rest.endswith(".toml"):
            return SimulatedRig(simulation_of(rest), first_sequence)
        return SimulatedRig(load_simulation(Path(rest) if rest else None), first_sequence)
    if kind == "gcode" and rest:
        from calib.rig.gcode import GcodeRig
        from calib.rig.stage import GcodeStage, load_stage
        from edge.errors import SourceError
        from edge.sources import open_source

        stage = GcodeStage(load_stage(rest))
        try:
            source = open_source(camera)
        except SourceError:
            stage.close()
            raise
        return GcodeRig(stage, source, ask)
    if spec == "manual":
        from calib.rig.manual import ManualRig
        from edge.sources import open_source

        return ManualRig(open_source(camera), ask)
    raise RigError(
        f"rig {spec!r} is unknown; one of sim, sim:FILE.toml, sim:SENSOR, gcode:PORT, gcode:FILE.toml, manual"
    )
