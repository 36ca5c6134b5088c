"""A ROS 2 peer on Zenoh: decodes CDR by pycdr2, from definitions written here.

pycdr2 reads the annotations, so they are not postponed here.
"""

import json
import socket
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import zenoh
from pycdr2 import IdlStruct
from pycdr2.types import float32, float64, int32, sequence, uint8, uint16, uint32


@dataclass
class Time(IdlStruct):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct):
    x: float64
    y: float64
    z: float64


@dataclass
class Wrench(IdlStruct):
    force: Vector3
    torque: Vector3


@dataclass
class WrenchStamped(IdlStruct):
    header: Header
    wrench: Wrench


@dataclass
class PointField(IdlStruct):
    name: str
    offset: uint32
    datatype: uint8
    count: uint32


@dataclass
class PointCloud2(IdlStruct):
    header: Header
    height: uint32
    width: uint32
    fields: sequence[PointField]  # type: ignore[type-arg]
    is_bigendian: bool
    point_step: uint32
    row_step: uint32
    data: sequence[uint8]  # type: ignore[type-arg]
    is_dense: bool


@dataclass
class KeyValue(IdlStruct):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]  # type: ignore[type-arg]


@dataclass
class DiagnosticArray(IdlStruct):
    header: Header
    status: sequence[DiagnosticStatus]  # type: ignore[type-arg]


@dataclass
class TriggerRequest(IdlStruct):
    structure_needs_at_least_one_member: uint8 = 0


@dataclass
class TriggerResponse(IdlStruct):
    success: bool
    message: str


@dataclass
class TactileContact(IdlStruct):
    x_mm: float32
    y_mm: float32
    depth_mm: float32


@dataclass
class TactileSample(IdlStruct):
    header: Header
    host_error_s: float64
    finger: uint8
    lost_n: uint32
    sample: uint16
    status: uint16
    capture_time_us: uint32
    latency_us: float32
    pins_tracked: float32
    contact_n: uint8
    displacement_mm: float32
    displacement_sigma_mm: float32
    force_n: float32
    force_x_n: float32
    force_y_n: float32
    force_xy_sigma_n: float32
    torque_z_nmm: float32
    torque_z_sigma_nmm: float32
    friction: float32
    slip_margin: float32
    pressure_kpa: float32
    contact_area_mm2: float32
    shear_x_mm: float32
    shear_y_mm: float32
    shear_sigma_mm: float32
    torsion_deg: float32
    tilt_x_deg: float32
    tilt_y_deg: float32
    slip_speed_mm_s: float32
    slip_probability: float32
    orientation_deg: float32
    vibration_mm: float32
    temperature_degc: float32
    contacts: sequence[TactileContact]  # type: ignore[type-arg]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def open_session(mode: str, where: str, port: int) -> Any:
    config = zenoh.Config()
    config.insert_json5("mode", json.dumps(mode))
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5(where, json.dumps([f"tcp/127.0.0.1:{port}"]))
    return zenoh.open(config)


def open_router(port: int) -> Any:
    return open_session("router", "listen/endpoints", port)


@dataclass
class Received:
    """One message: its key, CDR, and attachment."""

    key: str
    payload: bytes
    number: int
    sent_ns: int
    sender: bytes
    arrival_ns: int = field(default_factory=time.time_ns)


def take_apart(attachment: bytes) -> tuple[int, int, bytes]:
    """Sequence number, time and sender, as rmw_zenoh has them."""
    number, sent_ns, size = struct.unpack_from("<qqB", attachment)
    assert len(attachment) == 17 + size
    return number, sent_ns, attachment[17:]


class Peer:
    """Subscribes and asks."""

    def __init__(self, port: int) -> None:
        self.session = open_session("client", "connect/endpoints", port)
        self.received: dict[str, list[Received]] = {}
        self._lock = threading.Lock()

    def subscribe(self, key: str, then: Callable[[Received], None] | None = None) -> None:
        def take(sample: Any) -> None:
            received = Received(
                str(sample.key_expr), bytes(sample.payload), *take_apart(bytes(sample.attachment))
            )
            if then is not None:
                then(received)
                return
            with self._lock:
                topic = "/" + "/".join(received.key.split("/")[1:-2])
                self.received.setdefault(topic, []).append(received)

        self.session.declare_subscriber(key, take)

    def of(self, topic: str) -> list[Received]:
        with self._lock:
            return list(self.received.get(topic, ()))

    def tokens(self) -> list[str]:
        return [str(reply.ok.key_expr) for reply in self.session.liveliness().get("@ros2_lv/**")]

    def call(self, key: str, number: int) -> tuple[TriggerResponse, tuple[int, int, bytes]]:
        attachment = struct.pack("<qqB", number, time.time_ns(), 16) + b"\x07" * 16
        replies = self.session.get(
            key, payload=TriggerRequest().serialize(), attachment=attachment, timeout=30.0
        )
        for reply in replies:
            payload, answer = bytes(reply.ok.payload), bytes(reply.ok.attachment)
            return TriggerResponse.deserialize(payload), take_apart(answer)
        raise AssertionError(f"no answer at {key}")

    def close(self) -> None:
        self.session.close()
