"""A ROS 2 peer on Zenoh, which decodes CDR with another library than the bridge's."""

import json
import struct
import threading
import time
from dataclasses import dataclass, field, make_dataclass
from functools import cache
from typing import Any, cast

import zenoh
import zenoh.ext
from pycdr2 import IdlStruct, types
from rosbags.interfaces import Nodetype

from hostlink.bridge.ros_types import TRIGGER, Types, message_of

TYPES = Types("jazzy")


@cache
def struct_of(name: str) -> Any:
    """The class that pycdr2 packs and unpacks for a message, from rosbags' definition of it."""
    fields = [(member, _kind_of(*of)) for member, of in TYPES.store.fielddefs[name][1]]
    return make_dataclass(name.rpartition("/")[2], fields, bases=(IdlStruct,))


def _kind_of(kind: Any, of: Any) -> Any:
    if kind == Nodetype.NAME:
        return struct_of(of)
    if kind == Nodetype.BASE:
        plain = {"string": str, "bool": bool, "char": types.uint8, "octet": types.uint8, "byte": types.uint8}
        return plain.get(of[0]) or getattr(types, of[0])
    inner, generic = _kind_of(*of[0]), cast(Any, types)  # whose stubs do not know that they are
    return generic.array[inner, of[1]] if kind == Nodetype.ARRAY else generic.sequence[inner]


def unpack(name: str, data: bytes) -> Any:
    """A message of that type."""
    return struct_of(name).deserialize(data)


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
    def __init__(self, port: int) -> None:
        self.session = open_session("client", "connect/endpoints", port)
        self.received: dict[str, list[Received]] = {}
        self._lock = threading.Lock()

    def subscribe(self, key: str, *, latched: bool = False) -> None:
        """latched: with what was published before, as transient local subscribers get it."""

        def take(sample: Any) -> None:
            received = Received(
                str(sample.key_expr), bytes(sample.payload), *take_apart(bytes(sample.attachment))
            )
            with self._lock:
                topic = "/" + "/".join(received.key.split("/")[1:-2])
                self.received.setdefault(topic, []).append(received)

        if not latched:
            self.session.declare_subscriber(key, take)
            return
        history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
        self._latched = zenoh.ext.declare_advanced_subscriber(
            self.session, key, take, history=history, subscriber_detection=True
        )

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
        request = struct_of(message_of(TRIGGER, "Request"))(0).serialize()
        payload, attachment = self.ask(key, request, number)
        return unpack(message_of(TRIGGER, "Response"), payload), attachment

    def close(self) -> None:
        self.session.close()
