"""A ROS 2 peer on Zenoh: decodes CDR by pycdr2, from definitions written here."""

import json
import socket
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, make_dataclass
from typing import Any

import zenoh
import zenoh.ext
from pycdr2 import IdlStruct, types

from tests.support.waiting import until

#: As in the definitions of ROS 2; `TYPE[]` is a sequence.
DEFINITIONS = """
Time: int32 sec, uint32 nanosec
Header: Time stamp, string frame_id
Vector3: float64 x, float64 y, float64 z
Wrench: Vector3 force, Vector3 torque
WrenchStamped: Header header, Wrench wrench
PointField: string name, uint32 offset, uint8 datatype, uint32 count
PointCloud2: Header header, uint32 height, uint32 width, PointField[] fields, bool is_bigendian
PointCloud2: uint32 point_step, uint32 row_step, uint8[] data, bool is_dense
KeyValue: string key, string value
DiagnosticStatus: uint8 level, string name, string message, string hardware_id, KeyValue[] values
DiagnosticArray: Header header, DiagnosticStatus[] status
TriggerRequest: uint8 structure_needs_at_least_one_member
TriggerResponse: bool success, string message
TactileContact: float32 x_mm, float32 y_mm, float32 depth_mm
TactileSample: Header header, float64 host_error_s, uint8 finger, uint32 lost_n
TactileSample: uint8 wrench_known, uint16 sample, uint16 status, uint32 capture_time_us
TactileSample: float32 latency_us, float32 pins_tracked
TactileSample: uint8 contact_n, float32 displacement_mm, float32 displacement_sigma_mm, float32 force_n
TactileSample: float32 force_x_n, float32 force_y_n, float32 force_xy_sigma_n, float32 torque_z_nmm
TactileSample: float32 torque_z_sigma_nmm, float32 friction, float32 slip_margin, float32 pressure_kpa
TactileSample: float32 contact_area_mm2, float32 shear_x_mm, float32 shear_y_mm, float32 shear_sigma_mm
TactileSample: float32 torsion_deg, float32 tilt_x_deg, float32 tilt_y_deg, float32 slip_speed_mm_s
TactileSample: float32 slip_probability, float32 orientation_deg, float32 vibration_mm
TactileSample: float32 temperature_degc
TactileSample: TactileContact[] contacts
"""


def _structs() -> dict[str, Any]:
    """The classes that pycdr2 packs and unpacks."""
    members: dict[str, list[str]] = {}
    for line in DEFINITIONS.strip().splitlines():
        name, _, text = line.partition(": ")
        members.setdefault(name, []).extend(text.split(", "))
    sequence: Any = types.sequence
    known: dict[str, Any] = {"string": str, "bool": bool} | {
        plain: getattr(types, plain) for plain in ("uint8", "uint16", "uint32", "int32", "float32", "float64")
    }
    for name, texts in members.items():
        fields: list[tuple[str, Any]] = []
        for text in texts:
            kind, member = text.split()
            one = known[kind.removesuffix("[]")]
            fields.append((member, sequence[one] if kind.endswith("[]") else one))
        known[name] = make_dataclass(name, fields, bases=(IdlStruct,))
    return known


STRUCTS = _structs()


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

    def subscribe_latched(self, key: str) -> Callable[[str], bytes]:
        """What topics had published before, as transient local subscribers get it; waits for each."""
        got: dict[str, bytes] = {}

        def take(sample: Any) -> None:
            got["/" + "/".join(str(sample.key_expr).split("/")[1:-2])] = bytes(sample.payload)

        history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
        self._latched = zenoh.ext.declare_advanced_subscriber(
            self.session, key, take, history=history, subscriber_detection=True
        )

        def of(topic: str) -> bytes:
            until(lambda: topic in got, topic)
            return got[topic]

        return of

    def of(self, topic: str) -> list[Received]:
        with self._lock:
            return list(self.received.get(topic, ()))

    def tokens(self) -> list[str]:
        return [str(reply.ok.key_expr) for reply in self.session.liveliness().get("@ros2_lv/**")]

    def ask(self, key: str, request: bytes, number: int = 1) -> tuple[bytes, tuple[int, int, bytes]]:
        """A service's response, and the attachment taken apart."""
        attachment = struct.pack("<qqB", number, time.time_ns(), 16) + b"\x07" * 16
        for reply in self.session.get(key, payload=request, attachment=attachment, timeout=30.0):
            return bytes(reply.ok.payload), take_apart(bytes(reply.ok.attachment))
        raise AssertionError(f"no answer at {key}")

    def tare(self, key: str, number: int) -> tuple[Any, tuple[int, int, bytes]]:
        payload, attachment = self.ask(key, STRUCTS["TriggerRequest"](0).serialize(), number)
        return STRUCTS["TriggerResponse"].deserialize(payload), attachment

    def close(self) -> None:
        self.session.close()
