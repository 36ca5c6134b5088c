"""A recording of a running loop: the bus's samples, valid for other readers, complete up to a cut."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from edge.calibration import Calibration
from edge.link.sinks import MemorySink
from edge.recording.writer import Recorder
from edge.runtime.loop import Loop
from edge.sources import open_source
from hostlink.bridge.foxglove import FoxgloveOutlet
from hostlink.topics import Diagnosis, Level, values_of
from hostlink.web import Listen
from hostlink.wire import State, pack_state, unpack_state
from tests.hostlink.bridge.hand import Hand
from tests.support.messages import read_messages
from tests.support.waiting import SOON_S


@pytest.fixture(scope="module")
def recorded(
    data_dir: Path, calibration: Calibration, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, list[State]]:
    """A recording, and the samples as a host receives them."""
    path, sink = tmp_path_factory.mktemp("recorded") / "a.mcap", MemorySink()
    loop = Loop(open_source(str(data_dir / "press.mcap")), [sink], calibration)
    with Recorder(path, tip={"serial": "T-3"}, rate_hz=60) as recorder:
        recorder.finger = 3
        loop.measurement.watch(recorder)
        loop.session.begin(lambda name, *given: getattr(recorder, name)(*given) is not False)
        loop.run()
    assert recorder.fault is None
    assert recorder.dropped_n == recorder.refused_n == 0
    return path, [unpack_state(pack_state(state, 0)) for state in sink.states]


def test_the_recording_holds_the_samples_of_the_bus(recorded: tuple[Path, list[State]]) -> None:
    path, received = recorded
    samples = [message for _, _, message in read_messages(path, ["/finger_3/sample"])]
    assert len(samples) == len(received) == 26
    for written, sent in zip(samples, received, strict=True):
        assert written["sequence"] == sent.sample
        assert written["values"] == json.loads(json.dumps(values_of(sent)))
    assert any(written["values"]["contacts"] for written in samples)
    scenes = [message.entities[0] for _, _, message in read_messages(path, ["/finger_3/contacts"])]
    for scene, sent in zip(scenes, received, strict=True):
        places = [(s.pose.position.x * 1e3, s.pose.position.y * 1e3) for s in scene.spheres]
        assert places == [pytest.approx((c.x_mm, c.y_mm)) for c in sent.contacts]
        assert (scene.frame_id, len(scene.arrows) > 0) == ("finger_3", sent.displacement_mm > 0)
    (report,) = [m["status"] for _, _, m in read_messages(path, ["/diagnostics"])]
    assert [(s["name"], s["hardware_id"]) for s in report] == [("finger_3", "T-3")]
    counts = Counter(topic for topic, _, _ in read_messages(path))
    assert counts["/camera/image"] == 26
    assert counts["/pins"] == counts["/cells"] == counts["/features"] == counts["/reading"] == 19


def test_topics_and_schemas_are_as_of_the_bridge(recorded: tuple[Path, list[State]], tmp_path: Path) -> None:
    def shared(path: Path) -> dict[str, tuple[str, str, str, Any]]:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
        assert summary is not None
        found = {}
        for channel in summary.channels.values():
            schema = summary.schemas[channel.schema_id]
            content = json.loads(schema.data) if schema.encoding == "jsonschema" else None
            found[channel.topic] = (channel.message_encoding, schema.name, schema.encoding, content)
        return found

    path = tmp_path / "bridge.mcap"
    hand = Hand("same-topics", (3,), lambda number, k: State(sample=k, capture_time_us=k))
    outlet = FoxgloveOutlet(Listen("127.0.0.1", 0), path)
    sample = next(iter(hand.connection.samples(timeout_s=SOON_S)))
    outlet.add_finger(hand.connection.fingers[3])
    outlet.publish(sample)
    outlet.report([Diagnosis("finger_3", Level.OK, "measures", "T-3", {})])
    outlet.close()
    hand.close()
    bridge_s, edge_s = shared(path), shared(recorded[0])
    assert set(bridge_s) == {"/finger_3/sample", "/finger_3/contacts", "/diagnostics", "/tf"}
    assert {topic: edge_s[topic] for topic in bridge_s} == bridge_s
