"""A person who presses on a kitchen scale, against the simulator."""

import itertools
import json
import os
import threading
import tty
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest

from calib.commands.scale import UNITS, Loads, SerialScale, record
from calib.errors import RigError
from calib.rig.camera import SettledCamera
from calib.sim import Camera, Simulator, Tip, ToolPose
from edge.types import Clock, Frame
from tests.calib.test_rig import FakeCamera
from tests.support.commands import run_calib

pytestmark = pytest.mark.usefixtures("quick_fits")
DEPTHS_MM = np.linspace(0.4, 3.0, 16)


class Pressed(FakeCamera):
    """A live camera of a simulated tip that somebody presses."""

    name = "pressed"

    def __init__(self) -> None:
        super().__init__(Clock.DEVICE)
        camera = Camera(tip=Tip(127, "hex", pin_radius_mm=0.8), size_px=(240, 240))
        self.simulator, self.pose = Simulator(camera), ToolPose()

    def __iter__(self) -> Iterator[Frame]:
        while True:
            yield self.simulator.frame((self.pose,) if self.pose.depth_mm > 0 else ())

    def press(self, depth_mm: float) -> float:
        """Returns what the scale shows, g."""
        self.pose = ToolPose(depth_mm=depth_mm)
        truth = self.simulator.frame((self.pose,)).truth or {}
        return float(sum(truth["forces_n"])) / UNITS["g"]


def test_a_dozen_typed_loads_make_a_calibration(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    finger, asked = Pressed(), itertools.count()

    def ask(text: str) -> str:
        if "nothing touch" in text:
            return ""
        if wrong := {3: "12,5 1", 5: "1e9 1"}.get(next(asked)):  # mistyped
            return wrong
        if text.startswith(f"Load {len(DEPTHS_MM)} "):
            return ""
        depth_mm = DEPTHS_MM[int(text.split()[1]) - 1]
        return f"{finger.press(depth_mm):.1f} {depth_mm:.2f}"

    done = record(SettledCamera(finger, 0.0), Loads(ask, "g", True, len(DEPTHS_MM), None), tmp_path, 3)
    assert done == len(DEPTHS_MM)  # the untouched tip, and all loads but the last
    said = capsys.readouterr().err
    assert "'12,5' is not a number; write 12.5; type the load in g and the depth" in said
    assert "no load above 0, up to 101972 g and a depth up to 100 mm, or not 2 numbers" in said
    table, tip = tmp_path / "targets.csv", tmp_path / "tip.json"
    fit = run_calib("fit", table, "--frames", tmp_path, "-o", tip, "--json")
    assert fit.code == 0, fit.err
    rms = {tuple(row["outputs"]): row["rms_held_out"] for row in json.loads(fit.out)["models"]}
    assert rms[("force_n",)] < 0.05
    assert rms[("displacement_mm",)] < 0.05


def test_a_serial_scale_counts_only_loads_that_stand_still(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    finger, stop, (display, port) = Pressed(), threading.Event(), os.openpty()
    tty.setraw(port)
    os.set_blocking(display, False)
    shown, presses, sagged = [0.0], iter((1.0, 1.5, 1.5)), [False]

    def show() -> None:
        while not stop.wait(0.002):
            with suppress(BlockingIOError):  # nobody reads just now
                os.write(display, b"ST,GS, +%07.1f g\r\n" % shown[0])

    def ask(text: str) -> str:
        if "nothing touch" not in text:
            shown[0] = finger.press(next(presses))
        return ""

    class Sags(SettledCamera):
        def frame(self) -> Frame:
            if shown[0] > 80.0 and not sagged[0]:  # the hand grows tired once
                shown[0], sagged[0] = 0.9 * shown[0], True
            return super().frame()

    writer = threading.Thread(target=show)
    writer.start()
    with closing(SerialScale(os.ttyname(port), 9600)) as scale:
        try:
            assert record(Sags(finger, 0.0), Loads(ask, "g", False, 2, scale), tmp_path, 2) == 3
        finally:
            stop.set()
            writer.join()
        with pytest.raises(RigError, match="no reading for 2 s"):
            scale.still()
    os.close(port)
    os.close(display)
    assert "N: once more" in capsys.readouterr().err
    rows = [row.split(",") for row in (tmp_path / "targets.csv").read_text().splitlines()]
    assert rows[0] == ["sensor_image", "force_z"]
    assert [float(row[1]) for row in rows[1::2]] == pytest.approx(
        [0.0, *(UNITS["g"] * finger.press(d) for d in (1.0, 1.5))], abs=0.01
    )
