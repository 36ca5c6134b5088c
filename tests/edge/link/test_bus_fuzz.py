"""Any input from the bus or the line: the node survives, answers, and holds only valid values."""

from collections.abc import Iterator
from contextlib import closing, contextmanager

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edge.link.medium import CanFrame
from edge.link.node import Node
from edge.link.settings import SettingsFile
from edge.link.sinks import CanFdSink, SerialSink
from hostlink.wire import OBJECTS, CanIds, Kind, Message
from hostlink.wire.nmt import NmtState
from hostlink.wire.serial import FRAME_MAX
from tests.edge.link.test_node import Finger
from tests.support.bus import on_line
from tests.support.media import Wire
from tests.support.waiting import SOON_S, present

NODE = 3
REQUEST = CanIds().of(Kind.SDO_REQUEST, NODE)
RESPONSE = CanIds().of(Kind.SDO_RESPONSE, NODE)
IDENTITY = bytes((0x40, 0x18, 0x10, 0x01, 0, 0, 0, 0))  # upload of 0x1018:1
FEW = settings(max_examples=150)


@contextmanager
def a_node(kind: type[CanFdSink] | type[SerialSink]) -> Iterator[tuple[Node, Finger, Wire]]:
    wire, finger = Wire(instant=False), Finger()
    with closing(Node(kind("wire", lambda: wire, NODE), finger, SettingsFile())) as node:
        yield node, finger, wire


def check_values(node: Node, finger: Finger) -> None:
    """All settings are within their limits; no unusable value was accepted."""
    for row in OBJECTS:
        if row.stored and row.type != "domain" and row.low is not None and row.high is not None:
            assert row.low <= getattr(node._settings.values, row.name) <= row.high, row.name
    assert all(1 <= kind <= 240 or kind == 254 for kind in node.objects.transmission.values())
    assert finger.calibration == b"" or finger.calibration.startswith(b"{")


INDICES = [*sorted({row.index for row in OBJECTS}), 0, 0x1A00, 0xFFFF]
COMMANDS = [0x21, 0x22, 0x23, 0x2B, 0x2F, 0x40, 0x60, 0x70, 0x80, 0xC0, 0xA0]
KINDS = [Message.REQUEST, Message.NMT, Message.SYNC, Message.HEARTBEAT, Message.EMERGENCY]
requests = st.builds(
    lambda command, index, sub, data: bytes((command,)) + index.to_bytes(2, "little") + bytes((sub,)) + data,
    st.one_of(st.sampled_from(COMMANDS), st.integers(0, 255)),
    st.sampled_from(INDICES),
    st.integers(0, 6),
    st.binary(min_size=4, max_size=4),
)  # fmt: skip
segments = st.builds(lambda c, d: bytes((c,)) + d, st.integers(0, 0x1F), st.binary(min_size=7, max_size=7))
frames = st.one_of(requests, segments, st.binary(max_size=8))
identifiers = st.one_of(
    st.sampled_from([REQUEST, 0x000, 0x080, 0x100, 0x700 + NODE, 0x080 + NODE]), st.integers(0, 0x7FF)
)


@pytest.mark.generative
@FEW
@given(messages=st.lists(st.tuples(identifiers, frames), max_size=40))
def test_can(messages: list[tuple[int, bytes]]) -> None:
    with a_node(CanFdSink) as (node, finger, wire):
        receive = present(node.sink.on_message)
        for can_id, data in messages:
            receive(CanFrame(can_id, data))
        check_values(node, finger)
        # A master restarts it after any commands; then it answers as before.
        receive(CanFrame(0, bytes((1, NODE))))
        assert node.drain(SOON_S)
        wire.items.clear()
        receive(CanFrame(REQUEST, IDENTITY))
        assert node.drain(SOON_S)
        answers = [bytes(m.data) for m in wire.items if m.can_id == RESPONSE]
        assert [a[:4] for a in answers] == [b"\x43" + IDENTITY[1:4]]


@pytest.mark.generative
@FEW
@given(
    chunks=st.lists(
        st.one_of(
            st.binary(max_size=80),
            st.builds(
                on_line,
                st.sampled_from(KINDS),
                st.one_of(st.binary(max_size=60), requests),
                st.integers(0, 255),
            ),
        ),
        max_size=30,
    )
)  # fmt: skip
def test_serial(chunks: list[bytes]) -> None:
    with a_node(SerialSink) as (node, finger, _):
        assert isinstance(node.sink, SerialSink)
        for chunk in chunks:
            node.sink._split(chunk)
        check_values(node, finger)
        node.sink._split(b"\0" + on_line(Message.NMT, bytes((1,)), 0))
        assert node.state is NmtState.OPERATIONAL
        assert len(node.sink._buffer) <= FRAME_MAX
