"""Fingers in ROS 2, without a ROS installation: topics over the Zenoh middleware (`rmw_zenoh_cpp`).

    /finger_1/wrench    geometry_msgs/WrenchStamped         force and torque on the tip; NaN: not measured
    /finger_1/contacts  sensor_msgs/PointCloud2             x, y, z, depth, in metres
    /finger_1/sample    voronoi_touch_msgs/TactileSample    everything, with standard deviations
    /diagnostics        diagnostic_msgs/DiagnosticArray
    /finger_1/tare      service, std_srvs/Trigger

Rules
- A key is `domain/topic/type/hash of the type`: another distribution's differ, and what differs is never
  heard. So the distribution is named by the user. Humble has no hashes.
- An attachment goes with each message: sequence number, time, and the sender's id of 16 bytes.
- A liveliness token for the node and each endpoint is what `ros2 topic list` shows.
- The session is a client of a router, which forwards to peers. It waits for the router to come, and when one
  leaves and comes back the session declares everything anew by itself; meanwhile messages are lost.

Source: rmw_zenoh_cpp's design document (keys, tokens, attachments); REP 2016 (type hashes).
"""

from __future__ import annotations

import logging
import re
import struct
import threading
import time
from collections.abc import Sequence
from concurrent.futures import Future
from hashlib import blake2b
from itertools import count
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any, Final

from hostlink.bridge.values import TareDesk, stamp_ns
from hostlink.errors import LinkTimeout, UsageError
from hostlink.events import Sample
from hostlink.extras import require
from hostlink.finger import Finger
from hostlink.topics import Diagnosis, finger_name
from hostlink.wire.fields import FIELDS

__all__ = ["DISTRIBUTIONS", "MESSAGES", "TRIGGER_HASH", "RosOutlet", "Types", "endpoint_name"]

log = logging.getLogger(__name__)

EXTRA = "ros"
NODE = "voronoi_touch"
MESSAGES = Path(__file__).parent / "voronoi_touch_msgs" / "msg"
DISTRIBUTIONS = ("humble", "jazzy", "kilted", "lyrical")
DOMAIN_MAX = 232  # as ROS has it

WRENCH: Final = "geometry_msgs/msg/WrenchStamped"
CLOUD: Final = "sensor_msgs/msg/PointCloud2"
DIAGNOSTICS: Final = "diagnostic_msgs/msg/DiagnosticArray"
SAMPLE: Final = "voronoi_touch_msgs/msg/TactileSample"
CONTACT: Final = "voronoi_touch_msgs/msg/TactileContact"
TRIGGER: Final = "std_srvs/srv/Trigger"
#: Type hash of a service: no library at hand makes one. A test derives it by REP 2016's rules.
TRIGGER_HASH: Final = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
_NO_HASH: Final = "TypeHashNotSupported"

_QOS: Final = "::,10:,:,:,,"  # reliable, volatile, keep the last 10: the rest is empty, which is the default
_NAMESPACE: Final = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)*")
_ROUTER: Final = re.compile(r"[a-z][a-z0-9_-]*/[^\s/]+:(\d{1,5})(\?\S*)?")
_GIVE_ROUTER: Final = "give an endpoint with a port from 1 to 65535, e.g. tcp/127.0.0.1:7447"
_ATTACHMENT: Final = struct.Struct("<qqB16s")  # sequence number, ns, number of bytes, sender's id
_CDR: Final = b"\x00\x01\x00\x00"  # little-endian
_RETRY_S = 1.0  # a router that comes up takes longer
_FLOAT32, _FIELD_BYTES = 7, 4
_MM = 1e-3


class Types:
    """Messages of a distribution, and their names and hashes on the wire.

    Raises UsageError: extra not installed
    """

    def __init__(self, distribution: str) -> None:
        typesys = require("rosbags.typesys", EXTRA)
        self.store = typesys.get_typestore(getattr(typesys.Stores, f"ROS2_{distribution.upper()}"))
        for path in sorted(MESSAGES.glob("*.msg")):
            name = f"voronoi_touch_msgs/msg/{path.stem}"
            self.store.register(typesys.get_types_from_msg(path.read_text(encoding="utf-8"), name))
        self._hashed = distribution != "humble"

    def make(self, kind: str, /, **values: Any) -> Any:
        """A message."""
        return self.store.types[kind](**values)

    def pack(self, message: Any) -> bytes:
        """Its CDR, with the header that says so."""
        return bytes(self.store.serialize_cdr(message, message.__msgtype__))

    def hash_of(self, name: str) -> str:
        """As it stands in keys."""
        if not self._hashed:
            return _NO_HASH
        return TRIGGER_HASH if name == TRIGGER else str(self.store.hash_rihs01(name))


def endpoint_name(name: str) -> str:
    """A type as it stands in keys: `std_msgs/msg/String` is `std_msgs::msg::dds_::String_`."""
    package, kind, short = name.split("/")
    return f"{package}::{kind}::dds_::{short}_"


class RosOutlet:
    """A ROS 2 node that publishes what comes.

    distribution  one of DISTRIBUTIONS
    router        Zenoh endpoint, e.g. tcp/127.0.0.1:7447; waits until it is there
    domain        ROS_DOMAIN_ID
    namespace     before all names, e.g. /left_hand; "": none
    wait_s        longest wait for the router; None: for ever
    Raises        UsageError: extra not installed, or an argument makes no sense; LinkTimeout: no router
    """

    def __init__(
        self,
        distribution: str,
        router: str,
        domain: int = 0,
        namespace: str = "",
        wait_s: float | None = None,
    ) -> None:
        self._zenoh = require("zenoh", EXTRA)
        self._types = Types(distribution)
        if not _NAMESPACE.fullmatch(namespace):
            raise UsageError(f"--namespace {namespace}: give names after slashes, e.g. /left_hand")
        endpoint = _ROUTER.fullmatch(router)
        if endpoint is None or not 0 < int(endpoint[1]) < 1 << 16:
            raise UsageError(f"--router {router}: {_GIVE_ROUTER}")
        self._domain, self._namespace = domain, namespace
        self._session = self._open(router, wait_s)
        self._ids = count(1)  # 0 is the node
        zid = self._session.info.zid()
        self._token_head = f"@ros2_lv/{domain}/{zid}/0"
        self._token_tail = f"%/{_mangled(namespace)}/{NODE}"
        declare = self._session.liveliness().declare_token
        self._tokens = [declare(f"{self._token_head}/0/NN/{self._token_tail}")]
        self._topics: dict[str, _Topic] = {}
        self._services: list[Any] = []
        self._desks: list[TareDesk] = []
        self._declare(DIAGNOSTICS, "/diagnostics")
        self._fields = [
            self._types.make(
                "sensor_msgs/msg/PointField", name=name, offset=i * _FIELD_BYTES, datatype=_FLOAT32, count=1
            )
            for i, name in enumerate(("x", "y", "z", "depth"))
        ]

    def _open(self, router: str, wait_s: float | None) -> Any:
        config = self._zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("scouting/multicast/enabled", "false")
        try:
            config.insert_json5("connect/endpoints", f'["{router}"]')
        except self._zenoh.ZError:
            raise UsageError(f"--router {router}: {_GIVE_ROUTER}") from None
        end_s = inf if wait_s is None else time.monotonic() + wait_s
        warned = False
        while True:
            try:
                return self._zenoh.open(config)
            except self._zenoh.ZError:
                left_s = end_s - time.monotonic()
                if left_s <= 0:
                    raise LinkTimeout(f"--router {router}: no router was there for {wait_s:g} s") from None
                if not warned:
                    log.warning("no router at %s yet: waiting for it", router)
                warned = True
                threading.Event().wait(min(left_s, _RETRY_S))

    def _declare_token(self, kind: str, name: str, topic: str) -> bytes:
        """Announce an endpoint; its id, of 16 bytes."""
        what = f"{_mangled(topic)}/{endpoint_name(name)}/{self._types.hash_of(name)}/{_QOS}"
        token = f"{self._token_head}/{next(self._ids)}/{kind}/{self._token_tail}/{what}"
        self._tokens.append(self._session.liveliness().declare_token(token))
        return blake2b(token.encode(), digest_size=16).digest()

    def _key(self, name: str, topic: str) -> str:
        return f"{self._domain}/{topic.strip('/')}/{endpoint_name(name)}/{self._types.hash_of(name)}"

    def _declare(self, name: str, topic: str) -> None:
        full = self._namespace + topic
        sender = self._declare_token("MP", name, full)
        publisher = self._session.declare_publisher(self._key(name, full))
        self._topics[topic] = _Topic(publisher, sender)

    def add_finger(self, finger: Finger) -> None:
        """Its topics, and its service."""
        name = finger_name(finger.node)
        for kind, topic in ((WRENCH, "wrench"), (CLOUD, "contacts"), (SAMPLE, "sample")):
            self._declare(kind, f"/{name}/{topic}")
        service = f"{self._namespace}/{name}/tare"
        self._declare_token("SS", TRIGGER, service)
        desk = TareDesk(finger)
        self._desks.append(desk)
        self._services.append(
            self._session.declare_queryable(
                self._key(TRIGGER, service),
                lambda query: desk.ask().add_done_callback(lambda done: _answer(query, done)),
                complete=True,
            )
        )

    def publish(self, sample: Sample) -> None:
        """Stamped with when the image was taken; only what somebody subscribes to is made."""
        name = finger_name(sample.finger)
        header = None
        for kind, make in (("wrench", self._wrench), ("contacts", self._cloud), ("sample", self._sample)):
            topic = self._topics[f"/{name}/{kind}"]
            if topic.wanted:
                header = header or self._header(stamp_ns(sample), name)
                topic.put(self._types.pack(make(header, sample)))

    def report(self, diagnoses: Sequence[Diagnosis]) -> None:
        """All fingers' diagnoses."""
        make = self._types.make
        status = [
            make(
                "diagnostic_msgs/msg/DiagnosticStatus",
                level=int(d.level),
                name=d.name,
                message=d.message,
                hardware_id=d.serial_number,
                values=[make("diagnostic_msgs/msg/KeyValue", key=k, value=v) for k, v in d.values.items()],
            )
            for d in diagnoses
        ]
        message = make(DIAGNOSTICS, header=self._header(time.time_ns(), ""), status=status)
        self._topics["/diagnostics"].put(self._types.pack(message))

    def _header(self, at_ns: int, frame: str) -> Any:
        sec, nanosec = divmod(at_ns, 1_000_000_000)
        make = self._types.make
        stamp = make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
        return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def _wrench(self, header: Any, sample: Sample) -> Any:
        """z points out of the skin: what presses the tip is a force against it."""
        make, state = self._types.make, sample.state
        force = make("geometry_msgs/msg/Vector3", x=state.force_x_n, y=state.force_y_n, z=-state.force_n)
        torque = make("geometry_msgs/msg/Vector3", x=nan, y=nan, z=state.torque_z_nmm * _MM)
        wrench = make("geometry_msgs/msg/Wrench", force=force, torque=torque)
        return make(WRENCH, header=header, wrench=wrench)

    def _cloud(self, header: Any, sample: Sample) -> Any:
        import numpy as np

        state = sample.state
        rows = [(c.x_mm * _MM, c.y_mm * _MM, 0.0, c.depth_mm * _MM) for c in state.contacts]
        data = np.array(rows, "<f4").reshape(-1).view(np.uint8)
        step = _FIELD_BYTES * len(self._fields)
        return self._types.make(
            CLOUD, header=header, height=1, width=len(rows), fields=self._fields, is_bigendian=False,
            point_step=step, row_step=step * len(rows), data=data,
            is_dense=all(isfinite(c.depth_mm) for c in state.contacts),
        )  # fmt: skip

    def _sample(self, header: Any, sample: Sample) -> Any:
        make = self._types.make
        state = sample.state
        values = {f.name: getattr(state, f.name) for f in FIELDS}
        values["status"] = int(state.status)
        contacts = [make(CONTACT, x_mm=c.x_mm, y_mm=c.y_mm, depth_mm=c.depth_mm) for c in state.contacts]
        return make(
            SAMPLE, header=header, host_error_s=sample.host_error_s, finger=sample.finger,
            lost_n=sample.lost_n, contacts=contacts, **values,
        )  # fmt: skip

    def close(self) -> None:
        """Take the node from the graph."""
        for desk in self._desks:
            desk.close()
        self._session.close()


class _Topic:
    """A publisher with its attachments."""

    def __init__(self, publisher: Any, sender: bytes) -> None:
        self._publisher, self._sender = publisher, sender
        self._numbers = count(1)

    @property
    def wanted(self) -> bool:
        """Whether somebody subscribes to it, as far as the router has said."""
        return bool(self._publisher.matching_status.matching)

    def put(self, payload: bytes) -> None:
        attachment = _ATTACHMENT.pack(next(self._numbers), time.time_ns(), len(self._sender), self._sender)
        self._publisher.put(payload, attachment=attachment)


def _answer(query: Any, outcome: Future[tuple[bool, str]]) -> None:
    """Reply to a request for a rest frame; one that was given up with the bridge has no reply."""
    with query:
        if outcome.cancelled():
            return
        asked = bytes(query.attachment or b"")
        known = len(asked) == _ATTACHMENT.size
        number, _, size, client = _ATTACHMENT.unpack(asked) if known else (0, 0, 16, bytes(16))
        query.reply(
            query.key_expr,
            _triggered(*outcome.result()),
            attachment=_ATTACHMENT.pack(number, time.time_ns(), size, client),
        )


def _mangled(name: str) -> str:
    """A name in one piece of a key."""
    return name.replace("/", "%") or "%"


def _triggered(success: bool, message: str) -> bytes:
    """CDR of std_srvs/srv/Trigger_Response: bool, string with its length and a zero, aligned to 4."""
    text = message.encode() + b"\0"
    return _CDR + struct.pack("<?3xI", success, len(text)) + text
