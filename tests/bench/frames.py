"""Frames for measurements: simulated, rendered once, the same for all methods compared."""

from pathlib import Path

import msgspec

from calib.fit import sensor_of
from calib.sim import Camera, Simulator, Tip
from calib.sim.script import REST_FRAMES, SCENES, play
from edge.calibration import Calibration
from edge.pins import take_rest
from edge.types import Feature, Frame

#: A grasp controller asks for these.
GRASP = frozenset({Feature.DISPLACEMENT, Feature.SHEAR})


def scene(name: str, pins: int = 331, size_px: tuple[int, int] = (640, 480)) -> list[Frame]:
    """Every frame of a scene of the simulator; the first `REST_FRAMES` show the untouched tip."""
    camera = Camera(tip=Tip(n_pins=pins, pin_radius_mm=0.6 * (331 / pins) ** 0.5), size_px=size_px)
    simulator = Simulator(camera, seed=1, rate_hz=240.0)
    return [simulator.frame(contacts) for contacts in play(SCENES[name])]


def calibration_of(frames: list[Frame]) -> Calibration:
    """The bundled calibration's models on this tip, whatever its camera. Its times are right, its values are
    not.
    """
    rest = take_rest([frame.image for frame in frames[:REST_FRAMES]])
    bundled = Calibration.load(Path(__file__).parents[1] / "data" / "rings331_ball.json")
    return Calibration(msgspec.structs.replace(bundled.content, sensor=sensor_of(rest, "bench")))
