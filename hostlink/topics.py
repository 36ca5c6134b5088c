"""Fingers in Foxglove's terms: topics, schemas and contents of messages.

The same from the bridge, live and in its recordings, and in the recordings of a finger (`edge.recording`):

    /finger_1/sample    voronoi_touch.Sample              the sample's values, JSON
    /finger_1/contacts  foxglove.SceneUpdate              contacts, shear and depth in the tip's frame
    /tf                 foxglove.FrameTransforms          where the tips are mounted
    /diagnostics        diagnostic_msgs/DiagnosticArray   of all fingers, JSON

Rules
- Foxglove's own messages are made of the classes of a library `m`, which have the fields as arguments: those
  of the SDK, or those that protobuf makes. So this module needs neither.
- Lengths in metres, as in 3D panels; the sample's own values keep their units, by name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import IntEnum
from math import hypot, isfinite
from typing import Any

from hostlink.wire import NO_CONTROL, STATUS, State, Status

__all__ = [
    "ARROW_M",
    "ARROW_RGBA",
    "BALL_RGBA",
    "DIAGNOSIS_S",
    "DIAGNOSTICS",
    "LIFETIME_NS",
    "SAMPLE",
    "SPACING_M",
    "Diagnosis",
    "Level",
    "TipPlace",
    "arrows_of",
    "balls_of",
    "contact_scene",
    "diagnostics_message",
    "finger_name",
    "known",
    "level_of",
    "sample_message",
    "status_text",
    "tip_transforms",
    "values_of",
]

DIAGNOSIS_S = 1.0  # between two diagnoses: the rate of `diagnostic_updater`, which its viewers expect
_DIGITS = 6  # finer than the smallest step of any field
SPACING_M = 0.03  # between two tips whose places nobody has given
_CONTACT_M = 0.002  # a contact is drawn so wide, and wider with its depth
LIFETIME_NS = 500_000_000  # no contact is shown for a silent finger
ARROW_M = 1e-3  # width of an arrow's head
BALL_RGBA = (0.76, 0.29, 0.0, 0.9)
ARROW_RGBA = (0.0, 0.38, 0.66, 1.0)
_MM = 1e-3

SAMPLE: dict[str, Any] = {
    "title": "voronoi_touch.Sample",
    "type": "object",
    "properties": {
        "sequence": {"type": "integer", "description": "sample number; wraps at 65536"},
        "values": {"type": "object", "description": "the state frame's fields; null: not valid"},
        "host_error_s": {"type": "number", "description": "bound of the stamp's error; bridge only"},
        "lost_n": {"type": "integer", "description": "samples lost before this one; bridge only"},
    },
}
_TEXT, _WHOLE = {"type": "string"}, {"type": "integer"}
DIAGNOSTICS: dict[str, Any] = {
    "title": "diagnostic_msgs/DiagnosticArray",
    "type": "object",
    "properties": {
        "header": {
            "type": "object",
            "properties": {
                "stamp": {"type": "object", "properties": {"sec": _WHOLE, "nsec": _WHOLE}},
                "frame_id": _TEXT,
            },
        },
        "status": {
            "type": "array",
            "items": {
                "type": "object",
                "properties": {
                    "level": _WHOLE,
                    "name": _TEXT,
                    "message": _TEXT,
                    "hardware_id": _TEXT,
                    "values": {
                        "type": "array",
                        "items": {"type": "object", "properties": {"key": _TEXT, "value": _TEXT}},
                    },
                },
            },
        },
    },
}


def finger_name(node: int) -> str:
    """Name of a finger in topics, frames of reference, services and parameters."""
    return f"finger_{node}"


class Level(IntEnum):
    """Levels of `diagnostic_msgs/DiagnosticStatus`."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """State of one finger; `values` are for a person, too."""

    name: str
    level: Level
    message: str
    serial_number: str
    values: Mapping[str, str]


def status_text(status: Status) -> str:
    """The problems that the status bits show; empty: none."""
    return "; ".join(row.meaning for row in STATUS if row.bit in status and row.bit is not Status.TOUCHED)


def level_of(status: Status, problem: str) -> Level:
    """Level of a finger that sends samples."""
    if status & NO_CONTROL:
        return Level.ERROR
    return Level.WARN if problem else Level.OK


def values_of(state: State) -> dict[str, Any]:
    """The fields by name, as JSON types: an invalid value is None, status bits are names."""
    values: dict[str, Any] = {name: _plain(value) for name, value in asdict(state).items()}
    values["status"] = [bit.name for bit in Status if bit in state.status]
    return values


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, _DIGITS) if isfinite(value) else None
    if isinstance(value, dict):
        return {name: _plain(v) for name, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value


def sample_message(state: State) -> dict[str, Any]:
    """`SAMPLE` without what only a bridge knows."""
    return {"sequence": state.sample, "values": values_of(state)}


def diagnostics_message(diagnoses: Sequence[Diagnosis], at_ns: int) -> dict[str, Any]:
    """`DIAGNOSTICS`."""
    sec, nsec = divmod(at_ns, 1_000_000_000)
    status = [
        {
            "level": int(d.level),
            "name": d.name,
            "message": d.message,
            "hardware_id": d.serial_number,
            "values": [{"key": key, "value": value} for key, value in d.values.items()],
        }
        for d in diagnoses
    ]
    return {"header": {"stamp": {"sec": sec, "nsec": nsec}, "frame_id": ""}, "status": status}


@dataclass(frozen=True, slots=True)
class TipPlace:
    """Where a tip's frame is in its parent's.

    place_m   its origin
    rotation  quaternion x, y, z, w
    """

    name: str
    parent: str
    place_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)


def tip_transforms(m: Any, tips: Sequence[TipPlace], at_ns: int) -> Any:
    """Places of the tips: foxglove.FrameTransforms."""
    return m.FrameTransforms(
        transforms=[
            m.FrameTransform(
                timestamp=m.Timestamp(*divmod(at_ns, 1_000_000_000)),
                parent_frame_id=tip.parent,
                child_frame_id=tip.name,
                translation=m.Vector3(**dict(zip("xyz", tip.place_m, strict=True))),
                rotation=m.Quaternion(**dict(zip("xyzw", tip.rotation, strict=True))),
            )
            for tip in tips
        ]
    )


def balls_of(state: State) -> list[tuple[float, float, float]]:
    """Contacts as balls: x, y in the tip's frame, diameter; m."""
    return [
        (c.x_mm * _MM, c.y_mm * _MM, _CONTACT_M + known(c.depth_mm) * _MM)
        for c in state.contacts
        if isfinite(c.x_mm + c.y_mm)
    ]


def arrows_of(state: State) -> list[tuple[float, float, float]]:
    """Shear and depth as arrows from the tip's origin, as long as they are, m; if they are known."""
    both = (state.shear_x_mm, state.shear_y_mm, 0.0), (0.0, 0.0, -state.displacement_mm)
    return [(x * _MM, y * _MM, z * _MM) for x, y, z in both if isfinite(x + y + z) and (x or y or z)]


def contact_scene(m: Any, frame: str, state: State, at_ns: int) -> Any:
    """Contacts, shear and depth in a tip's frame: foxglove.SceneUpdate."""
    balls = [
        m.SpherePrimitive(
            pose=m.Pose(position=m.Vector3(x=x, y=y, z=0.0), orientation=_rotation(m)),
            size=m.Vector3(**dict.fromkeys("xyz", diameter)),
            color=m.Color(**dict(zip("rgba", BALL_RGBA, strict=True))),
        )
        for x, y, diameter in balls_of(state)
    ]
    entity = m.SceneEntity(
        timestamp=m.Timestamp(*divmod(at_ns, 1_000_000_000)),
        frame_id=frame,
        id="touch",
        lifetime=m.Duration(0, LIFETIME_NS),
        frame_locked=True,
        spheres=balls,
        arrows=[_arrow(m, *arrow) for arrow in arrows_of(state)],
    )
    return m.SceneUpdate(entities=[entity])


def known(value: float) -> float:
    """The value, or 0 where there is none, for what is drawn."""
    return value if isfinite(value) else 0.0


def _rotation(m: Any, x: float = 1.0, y: float = 0.0, z: float = 0.0) -> Any:
    """The rotation that takes the x axis to this direction."""
    length = hypot(x, y, z)
    # half-way vector between the axis and the direction: q = (axis x direction, 1 + axis . direction)
    w, qy, qz = length + x, -z, y
    norm = hypot(w, qy, qz)
    if norm == 0.0:  # opposite directions
        return m.Quaternion(x=0.0, y=0.0, z=1.0, w=0.0)
    return m.Quaternion(x=0.0, y=qy / norm, z=qz / norm, w=w / norm)


def _arrow(m: Any, x_m: float, y_m: float, z_m: float) -> Any:
    length_m = hypot(x_m, y_m, z_m)
    origin = m.Vector3(x=0.0, y=0.0, z=0.0)
    return m.ArrowPrimitive(
        pose=m.Pose(position=origin, orientation=_rotation(m, x_m, y_m, z_m)),
        shaft_length=0.8 * length_m,
        shaft_diameter=ARROW_M / 2,
        head_length=0.2 * length_m,
        head_diameter=ARROW_M,
        color=m.Color(**dict(zip("rgba", ARROW_RGBA, strict=True))),
    )
