"""Objects asked of a node whose answers are late or lost, while others ask on the same bus."""

import threading
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from random import Random
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hostlink
from edge.errors import RequestRefused
from edge.link.commands import SerialCommands
from edge.link.object_server import ObjectServer
from edge.link.sdo_server import SdoServer
from edge.link.settings import SettingsFile
from hostlink import objects
from hostlink.errors import LinkTimeout, ObjectAborted
from hostlink.finger import Finger
from hostlink.hand_file import HandFile
from hostlink.objects import ObjectClient, SdoObjects, SerialObjects
from hostlink.wire import Abort, CanIds, Message, ObjectReply, ObjectRequest, Op, object_named, unpack_message
from hostlink.wire.nmt import NmtState
from hostlink.wire.serial import decode_frame
from tests.support.fingers import Application

NODE, INDEX = 5, 0x2030


kinds = st.sampled_from([0x00, 0x01, 0x10, 0x20, 0x30, 0x41, 0x43, 0x4F, 0x60, 0x70, 0x80, 0xA0, 0xC0])
frames = st.builds(
    lambda kind, what, tail: bytes((kind,)) + what + tail,
    st.one_of(kinds, st.integers(0, 255)),
    st.one_of(st.sampled_from([b"\x30\x20\0", bytes(3)]), st.binary(min_size=3, max_size=3)),
    st.one_of(st.just(b"\x09\0\0\0"), st.binary(min_size=4, max_size=4)),
)


@pytest.mark.generative
@settings(max_examples=100, deadline=None)
@given(
    received=st.lists(st.lists(st.tuples(st.booleans(), frames), max_size=4), max_size=12),
    size=st.integers(0, 9),
)
def test_a_transfer_ends_whatever_is_received(received: list[list[tuple[bool, bytes]]], size: int) -> None:
    """Answers and others' requests of any content; each list is what comes after a request of ours."""
    rounds = iter(received)

    def send(can_id: int, data: bytes) -> None:
        for another, frame in next(rounds, []):
            (client.overhear if another else client.answer)(frame)

    client = SdoObjects(NODE, 0x605, 0x585, send)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(objects, "TIMEOUT_S", 0.001)
        for transfer in (lambda: client.read(INDEX, 0), lambda: client.write(INDEX, 0, bytes(size))):
            with suppress(ObjectAborted, LinkTimeout):
                transfer()


class OneTare(Application):
    """Takes one rest frame, for ever."""

    def tare(self, force: bool) -> None:
        if self.tares:
            raise RequestRefused("a rest frame is being taken already")
        super().tare(force)


class Line:
    """A finger's objects over a serial line or a bus, whose first answers are lost."""

    def __init__(self, link: str, application: Application, lost_n: int = 0) -> None:
        self.lost_n = lost_n
        server = ObjectServer(application, SettingsFile(), NODE, CanIds(), lambda _: None, dict)
        self.sdo = SdoServer(
            server, lambda data: self._answer(lambda: self.client.answer(data)), lambda block: None
        )
        node: Any = SimpleNamespace(objects=server, number=NODE, state=NmtState.OPERATIONAL)
        line: Any = self
        self.commands = SerialCommands(line, node)
        self.client: Any
        self.link = link
        self.connect()

    def connect(self) -> None:
        if self.link == "serial":
            self.client = SerialObjects(self._write)
        else:
            self.client = SdoObjects(NODE, 0x605, 0x585, lambda _, data: self.sdo.request(data))

    def _write(self, frame: bytes) -> None:
        kind, payload = decode_frame(frame.strip(b"\0"))
        self.commands.receive(Message(kind), *unpack_message(Message(kind), payload))

    def _answer(self, deliver: Callable[[], None]) -> None:
        if self.lost_n:
            self.lost_n -= 1
        else:
            deliver()

    def frame(self, kind: Message, body: bytes, counter: int) -> tuple[int, bytes]:
        return counter, body

    def post(self, reply: tuple[int, bytes]) -> None:
        """The node replies."""
        self._answer(lambda: self.client.answer(reply[0], ObjectReply.unpack(reply[1])))


TARE, SERIAL_NUMBER = (0x2010, 0), (0x2000, 3)
links = pytest.mark.parametrize("link", ["can", "serial"])


@links
@pytest.mark.parametrize("lost_n", [1, 2])
def test_a_lost_answer_does_not_turn_an_accepted_tare_into_a_refusal(
    monkeypatch: pytest.MonkeyPatch, link: str, lost_n: int
) -> None:
    monkeypatch.setattr(objects, "TIMEOUT_S", 0.01)
    monkeypatch.setattr(objects, "TRIES", 1000)  # on a busy machine
    line = Line(link, application := OneTare("VT-1"))
    line.client.read(*SERIAL_NUMBER)
    line.lost_n = lost_n
    line.client.write(*TARE, b"\1")
    assert application.tares == [False]
    with pytest.raises(ObjectAborted) as refused:  # this is no repetition
        line.client.write(*TARE, b"\1")
    assert refused.value.code == Abort.NOT_NOW


@links
def test_a_new_connection_gets_no_answers_of_the_one_before(
    monkeypatch: pytest.MonkeyPatch, link: str
) -> None:
    monkeypatch.setattr("os.urandom", lambda n: bytes(n))  # every connection counts alike
    line = Line(link, application := Application("VT-1"))
    for n in range(1, 4):
        if link == "serial":
            line.connect()
        line.client.write(*TARE, b"\1")
        assert len(application.tares) == n


@links
def test_a_request_ends_in_time_whatever_else_arrives(monkeypatch: pytest.MonkeyPatch, link: str) -> None:
    monkeypatch.setattr(objects, "TIMEOUT_S", 0.02)
    line = Line(link, Application("VT-1"), lost_n=1000)
    ended = threading.Event()

    def chatter() -> None:
        """Another's answers, one each millisecond, for far longer than a request may take."""
        for k in range(3000):
            if ended.wait(0.001):
                return
            if link == "serial":
                line.client.answer(k & 0xFF, ObjectReply(0x2000, 4))
            else:
                line.client.overhear(b"\x40\x00\x20\x04" + bytes(4))
                line.client.answer(b"\x43\x00\x20\x04" + bytes(4))

    thread = threading.Thread(target=chatter)
    thread.start()
    with pytest.raises(LinkTimeout):
        line.client.read(*SERIAL_NUMBER)
    assert thread.is_alive()
    ended.set()
    thread.join()


def test_a_finger_that_another_host_keeps_busy_gives_that_as_the_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(objects, "TIMEOUT_S", 0.01)
    line = Line("can", Application("VT-0042"))
    line.sdo.request(b"\x21\x30\x20\0" + (9).to_bytes(4, "little"))  # another host's, unheard
    line.sdo.request(b"\x00{______")
    with pytest.raises(ObjectAborted, match="serial_number: another host keeps the finger busy") as error:
        line.client.read(*SERIAL_NUMBER)
    assert error.value.code == Abort.NOT_NOW
    line.client.write(*TARE, b"\1")  # a short value needs no turn


def test_serial_refusals_carry_their_code() -> None:
    line = Line("serial", application := Application("VT-1"))
    stored = object_named("settings_stored")
    assert line.client.read(stored.index, stored.sub) == b"\0", "there is no folder"
    application.touched, replies = True, list[ObjectReply]()
    line.client = SimpleNamespace(answer=lambda counter, reply: replies.append(reply))
    for name, offset, total, data, code in (
        ("calibration", 50, 100, b"x", Abort.TOGGLE),
        ("divider", 0, 9, bytes(20), Abort.LENGTH),
        ("tare", 0, 1, b"\1", Abort.NOT_NOW),
    ):
        row = object_named(name)
        request = ObjectRequest(Op.WRITE, row.index, row.sub, offset, total, data)
        line.commands.receive(Message.REQUEST, 7, request.pack())
        assert replies.pop().abort == code


class SharedBus:
    """A finger and hosts on a bus. Whose frame comes next is random; the frames of each keep their order.

    Each host loses a share of the answers. late: each request comes again, and is answered, after the next.
    """

    def __init__(self, hosts_n: int, lost: float, late: bool) -> None:
        self.application = Application("VT-0042 of the left hand")
        self.application.touched = True
        server = ObjectServer(self.application, SettingsFile(), NODE, CanIds(), lambda _: None, dict)
        self._server = SdoServer(server, lambda data: self._put(0, data), self._put_block)
        self._queues = [deque[bytes]() for _ in range(1 + hosts_n)]
        self._changed = threading.Condition()
        self._ended = False
        self._rng, self._lost, self._late = Random(1), lost, late
        self.hosts = [self._host(k) for k in range(1, 1 + hosts_n)]
        self._thread = threading.Thread(target=self._carry)
        self._thread.start()

    def _host(self, k: int) -> SdoObjects:
        return SdoObjects(NODE, 0x605, 0x585, lambda _, data: self._put(k, data))

    def _put(self, sender: int, data: bytes) -> None:
        with self._changed:
            self._queues[sender].append(data)
            self._changed.notify()

    def _put_block(self, block: Sequence[bytes]) -> None:
        for data in block:
            self._put(0, data)

    def _carry(self) -> None:
        before: list[bytes] = []
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._ended or any(self._queues))
                if self._ended:
                    return
                sender = self._rng.choice([k for k, queue in enumerate(self._queues) if queue])
                data = self._queues[sender].popleft()
            for k, host in enumerate(self.hosts, 1):
                if sender == 0 and self._rng.random() >= self._lost:
                    host.answer(data)
                elif sender not in (0, k):
                    host.overhear(data)
            if sender:
                for again in before:
                    self._server.request(again)
                self._server.request(data)
                before = [data] * self._late

    def close(self) -> None:
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join()


def not_needed() -> Any:
    raise AssertionError("nothing of a finger's samples is needed")


def ask_often(finger: Finger, text: tuple[str, str], n: int, force: bool) -> list[str]:
    """Read a text and tare, n times; returns what is not right. The tip is touched."""
    (name, expected), wrong = text, list[str]()
    for _ in range(n):
        try:
            if (read := finger.get(name)) != expected:
                wrong.append(f"read {read!r}")
            if force:
                finger.tare(force=True)
                continue
            with suppress(ObjectAborted):
                finger.tare()
                wrong.append("a tare of a touched tip was accepted")
        except hostlink.LinkError as error:
            wrong.append(repr(error))
    return wrong


@pytest.mark.parametrize(
    ("hosts_n", "lost", "late", "n"),
    [(2, 0.0, False, 1000), (3, 0.0, False, 100), (2, 0.01, False, 30), (1, 0.0, True, 100)],
    ids=["two", "three", "losses", "late answers"],
)
def test_hosts_on_one_bus_read_and_tare_correctly(
    monkeypatch: pytest.MonkeyPatch, hosts_n: int, lost: float, late: bool, n: int
) -> None:
    """The first host forces its tares, so that they are accepted; the others' are refused."""
    if lost:
        monkeypatch.setattr(objects, "TIMEOUT_S", 0.05)
        monkeypatch.setattr(objects, "TRIES", 200)  # on a busy machine
    with closing(SharedBus(hosts_n, lost, late)) as bus, ThreadPoolExecutor(hosts_n) as pool:
        clients: list[ObjectClient] = [*bus.hosts]
        fingers = [Finger(HandFile().mount(NODE), client, not_needed, not_needed) for client in clients]
        texts = (("serial_number", bus.application.serial), ("device_name", "voronoi-touch"))
        asked = [pool.submit(ask_often, one, texts[k % 2], n, k == 0) for k, one in enumerate(fingers)]
        assert [future.result() for future in asked] == [[]] * hosts_n
        assert bus.application.tares == [True] * n
