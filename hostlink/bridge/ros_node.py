"""A node of ROS 2 on Zenoh, as the middleware `rmw_zenoh_cpp` has it: publishers, services, the graph.

Rules
- A key is `domain/topic/type/hash of the type`: another distribution's differ, and what differs is never
  heard. So the distribution is named by the user. Humble has no hashes.
- An attachment goes with each message: sequence number, time, and the sender's id: XXH3-128 of its token.
- A liveliness token for the node and each endpoint is what `ros2 topic list` shows.
- A latched topic ("transient local") keeps its last message for whoever comes later.
- The session is a client of a router, which forwards to peers. It waits for the router to come, and when one
  leaves and comes back the session declares everything anew by itself; meanwhile messages are lost.

Source: rmw_zenoh_cpp's design document (keys, tokens, attachments) and source (ids, caches).
"""

from __future__ import annotations

import logging
import re
import struct
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from itertools import count
from math import inf
from typing import Any, Final

from hostlink.bridge.ros_types import EXTRA, Types, endpoint_name
from hostlink.errors import LinkTimeout, UsageError
from hostlink.extras import require

__all__ = ["NODE", "RosNode", "RosTopic"]

log = logging.getLogger(__name__)

NODE: Final = "voronoi_touch"
# Reliable, keep the last 10, 1 of a latched one; what is the default is left out.
_QOS: Final = {False: "::,10:,:,:,,", True: ":1:,1:,:,:,,"}
_NAMESPACE: Final = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)*")
_ROUTER: Final = re.compile(r"[a-z][a-z0-9_-]*/[^\s/]+:(\d{1,5})(\?\S*)?")
_GIVE_ROUTER: Final = "give an endpoint with a port from 1 to 65535, e.g. tcp/127.0.0.1:7447"
_ATTACHMENT: Final = struct.Struct("<qqB16s")  # sequence number, ns, number of bytes, sender's id
_RETRY_S: Final = 1.0  # a router that comes up takes longer


class RosNode:
    """Arguments and errors as those of `hostlink.bridge.ros.RosOutlet`."""

    def __init__(self, types: Types, router: str, domain: int, namespace: str, wait_s: float | None) -> None:
        self._zenoh, self._types = require("zenoh", EXTRA), types
        self._hash = require("xxhash", EXTRA).xxh3_128_intdigest
        if not _NAMESPACE.fullmatch(namespace):
            raise UsageError(f"--namespace {namespace}: give names after slashes, e.g. /left_hand")
        endpoint = _ROUTER.fullmatch(router)
        if endpoint is None or not 0 < int(endpoint[1]) < 1 << 16:
            raise UsageError(f"--router {router}: {_GIVE_ROUTER}")
        self._domain, self.namespace = domain, namespace
        self._session = self._open(router, wait_s)
        self._ids = count(1)  # 0 is the node
        self.session_id = str(self._session.info.zid())
        self._token_head = f"@ros2_lv/{domain}/{self.session_id}/0"
        self._token_tail = f"%/{_mangled(namespace)}/{NODE}"
        declare = self._session.liveliness().declare_token
        self._tokens = [declare(f"{self._token_head}/0/NN/{self._token_tail}")]
        self._services: list[Any] = []

    def _open(self, router: str, wait_s: float | None) -> Any:
        config = self._zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("timestamping/enabled", "true")  # what a cache is ordered by
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

    def _declare_token(self, kind: str, name: str, topic: str, latched: bool = False) -> bytes:
        """Announce an endpoint; its id, of 16 bytes."""
        what = f"{_mangled(topic)}/{endpoint_name(name)}/{self._types.hash_of(name)}/{_QOS[latched]}"
        token = f"{self._token_head}/{next(self._ids)}/{kind}/{self._token_tail}/{what}"
        self._tokens.append(self._session.liveliness().declare_token(token))
        return int(self._hash(token.encode())).to_bytes(16, "little")

    def _key(self, name: str, topic: str) -> str:
        return f"{self._domain}/{topic.strip('/')}/{endpoint_name(name)}/{self._types.hash_of(name)}"

    def publisher(self, name: str, topic: str) -> RosTopic:
        """Publisher of messages of this type; the topic is a full name."""
        sender = self._declare_token("MP", name, topic)
        return RosTopic(self._session.declare_publisher(self._key(name, topic)), sender)

    def publish_latched(self, name: str, topic: str) -> RosTopic:
        """The same, keeping its last message."""
        ext = require("zenoh.ext", EXTRA)
        sender = self._declare_token("MP", name, topic, latched=True)
        publisher = ext.declare_advanced_publisher(
            self._session,
            self._key(name, topic),
            cache=ext.CacheConfig(max_samples=1),
            publisher_detection=True,
            sample_miss_detection=ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=_RETRY_S),
        )
        return RosTopic(publisher, sender)

    def serve(self, name: str, service: str, answer: Callable[[bytes], bytes | Future[bytes]]) -> None:
        """A service: `answer` makes of a request its response, at once or later. One for which it raises is
        left without a response.
        """

        def take(query: Any) -> None:
            try:
                response = answer(bytes(query.payload or b""))
            except Exception:
                log.debug("a request of %s", service, exc_info=True)
                query.drop()
                return
            if isinstance(response, bytes):
                _reply(query, response)
            else:
                response.add_done_callback(lambda done: _reply(query, _result(done)))

        declare = self._session.declare_queryable
        self._services.append(declare(self._key(name, service), take, complete=True))
        # The token comes last: whoever sees the service in the graph may ask it at once.
        self._declare_token("SS", name, service)

    def close(self) -> None:
        """Take the node from the graph."""
        self._session.close()


class RosTopic:
    """A publisher with its attachments."""

    def __init__(self, publisher: Any, sender: bytes) -> None:
        self._publisher, self.sender = publisher, sender
        self._numbers = count(1)
        self._listener: Any = None

    @property
    def wanted(self) -> bool:
        """Whether somebody subscribes to it, as far as the router has said; not of a latched one."""
        return bool(self._publisher.matching_status.matching)

    def on_wanted(self, then: Callable[[], Any]) -> None:
        """Call this in a thread of Zenoh's when `wanted` has changed."""
        self._listener = self._publisher.declare_matching_listener(lambda _: then())

    def put(self, payload: bytes) -> None:
        attachment = _ATTACHMENT.pack(next(self._numbers), time.time_ns(), len(self.sender), self.sender)
        self._publisher.put(payload, attachment=attachment)


def _result(done: Future[bytes]) -> bytes | None:
    return None if done.cancelled() else done.result()


def _reply(query: Any, response: bytes | None) -> None:
    """None: it was given up with the bridge, and has no reply."""
    with query:
        if response is None:
            return
        asked = bytes(query.attachment or b"")
        known = len(asked) == _ATTACHMENT.size
        number, _, size, client = _ATTACHMENT.unpack(asked) if known else (0, 0, 16, bytes(16))
        attachment = _ATTACHMENT.pack(number, time.time_ns(), size, client)
        query.reply(query.key_expr, response, attachment=attachment)


def _mangled(name: str) -> str:
    """A name in one piece of a key."""
    return name.replace("/", "%") or "%"
