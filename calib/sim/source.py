"""The simulator as a source of frames for the loop: `sim:SCENE?key=value`.

    sim:                        the tour: press, shear, two contacts, an edge, over and over, 60 frames/s
    sim:two?rate_hz=240         one scene, paced
    sim:press?paced=0           once, as fast as it is read
    sim:tour?pins=127&layout=hex&seed=7
    sim:tour?light=ugly             glare, reflections, dead pins, a noisy sensor
    sim:press?sensor=gelsight-mini  a known sensor, or a file of your own

Rules
- Paced frames are rendered before the first one is due, then looped: at 640x480 that takes some 25 ms
  and 300 kB a frame (the tour has 200); then any rate is possible.
- Unpaced frames are rendered when they are read.
"""

from collections.abc import Iterator

import msgspec

from calib.sim.camera import Camera
from calib.sim.of_sensor import appearance_of, camera_of, depth_factor
from calib.sim.render import Appearance, ugly
from calib.sim.script import SCENES, play, shallower
from calib.sim.simulator import Simulator
from calib.sim.tip import Tip
from edge.errors import ConfigError, SourceError
from edge.sensors import KnownSensor, load_sensor
from edge.sources.options import Options
from edge.sources.paced import Paced
from edge.types import Frame, FrameSource

RATE_HZ = 60.0


class SimKeys(msgspec.Struct):
    """The scheme's own keys."""

    pins: int = 331
    layout: str = "rings"
    seed: int = 0
    paced: bool = True
    light: str = "clean"
    sensor: str = ""


_LIGHTS = {"clean": lambda camera, seed: Appearance(), "ugly": ugly}


class SceneSource(FrameSource):
    """Frames of a scene; iterating again plays it again, with other noise unless `keep`."""

    live = False

    def __init__(
        self, simulator: Simulator, scene: str, keep: bool = False, depth_factor: float = 1.0
    ) -> None:
        self.name = f"sim:{scene}"
        self.size_px = simulator.camera.size_px
        self.rate_hz = simulator.rate_hz
        self._simulator = simulator
        self._moves = shallower(SCENES[scene], depth_factor)
        self._kept: list[Frame] | None = list(self._render()) if keep else None
        self._closed = False

    def _render(self) -> Iterator[Frame]:
        for contacts in play(self._moves):
            yield self._simulator.frame(contacts)

    def __iter__(self) -> Iterator[Frame]:
        for frame in self._render() if self._kept is None else self._kept:
            if self._closed:
                return
            yield frame.within(self.region)

    def close(self) -> None:
        self._closed = True


def open_sim(where: str, options: Options) -> FrameSource:
    """Open `sim:where?...`; the entry point of sources. Raises SourceError."""
    scene = where or "tour"
    if scene not in SCENES:
        raise SourceError(f"source sim:{where}: no scene {scene!r}; one of {', '.join(SCENES)}")
    keys = options.own(f"sim:{where}", SimKeys)
    try:
        sensor = load_sensor(keys.sensor) if keys.sensor else None
        camera = _camera(sensor, keys, options)
        if keys.light not in _LIGHTS:
            raise ValueError(f"light {keys.light!r} is unknown; one of {', '.join(_LIGHTS)}")
        appearance = _LIGHTS[keys.light](camera, keys.seed)
        if sensor is not None:
            appearance = appearance_of(sensor, appearance)
        simulator = Simulator(camera, appearance, keys.seed, options.rate_hz or RATE_HZ)
    except (ValueError, ConfigError) as error:
        raise SourceError(f"source sim:{where}: {error}") from None
    factor = 1.0 if sensor is None else depth_factor(sensor)
    source = SceneSource(simulator, scene, keep=keys.paced, depth_factor=factor)
    if not keys.paced:
        return source
    return Paced(source, loop=True)


def _camera(sensor: KnownSensor | None, keys: SimKeys, options: Options) -> Camera:
    """Raises ValueError."""
    given = (options.width, options.height)
    if sensor is None:
        tip = Tip(n_pins=keys.pins, kind=keys.layout)
        return Camera(tip=tip, size_px=(given[0] or 640, given[1] or 480))
    both = [key for key in ("pins", "layout") if key in options.extra]
    if both:
        raise ValueError(f"{both[0]}= beside sensor=: the sensor has its own; leave one of them out")
    return camera_of(sensor, given)
