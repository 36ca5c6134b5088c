"""Captures of a small simulated tip, a rig that breaks, and tables of images."""

from collections.abc import Callable, Iterable
from pathlib import Path

import cv2
import numpy as np

from calib.errors import RigError
from calib.rig import Rig
from calib.rig.simulated import CameraTable, SimulatedRig, Simulation
from calib.sim import Tip
from edge.types import Array, Frame, Image

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


def write_table(folder: Path, images: Iterable[Image | Path], columns: dict[str, Array]) -> Path:
    """Images 0.png, 1.png, ... and the table that names them, with these columns."""
    lines = [",".join(("sensor_image", *columns))]
    for k, (image, *values) in enumerate(zip(images, *columns.values(), strict=True)):
        cv2.imwrite(str(folder / f"{k}.png"), np.asarray(image))
        lines.append(",".join((f"{k}.png", *(repr(float(value)) for value in values))))
    path = folder / "targets.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
