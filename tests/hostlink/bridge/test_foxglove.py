"""The Foxglove bridge, seen by a websocket client that decodes with other libraries than the server's."""

import asyncio
import json
import socket
import struct
import threading
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import closing, suppress
from math import pi, sqrt
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.reader import make_reader

from hostlink.bridge.foxglove import LAYOUT, FoxgloveOutlet
from hostlink.bridge.values import PARAMETERS
from hostlink.hand_file import HandFile, Mount
from hostlink.topics import DIAGNOSTICS, values_of
from hostlink.web import Listen
from hostlink.wire import Contact, State, Status
from tests.hostlink.bridge.hand import Hand
from tests.support.commands import run_host as run
from tests.support.fingers import state as live_state
from tests.support.states import as_seen
from tests.support.waiting import until

WAIT_S = 20.0


def state(number: int, k: int) -> State:
    contacts = (Contact(1.5, -2.5, 0.5), Contact(-3.0, 4.0))
    return live_state(
        k, status=Status.TOUCHED, displacement_mm=number / 4, shear_x_mm=0.3, shear_y_mm=-0.4,
        contact_n=len(contacts), contacts=contacts,
    )  # fmt: skip


class Viewer:
    """A client of the protocol `foxglove.sdk.v1`, as its specification has it."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self.info: dict[str, Any] = {}
        self.channels: dict[str, dict[str, Any]] = {}
        self.services: dict[str, dict[str, Any]] = {}
        self.messages: dict[str, list[tuple[int, bytes]]] = {}
        self.parameters: dict[str, list[dict[str, Any]]] = {}
        self.answers: dict[int, bytes] = {}
        self._subscribed: dict[int, str] = {}
        self._refused: set[str] = set()  # ids of channels that the server did not know yet

    async def until(self, condition: Callable[[], Any], what: str) -> Any:
        async with asyncio.timeout(WAIT_S):
            while not (found := condition()):
                self._take(await self._socket.receive())
                await self._insist()
            return found

    def _take(self, message: aiohttp.WSMessage) -> None:
        assert message.type in (aiohttp.WSMsgType.TEXT, aiohttp.WSMsgType.BINARY), message
        if message.type == aiohttp.WSMsgType.BINARY:
            data = message.data
            if data[0] == 1:
                number, at_ns = struct.unpack_from("<IQ", data, 1)
                self.messages.setdefault(self._subscribed[number], []).append((at_ns, data[13:]))
            elif data[0] == 3:
                _, call, size = struct.unpack_from("<III", data, 1)
                self.answers[call] = data[13 + size :]
            return
        output = json.loads(message.data)
        match output["op"]:
            case "serverInfo":
                self.info = output
            case "advertise":
                self.channels |= {c["topic"]: c for c in output["channels"]}
            case "advertiseServices":
                self.services |= {s["name"]: s for s in output["services"]}
            case "parameterValues":
                self.parameters[output.get("id", "")] = output["parameters"]
            case "status":
                _, _, channel = output["message"].partition("Unknown channel ID: ")
                self._refused |= {channel} - {""}

    async def subscribe(self, *topics: str) -> None:
        await self.until(lambda: {*topics} <= self.channels.keys(), f"channels {topics}")
        for topic in topics:
            number = len(self._subscribed) + 1
            self._subscribed[number] = topic
            await self.ask(number)

    async def ask(self, number: int) -> None:
        """Subscribe to the topic that was subscribed to as this one, again too."""
        channel = self.channels[self._subscribed[number]]["id"]
        await self.say(op="subscribe", subscriptions=[{"id": number, "channelId": channel}])

    async def _insist(self) -> None:
        """The server announces a channel a moment before it knows it."""
        refused, self._refused = self._refused, set()
        for number, topic in self._subscribed.items():
            if str(self.channels[topic]["id"]) in refused:
                await self.ask(number)

    async def say(self, **what: Any) -> None:
        await self._socket.send_str(json.dumps(what))

    async def say_raw(self, text: str) -> None:
        await self._socket.send_str(text)

    async def call(self, name: str) -> dict[str, Any]:
        await self.until(lambda: name in self.services, name)
        number = len(self.answers) + 1
        head = struct.pack("<BIII", 2, self.services[name]["id"], number, 4)
        await self._socket.send_bytes(head + b"json" + b"{}")
        await self.until(lambda: number in self.answers, "an answer")
        answer = json.loads(self.answers[number])
        assert isinstance(answer, dict)
        return answer


def watch(url: str, visit: Callable[[Viewer], Awaitable[None]]) -> None:
    async def main() -> None:
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(url, protocols=["foxglove.sdk.v1"]) as socket,
        ):
            await visit(Viewer(socket))

    asyncio.run(main())


@pytest.fixture
def hand(request: pytest.FixtureRequest) -> Iterator[Hand]:
    with Hand(f"fox-{request.node.name}", (1, 3), state) as made:
        yield made


def bridged(hand: Hand, **options: Any) -> FoxgloveOutlet:
    outlet = FoxgloveOutlet(Listen("127.0.0.1", 0), **options)
    hand.bridge(outlet)
    return outlet


def test_samples_scenes_and_diagnoses_are_what_the_fingers_sent(hand: Hand) -> None:
    outlet = bridged(hand)

    async def visit(viewer: Viewer) -> None:
        samples = "/finger_1/sample", "/finger_3/sample"
        await viewer.subscribe(*samples, "/finger_3/contacts", "/diagnostics", "/tf")
        assert (viewer.info["capabilities"], viewer.services) == ([], {}), "without --allow-control"
        got = viewer.messages
        await viewer.until(lambda: len(got) == 5 and len(got["/finger_1/sample"]) > 20, "messages")
        at_ns, data = got["/finger_3/sample"][-1]
        message = json.loads(data)
        expected = values_of(as_seen(state(3, message["sequence"])))
        for name in expected.keys() - {"capture_time_us"}:
            assert message["values"][name] == expected[name], name
        assert message["values"]["force_n"] is None
        assert abs(time.time_ns() - at_ns) < WAIT_S * 1e9
        sequences = [json.loads(data)["sequence"] for _, data in got["/finger_1/sample"]]
        assert sequences == list(range(sequences[0], sequences[0] + len(sequences)))

        scene = SceneUpdate.FromString(got["/finger_3/contacts"][-1][1]).entities[0]
        places = [(s.pose.position.x, s.pose.position.y) for s in scene.spheres]
        assert places == [pytest.approx((1.5e-3, -2.5e-3)), pytest.approx((-3e-3, 4e-3))]
        assert scene.frame_id == "finger_3"
        lengths = [a.shaft_length + a.head_length for a in scene.arrows]
        assert lengths == [pytest.approx(0.5e-3), pytest.approx(0.75e-3)]
        turn = scene.arrows[0].pose.orientation
        assert (1 - 2 * turn.z**2, 2 * turn.z * turn.w) == pytest.approx((0.6, -0.8))  # along the shear

        diagnoses, places = got["/diagnostics"], got["/tf"]
        status = await viewer.until(lambda: json.loads(diagnoses[-1][1])["status"], "a diagnosis")
        assert [(s["name"], s["level"]) for s in status] == [("finger_1", 0), ("finger_3", 0)]
        tips = await viewer.until(lambda: FrameTransforms.FromString(places[-1][1]).transforms, "transforms")
        assert [t.child_frame_id for t in tips] == ["finger_1", "finger_3"]

    watch(outlet.url, visit)


def test_a_hands_names_are_those_of_topics_frames_and_parameters() -> None:
    mounts = (Mount("thumb", 1, (-0.04, 0.0, 0.0), (0.0, 0.0, pi / 2)), Mount("index", 3, (0.0, 0.0, 0.0)))
    with Hand("fox-named", (1, 3), state, HandFile("left_hand", mounts=mounts)) as hand:
        outlet = bridged(hand, control=())

        async def visit(viewer: Viewer) -> None:
            await viewer.subscribe("/thumb/sample", "/thumb/contacts", "/tf")
            got = viewer.messages
            await viewer.until(lambda: len(got) == 3, "messages")
            assert SceneUpdate.FromString(got["/thumb/contacts"][-1][1]).entities[0].frame_id == "thumb"

            def thumb() -> Any:
                tips = FrameTransforms.FromString(got["/tf"][-1][1]).transforms
                return next((tip for tip in tips if tip.child_frame_id == "thumb"), None)

            tip = await viewer.until(thumb, "where the thumb is")
            assert (tip.parent_frame_id, tip.translation.x) == ("hand", -0.04)
            assert (tip.rotation.z, tip.rotation.w) == pytest.approx((sqrt(0.5), sqrt(0.5)))
            await viewer.until(lambda: "/index/tare" in viewer.services, "the service")

        watch(outlet.url, visit)


def test_tare_is_a_service(hand: Hand) -> None:
    outlet = bridged(hand, control=())

    async def visit(viewer: Viewer) -> None:
        answer = await viewer.call("/finger_3/tare")
        assert answer["success"], answer
        assert hand.applications[3].tares == [False]
        hand.applications[3].touched = True
        answer = await viewer.call("/finger_3/tare")
        assert not answer["success"]
        assert "something touches the tip" in answer["message"]
        assert hand.applications[1].tares == []

    watch(outlet.url, visit)


def test_parameters_are_read_and_set(hand: Hand) -> None:
    outlet = bridged(hand, control=())

    async def visit(viewer: Viewer) -> None:
        async def ask(number: str, **what: Any) -> dict[str, Any]:
            await viewer.say(id=number, **what)
            values = await viewer.until(lambda: viewer.parameters.get(number), "parameters")
            return {p["name"]: p["value"] for p in values}

        await viewer.until(lambda: len(viewer.services) == 2, "both fingers")
        everything = await ask("1", op="getParameters", parameterNames=[])
        assert everything.keys() == {f"finger_{n}.{key}" for n in (1, 3) for key in PARAMETERS}
        rate = [{"name": "finger_3.rate_hz", "value": 50}]
        assert await ask("2", op="setParameters", parameters=rate) == {"finger_3.rate_hz": 50}
        rate[0]["value"] = -1
        assert await ask("3", op="setParameters", parameters=rate) == {"finger_3.rate_hz": 50}, "refused"

    watch(outlet.url, visit)
    assert hand.connection.finger(3).get("rate_hz") == 50.0
    assert hand.connection.finger(1).get("rate_hz") == 0.0


RATE = json.dumps(
    {"op": "setParameters", "id": "1", "parameters": [{"name": "finger_1.rate_hz", "value": 50}]}
)


def received(
    url: str, say: str = "", protocol: str = "foxglove.sdk.v1", **headers: str
) -> tuple[int, dict[str, Any]]:
    """How a client is received: HTTP's status, 0 if it was let in; the greeting."""

    async def main() -> tuple[int, dict[str, Any]]:
        async with aiohttp.ClientSession(headers=headers) as session:
            try:
                async with session.ws_connect(url, protocols=[protocol]) as socket:
                    greeting: dict[str, Any] = await socket.receive_json(timeout=WAIT_S)
                    if say:
                        await socket.send_str(say)
                    while say and "parameterValues" not in str(message := await socket.receive(WAIT_S)):
                        assert message.type != aiohttp.WSMsgType.CLOSED
                    return 0, greeting
            except aiohttp.WSServerHandshakeError as error:
                return error.status, {}

    return asyncio.run(main())


FOREIGN = [
    ("403 for the page of another site", {"Origin": "https://example.org"}),
    ("403 for a page of this machine that nobody named", {"Origin": "http://localhost:3000"}),
    ("403 for a page by the server's own name", {"Origin": "http://127.0.0.1:8765"}),
    ("403 for another name of this machine", {"Host": "example.org:8765"}),
    ("403 for another name in the place of the page's", {"Host": "evil.test", "Origin": "http://evil.test"}),
    ("403 for no host", {"Host": ""}),
]


@pytest.mark.parametrize(("why", "headers"), FOREIGN)
def test_foreign_pages_look_at_most(hand: Hand, why: str, headers: dict[str, str]) -> None:
    with closing(bridged(hand)) as outlet:
        status, greeting = received(outlet.url, **headers)
        assert (status, greeting["capabilities"]) == (0, []), why
    with closing(FoxgloveOutlet(Listen("127.0.0.1", 0), control=("http://localhost:8080",))) as commanding:
        assert received(commanding.url, RATE, **headers)[0] == 403, why
    assert hand.connection.finger(1).get("rate_hz") == 0.0


@pytest.mark.parametrize("headers", [{}, {"Origin": "http://localhost:8080"}, {"Host": "localhost:8765"}])
def test_programs_and_pages_that_were_named_may_set(hand: Hand, headers: dict[str, str]) -> None:
    outlet = bridged(hand, control=("http://localhost:8080",))
    until(lambda: 1 in hand.connection.fingers and "finger_1" in outlet._fingers, "the finger is known")
    assert received(outlet.url, RATE, **headers)[0] == 0
    assert hand.connection.finger(1).get("rate_hz") == 50.0


def test_a_viewer_of_the_old_protocol_reads_which_release_it_needs(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with closing(FoxgloveOutlet(Listen("127.0.0.1", 0))) as outlet:
        for _ in range(5):
            _, greeting = received(outlet.url, protocol="foxglove.websocket.v1")
            assert "update it (Lichtblick 1.26" in greeting["message"]
        assert received(outlet.url, protocol="chat")[0] == 400
    assert len(caplog.records) == 1, "one line, however often it tries"
    assert "Lichtblick 1.26" in caplog.text


BAD_REQUESTS = (
    b"", b"\0" * 64, b"\xff" * 20_000, b"GET / HTTP/1.1\r\n", b"GET / HTTP/1.1\r\n\r\n", b"\r\n\r\n",
    b"POST / HTTP/1.1\r\nUpgrade: websocket\r\n\r\n", b"GET / HTTP/1.1\r\nUpgrade : websocket\r\n\r\n",
    b"GET / HTTP/1.1\r\n Origin: a\r\nUpgrade: websocket\r\n\r\n",
    b"GET / HTTP/1.1\r\nUpgrade: websocket\r\nOrigin: a\r\nOrigin: b\r\n\r\n",
    b"GET / HTTP/1.1\r\nUpgrade: websocket\r\nHost: [::1\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n",
)  # fmt: skip


def test_requests_that_are_none_end_and_the_next_viewer_is_served(caplog: pytest.LogCaptureFixture) -> None:
    with closing(FoxgloveOutlet(Listen("127.0.0.1", 0), control=())) as outlet:
        for request in BAD_REQUESTS * 10:
            place = ("127.0.0.1", outlet.server.port)
            with socket.create_connection(place, WAIT_S) as client, suppress(ConnectionError):
                client.sendall(request)
                client.shutdown(socket.SHUT_WR)
                answer = client.recv(1000)
                assert not answer or answer.startswith(b"HTTP/1.1 4"), request
        assert received(outlet.url)[0] == 0
    assert len(caplog.records) <= 1


def test_messages_that_make_no_sense_are_one_line_in_the_log(
    hand: Hand, caplog: pytest.LogCaptureFixture
) -> None:
    outlet = bridged(hand, control=())
    threads_n = threading.active_count()

    async def visit(viewer: Viewer) -> None:
        await viewer.until(lambda: "/finger_1/tare" in viewer.services, "the finger")
        for text in ("{", "[]", '{"op":"nothing"}', "[" * 10_000, '{"op":"setParameters"}') * 200:
            await viewer.say_raw(text)
        for value in (1e300, -1, "\ud800" * 5000, [1], {"a": 1}, True, None, 2**63 - 1):
            rate = [{"name": f"finger_1.{name}", "value": value} for name in (*PARAMETERS, "nothing")]
            await viewer.say(op="setParameters", id="x", parameters=rate * 20)
        await viewer.say(op="getParameters", id="end", parameterNames=["finger_1.divider"] * 1000)
        values = await viewer.until(lambda: viewer.parameters.get("end"), "an answer")
        assert [p["value"] for p in values] == [1]

    watch(outlet.url, visit)
    assert threading.active_count() < threads_n + 20
    lines = [r for r in caplog.records if r.name == "hostlink.bridge.foxglove"]
    assert 0 < len(lines) <= 4, "one for each kind of complaint"
    assert all(len(r.getMessage()) < 400 for r in lines)


def test_the_layout_shows_what_is_there() -> None:
    layout = json.loads(LAYOUT.read_text())
    panels = layout["configById"]

    def names(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else names(node["first"]) + names(node["second"])

    assert sorted(names(layout["layout"])) == sorted(panels)
    values = values_of(State())
    for name, panel in panels.items():
        for path in panel.get("paths", ()):
            topic, _, field = path["value"].partition(".values.")
            assert topic.endswith("/sample"), name
            assert field in values, name
    assert panels["DiagnosticSummary!fingers"]["topicToRender"] == "/diagnostics"
    assert DIAGNOSTICS["title"] == "diagnostic_msgs/DiagnosticArray"  # the name that the panel looks for
    image = panels["Image!camera"]["imageMode"]
    assert image["imageTopic"] == "/finger_1/camera/image"
    assert set(image["annotations"]) == {"/finger_1/pins/overlay", "/finger_1/cells/overlay"}


def test_a_taken_port_is_one_line() -> None:
    with closing(FoxgloveOutlet(Listen("127.0.0.1", 0))) as outlet:
        listen = f"127.0.0.1:{outlet.server.port}"
        refusal = run("bridge", "virtual:fox-taken", "--foxglove", "--listen", listen).refusal
        assert f"--listen {listen}: " in refusal


def test_the_command_records_and_prints_the_path(tmp_path: Path) -> None:
    path = tmp_path / "hand.mcap"
    arguments = ("bridge", "virtual:fox-command", "--foxglove", "--listen", "127.0.0.1:0", "--seconds", "2")
    with Hand("fox-command", (2,), state):
        done = run(*arguments, "--record", path)
    assert done.code == 0
    assert "foxglove: ws://127.0.0.1:" in done.err
    with path.open("rb") as file:
        assert sum(1 for _ in make_reader(file).iter_messages(topics=["/finger_2/sample"])) > 20
    assert "exists already" in run(*arguments, "--record", path).refusal
