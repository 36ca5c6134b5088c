"""Make the bundled recordings and calibrations again: `python tests/data/make.py [NAME...]`.

Small images and a quiet sensor keep them small; they are lossless. The tables below define them completely:
same table, same code, same pixels.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from calib.sim import Appearance, Camera, Simulator, Tip
from calib.sim.mechanics import Tool
from calib.sim.script import SCENES, play
from calib.simulated_calibration import Range, calibrate_simulated
from edge.recording.writer import Recorder

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parents[1] / "edge" / "examples"  # what every installation has: `example:NAME`
_QUIET = Appearance(read_noise=0.4, shot_noise=0.008)


@dataclass(frozen=True, slots=True)
class Recipe:
    """A recording: tip, scene and camera. scene "": none is made, only a calibration."""

    scene: str
    tip: Tip
    size_px: tuple[int, int]
    appearance: Appearance
    seed: int
    rate_hz: float = 60.0


_HEX = Tip(127, "hex", pin_radius_mm=0.8)
_RINGS = Tip(331, "rings")
RECIPES: dict[str, Recipe] = {
    "press": Recipe("press", _RINGS, (320, 320), _QUIET, 1),
    "press_shear": Recipe("press-shear", _HEX, (280, 210), replace(_QUIET, rim=60.0, leds=5), 2),
    "two_contacts": Recipe("two", _RINGS, (320, 320), _QUIET, 3),
    "nothing": Recipe("nothing", _HEX, (280, 210), _QUIET, 4),
    "example": Recipe(
        "slip", _HEX, (160, 160), Appearance(vignetting=0, read_noise=0.2, shot_noise=0), 5, 25.0
    ),
    "simulator": Recipe("", _RINGS, (640, 480), Appearance(), 6),
}
#: Recordings that are made, with their recipes.
RECORDINGS = {HERE / f"{name}.mcap": name for name in ("press", "press_shear", "two_contacts", "nothing")}
RECORDINGS[EXAMPLES / "press.mcap"] = "example"


def make(path: Path, recipe: Recipe) -> None:
    """Write one recording."""
    camera = Camera(tip=recipe.tip, size_px=recipe.size_px)
    simulator = Simulator(camera, recipe.appearance, recipe.seed, recipe.rate_hz)
    n, kind = recipe.tip.n_pins, recipe.tip.kind
    about = {"serial": f"SIM-{n}", "pins": str(n), "layout": kind, "seed": str(recipe.seed)}
    stored: dict[str, Any] = {"image": "png", "compression": "zstd", "offset_ns": 0, "overwrite": True}
    with Recorder(path, tip=about, rate_hz=recipe.rate_hz, **stored) as recorder:
        for contacts in play(SCENES[recipe.scene]):
            if not recorder.frame(simulator.frame(contacts)):
                raise SystemExit(f"{path}: {recorder.fault or 'the disk is too slow'}")
    if recorder.fault:
        raise SystemExit(recorder.fault)


#: Calibration file: the recipe of its tip, the tool that presses it at random poses, how often and how far.
CALIBRATIONS: dict[Path, tuple[str, Tool, int, Range]] = {
    HERE / "rings331_ball.json": ("press", Tool("sphere", radius_mm=3.0), 300, Range()),
    HERE / "hex127_flat.json": ("press_shear", Tool("flat"), 300, Range()),
    EXAMPLES / "press.json": ("example", Tool("flat"), 200, Range((0.1, 4.0), 2.5, 8.0, 7.0)),
    EXAMPLES / "sim.json": ("simulator", Tool("sphere", radius_mm=3.0), 150, Range()),
}


def calibrate(path: Path, recipe: Recipe, tool: Tool, n_frames: int, reach: Range) -> None:
    """Write one calibration."""
    simulator = Simulator(
        Camera(tip=recipe.tip, size_px=recipe.size_px), recipe.appearance, 99, recipe.rate_hz
    )
    serial = f"SIM-{recipe.tip.n_pins}"
    calibration, _ = calibrate_simulated(simulator, tool, n_frames=n_frames, serial=serial, reach=reach)
    calibration.save(path)


def main() -> None:
    for path in (*CALIBRATIONS, *RECORDINGS):
        if sys.argv[1:] and path.name not in sys.argv[1:]:
            continue
        if path in RECORDINGS:
            make(path, RECIPES[RECORDINGS[path]])
        else:
            name, tool, n_frames, reach = CALIBRATIONS[path]
            calibrate(path, RECIPES[name], tool, n_frames, reach)
        print(f"{path.name:20} {path.stat().st_size / 1e6:5.2f} MB")


if __name__ == "__main__":
    main()
