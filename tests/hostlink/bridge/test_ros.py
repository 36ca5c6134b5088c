"""The ROS 2 bridge, received by a peer on Zenoh that decodes CDR with another library."""

import json
import queue
import re
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from math import nan, pi, sqrt
from socket import SOCK_STREAM
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import xxhash

from hostlink.bridge.robot_model import rviz_config
from hostlink.bridge.ros import RosOutlet
from hostlink.bridge.ros_messages import KINDS
from hostlink.bridge.ros_types import DISTRIBUTIONS, TRIGGER, Types, endpoint_name, message_of
from hostlink.bridge.values import PARAMETERS
from hostlink.finger import Finger, RestFrameOutcome
from hostlink.hand_file import HandFile, Mount
from hostlink.wire import Contact, RestFrameState, State
from hostlink.wire.fields import FIELDS
from tests.hostlink.bridge.hand import Hand
from tests.hostlink.bridge.ros_peer import Peer, open_router, unpack
from tests.hostlink.bridge.test_foxglove import state as touched
from tests.hostlink.bridge.test_foxglove_camera import ARRAYS, Page
from tests.support.commands import run_host as run
from tests.support.fingers import free_port
from tests.support.states import as_seen
from tests.support.waiting import SOON_S, until

OF_FINGER = ("wrench", "contacts", "markers", "pins", "sample")
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"  # design document


def state(number: int, k: int) -> State:
    return replace(touched(number, k), force_n=2.5, force_x_n=0.5, force_y_n=-0.75, torque_z_nmm=12.5)


class Scene:
    """A router, a hand with its bridge, and a peer."""

    def __init__(self, name: str, sent: Callable[[int, int], State] = state, **options: Any) -> None:
        self.port = free_port(SOCK_STREAM)
        self.router = open_router(self.port)
        self.hand = Hand(f"ros-{name}", (1, 3), sent, options.get("hand"))
        self.outlet = RosOutlet("jazzy", f"tcp/127.0.0.1:{self.port}", 7, **options)
        self.types = Types("jazzy")
        self.hand.bridge(self.outlet)
        self.peer = Peer(self.port)

    def message(self, topic: str) -> Any:
        """The newest of a topic."""
        kind = next(kind for end, kind in KINDS.items() if topic.endswith(f"/{end}"))
        until(lambda: self.peer.of(topic), topic)
        return unpack(kind, self.peer.of(topic)[-1].payload)

    def close(self) -> None:
        self.peer.close()
        self.hand.close()
        self.router.close()


@pytest.fixture
def scene(request: pytest.FixtureRequest) -> Iterator[Scene]:
    with closing(Scene(request.node.name)) as made:
        yield made


def test_a_peer_decodes_the_samples_that_were_sent(scene: Scene) -> None:
    peer = scene.peer
    peer.subscribe("7/**")
    until(lambda: len(peer.of("/finger_3/sample")) > 20 and peer.of("/diagnostics"), "messages")
    received = peer.of("/finger_3/sample")
    message = unpack(KINDS["sample"], received[-1].payload)
    expected = as_seen(state(3, message.sample))
    for f in FIELDS:
        if f.name != "capture_time_us":
            value = getattr(message, f.name)
            assert value == pytest.approx(float(getattr(expected, f.name)), rel=1e-6, nan_ok=True), f.name
    places = [(c.x_mm, c.y_mm) for c in message.contacts]
    assert places == [pytest.approx((c.x_mm, c.y_mm)) for c in expected.contacts]
    assert (message.finger, message.header.frame_id) == (3, "finger_3")
    kind = f"voronoi_touch_msgs::msg::dds_::TactileSample_/{scene.types.hash_of(KINDS['sample'])}"
    assert received[-1].key == f"7/finger_3/sample/{kind}"

    wrench = scene.message("/finger_3/wrench")
    force, torque = wrench.wrench.force, wrench.wrench.torque
    assert (force.x, force.y, force.z) == pytest.approx((0.5, -0.75, -2.5))
    assert (torque.x, torque.y, torque.z) == (0.0, 0.0, pytest.approx(0.0125))
    assert message.wrench_known == 0b100111
    cloud = scene.message("/finger_1/contacts")
    points = list(struct.iter_unpack("<4f", bytes(cloud.data)))
    assert points[0] == pytest.approx((1.5e-3, -2.5e-3, 0.0, 0.5e-3))
    assert points[1] == pytest.approx((-3e-3, 4e-3, 0.0, 0.0)), "an unknown depth is 0"
    assert [f.name for f in cloud.fields] == ["x", "y", "z", "depth"]
    assert cloud.is_dense

    def diagnosed() -> list[tuple[str, int]]:
        return [(s.name, s.level) for s in scene.message("/diagnostics").status]

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
            stamp = unpack(KINDS["wrench"], one.payload).header.stamp
            at_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
            assert at_ns < one.sent_ns, "captured before it was sent"
            assert begun_ns - 60e9 < at_ns < ended_ns
            assert at_ns > previous_ns
            previous_ns = at_ns
    tokens = [token for token in scene.peer.tokens() if "%wrench/" in token]
    assert senders == {xxhash.xxh3_128_intdigest(token.encode()).to_bytes(16, "little") for token in tokens}
    assert len(senders) == 2


def test_only_what_is_subscribed_to_is_made(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    pack, made = Types.pack, set()

    def noted(types: Types, message: Any) -> bytes:
        made.add(message.__msgtype__)
        return pack(types, message)

    monkeypatch.setattr(Types, "pack", noted)
    scene.peer.subscribe("7/*/sample/**")
    until(lambda: len(scene.peer.of("/finger_1/sample")) > 20, "samples")
    assert KINDS["sample"] in made
    assert not made & {KINDS["wrench"], KINDS["contacts"], KINDS["markers"]}
    scene.peer.subscribe("7/*/wrench/**")
    until(lambda: scene.peer.of("/finger_3/wrench"), "a wrench")
    assert KINDS["contacts"] not in made


PARAMETER_SERVICES = (
    "list_parameters", "get_parameters", "get_parameter_types", "describe_parameters", "set_parameters",
    "set_parameters_atomically",
)  # fmt: skip


def test_the_graph_shows_node_topics_and_services(scene: Scene) -> None:
    endpoints = {"/diagnostics": "MP", "/tf_static": "MP", "/robot_description": "MP"}
    endpoints |= {f"/voronoi_touch/{name}": "SS" for name in PARAMETER_SERVICES}
    for n in (1, 3):
        endpoints |= {f"/finger_{n}/{name}": "MP" for name in OF_FINGER} | {f"/finger_{n}/tare": "SS"}
    until(lambda: len(scene.peer.tokens()) == 1 + len(endpoints), "all tokens")
    tokens = [token.split("/") for token in scene.peer.tokens()]
    ids = [token[4] for token in tokens]
    assert len(set(ids)) == len(ids)
    seen = {}
    for token in tokens:
        assert token[:4] == ["@ros2_lv", "7", scene.outlet.node.session_id, "0"]
        assert token[6:9] == ["%", "%", "voronoi_touch"]
        if token[5] != "NN":
            topic, kind, hashed, qos = token[9:]
            seen[topic.replace("%", "/")] = token[5]
            assert "::dds_::" in kind
            assert hashed.startswith("RIHS01_")
            latched = topic in ("%tf_static", "%robot_description")
            assert qos == (":1:,1:,:,:,," if latched else "::,10:,:,:,,")
    assert seen == endpoints


NOTHING = State(contact_n=1, contacts=(Contact(1.0, nan, nan), Contact(2.0, -1.0, nan)))


def test_rviz_gets_no_nan() -> None:
    """Of a sample of which nothing is known; one with contacts has markers for them, shear and depth."""
    fed = {1: NOTHING, 3: state(3, 0)}
    with closing(Scene("nan", sent=lambda number, k: replace(fed[number], sample=k))) as scene:
        scene.peer.subscribe("7/**")
        wrench = scene.message("/finger_1/wrench").wrench
        assert [getattr(part, axis) for part in (wrench.force, wrench.torque) for axis in "xyz"] == [0.0] * 6
        assert scene.message("/finger_1/sample").wrench_known == 0
        cloud = scene.message("/finger_1/contacts")
        assert np.frombuffer(bytes(cloud.data), "<f4").tolist() == pytest.approx([2e-3, -1e-3, 0.0, 0.0])
        first, *shown = scene.message("/finger_1/markers").markers
        assert (first.action, len(shown)) == (3, 1), "the ball of the contact whose place is known"
        _, *shown = scene.message("/finger_3/markers").markers
        assert [marker.type for marker in shown] == [2, 2, 0, 0], "two balls, shear, depth"
        assert len({marker.id for marker in shown}) == 4
        assert shown[0].pose.position.x == pytest.approx(1.5e-3)
        ends = [(p.x, p.y, p.z) for marker in shown[2:] for p in marker.points[1:]]
        assert ends == [pytest.approx((0.3e-3, -0.4e-3, 0.0)), pytest.approx((0.0, 0.0, -0.75e-3))]


THUMB = Mount("thumb", 3, (-0.04, 0.02, 0.0), (0.0, pi / 2, 0.0), calibration="wanted")
HAND = HandFile("left_hand", mounts=(THUMB, Mount("index", 1, (0.0, 0.0, 0.0))))


def test_a_hand_has_names_frames_and_a_description_for_whoever_comes_late() -> None:
    scene = Scene("left", namespace="/left_hand", hand=HAND)
    scene.peer.subscribe("7/**", latched=True)
    wrench = scene.message("/left_hand/thumb/wrench")
    assert wrench.header.frame_id == "left_hand/thumb"
    places = scene.message("/tf_static").transforms
    frames = [(t.header.frame_id, t.child_frame_id) for t in places]
    assert frames == [("left_hand/hand", "left_hand/thumb"), ("left_hand/hand", "left_hand/index")]
    turn, place = places[0].transform.rotation, places[0].transform.translation
    assert (place.x, place.y) == (-0.04, 0.02)
    assert (turn.x, turn.y, turn.z, turn.w) == pytest.approx((0.0, sqrt(0.5), 0.0, sqrt(0.5)))
    robot = ElementTree.fromstring(scene.message("/left_hand/robot_description").data)
    assert [link.get("name") for link in robot.iter("link")] == ["left_hand/hand", *(f[1] for f in frames)]
    view = json.loads(rviz_config(HAND, "/left_hand"))
    shown = [d["Topic"]["Value"] for d in view["Visualization Manager"]["Displays"] if "Topic" in d]
    published = {token.split("/")[9].replace("%", "/") for token in scene.peer.tokens() if "/MP/" in token}
    assert {*shown, "/left_hand/robot_description"} <= published

    def other_calibration() -> bool:
        status = {s.name: (s.level, s.message) for s in scene.message("/diagnostics").status}
        return status.get("left_hand/thumb") == (1, "calibration c0ffee, not wanted")

    until(other_calibration, "a warning")
    scene.close()


def test_pins_are_a_cloud_of_where_they_are_now(scene: Scene) -> None:
    """The places come from the calibration, the motion from the detail stream; lost pins are left out."""
    sensor = {"centre_px": [100, 50], "rest_xy_px": [[100, 50], [110, 50], [100, 70]]}
    scene.hand.applications[1].calibration = json.dumps({"sensor": sensor, "mm_per_px": 0.1}).encode()
    scene.hand.connection.finger(1).set("detail_divider", 1)
    scene.peer.subscribe("7/finger_1/**")
    rows = [(1.0, -2.0, 0.5), (nan, nan, nan), (0.0, 0.0, nan)]

    def sent() -> bool:
        if newest := scene.hand.connection.latest(1, None):
            scene.hand.nodes[1].send_detail(newest.state.sample, rows)
        return bool(scene.peer.of("/finger_1/pins"))

    until(sent, "a cloud")
    cloud = scene.message("/finger_1/pins")
    assert [f.name for f in cloud.fields] == ["x", "y", "z", "dx", "dy", "da", "pin"]
    points = np.frombuffer(bytes(cloud.data), "<f4").reshape(-1, 7)
    assert points[0] == pytest.approx([1e-4, -2e-4, 0.0, 1e-4, -2e-4, 0.5, 0.0])
    assert points[1] == pytest.approx([0.0, 2e-3, 0.0, 0.0, 0.0, 0.0, 2.0])
    assert len(points) == cloud.width == 2


def test_the_camera_is_a_compressed_image_while_somebody_looks() -> None:
    page = Page()
    with closing(Scene("camera", pages=[page.address])) as scene:
        scene.peer.subscribe("7/*/sample/**")
        until(lambda: scene.peer.of("/finger_3/sample"), "a sample")
        assert page.wants == []
        scene.peer.subscribe("7/*/image/**")
        image = scene.message("/finger_3/image/compressed")
        assert (image.format, bytes(image.data)) == ("jpeg", ARRAYS["image"][1])
        assert image.header.frame_id == "finger_3"
        assert page.wants == [frozenset({"image"})]
    until(lambda: page.wants[-1] is None, "nobody watches the page")
    page.server.close()


def test_rates_and_features_are_parameters(scene: Scene) -> None:
    make = scene.types.make
    until_service(scene)

    def ask(service: str, **request: Any) -> Any:
        kind = f"rcl_interfaces/srv/{service}"
        snake = re.sub(r"(?<!^)(?=[A-Z])", "_", service).lower()
        key = f"7/voronoi_touch/{snake}/{endpoint_name(kind)}/{scene.types.hash_of(kind)}"
        asked = make(message_of(kind, "Request"), **request)
        answer, _ = scene.peer.ask(key, scene.types.pack(asked))
        return unpack(message_of(kind, "Response"), answer)

    def parameter(name: str, kind: int, field: str, value: Any) -> Any:
        given = make("rcl_interfaces/msg/ParameterValue", type=kind, **{field: value})
        return make("rcl_interfaces/msg/Parameter", name=name, value=given)

    until(lambda: len(ask("ListParameters").result.names) == 2 * len(PARAMETERS), "both fingers")
    assert ask("ListParameters", prefixes=["finger_3"]).result.names == [f"finger_3.{p}" for p in PARAMETERS]
    names = ["finger_3.rate_hz", "finger_3.divider", "finger_9.rate_hz"]
    assert ask("GetParameterTypes", names=names).types == [3, 2, 0]
    described = ask("DescribeParameters", names=names).descriptors
    assert [(d.name, d.type) for d in described] == [("finger_3.rate_hz", 3), ("finger_3.divider", 2)]
    limits = described[0].floating_point_range[0], described[1].integer_range[0]
    assert [(r.from_value, r.to_value) for r in limits] == [(0.0, 1000.0), (1, 1000)]
    asked = [
        parameter("finger_3.rate_hz", 3, "double_value", 50.0),
        parameter("finger_3.divider", 2, "integer_value", 0),
        parameter("finger_3.colour", 2, "integer_value", 1),
        parameter("finger_3.rate_hz", 9, "string_array_value", ["fast"]),
    ]
    results = ask("SetParameters", parameters=asked).results
    assert [r.successful for r in results] == [True, False, False, False]
    assert "divider = 0: give 1 to 1000" in results[1].reason
    assert not ask("SetParametersAtomically", parameters=asked[1:]).result.successful
    got = [(v.type, v.double_value, v.integer_value) for v in ask("GetParameters", names=names).values]
    assert got == [(3, 50.0, 0), (2, 0.0, 1), (0, 0.0, 0)]
    assert scene.hand.connection.finger(3).get("rate_hz") == 50.0


def test_tare_is_a_service(scene: Scene) -> None:
    until_service(scene)
    response, (number, _, client) = scene.peer.tare(TARE_KEY, 41)
    assert response.success, response.message
    assert (number, client) == (41, b"\x07" * 16), "what came with the question comes back"
    assert scene.hand.applications[3].tares == [False]
    scene.hand.applications[3].touched = True
    response, _ = scene.peer.tare(TARE_KEY, 42)
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
    until(lambda: len(scene.peer.tokens()) == 22, "tokens again")
    assert scene.peer.tare(TARE_KEY, 1)[0].success


def test_it_waits_for_a_router(caplog: pytest.LogCaptureFixture) -> None:
    port, made = free_port(SOCK_STREAM), []
    thread = threading.Thread(target=lambda: made.append(RosOutlet("jazzy", f"tcp/127.0.0.1:{port}")))
    thread.start()
    until(lambda: "waiting for it" in caplog.text, "it says so")
    with closing(open_router(port)):
        until(lambda: made, "it is there")
        made[0].close()


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
    router = f"tcp/127.0.0.1:{free_port(SOCK_STREAM)}"
    done = run("bridge", "virtual:none", "--ros", "jazzy", "--router", router, "--seconds", "0.2")
    assert done.code == 1
    assert f"error: --router {router}: no router was there for 0.2 s" in done.err


#: The hashes are those of ROS's own type descriptions.
HASHES = {
    "std_msgs/msg/String": STRING_HASH,
    TRIGGER: "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    "rcl_interfaces/srv/GetParameters": (
        "RIHS01_bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc"
    ),
    "rcl_interfaces/srv/ListParameters": (
        "RIHS01_3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d"
    ),
    "rcl_interfaces/srv/SetParameters": (
        "RIHS01_56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0"
    ),
}


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_hashes_are_those_that_ros_publishes(distribution: str) -> None:
    types = Types(distribution)
    hashes = {name: types.hash_of(name) for name in HASHES}
    assert hashes == (HASHES if distribution != "humble" else dict.fromkeys(HASHES, "TypeHashNotSupported"))
