"""The node from outside: `canopen`'s RemoteNode on a virtual bus, serial requests, and what persists."""

import termios
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from functools import partial
from importlib.resources import files
from pathlib import Path

import can
import canopen
import pytest

from edge.errors import CalibrationError
from edge.link.medium import CanFrame, Medium, MediumError
from edge.link.node import Node
from edge.link.settings import NodeSettings, SettingsFile
from edge.link.sinks import CanFdSink, CanSink, SerialSink, open_sink
from hostlink import wire
from hostlink.wire import Abort, FaultCode, Message, State, Status, object_named
from hostlink.wire.nmt import NmtState
from hostlink.wire.serial import decode_frame
from tests.support.fingers import Application
from tests.support.media import Trouble, Wire
from tests.support.waiting import SOON_S, present, until

NODE = 5
EDS = files("hostlink") / "eds" / "voronoi_touch.eds"


class Finger(Application):
    """An application that takes calibrations in JSON only."""

    def __init__(self) -> None:
        super().__init__("VT-0042")

    def describe(self) -> Mapping[str, int | float | str | bytes]:
        return {**super().describe(), "pin_n": 331, "samples_n": (1 << 32) + 7, "camera_rate_hz": 239.5}

    def upload_calibration(self, data: bytes) -> None:
        if not data.startswith(b"{"):
            raise CalibrationError("not JSON")
        super().upload_calibration(data)


def state(sample: int, capture_us: int | None = None) -> State:
    return State(
        sample=sample, capture_time_us=sample * 4000 if capture_us is None else capture_us, latency_us=100.0
    )


class Bench:
    """A node on a virtual bus, with `canopen` and a plain receiver on the other side."""

    def __init__(self, channel: str, tmp_path: Path, query: str = "") -> None:
        self.address = f"virtual:{channel}?node={NODE}{query}"
        self.settings = tmp_path / "settings.json"
        self.listener = can.Bus(interface="virtual", channel=channel)
        self.finger = Finger()
        self.network = canopen.Network()
        self.network.NOTIFIER_CYCLE = 0.02  # disconnecting waits for it so long
        self.network.connect(interface="virtual", channel=channel)
        self.remote = self.network.add_node(NODE, str(EDS))  # a third party needs only the EDS
        self.remote.sdo.RESPONSE_TIMEOUT = SOON_S  # the library's 0.3 s may pass on a busy machine
        self.open()

    def open(self) -> None:
        sink = open_sink(self.address)
        assert isinstance(sink, CanSink)
        self.node = Node(sink, self.finger, SettingsFile(self.settings))

    def close(self) -> None:
        self.node.close()
        self.network.disconnect()
        self.listener.shutdown()

    def read(self, name: str) -> object:
        row = object_named(name)
        return wire.unpack_value(row, self.remote.sdo.upload(row.index, row.sub))

    def write(self, name: str, value: float | bytes) -> None:
        row = object_named(name)
        data = value if isinstance(value, bytes) else wire.pack_value(row, value)
        self.remote.sdo.download(row.index, row.sub, data)

    def messages(self, can_id: int, n: int) -> list[bytes]:
        """The next n messages with this identifier."""
        found: list[bytes] = []
        while len(found) < n:
            message = self.listener.recv(SOON_S)
            assert message is not None, f"{len(found)} of {n} messages 0x{can_id:X}"
            if message.arbitration_id == can_id:
                assert message.is_fd == (len(message.data) > 8)
                found.append(bytes(message.data))
        return found

    def send(self, state: State) -> bool:
        """Send a sample, and wait until it has left: a heartbeat may delay it."""
        sent = self.node.send(state)
        assert self.node.drain(SOON_S)
        return sent

    def samples(self, n: int) -> list[int]:
        return [wire.unpack_state(data).sample for data in self.messages(0x180 + NODE, n)]

    def nmt(self, command: int) -> None:
        self.network.send_message(0, bytes((command, NODE)))


@pytest.fixture
def bench(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Bench]:
    with closing(Bench(f"node-{request.node.name}", tmp_path)) as bench:
        yield bench


def refused(code: int) -> pytest.RaisesExc[canopen.SdoAbortedError]:
    return pytest.raises(canopen.SdoAbortedError, check=lambda e: e.code == code)


def test_boot_up_then_heartbeat(bench: Bench) -> None:
    beats = bench.messages(0x700 + NODE, 1)
    assert beats == [b"\0"]
    bench.write("heartbeat_ms", 10)
    assert bench.messages(0x700 + NODE, 2) == [b"\5", b"\5"]
    assert bench.remote.nmt.wait_for_heartbeat(SOON_S) == "OPERATIONAL"


def test_remote_node_reads_identity(bench: Bench) -> None:
    assert bench.read("serial_number") == bench.remote.sdo[0x2000][3].raw == "VT-0042"
    assert bench.read("software_version") == "0.1"
    assert bench.read("schema_hash") == object_named("schema_hash").default
    assert bench.read("camera_rate_hz") == pytest.approx(239.5)
    assert bench.read("samples_n") == 7  # counts on modulo its width
    assert bench.read("emergency_cob_id") == 0x80 + NODE
    assert bench.remote.sdo[0x1018][2].raw == 1
    before_us = time.monotonic_ns() // 1000
    assert 0 <= (bench.remote.sdo[0x1013].raw - before_us) % 2**32 < SOON_S * 1e6


@pytest.mark.parametrize(
    ("name", "data", "code"),
    [
        ("divider", b"\0\0", Abort.VALUE_LOW),
        ("divider", b"\xff\xff", Abort.VALUE_HIGH),
        ("divider", b"\1", Abort.LENGTH),
        ("rate_hz", b"\0\0\xc0\x7f", Abort.VALUE_LOW),  # NaN
        ("schema_hash", b"\0\0\0\0", Abort.READ_ONLY),
        ("reboot", b"\0\0\0\0", Abort.VALUE_LOW),
        ("error_n", b"\1", Abort.VALUE_RANGE),  # CiA 301, object 1003h
    ],
)
def test_unusable_values_are_refused(bench: Bench, name: str, data: bytes, code: int) -> None:
    with refused(code):
        bench.write(name, data)
    assert bench.finger.reboots == 0


def test_unknown_and_write_only_objects_and_a_full_disk_are_refused(bench: Bench) -> None:
    for index, sub, code in ((0x2999, 0, Abort.NO_OBJECT), (0x2020, 99, Abort.NO_SUB)):
        with refused(code):
            bench.remote.sdo.upload(index, sub)
    with refused(Abort.WRITE_ONLY):
        bench.read("tare")
    bench.settings.mkdir()
    with refused(Abort.NOT_STORED):
        bench.write("divider", 7)
    assert bench.read("divider") == 1


def test_the_node_gives_the_reason_of_a_refusal(bench: Bench) -> None:
    bench.remote.sdo[0x2010].raw = 1  # a tare, by the EDS
    bench.finger.touched = True
    for name, value, code, message in (
        ("tare", 1, Abort.NOT_NOW, "something touches the tip; let go, or force the tare"),
        ("calibration", b"no JSON", Abort.VALUE_RANGE, "not JSON"),
        ("tpdo1_transmission", 245, Abort.VALUE_RANGE, "transmission type 245: 1..240 or 254"),
    ):
        with refused(code):
            bench.write(name, value)
        assert bench.read("refusal") == message
    bench.write("tare", 2)
    assert bench.finger.tares == [False, True]
    with refused(Abort.NO_DATA):  # there is no reason any more
        bench.read("refusal")


def test_settings_survive_a_restart(bench: Bench) -> None:
    assert bench.read("settings_stored") is True
    bench.write("divider", 3)
    bench.write("features", 0b100001)
    assert bench.finger.features == {"displacement", "shear"}
    bench.node.close()
    bench.finger.features = frozenset()
    bench.open()
    assert bench.read("divider") == 3
    assert bench.finger.features == {"displacement", "shear"}
    bench.write("restore_defaults", 0x64616F6C)
    assert bench.read("divider") == 1
    assert SettingsFile(bench.settings).values == NodeSettings()


def test_divider_and_rate_thin_out(bench: Bench) -> None:
    bench.write("divider", 4)
    for k in range(20):
        bench.send(State(sample=k, status=Status.CLOCK_STEP | Status.TOUCHED if k == 5 else Status(0)))
    sent_as = {s.sample: s.status for s in map(wire.unpack_state, bench.messages(0x180 + NODE, 5))}
    assert sent_as == dict.fromkeys((3, 11, 15, 19), Status(0)) | {7: Status.CLOCK_STEP}
    bench.write("divider", 1)
    bench.write("rate_hz", 100.0)
    sent = [bench.send(state(k, 1_000_000 + k * 4167)) for k in range(240)]  # a second at 240 Hz
    assert 99 <= sum(sent) <= 101
    bench.write("rate_hz", 250.0)  # above the camera's: every frame
    jittered = [state(k, 3_000_000 + k * 4167 + (300 if k % 2 else 0)) for k in range(100)]
    assert all(bench.send(s) for s in jittered)
    assert bench.node.counters.dropped == 0


def test_master_stops_and_starts(bench: Bench) -> None:
    bench.nmt(2)
    until(lambda: bench.node.state is NmtState.STOPPED, "stopped")
    assert not bench.node.send(state(1))
    bench.remote.sdo.RESPONSE_TIMEOUT, bench.remote.sdo.MAX_RETRIES = 0.05, 1
    with pytest.raises(canopen.SdoCommunicationError):  # a stopped node serves no objects
        bench.read("divider")
    bench.remote.sdo.RESPONSE_TIMEOUT = SOON_S
    bench.nmt(128)
    until(lambda: bench.node.state is NmtState.PRE_OPERATIONAL, "pre-operational")
    assert not bench.node.send(state(2))
    for command in (0, 3, 80, 127, 255):  # unknown ones change nothing
        bench.nmt(command)
    assert bench.read("serial_number") == "VT-0042"
    assert bench.node.state is NmtState.PRE_OPERATIONAL
    bench.write("heartbeat_ms", 10)
    assert bench.remote.nmt.wait_for_heartbeat(SOON_S) == "PRE-OPERATIONAL"
    bench.write("heartbeat_ms", 0)
    bench.nmt(1)
    until(lambda: bench.node.state is NmtState.OPERATIONAL, "operational")
    assert bench.node.send(state(3))
    assert bench.samples(1) == [3]
    for reset in (129, 130):
        bench.nmt(reset)
        # A heartbeat from before the reset may come first.
        until(lambda: bench.messages(0x700 + NODE, 1) == [b"\0"], "boot-up")
        until(lambda: bench.node.state is NmtState.OPERATIONAL, "up again")


def test_sync_sends_the_newest_sample_once(bench: Bench) -> None:
    bench.write("tpdo1_transmission", 2)
    assert not any(bench.node.send(state(k)) for k in range(3))
    for _ in range(4):
        bench.network.sync.transmit()
    assert bench.samples(1) == [2]
    bench.node.send(state(3))
    bench.network.sync.transmit()
    bench.network.sync.transmit()
    assert bench.samples(1) == [3]
    assert bench.node.counters.sent == 2


def test_faults_and_their_clearing(bench: Bench) -> None:
    bench.node.report(FaultCode.OVERLOAD, True)
    bench.node.report(FaultCode.OVER_TEMPERATURE, True)
    bench.node.report(FaultCode.OVERLOAD, True)  # reported again: no second emergency
    bench.node.report(FaultCode.OVERLOAD, False)
    bench.node.report(FaultCode.OVER_TEMPERATURE, False)
    overload, hot, cooler, fine = (wire.unpack_emergency(d) for d in bench.messages(0x80 + NODE, 4))
    assert overload == (0x9002, 0x01, FaultCode.OVERLOAD, Status.OVERLOAD)
    assert hot == (0x4201, 0x09, FaultCode.OVER_TEMPERATURE, Status.OVERLOAD | Status.OVER_TEMPERATURE)
    assert cooler == (0, 0x09, FaultCode.OVERLOAD, Status.OVER_TEMPERATURE)
    assert fine == (0, 0, 0, 0)
    until(lambda: len(bench.remote.emcy.log) == 4, "seen by canopen")
    assert bench.remote.emcy.active == []
    assert bench.read("error_n") == 2
    assert bench.read("error_1") == 0x4201 | FaultCode.OVER_TEMPERATURE << 16
    bench.write("error_n", 0)
    assert bench.read("error_n") == 0


class Troubled(Wire):
    """A bus with a driver that raises anything, once, in one of its calls."""

    def __init__(self, instant: bool) -> None:
        super().__init__(instant)
        self.trouble = Trouble()

    def __call__(self) -> "Troubled":
        self.trouble.call("open")
        return self

    def write(self, item: CanFrame) -> None:
        self.trouble.call("write")
        super().write(item)

    def read(self, timeout_s: float) -> None:
        self.trouble.call("read")
        threading.Event().wait(0.002)

    def close(self) -> None:
        self.trouble.call("close")


UNFORESEEN = [IndexError(), termios.error(5), MemoryError(), AssertionError(), KeyError(), SystemExit(1)]


@pytest.mark.parametrize("instant", [True, False])
@pytest.mark.parametrize("error", UNFORESEEN, ids=repr)
@pytest.mark.parametrize("where", ["read", "write", "open", "close"])
def test_whatever_a_driver_raises_is_a_lost_link_and_no_thread_ends(
    where: str, error: BaseException, instant: bool
) -> None:
    bus, finger = Troubled(instant), Finger()
    sink = CanFdSink("troubled", bus, NODE)
    with closing(Node(sink, finger)) as node:
        sink.every(0.0, None)  # a heartbeat would show that the link is back
        assert node.drain(SOON_S)
        bus.trouble[where] = error
        if where in ("open", "close"):
            sink._lose(bus, MediumError("lost"))
        if where == "write":
            node.send(state(1))
        until(lambda: finger.faults == {FaultCode.LINK_DOWN: True}, "the fault")
        bus.items.clear()
        until(lambda: node.send(state(2)) and node.drain(SOON_S) and sink.up, "samples again")
        until(lambda: finger.faults == {FaultCode.LINK_DOWN: False}, "the fault's end")
        assert not bus.trouble
        assert sink.guard.unforeseen_n == 1
        assert all(thread.is_alive() for thread in sink._threads)
        first = next(wire.unpack_state(frame.data) for frame in bus.items if frame.can_id == 0x180 + NODE)
        assert first.status == Status.LINK_FAULT
    assert not any(thread.is_alive() for thread in sink._threads)


@pytest.mark.parametrize("error", UNFORESEEN, ids=repr)
def test_whatever_a_handler_raises_costs_its_message_alone(
    monkeypatch: pytest.MonkeyPatch, bench: Bench, error: BaseException
) -> None:
    sink = bench.node.sink
    receive, report, raised = present(sink.on_message), present(sink.on_faults), [error]

    def fail_once(then: Callable[..., None], *arguments: object) -> None:
        if raised:
            raise raised.pop()
        then(*arguments)

    def stay_lost() -> Medium:
        raise MediumError("no medium")

    sink.on_message = partial(fail_once, receive)
    bench.nmt(1)
    until(lambda: not raised, "the message")
    assert bench.read("serial_number") == "VT-0042"
    raised.append(error)
    medium = present(sink._medium)
    monkeypatch.setattr(sink, "_open_medium", stay_lost)
    sink.on_faults = partial(fail_once, report)
    sink._lose(medium, MediumError("lost"))
    until(lambda: bench.finger.faults == {FaultCode.LINK_DOWN: True}, "the fault, in the second attempt")
    assert all(thread.is_alive() for thread in sink._threads)
    assert sink.guard.unforeseen_n == 2


def test_detail_is_off_until_asked_for(bench: Bench) -> None:
    rows = [(k / 10, -k / 10, 0.1) for k in range(30)]
    assert not bench.node.send_detail(0, rows)
    bench.write("detail_divider", 2)
    assert bench.node.send_detail(1, rows)
    assert not bench.node.send_detail(2, rows)
    assembler, detail = wire.DetailAssembler(), None
    while detail is None:
        detail = assembler.add(wire.unpack_segment(bench.messages(0x480 + NODE, 1)[0]))
    assert detail.sample == 1
    assert [r[0] for r in detail.rows] == pytest.approx([r[0] for r in rows], abs=0.01)
    until(lambda: bench.node.counters.detail_sent == 1, "counted")


def test_moved_identifiers(request: pytest.FixtureRequest) -> None:
    ids = wire.CanIds(sdo_request=0x680, sdo_response=0x500, heartbeat=0x780 - 0x80)
    sink = open_sink(f"virtual:{request.node.name}", node=NODE, ids=ids)
    assert isinstance(sink, CanFdSink)
    with can.Bus(interface="virtual", channel=request.node.name) as bus:
        node = Node(sink, Finger())
        bus.send(
            can.Message(arbitration_id=0x680 + NODE, data=b"\x40\x00\x12\x02\0\0\0\0", is_extended_id=False)
        )
        answer = next(m for m in iter(partial(bus.recv, SOON_S), None) if m.arbitration_id == 0x500 + NODE)
        node.close()
    assert bytes(answer.data[4:]) == (0x500 + NODE).to_bytes(4, "little")


def test_serial_heartbeat() -> None:
    line = Wire(instant=False)
    with closing(Node(SerialSink("line", lambda: line), Finger())) as node:
        node.objects.write(0x1017, 0, b"\x0a\0")
        until(lambda: any(decode_frame(frame.strip(b"\0"))[0] == Message.HEARTBEAT for frame in line.items))
