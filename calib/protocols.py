"""Measurement protocols: sequences of poses, as data.

The paper's ("Experimental Procedure"): displacement 0..5 mm by 0.1 mm and shear 0..2 mm by 0.1 mm, 10
frames a step, on a flat surface; direction: press 3 mm, shear 2 mm, in 36 directions.

Rules
- A protocol starts with frames of the untouched tip (role "rest"): they are the frame of reference.
- A step without frames only moves: it lifts the tool clear so that what follows starts from a fresh
  contact, without the history of friction.
- Files (TOML) describe the same with ranges:

      name = "corner"
      rest_frames = 10
      frames = 10                      # of a step, unless it says otherwise
      tool = { kind = "sphere", radius_mm = 3.0 }

      [[step]]                         # every combination of the listed values, last key fastest
      x_mm = [0.0, 2.0, 4.0]
      depth_mm = { from = 0.5, to = 3.0, by = 0.5 }
      lift = true                      # clear of the tip before each pose (false)
"""

import hashlib
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Protocol

import msgspec
import numpy as np

from calib.errors import ProtocolError
from calib.rig.base import CLEAR, Pose
from calib.sim.mechanics import Tool
from edge.limits import read_toml_as
from edge.types import Frame

SHEAR_DEPTH_MM = 3.0  # paper: "pressing the sensor into a flat level object approximately 3 mm"
FLAT = Tool("flat")
STEPS_MAX = 100_000  # at a pose in 2 s a rig would be at it for two days


@dataclass(frozen=True, slots=True)
class Step:
    """One pose.

    frames  number taken there; 0: only pass through
    role    "rest": untouched, reference; "sample"
    """

    pose: Pose
    tool: Tool
    frames: int
    role: str = "sample"


class AnyPlan(Protocol):
    """The steps that a capture runs: they are fixed, or that follow from the frames so far.

    name      of the protocol
    digest    identifies its recordings
    n_frames  of all steps, or at most
    steps     as far as they are known
    """

    @property
    def name(self) -> str: ...
    @property
    def digest(self) -> str: ...
    @property
    def n_frames(self) -> int: ...
    @property
    def steps(self) -> Sequence[Step]: ...

    def recall(self, poses: Mapping[int, Pose]) -> None:
        """Add the steps that a recording holds. poses: of the step with this number."""

    def take(self, frame: Frame, row: Mapping[str, str]) -> None:
        """Another frame of the capture, with its row of the table."""

    def review(self, frames: Iterable[tuple[Frame, Mapping[str, str]]]) -> None:
        """The same for all that a recording holds, in their order."""

    def grow(self) -> bool:
        """Add steps after those there are. False: the protocol is complete."""


@dataclass(frozen=True, slots=True)
class Plan:
    """A protocol's name and steps, which are fixed."""

    name: str
    steps: tuple[Step, ...]

    @property
    def n_frames(self) -> int:
        return sum(step.frames for step in self.steps)

    @property
    def digest(self) -> str:
        """Hash of all steps."""
        return digest_of(self.steps)

    def recall(self, poses: Mapping[int, Pose]) -> None:
        """Nothing to add."""

    def take(self, frame: Frame, row: Mapping[str, str]) -> None:
        """Nothing follows from it."""

    def review(self, frames: Iterable[tuple[Frame, Mapping[str, str]]]) -> None:
        """Nothing follows from them."""

    def grow(self) -> bool:
        return False


def digest_of(steps: Sequence[Step]) -> str:
    return hashlib.sha256(msgspec.json.encode([asdict(s) for s in steps])).hexdigest()[:16]


def sheared(depth_mm: float, tilt_x_deg: float, tilt_y_deg: float, *shear_and_twist: float) -> list[Step]:
    """A fresh contact with a flat surface: clear of the tip, pressed, then sheared and twisted."""
    pressed = Pose(depth_mm=depth_mm, tilt_x_deg=tilt_x_deg, tilt_y_deg=tilt_y_deg)
    shear_x, shear_y, twist = shear_and_twist
    moved = replace(pressed, shear_x_mm=shear_x, shear_y_mm=shear_y, twist_deg=twist)
    return [Step(CLEAR, FLAT, 0), Step(pressed, FLAT, 0), Step(moved, FLAT, 1)]


def rest_steps(tool: Tool, frames: int = 10) -> list[Step]:
    return [Step(CLEAR, tool, frames, "rest")]


def displacement() -> Plan:
    """0..5 mm by 0.1 mm, flat, 10 frames a step (paper)."""
    presses = [Step(Pose(depth_mm=i / 10), FLAT, 10) for i in range(51)]
    return Plan("displacement", tuple(rest_steps(FLAT) + presses))


def shear() -> Plan:
    """0..2 mm by 0.1 mm along x at 3 mm depth, flat, 10 frames a step (paper)."""
    steps = [Step(Pose(depth_mm=SHEAR_DEPTH_MM, shear_x_mm=i / 10), FLAT, 10) for i in range(21)]
    return Plan("shear", tuple(rest_steps(FLAT) + steps))


def direction() -> Plan:
    """Press 3 mm, shear 2 mm, every 10 degrees, flat, 10 frames each (paper)."""
    steps = rest_steps(FLAT)
    for i in range(36):
        a = math.radians(10 * i)
        x, y = round(2 * math.cos(a), 12), round(2 * math.sin(a), 12)
        steps += [
            Step(CLEAR, FLAT, 0),
            Step(Pose(depth_mm=SHEAR_DEPTH_MM), FLAT, 0),
            Step(Pose(depth_mm=SHEAR_DEPTH_MM, shear_x_mm=x, shear_y_mm=y), FLAT, 10),
        ]
    return Plan("direction", tuple(steps))


def contacts() -> Plan:
    """Single places on a 3 mm grid out to 12 mm, then pairs 4..10 mm apart in six directions.

    Probes of 1.5 mm radius, 2 mm deep; 3 frames each. The paper resolves probes about 4 mm apart.
    """
    probe = Tool("sphere", radius_mm=1.5)
    steps = rest_steps(probe)
    for y in range(-12, 13, 3):
        for x in range(-12, 13, 3):
            if math.hypot(x, y) <= 12:
                here = Pose(x_mm=x, y_mm=y, depth_mm=2.0)
                clear = Pose(x_mm=x, y_mm=y, depth_mm=CLEAR.depth_mm)
                steps += [Step(clear, probe, 0), Step(here, probe, 3)]
    for distance in (4, 5, 6, 8, 10):
        for angle in range(0, 180, 30):
            pair = Tool("two", radius_mm=1.0, angle_deg=angle, distance_mm=distance)
            steps += [Step(CLEAR, pair, 0), Step(Pose(depth_mm=2.0), pair, 3)]
    return Plan("contacts", tuple(steps))


#: Depth mm, tilt about x and y deg, shear along x and y mm, twist deg of contacts with a flat surface.
SURFACE_LOW = (1.0, -15.0, -15.0, -2.0, -2.0, -5.0)
SURFACE_HIGH = (5.0, 15.0, 15.0, 2.0, 2.0, 5.0)


def surface() -> Plan:
    """600 random poses on a flat surface, sheared and twisted, one frame each, seeded.

    Depth 1..5 mm, tilt up to 15 deg, shear up to 2 mm per axis, twist up to 5 deg: as the published
    331-pin set was taken, within the range in which the tip does not slide.
    """
    steps = rest_steps(FLAT)
    rng = np.random.default_rng(600)
    for values in np.round(rng.uniform(SURFACE_LOW, SURFACE_HIGH, (600, 6)), 4).tolist():
        steps += sheared(*values)
    return Plan("surface", tuple(steps))


def drag() -> Plan:
    """300 random presses, then dragged and twisted at load until some slide; two frames each, seeded.

    Depth 1..4 mm, tilt up to 10 deg; up to 3 mm along the surface in any direction, twist up to 20 deg. For
    forces along the surface: they grow while the skin sticks and no further once it slides, and a fit needs
    both.
    """
    steps = rest_steps(FLAT)
    low = np.array([1.0, -10.0, -10.0, -180.0, 0.0, -20.0])
    high = np.array([4.0, 10.0, 10.0, 180.0, 3.0, 20.0])
    for values in np.round(np.random.default_rng(300).uniform(low, high, (300, 6)), 4).tolist():
        depth, tilt_x, tilt_y, direction, way, twist = values
        pressed = Pose(depth_mm=depth, tilt_x_deg=tilt_x, tilt_y_deg=tilt_y)
        steps += [Step(CLEAR, FLAT, 0), Step(pressed, FLAT, 0)]
        for share in (0.5, 1.0):
            x = round(share * way * math.cos(math.radians(direction)), 4)
            y = round(share * way * math.sin(math.radians(direction)), 4)
            steps.append(Step(replace(pressed, shear_x_mm=x, shear_y_mm=y, twist_deg=share * twist), FLAT, 1))
    return Plan("drag", tuple(steps))


ADAPTIVE = "adaptive"  # chooses its poses while it is captured: `calib.adaptive`
PROTOCOLS: dict[str, Callable[[], Plan]] = {
    made.__name__: made for made in (displacement, shear, direction, contacts, surface, drag)
}


def load_protocol(spec: str) -> Plan:
    """A protocol by name, or from a TOML file. Raises ProtocolError: one line, file and key."""
    if spec in PROTOCOLS:
        return PROTOCOLS[spec]()
    path = Path(spec)
    if path.suffix != ".toml":
        raise ProtocolError(
            f"protocol {spec!r} is unknown; one of {', '.join(PROTOCOLS)}, {ADAPTIVE}, FILE.toml"
        )
    try:
        _, file = read_toml_as(path, _File)
        return _plan(file, path.stem)
    except ValueError as error:
        raise ProtocolError(f"{path}: {error}") from None


#: Millimetres or degrees: a tip is smaller than either.
_Value = Annotated[float, msgspec.Meta(ge=-360, le=360)]
_Count = Annotated[int, msgspec.Meta(ge=0, le=10_000)]


class _Range(msgspec.Struct, forbid_unknown_fields=True, rename={"start": "from"}):
    start: _Value
    to: _Value
    by: _Value


_Values = _Value | list[_Value] | _Range


class _ToolTable(msgspec.Struct, forbid_unknown_fields=True):
    kind: str = "flat"
    radius_mm: _Value = 3.0
    angle_deg: _Value = 0.0
    distance_mm: _Value = 8.0

    def tool(self) -> Tool:
        return Tool(self.kind, self.radius_mm, self.angle_deg, self.distance_mm)


class _StepTable(msgspec.Struct, forbid_unknown_fields=True):
    x_mm: _Values = 0.0
    y_mm: _Values = 0.0
    depth_mm: _Values = 0.0
    tilt_x_deg: _Values = 0.0
    tilt_y_deg: _Values = 0.0
    shear_x_mm: _Values = 0.0
    shear_y_mm: _Values = 0.0
    twist_deg: _Values = 0.0
    frames: _Count | None = None
    tool: _ToolTable | None = None
    lift: bool = False


class _File(msgspec.Struct, forbid_unknown_fields=True):
    step: list[_StepTable]
    name: str = ""
    rest_frames: _Count = 10
    frames: _Count = 10
    tool: _ToolTable = msgspec.field(default_factory=_ToolTable)


def _plan(file: _File, stem: str) -> Plan:
    if not file.step:
        raise ValueError("no [[step]]; give at least one")
    if file.rest_frames < 1:
        raise ValueError(f"rest_frames = {file.rest_frames}; the untouched tip is needed, >= 1")
    default_tool = file.tool.tool()
    steps = rest_steps(default_tool, file.rest_frames)
    axes = Pose.__dataclass_fields__
    for i, table in enumerate(file.step, 1):
        tool = table.tool.tool() if table.tool else default_tool
        frames = file.frames if table.frames is None else table.frames
        listed = [_listed(getattr(table, axis), i, axis) for axis in axes]
        if len(steps) + math.prod(map(len, listed)) > STEPS_MAX:
            raise ValueError(f"step {i}: makes more than {STEPS_MAX} poses in all; give fewer values")
        for values in itertools.product(*listed):
            pose = Pose(*values)
            if table.lift:
                steps.append(Step(Pose(x_mm=pose.x_mm, y_mm=pose.y_mm, depth_mm=CLEAR.depth_mm), tool, 0))
            steps.append(Step(pose, tool, frames))
    return Plan(file.name or stem, tuple(steps))


def _listed(values: _Values, step: int, axis: str) -> list[float]:
    if isinstance(values, _Range):
        n = (values.to - values.start) / values.by + 1e-9 if values.by else -1.0
        if not 0 <= n < STEPS_MAX:
            raise ValueError(
                f"step {step}: {axis} from {values.start} to {values.to} by {values.by} "
                + ("never arrives" if n < 0 else f"makes more than {STEPS_MAX} poses")
            )
        return [round(values.start + k * values.by, 9) for k in range(math.floor(n) + 1)]
    return values if isinstance(values, list) else [values]
