"""Frames for measurements: simulated, rendered once, the same for all methods compared."""

import math
from pathlib import Path

import msgspec
import numpy as np

from calib.sim import Camera, Simulator, Tip
from calib.sim.script import REST_FRAMES, SCENES, play
from edge.calibration import Calibration
from edge.calibration.file import sensor_of
from edge.pins import take_rest
from edge.types import Feature, Frame

#: What a grasp controller asks for.
GRASP = frozenset({Feature.DISPLACEMENT, Feature.SHEAR})
#: Tips and images over which the cost of a frame is measured.
PINS = (61, 127, 331, 547, 721, 1027)  # whole rings; 1027 is the next one to 1000
SIZES = ((320, 240), (640, 480), (1280, 800))
NARROW = 0.38 * 240  # px, a tip that fits the smallest image


def scene(
    name: str = "tour", pins: int = 331, size_px: tuple[int, int] = (640, 480), radius_px: float = 0.0
) -> list[Frame]:
    """Every frame of a scene of the simulator; the first `REST_FRAMES` show the untouched tip.

    radius_px  of the outermost pins' circle; 0: the tip fills the image
    """
    thin = min(1.0, math.sqrt(331 / pins))  # more than 331 pins must be thinner to be separate
    tip = Tip(n_pins=pins, pin_radius_mm=0.6 * thin)
    camera = Camera(tip=tip, size_px=size_px, pins_radius_px=radius_px)
    simulator = Simulator(camera, seed=1, rate_hz=240.0)
    return [simulator.frame(contacts) for contacts in play(SCENES[name])]


def there_and_back(name: str) -> tuple[np.ndarray, int]:
    """Images of the untouched tip, how many these are, and of a scene to its end and back."""
    images = [frame.image for frame in scene(name)]
    touched = images[REST_FRAMES:]
    return np.stack([*images[:REST_FRAMES], *touched, *touched[-2:0:-1]]), REST_FRAMES


def calibration_of(frames: list[Frame]) -> Calibration:
    """The bundled calibration's models on this tip, whatever its camera. Its times are right, its values are
    not.
    """
    rest = take_rest([frame.image for frame in frames[:REST_FRAMES]])
    bundled = Calibration.load(Path(__file__).parents[1] / "data" / "rings331_ball.json")
    return Calibration(msgspec.structs.replace(bundled.content, sensor=sensor_of(rest, "bench")))
