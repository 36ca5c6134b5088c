"""Samples, pins and hands as ROS messages. Nothing that RViz draws holds a NaN: it refuses such messages.

Frames carry the namespace (`left_hand/thumb`): mm and px of the tip's frame are metres here.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite, isnan
from typing import Any, Final

from hostlink.bridge.ros_types import Types
from hostlink.events import Sample
from hostlink.topics import (
    ARROW_M,
    ARROW_RGBA,
    BALL_RGBA,
    LIFETIME_NS,
    Diagnosis,
    TipPlace,
    arrows_of,
    balls_of,
    known,
)
from hostlink.wire import Detail
from hostlink.wire.fields import FIELDS
from hostlink.wire.shown import WRENCH

__all__ = ["KINDS", "RosMessages"]

CONTACT: Final = "voronoi_touch_msgs/msg/TactileContact"
#: Types of messages that are published, by the end of the topic's name.
KINDS: Final = {
    "wrench": "geometry_msgs/msg/WrenchStamped",
    "contacts": "sensor_msgs/msg/PointCloud2",
    "markers": "visualization_msgs/msg/MarkerArray",
    "pins": "sensor_msgs/msg/PointCloud2",
    "sample": "voronoi_touch_msgs/msg/TactileSample",
    "image/compressed": "sensor_msgs/msg/CompressedImage",
    "diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "tf_static": "tf2_msgs/msg/TFMessage",
    "robot_description": "std_msgs/msg/String",
}
_FLOAT32, _FLOAT_BYTES = 7, 4  # of PointField
_SPHERE, _ARROW, _DELETE_ALL = 2, 0, 3  # of Marker
_MM: Final = 1e-3


class RosMessages:
    """Makes them of one distribution's types."""

    def __init__(self, types: Types) -> None:
        self._make = types.make

    def _time(self, at_ns: int) -> Any:
        sec, nanosec = divmod(at_ns, 1_000_000_000)
        return self._make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)

    def _header(self, at_ns: int, frame: str) -> Any:
        return self._make("std_msgs/msg/Header", stamp=self._time(at_ns), frame_id=frame)

    def _vector(self, x: float, y: float, z: float) -> Any:
        return self._make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)

    def _point(self, x: float, y: float, z: float) -> Any:
        return self._make("geometry_msgs/msg/Point", x=x, y=y, z=z)

    def wrench(self, at_ns: int, frame: str, sample: Sample) -> Any:
        """Force and torque on the tip, z out of the skin: what presses it is a force against z. A part that
        is not known is 0; `TactileSample` says which these are.
        """
        values: dict[str, list[float]] = {"force": [], "torque": []}
        for part, _, field, factor in WRENCH:
            values[part].append(known(getattr(sample.state, field)) * factor if field else 0.0)
        parts = {part: self._vector(*xyz) for part, xyz in values.items()}
        wrench = self._make("geometry_msgs/msg/Wrench", **parts)
        return self._make(KINDS["wrench"], header=self._header(at_ns, frame), wrench=wrench)

    def _cloud(self, at_ns: int, frame: str, names: Sequence[str], rows: Sequence[Sequence[float]]) -> Any:
        """Points with these fields, of which the first are x, y and z."""
        import numpy as np

        fields = [
            self._make(
                "sensor_msgs/msg/PointField", name=name, offset=i * _FLOAT_BYTES, datatype=_FLOAT32, count=1
            )
            for i, name in enumerate(names)
        ]
        step = _FLOAT_BYTES * len(names)
        return self._make(
            KINDS["pins"], header=self._header(at_ns, frame), height=1, width=len(rows), fields=fields,
            point_step=step, row_step=step * len(rows), is_dense=True,
            data=np.array(rows, "<f4").reshape(-1).view(np.uint8),
        )  # fmt: skip

    def contacts(self, at_ns: int, frame: str, sample: Sample) -> Any:
        """Places of contact, and how deep; a depth that is not known is 0."""
        rows = [
            (c.x_mm * _MM, c.y_mm * _MM, 0.0, known(c.depth_mm) * _MM)
            for c in sample.state.contacts
            if isfinite(c.x_mm + c.y_mm)
        ]
        return self._cloud(at_ns, frame, ("x", "y", "z", "depth"), rows)

    def pins(
        self, at_ns: int, frame: str, detail: Detail, places: Sequence[tuple[float, float, float]]
    ) -> Any:
        """Where the pins are now, how far they moved, and how much their cells have grown; no lost ones.

        places  of each pin at rest: x, y in the tip's frame, m; m in a pixel
        """
        rows = [
            (x + dx * m, y + dy * m, 0.0, dx * m, dy * m, known(da), i)
            for i, ((dx, dy, da), (x, y, m)) in enumerate(zip(detail.rows, places, strict=True))
            if isfinite(dx + dy)
        ]
        return self._cloud(at_ns, frame, ("x", "y", "z", "dx", "dy", "da", "pin"), rows)

    def markers(self, at_ns: int, frame: str, sample: Sample) -> Any:
        """Contacts as balls, shear and depth as arrows; each message replaces the one before."""
        header = self._header(at_ns, frame)
        sec, nanosec = divmod(LIFETIME_NS, 1_000_000_000)
        lifetime = self._make("builtin_interfaces/msg/Duration", sec=sec, nanosec=nanosec)
        colour = {rgba: self._make("std_msgs/msg/ColorRGBA", **dict(zip("rgba", rgba, strict=True)))
                  for rgba in (BALL_RGBA, ARROW_RGBA)}  # fmt: skip
        upright = self._make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)

        def marker(kind: int, place: Any, size: Any, rgba: Any, points: Sequence[Any] = ()) -> Any:
            pose = self._make("geometry_msgs/msg/Pose", position=place, orientation=upright)
            return self._make(
                "visualization_msgs/msg/Marker", header=header, ns="touch", id=len(made), type=kind,
                pose=pose, scale=size, color=colour[rgba], lifetime=lifetime, frame_locked=True,
                points=[*points],
            )  # fmt: skip

        made = [self._make("visualization_msgs/msg/Marker", header=header, action=_DELETE_ALL)]
        origin = self._point(0.0, 0.0, 0.0)
        for x, y, diameter in balls_of(sample.state):
            size = self._vector(diameter, diameter, diameter)
            made.append(marker(_SPHERE, self._point(x, y, 0.0), size, BALL_RGBA))
        for arrow in arrows_of(sample.state):
            size = self._vector(ARROW_M / 2, ARROW_M, 0.0)  # of the shaft, of the head
            made.append(marker(_ARROW, origin, size, ARROW_RGBA, (origin, self._point(*arrow))))
        return self._make(KINDS["markers"], markers=made)

    def sample(self, at_ns: int, frame: str, sample: Sample) -> Any:
        """Everything, by the names of the wire; NaN: not known."""
        state = sample.state
        values = {f.name: getattr(state, f.name) for f in FIELDS}
        values["status"] = int(state.status)
        contacts = [
            self._make(CONTACT, x_mm=c.x_mm, y_mm=c.y_mm, depth_mm=c.depth_mm) for c in state.contacts
        ]
        parts = (not isnan(getattr(state, field)) if field else False for _, _, field, _ in WRENCH)
        return self._make(
            KINDS["sample"], header=self._header(at_ns, frame), host_error_s=sample.host_error_s,
            finger=sample.finger, lost_n=sample.lost_n, contacts=contacts,
            wrench_known=sum(part << i for i, part in enumerate(parts)), **values,
        )  # fmt: skip

    def image(self, at_ns: int, frame: str, jpeg: bytes) -> Any:
        """A camera's image; the tip's frame is parallel to the camera's."""
        import numpy as np

        data = np.frombuffer(jpeg, np.uint8)
        header = self._header(at_ns, frame)
        return self._make(KINDS["image/compressed"], header=header, format="jpeg", data=data)

    def transforms(self, tips: Iterable[TipPlace]) -> Any:
        """Where the tips are mounted."""
        header = self._header
        return self._make(
            KINDS["tf_static"],
            transforms=[
                self._make(
                    "geometry_msgs/msg/TransformStamped",
                    header=header(time.time_ns(), tip.parent),
                    child_frame_id=tip.name,
                    transform=self._make(
                        "geometry_msgs/msg/Transform",
                        translation=self._vector(*tip.place_m),
                        rotation=self._make(
                            "geometry_msgs/msg/Quaternion", **dict(zip("xyzw", tip.rotation, strict=True))
                        ),
                    ),
                )
                for tip in tips
            ],
        )

    def text(self, text: str) -> Any:
        """A description of the hand."""
        return self._make(KINDS["robot_description"], data=text)

    def diagnostics(self, diagnoses: Sequence[Diagnosis]) -> Any:
        """All fingers' diagnoses."""

        def values(of: Mapping[str, str]) -> list[Any]:
            return [self._make("diagnostic_msgs/msg/KeyValue", key=k, value=v) for k, v in of.items()]

        status = [
            self._make(
                "diagnostic_msgs/msg/DiagnosticStatus", level=int(d.level), name=d.name, message=d.message,
                hardware_id=d.serial_number, values=values(d.values),
            )
            for d in diagnoses
        ]  # fmt: skip
        header = self._header(time.time_ns(), "")
        return self._make(KINDS["diagnostics"], header=header, status=status)
