"""The simulator as a rig.

Rules
- The frames depend on the simulation's file and on their number only: a capture that is resumed gives
  the same bytes as one that ran through.
"""

from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

from calib.errors import RigError
from calib.rig.base import Pose
from calib.sim import Appearance, Camera, Simulator, Tip, Tool, ToolPose
from calib.sim.of_sensor import appearance_of, camera_of
from edge.errors import ConfigError
from edge.limits import PINS_MAX, PINS_MIN, read_toml_as
from edge.sensors import load_sensor
from edge.sources.image_header import check_size
from edge.types import Frame


@dataclass(frozen=True)
class CameraTable:
    """[camera] as `calib.sim.Camera`, without the tip."""

    size_px: tuple[int, int] = (640, 480)
    pins_radius_px: float = 0.0
    centre_px: tuple[float, float] = (0.0, 0.0)
    roll_deg: float = 0.0
    k1: float = -0.08
    k2: float = 0.0


@dataclass(frozen=True)
class Simulation:
    """Everything that defines a simulated rig; a TOML file of these tables and keys."""

    tip: Tip = field(default_factory=Tip)
    camera: CameraTable = field(default_factory=CameraTable)
    look: Appearance = field(default_factory=Appearance)
    seed: int = 0
    rate_hz: float = 60.0

    def simulator(self) -> Simulator:
        camera = Camera(tip=self.tip, **asdict(self.camera))
        return Simulator(camera, self.look, self.seed, self.rate_hz)


def load_simulation(path: Path | None) -> Simulation:
    """Read a simulation; without a file, the defaults. Raises RigError: one line, file and key."""
    if path is None:
        return Simulation()
    try:
        table, known = read_toml_as(path, Simulation)
        _refuse_unknown(table, known)
        if not PINS_MIN <= known.tip.n_pins <= PINS_MAX:
            raise ValueError(f"tip: n_pins = {known.tip.n_pins}; give {PINS_MIN} to {PINS_MAX}")
        check_size(*known.camera.size_px)
        known.simulator()
        return known
    except ValueError as error:
        raise RigError(f"{path}: {error}") from None


def simulation_of(name: str) -> Simulation:
    """The simulation of a known sensor. Raises RigError: its file lacks what a simulation needs."""
    try:
        sensor = load_sensor(name)
        camera = camera_of(sensor)
    except (ConfigError, ValueError) as error:
        raise RigError(f"sim:{name}: {error}") from None
    table = {field.name: getattr(camera, field.name) for field in fields(CameraTable)}
    return Simulation(camera.tip, CameraTable(**table), appearance_of(sensor, Appearance()))


def _refuse_unknown(table: dict[str, object], known: object) -> None:
    """Dataclasses take unknown keys in silence; a user's typing error must not."""
    fields = getattr(type(known), "__dataclass_fields__", {})
    for key, value in table.items():
        if key not in fields:
            raise ValueError(f"key {key!r} is unknown; one of {', '.join(fields)}")
        if isinstance(value, dict):
            _refuse_unknown(value, getattr(known, key))


class SimulatedRig:
    """A tip that exists as equations only."""

    def __init__(self, simulation: Simulation | None = None, first_sequence: int = 0) -> None:
        self.name = "sim"
        self.simulator = (simulation or Simulation()).simulator()
        self.simulator.sequence = first_sequence
        self._tool = Tool()
        self._contacts: tuple[ToolPose, ...] = ()

    def mount(self, tool: Tool) -> None:
        self._tool = tool
        self._contacts = ()

    def move(self, pose: Pose) -> None:
        self._contacts = (ToolPose(tool=self._tool, **asdict(pose)),) if pose.depth_mm > 0 else ()

    def frame(self) -> Frame:
        try:
            return self.simulator.frame(self._contacts)
        except ValueError as error:
            raise RigError(f"sim: {error}") from None

    def close(self) -> None:
        self._contacts = ()
