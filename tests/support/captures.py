"""Captures of a small simulated tip, and a rig that breaks."""

from __future__ import annotations

from collections.abc import Callable

from calib.errors import RigError
from calib.rig import Rig
from calib.rig.simulated import CameraTable, SimulatedRig, Simulation
from calib.sim import Tip
from edge.types import Frame

SMALL = Simulation(tip=Tip(37, "hex"), camera=CameraTable(size_px=(96, 96)))


def simulated(first_sequence: int) -> Rig:
    return SimulatedRig(SMALL, first_sequence)


class _Breaking(SimulatedRig):
    left = 0

    def frame(self) -> Frame:
        if self.left == 0:
            raise RigError("rig: the cable is out")
        self.left -= 1
        return super().frame()


def breaking_after(n: int) -> Callable[[int], Rig]:
    """A camera whose cable is pulled after so many frames."""

    def make(first_sequence: int) -> Rig:
        rig = _Breaking(SMALL, first_sequence)
        rig.left = n
        return rig

    return make
