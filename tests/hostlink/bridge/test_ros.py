"""The ROS 2 bridge, received by a peer on Zenoh that decodes CDR with another library."""

import dataclasses
import queue
import struct
import threading
import time
from collections.abc import Iterator
from math import isnan
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Nodetype
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from hostlink.bridge.ros import CLOUD, DISTRIBUTIONS, SAMPLE, TRIGGER, WRENCH, RosOutlet, Types
from hostlink.finger import Finger, RestFrameOutcome
from hostlink.wire import RestFrameState, State, pack_state, unpack_state
from hostlink.wire.fields import FIELDS
from tests.hostlink.bridge.hand import Hand
from tests.hostlink.bridge.ros_peer import STRUCTS, Peer, free_port, open_router
from tests.hostlink.bridge.test_foxglove import state as touched
from tests.support.commands import run_host as run
from tests.support.waiting import SOON_S, until

STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"  # design document


def state(number: int, k: int) -> State:
    sent = touched(number, k)
    forces = {"force_n": 2.5, "force_x_n": 0.5, "force_y_n": -0.75, "torque_z_nmm": 12.5}
    return State(**{f.name: getattr(sent, f.name) for f in FIELDS} | forces, contacts=sent.contacts)


class Scene:
    """A router, a hand with its bridge, and a peer."""

    def __init__(self, name: str, distribution: str = "jazzy", namespace: str = "") -> None:
        self.port = free_port()
        self.router = open_router(self.port)
        self.hand = Hand(f"ros-{name}", (1, 3), state)
        self.outlet = RosOutlet(distribution, f"tcp/127.0.0.1:{self.port}", 7, namespace)
        self.bridge = self.hand.bridge(self.outlet)
        self.peer = Peer(self.port)

    def close(self) -> None:
        self.peer.close()
        self.hand.close()
        self.router.close()


@pytest.fixture
def scene(request: pytest.FixtureRequest) -> Iterator[Scene]:
    made = Scene(request.node.name, getattr(request, "param", "jazzy"))
    yield made
    made.close()


def test_a_peer_decodes_the_samples_that_were_sent(scene: Scene) -> None:
    peer = scene.peer
    peer.subscribe("7/**")
    until(lambda: len(peer.of("/finger_3/sample")) > 20 and peer.of("/diagnostics"), "messages")
    received = peer.of("/finger_3/sample")
    message: Any = STRUCTS["TactileSample"].deserialize(received[-1].payload)
    expected = unpack_state(pack_state(state(3, message.sample), 0))
    for f in FIELDS:
        if f.name != "capture_time_us":
            value = getattr(message, f.name)
            assert value == pytest.approx(float(getattr(expected, f.name)), rel=1e-6, nan_ok=True), f.name
    places = [(c.x_mm, c.y_mm) for c in message.contacts]
    assert places == [pytest.approx((c.x_mm, c.y_mm)) for c in expected.contacts]
    assert (message.finger, message.header.frame_id) == (3, "finger_3")

    wrench = STRUCTS["WrenchStamped"].deserialize(peer.of("/finger_3/wrench")[-1].payload)
    force, torque = wrench.wrench.force, wrench.wrench.torque
    assert (force.x, force.y, force.z) == pytest.approx((0.5, -0.75, -2.5))
    assert torque.z == pytest.approx(0.0125)
    assert isnan(torque.x)
    assert isnan(torque.y)
    cloud: Any = STRUCTS["PointCloud2"].deserialize(peer.of("/finger_1/contacts")[-1].payload)
    points = list(struct.iter_unpack("<4f", bytes(cloud.data)))
    assert points[0] == pytest.approx((1.5e-3, -2.5e-3, 0.0, 0.5e-3))
    assert points[1] == pytest.approx((-3e-3, 4e-3, 0.0, float("nan")), nan_ok=True)
    assert [f.name for f in cloud.fields] == ["x", "y", "z", "depth"]
    assert not cloud.is_dense

    def diagnosed() -> list[tuple[str, int]]:
        newest: Any = STRUCTS["DiagnosticArray"].deserialize(peer.of("/diagnostics")[-1].payload)
        return [(s.name, s.level) for s in newest.status]

    until(lambda: diagnosed() == [("finger_1", 0), ("finger_3", 0)], "both diagnosed")


TARE_KEY = f"7/finger_3/tare/std_srvs::srv::dds_::Trigger_/{Types('jazzy').hash_of(TRIGGER)}"


def until_service(scene: Scene) -> None:
    until(lambda: any("/SS/" in t and "%finger_3%tare" in t for t in scene.peer.tokens()), "the service")


def test_stamps_are_the_capture_and_attachments_count_and_name_the_sender(scene: Scene) -> None:
    scene.peer.subscribe("7/*/wrench/**")
    topics = ("/finger_1/wrench", "/finger_3/wrench")
    begun_ns = time.time_ns()
    until(lambda: all(len(scene.peer.of(topic)) > 50 for topic in topics), "messages")
    ended_ns = time.time_ns()
    senders = set()
    for topic in topics:
        received = [one for one in scene.peer.of(topic) if one.arrival_ns < ended_ns]
        numbers = [one.number for one in received]
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
        senders |= {one.sender for one in received}
        previous_ns = 0
        for one in received:
            stamp = STRUCTS["WrenchStamped"].deserialize(one.payload).header.stamp
            at_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
            assert at_ns < one.sent_ns, "captured before it was sent"
            assert begun_ns - 60e9 < at_ns < ended_ns
            assert at_ns > previous_ns
            previous_ns = at_ns
    assert len(senders) == 2
    assert all(len(sender) == 16 for sender in senders)


def test_only_what_is_subscribed_to_is_made(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    pack, made = Types.pack, set()

    def noted(types: Types, message: Any) -> bytes:
        made.add(message.__msgtype__)
        return pack(types, message)

    monkeypatch.setattr(Types, "pack", noted)
    scene.peer.subscribe("7/*/sample/**")
    until(lambda: len(scene.peer.of("/finger_1/sample")) > 20, "samples")
    assert SAMPLE in made
    assert not made & {WRENCH, CLOUD}
    scene.peer.subscribe("7/*/wrench/**")
    until(lambda: scene.peer.of("/finger_3/wrench"), "a wrench")
    assert CLOUD not in made


@pytest.mark.parametrize("scene", DISTRIBUTIONS, indirect=True)
def test_keys_are_those_of_the_distribution(scene: Scene, request: pytest.FixtureRequest) -> None:
    distribution = request.node.callspec.params["scene"]
    scene.peer.subscribe("7/**")
    until(lambda: scene.peer.of("/finger_1/wrench"), "a message")
    key = scene.peer.of("/finger_1/wrench")[0].key
    hashed = get_typestore(getattr(Stores, f"ROS2_{distribution.upper()}")).hash_rihs01(WRENCH)
    end = "TypeHashNotSupported" if distribution == "humble" else hashed
    assert key == f"7/finger_1/wrench/geometry_msgs::msg::dds_::WrenchStamped_/{end}"


def test_the_graph_shows_node_topics_and_services(scene: Scene) -> None:
    endpoints = {"/diagnostics": "MP"} | {
        f"/finger_{n}/{name}": kind
        for n in (1, 3)
        for name, kind in (("wrench", "MP"), ("contacts", "MP"), ("sample", "MP"), ("tare", "SS"))
    }
    until(lambda: len(scene.peer.tokens()) == 1 + len(endpoints), "all tokens")
    tokens = [token.split("/") for token in scene.peer.tokens()]
    session = str(scene.outlet._session.info.zid())
    ids = [token[4] for token in tokens]
    assert len(set(ids)) == len(ids)
    seen = {}
    for token in tokens:
        assert token[:4] == ["@ros2_lv", "7", session, "0"]
        assert token[6:9] == ["%", "%", "voronoi_touch"]
        if token[5] != "NN":
            topic, kind, hashed, qos = token[9:]
            seen[topic.replace("%", "/")] = token[5]
            assert "::dds_::" in kind
            assert hashed.startswith("RIHS01_")
            assert qos == "::,10:,:,:,,"
    assert seen == endpoints


def test_tare_is_a_service(scene: Scene) -> None:
    until_service(scene)
    response, (number, _, client) = scene.peer.call(TARE_KEY, 41)
    assert response.success, response.message
    assert (number, client) == (41, b"\x07" * 16), "what came with the question comes back"
    assert scene.hand.applications[3].tares == [False]
    scene.hand.applications[3].touched = True
    response, _ = scene.peer.call(TARE_KEY, 42)
    assert not response.success
    assert "something touches the tip" in response.message
    assert scene.hand.applications[1].tares == []


def test_a_router_may_leave_and_come_back(scene: Scene) -> None:
    peer = scene.peer
    peer.subscribe("7/finger_1/sample/**")
    until(lambda: peer.of("/finger_1/sample"), "a message")
    scene.router.close()
    scene.router = open_router(scene.port)
    known = len(peer.of("/finger_1/sample"))
    until(lambda: len(peer.of("/finger_1/sample")) > known + 20, "messages again")
    numbers = [h.number for h in peer.of("/finger_1/sample")]
    assert numbers == sorted(set(numbers))
    until(lambda: len(scene.peer.tokens()) == 10, "tokens again")
    assert scene.peer.call(TARE_KEY, 1)[0].success


def test_it_waits_for_a_router(caplog: pytest.LogCaptureFixture) -> None:
    port, made = free_port(), []
    thread = threading.Thread(target=lambda: made.append(RosOutlet("jazzy", f"tcp/127.0.0.1:{port}")))
    thread.start()
    until(lambda: "waiting for it" in caplog.text, "it says so")
    router = open_router(port)
    until(lambda: made, "it is there")
    made[0].close()
    router.close()


def test_requests_without_end_take_no_threads(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """One is served, three wait, the others are refused at once, whoever asks."""
    let_go, served = threading.Event(), []

    def tare(finger: Finger) -> Any:
        served.append(finger.node)
        assert let_go.wait(SOON_S)
        return RestFrameOutcome(RestFrameState.ACCEPTED)

    monkeypatch.setattr(Finger, "tare", tare)
    until_service(scene)
    threads_n = threading.active_count()
    replies: queue.SimpleQueue[bool] = queue.SimpleQueue()
    for _ in range(300):
        scene.peer.session.get(
            TARE_KEY, lambda reply: replies.put(bytes(reply.ok.payload)[4] == 1), timeout=SOON_S
        )
    refused = [replies.get(timeout=SOON_S) for _ in range(296)]
    more_n = threading.active_count() - threads_n
    let_go.set()
    assert refused == [False] * 296
    assert more_n < 20, "one for the finger, some of the library's"
    assert [replies.get(timeout=SOON_S) for _ in range(4)] == [True] * 4
    assert served == [3] * 4


def test_it_waits_for_a_router_as_long_as_it_runs() -> None:
    router = f"tcp/127.0.0.1:{free_port()}"
    done = run("bridge", "virtual:none", "--ros", "jazzy", "--router", router, "--seconds", "0.2")
    assert done.code == 1
    assert f"error: --router {router}: no router was there for 0.2 s" in done.err


def test_two_hands_have_names_of_their_own() -> None:
    scene = Scene("left", namespace="/left_hand")
    scene.peer.subscribe("7/left_hand/**")
    until(lambda: scene.peer.of("/left_hand/finger_1/sample"), "a message")
    assert any("%left_hand%finger_1%sample" in token for token in scene.peer.tokens())
    scene.close()


def test_bags_are_read_by_rosbags(scene: Scene, tmp_path: Path) -> None:
    """What a recorder stores are the bytes on the wire and the definitions; both must fit."""
    peer, types = scene.peer, Types("jazzy")
    peer.subscribe("7/**")
    until(lambda: len(peer.of("/finger_1/sample")) > 20 and peer.of("/finger_1/wrench"), "messages")
    bag = tmp_path / "bag"
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, kind in (("/finger_1/sample", SAMPLE), ("/finger_1/wrench", WRENCH)):
            connection = writer.add_connection(topic, kind, typestore=types.store)
            for received in peer.of(topic):
                writer.write(connection, received.arrival_ns, received.payload)
    with AnyReader([bag]) as reader:
        read: list[Any] = [
            reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
            if connection.topic == "/finger_1/sample"
        ]
    assert len(read) > 20
    assert [m.displacement_mm for m in read] == pytest.approx([0.25] * len(read), abs=0.002)


def test_hash_of_the_service_follows_from_its_description() -> None:
    """REP 2016: a service is a type with a request, a response and an event; char is uint8 there."""
    assert Types("jazzy").store.hash_rihs01("std_msgs/msg/String") == STRING_HASH
    store = get_typestore(Stores.ROS2_JAZZY)
    fields: Any = store.fielddefs

    def nested(name: str) -> Any:
        return (Nodetype.NAME, name)

    def plain(name: str) -> Any:
        return (Nodetype.BASE, (name, 0))

    for part, text in (
        ("Request", "uint8 structure_needs_at_least_one_member\n"),
        ("Response", "bool success\nstring message\n"),
    ):
        ((_, definition),) = get_types_from_msg(text, f"std_srvs/msg/Trigger_{part}").items()
        fields[f"std_srvs/srv/Trigger_{part}"] = definition
    consts, info = fields["service_msgs/msg/ServiceEventInfo"]
    fields["service_msgs/msg/ServiceEventInfo"] = (
        consts,
        [(n, (Nodetype.ARRAY, (plain("uint8"), 16)) if n == "client_gid" else d) for n, d in info],
    )
    one = [
        (n, (Nodetype.SEQUENCE, (nested(f"std_srvs/srv/Trigger_{n.title()}"), 1)))
        for n in ("request", "response")
    ]
    fields["std_srvs/srv/Trigger_Event"] = ([], [("info", nested("service_msgs/msg/ServiceEventInfo")), *one])
    parts = [
        (f"{n.lower()}_message", nested(f"std_srvs/srv/Trigger_{n}"))
        for n in ("Request", "Response", "Event")
    ]
    fields[TRIGGER] = ([], parts)
    assert store.hash_rihs01(TRIGGER) == Types("jazzy").hash_of(TRIGGER)


def test_own_message_has_every_field() -> None:
    names = [f.name for f in dataclasses.fields(STRUCTS["TactileSample"])]
    defined = [name for name, _ in Types("jazzy").store.fielddefs[SAMPLE][1]]
    assert defined == names
    assert {f.name for f in FIELDS} <= set(names)
