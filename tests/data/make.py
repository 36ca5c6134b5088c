"""Make the bundled recordings again: `python tests/data/make.py [FOLDER]`.

Small images and a quiet sensor keep them under 5 MB in all; they are lossless. The table below defines them
completely: same table, same code, same pixels.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from calib.sim import Appearance, Camera, Simulator, Tip
from calib.sim.mechanics import Tool
from calib.sim.script import SCENES, play
from calib.simulated_calibration import calibrate_simulated
from edge.recording.writer import Recorder

_QUIET = Appearance(read_noise=0.4, shot_noise=0.008)


@dataclass(frozen=True, slots=True)
class Recipe:
    """A recording: tip, scene and camera."""

    scene: str
    tip: Tip
    size_px: tuple[int, int]
    appearance: Appearance
    seed: int


_HEX = Tip(127, "hex", pin_radius_mm=0.8)
_RINGS = Tip(331, "rings")
RECIPES: dict[str, Recipe] = {
    "press": Recipe("press", _RINGS, (320, 320), _QUIET, 1),
    "press_shear": Recipe("press-shear", _HEX, (280, 210), replace(_QUIET, rim=60.0, leds=5), 2),
    "two_contacts": Recipe("two", _RINGS, (320, 320), _QUIET, 3),
    "nothing": Recipe("nothing", _HEX, (280, 210), _QUIET, 4),
}
RATE_HZ = 60.0


def make(folder: Path, name: str) -> Path:
    """Write one recording."""
    recipe = RECIPES[name]
    camera = Camera(tip=recipe.tip, size_px=recipe.size_px)
    simulator = Simulator(camera, recipe.appearance, recipe.seed, RATE_HZ)
    path = folder / f"{name}.mcap"
    n, kind = recipe.tip.n_pins, recipe.tip.kind
    about = {"serial": f"SIM-{n}", "pins": str(n), "layout": kind, "seed": str(recipe.seed)}
    stored: dict[str, Any] = {"image": "png", "compression": "zstd", "offset_ns": 0, "overwrite": True}
    with Recorder(path, tip=about, rate_hz=RATE_HZ, **stored) as recorder:
        for contacts in play(SCENES[recipe.scene]):
            if not recorder.frame(simulator.frame(contacts)):
                raise SystemExit(f"{path}: {recorder.fault or 'the disk is too slow'}")
    if recorder.fault:
        raise SystemExit(recorder.fault)
    return path


#: Calibration file: the recording whose tip it is made of, and the tool that presses it at random poses.
CALIBRATIONS: dict[str, tuple[str, Tool]] = {
    "rings331_ball": ("press", Tool("sphere", radius_mm=3.0)),
    "hex127_flat": ("press_shear", Tool("flat")),
}


def calibrate(folder: Path, name: str) -> Path:
    """Write one calibration."""
    recipe = RECIPES[CALIBRATIONS[name][0]]
    simulator = Simulator(Camera(tip=recipe.tip, size_px=recipe.size_px), recipe.appearance, 99, RATE_HZ)
    calibration, _ = calibrate_simulated(
        simulator, CALIBRATIONS[name][1], n_frames=300, serial=f"SIM-{recipe.tip.n_pins}"
    )
    path = folder / f"{name}.json"
    calibration.save(path)
    return path


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent
    for path in [
        *(calibrate(folder, name) for name in CALIBRATIONS),
        *(make(folder, name) for name in RECIPES),
    ]:
        print(f"{path.name:20} {path.stat().st_size / 1e6:5.2f} MB")


if __name__ == "__main__":
    main()
