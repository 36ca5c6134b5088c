"""The client against real nodes: over the virtual bus (FD, classic), UDP multicast, slcan and ptys."""

import asyncio
import json
import os
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path

import can
import pytest

import hostlink
from edge.errors import SinkError
from edge.link.node import Node
from edge.link.sinks import open_sink
from hostlink import RestFrameOutcome, RestFrameReason, RestFrameState
from hostlink.can_bus import OpenBus
from hostlink.commands.monitor import Board
from hostlink.finger import STALE_S
from hostlink.links import Arrival
from hostlink.subscription import QUEUE
from hostlink.wire import CanIds, FaultCode, Kind, State, pack_state
from hostlink.wire.fields import DATA_ID, VERSION
from hostlink.wire.nmt import NmtState
from tests.support.bus import Wire, foreign_frame, message
from tests.support.fingers import Application, free_port, need_multicast, node_at, state
from tests.support.ptys import Ptys
from tests.support.states import as_seen
from tests.support.waiting import SOON_S, present, until

ROUNDING_S = 2e-6  # of the wire's microseconds, and of floats
Ends = tuple[str, str]  # addresses of edge and host
Pair = tuple[Node, Application, hostlink.Connection]


@pytest.fixture(params=["fd", "classic", "udp", "serial"])
def ends(request: pytest.FixtureRequest, tmp_path: Path) -> Ends:
    bus = f"virtual:client-{request.node.name}"
    match request.param:
        case "fd":
            return f"{bus}?node=3", bus
        case "classic":
            return f"{bus}?node=3&fd=0", bus
        case "udp":
            need_multicast()
            address = f"udp:239.0.0.7?port={free_port()}"
            return f"{address}&node=3", address
        case _:
            pty = Ptys(tmp_path)
            return f"serial:{pty.paths[0]}", f"serial:{pty.paths[1]}"


@pytest.fixture
def pair(ends: Ends) -> Iterator[Pair]:
    with node_at(ends[0]) as (node, application):
        node.drain(SOON_S)  # behind a sample, its boot-up message would restart the mapping of the clock
        with hostlink.connect(ends[1]) as hand:
            yield node, application, hand


def test_samples_come_as_they_were_sent(pair: Pair) -> None:
    node, _, hand = pair
    received: list[hostlink.Sample] = []
    hand.on_sample(received.append)
    sent = []
    for k in range(100):
        sent.append(state(k))
        assert node.send(sent[-1])
        if k % 4 == 3:
            node.drain(SOON_S)
    until(lambda: len(received) == 100, "all samples")
    assert [sample.state for sample in received] == [as_seen(state) for state in sent]
    statistics = hand.finger().statistics
    assert statistics.received_n == 100
    assert statistics.lost_n == statistics.corrupt_n == statistics.duplicate_n == 0
    for sample, original in zip(received, sent, strict=True):
        taken_s = original.capture_time_us * 1e-6  # both ends share this machine's clock
        off_s = sample.host_time_s - taken_s
        # Any delay of this machine is included.
        transit_s = sample.arrival_s - taken_s - original.latency_us * 1e-6
        assert -sample.host_error_s - ROUNDING_S <= off_s <= sample.host_error_s + transit_s + ROUNDING_S


def test_iterator_and_latest(pair: Pair) -> None:
    node, _, hand = pair
    assert hand.latest() is None
    stop = threading.Event()

    sent: list[State] = []

    def feed() -> None:
        while not stop.wait(0.002):
            sent.append(state(len(sent)))
            node.send(sent[-1])
            node.drain(SOON_S)  # a line that is slower would take the newest only

    feeder = threading.Thread(target=feed, daemon=True)
    feeder.start()
    numbers = [sample.state.sample for sample, _ in zip(hand, range(10), strict=False)]
    assert numbers == list(range(numbers[0], numbers[0] + 10))
    until(hand.latest, "one that is new")
    assert present(hand.latest(max_age_s=None)).age_s < SOON_S
    stop.set()
    feeder.join(SOON_S)
    until(lambda: hand.finger().statistics.received_n == len(sent), "all that was sent")
    until(lambda: hand.latest(max_age_s=0.01) is None, "the newest is too old")
    assert hand.latest(max_age_s=None) is not None
    with pytest.raises(hostlink.LinkTimeout):
        next(hand.samples(timeout_s=0.05))


def test_a_sample_that_waited_is_not_fresh_when_it_is_read(pair: Pair) -> None:
    """As after a halt of the host: what waited comes in now, and no stamp says that it is old."""
    node, _, hand = pair
    first = state(0)
    node.send(first)
    until(lambda: hand.latest(max_age_s=None), "the first")
    until(lambda: hand.latest() is None, "it is old by now")
    node.send(replace(first, sample=1, capture_time_us=first.capture_time_us + 1))
    until_sample(hand, 1)
    assert hand.latest() is None
    assert hand.latest(hand.finger().node) is None
    numbers = count(2)

    def read_the_next() -> hostlink.Sample | None:
        """The next one when it is read: more of them could wait in a line, each older by then."""
        number = next(numbers)
        node.send(state(number))
        until_sample(hand, number)
        return hand.latest()

    until(read_the_next, "one that is new")


@pytest.mark.parametrize("age_s", [0.5, 3.0, 20.0, 86_400.0])
def test_an_old_stamp_of_the_kernel_is_kept(age_s: float) -> None:
    """As after a halt of the host on a bus: the first that is read is old, and its stamp says so."""
    channel = f"waited-{age_s}"
    with hostlink.connect(f"virtual:{channel}") as hand:
        bus = can.Bus(interface="virtual", channel=channel, preserve_timestamps=True)
        for k, waited_s in enumerate((age_s, age_s / 2, 0.0)):
            bus.send(message(0x183, pack_state(state(k, waited_s), k), time.time() - waited_s))
            until_sample(hand, k)
            fresh, (row,), sample = hand.latest(), Board(hand).rows(), present(hand.latest(max_age_s=None))
            assert sample.age_s >= waited_s
            assert sample.age_s == pytest.approx(waited_s, abs=SOON_S)
            assert fresh is None or waited_s < STALE_S
            assert row.state is None or waited_s < Board.STALE_S
        bus.shutdown()


@pytest.mark.parametrize("step_s", [-3600.0, 3600.0])
def test_a_clock_that_is_set_makes_no_sample_old(step_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A message stamped before the step is read after it."""
    arrival, message = Arrival(trusted=True), can.Message(timestamp=time.time())
    before_s = time.monotonic()
    assert before_s - SOON_S < arrival.time_s(message) <= time.monotonic()
    monkeypatch.setattr("hostlink.links.time.time", partial(lambda now: now() + step_s, time.time))
    assert arrival.time_s(message) >= before_s
    message.timestamp = time.time() - 5.0
    assert arrival.time_s(message) == pytest.approx(time.monotonic() - 5.0, abs=1.0)
    assert Arrival(trusted=False).time_s(message) >= before_s, "stamped by an adapter's clock"


def test_async_iterator_ends_with_the_link(pair: Pair) -> None:
    node, _, hand = pair

    async def read() -> list[int]:
        numbers: list[int] = []
        asyncio.get_running_loop().call_later(0.05, lambda: [node.send(state(k)) for k in range(4)])
        async for sample in hand:
            numbers.append(sample.state.sample)
            if len(numbers) == 4:
                asyncio.get_running_loop().run_in_executor(None, hand.close)
        return numbers

    assert asyncio.run(asyncio.wait_for(read(), SOON_S)) == [0, 1, 2, 3]


def test_a_finger_s_objects_can_be_read(pair: Pair) -> None:
    node, application, hand = pair
    node.send(state(0))
    finger = hand.finger()
    info = finger.info()
    assert info.serial_number == application.serial
    assert info.calibration_id == application.calibration_id
    finger.tare()
    application.touched = True
    with pytest.raises(hostlink.ObjectAborted, match="something touches the tip; let go"):
        finger.tare()
    finger.tare(force=True)
    assert application.tares == [False, True]
    finger.set_rate(100)
    assert finger.get("rate_hz") == 100
    file = json.dumps({"noise": os.urandom(750).hex()}).encode()
    finger.upload_calibration(file)
    assert application.calibration == file
    assert finger.calibration() == file
    application.no_calibration = "upload: models[0]: " + "why not, at length; " * 20
    with pytest.raises(hostlink.ObjectAborted) as refused:
        finger.upload_calibration(b'{"a": 1}')
    assert refused.value.reason == application.no_calibration
    assert str(refused.value).startswith("calibration: upload: models[0]: why not")
    finger.set_rate(50)
    assert finger.get("refusal") == ""


def test_emergencies_set_and_clear_faults(pair: Pair) -> None:
    node, _, hand = pair
    node.send(state(0))
    finger = hand.finger()
    node.report(FaultCode.OVERLOAD, True)
    node.report(FaultCode.PINS_LOST, True)
    until(lambda: set(finger.faults) == {FaultCode.OVERLOAD, FaultCode.PINS_LOST}, "both")
    node.report(FaultCode.OVERLOAD, False)
    until(lambda: set(finger.faults) == {FaultCode.PINS_LOST}, "one cleared")
    node.report(FaultCode.PINS_LOST, False)
    until(lambda: not finger.faults, "all cleared")


def test_stop_and_sync_from_the_host(pair: Pair) -> None:
    node, _, hand = pair
    node.send(state(0))
    finger = hand.finger()
    hand.nmt(2, finger.node)
    until(lambda: node.state == NmtState.STOPPED, "stopped")
    hand.nmt(1)
    until(lambda: node.state == NmtState.OPERATIONAL, "started")
    finger.set("tpdo1_transmission", 1)
    node.send(state(7))
    hand.sync()
    until_sample(hand, 7)


class LocalBus(OpenBus):
    """As SocketCAN's: what another program of the computer has sent is not marked as received."""

    def recv(self, timeout: float) -> can.Message | None:
        message = super().recv(timeout)
        if message is not None:
            message.is_rx = False
        return message

    def fileno(self) -> int:
        return 0


def test_samples_sent_on_the_same_computer_are_received(monkeypatch: pytest.MonkeyPatch) -> None:
    bus = partial(can.Bus, interface="virtual", channel="one-computer")
    monkeypatch.setattr("hostlink.links.open_can_bus", lambda address: LocalBus(bus(), address.interface))
    monkeypatch.setattr("hostlink.links._widen", lambda number: None)
    with bus() as sender, hostlink.connect("can:can0") as hand:
        sender.send(message(0x181, pack_state(State(sample=5), 0)))
        until(lambda: hand.latest(1) is not None, "a sample")


def test_line_lost_and_back(tmp_path: Path) -> None:
    pty = Ptys(tmp_path)
    received: list[hostlink.Sample] = []
    with node_at(f"serial:{pty.paths[0]}") as (node, _), hostlink.connect(f"serial:{pty.paths[1]}") as hand:
        hand.on_sample(received.append)
        assert node.send(state(0))
        until(lambda: len(received) == 1, "the first")
        pty.close()
        until(lambda: not node.send(state(1)) and not node.sink.up and not hand.up, "both ends notice")
        pty.open()
        until(lambda: node.sink.up and hand.up, "both ends are back")
        assert node.send(state(50))
        until(lambda: len(received) == 2, "the next")
        assert hand.reconnects == 1
    assert received[1].state.sample == 50
    assert received[1].lost_n > 0  # a gap, nothing old


def until_sample(hand: hostlink.Connection, number: int) -> None:
    until(lambda: (s := hand.latest(max_age_s=None)) is not None and s.state.sample == number, "the sample")


def test_another_version_under_an_absent_number_does_not_end_the_loops_of_others(
    wire: Wire, caplog: pytest.LogCaptureFixture
) -> None:
    hand = wire.hand
    for k in range(20):
        wire.send_foreign(1, k)
    until(lambda: 1 in hand.fingers and hand.fingers[1].mismatch, "the mismatch of the only one")
    with pytest.raises(hostlink.VersionMismatch, match=rf"version 9 .* version {VERSION} "):
        next(iter(hand))
    wire.send_state(1, state(0))
    until(lambda: not hand.fingers[1].mismatch, "a sample of our version")
    reader = hand.samples(timeout_s=SOON_S)
    got = []
    for k in range(1, 20):
        wire.send_foreign(7, k)
        wire.send(0x188, foreign_frame(0, DATA_ID))  # with a right CRC-16, again and again: noise, no version
        wire.send_state(1, state(k))
        got.append(next(reader).state.sample)
    assert got == list(range(1, 20))
    with pytest.raises(hostlink.VersionMismatch, match="finger 7 "):
        hand.latest(7)
    assert present(hand.latest(max_age_s=None)).finger == 1
    assert 8 not in hand.fingers
    assert "finger 7 speaks wire version 9" in caplog.text


def test_unexpected_errors_are_counted_and_logged_once(
    wire: Wire, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    receive = wire.hand._can.receive

    def fail_at_times(can_id: int, data: bytes, arrival_s: float) -> object:
        if can_id == 0x182:
            raise KeyError("capture_time_us")
        return receive(can_id, data, arrival_s)

    monkeypatch.setattr(wire.hand._can, "receive", fail_at_times)
    for k in range(50):
        wire.send_state(2, state(k))
        wire.send_state(1, state(k))
    until_sample(wire.hand, 49)
    assert wire.hand.unforeseen_n == 50
    assert caplog.text.count("unforeseen") == 1
    assert "KeyError: 'capture_time_us'" in caplog.text


def test_requesting_an_absent_finger_creates_none(wire: Wire) -> None:
    hand = wire.hand
    with pytest.raises(hostlink.LinkTimeout, match="no finger"):
        hand.finger(timeout_s=0.01)
    with pytest.raises(hostlink.UsageError, match=r"1\.\.127"):
        hand.finger(200)
    wire.send_state(1, state(0))
    until_sample(hand, 0)
    assert hand.latest(7) is None
    with pytest.raises(hostlink.LinkTimeout, match=r"finger 7 was not heard; finger 1 heard$"):
        hand.finger(7, timeout_s=0.0)
    assert set(hand.fingers) == {1}
    assert set(hand.statistics) == {1}
    assert hand.finger().node == 1
    wire.send_state(2, state(1))
    until_sample(hand, 1)
    with pytest.raises(hostlink.UsageError, match="name one"):
        hand.finger()


def test_another_canopen_device_is_no_finger(wire: Wire, request: pytest.FixtureRequest) -> None:
    """It has a heartbeat and an SDO server, and neither makes it a fingertip."""
    hand, ids = wire.hand, CanIds()

    def answer(message: can.Message) -> None:
        if message.arbitration_id == ids.of(Kind.SDO_REQUEST, 5):
            abort = b"\x80" + bytes(message.data[1:4]) + (0x06020000).to_bytes(4, "little")
            wire.send(ids.of(Kind.SDO_RESPONSE, 5), abort)

    with can.Bus(interface="virtual", channel=request.node.name) as bus:
        notifier = can.Notifier(bus, [answer], timeout=0.1)
        wire.send(ids.of(Kind.HEARTBEAT, 5), b"\x05")
        until(lambda: 5 in hand.silent_nodes, "its heartbeat is heard")
        assert hand.fingers == {}
        for node in (None, 5):
            with pytest.raises(hostlink.LinkTimeout):
                hand.finger(node, timeout_s=0.3)
        row = Board(hand).rows()[0]
        assert (row.finger, row.problem) == (5, "a heartbeat alone: perhaps no fingertip")
        wire.send_state(3, state(0))
        assert hand.finger().node == 3
        assert set(hand.fingers) == {3}
        notifier.stop()


@pytest.mark.parametrize("heartbeat_ms", [20, 0])
def test_a_stopped_finger_is_found(request: pytest.FixtureRequest, heartbeat_ms: int) -> None:
    """After an NMT command it sends its heartbeat alone; without one it answers whoever knows its number."""
    bus = f"virtual:{request.node.name}"
    with node_at(f"{bus}?node=4") as (node, application):
        with hostlink.connect(bus) as hand:
            hand.finger(4).set("heartbeat_ms", heartbeat_ms)
            hand.nmt(128)
            until(lambda: node.state == NmtState.PRE_OPERATIONAL, "it sends no samples")
        with hostlink.connect(bus) as hand:
            assert hand.fingers == {}
            assert hand.finger(None if heartbeat_ms else 4).info().serial_number == application.serial
            assert hand.finger() is hand.finger(4)
            assert set(hand.fingers) == {4}


def test_a_line_is_for_one_program_and_its_finger_has_one_number(tmp_path: Path) -> None:
    pty = Ptys(tmp_path)
    edge, host = (f"serial:{path}" for path in pty.paths)
    with node_at(edge) as (_, application), hostlink.connect(f"{host}?node=3") as hand:
        assert hand.finger(3).info().serial_number == application.serial
        with pytest.raises(hostlink.UsageError, match=r"has number 3; \?node=1"):
            hand.finger(1)
        assert set(hand.fingers) == {3}
        for kind in ("serial", "slcan"):
            with pytest.raises(hostlink.ConnectError, match="another program has it open; end that program"):
                hostlink.connect(f"{kind}:{pty.paths[1]}")
            with pytest.raises(SinkError, match="another program has it open; end that program"):
                open_sink(f"{kind}:{pty.paths[0]}")
    hostlink.connect(host).close()  # free again
    pty.close()


def test_tare_waits_for_its_outcome(pair: Pair) -> None:
    node, application, hand = pair
    node.send(state(0))
    finger = hand.finger()
    application.busy_for_n = 3
    assert finger.tare().state is RestFrameState.ACCEPTED
    assert application.busy_for_n < 0, "it was asked until it was known"
    application.outcome = RestFrameOutcome(
        RestFrameState.REFUSED, RestFrameReason.TOUCHED, "12 pins are pressed"
    )
    with pytest.raises(hostlink.RestFrameRefused, match=r"^tare refused: 12 pins are pressed") as error:
        finger.tare()
    assert error.value.reason is RestFrameReason.TOUCHED
    application.outcome = RestFrameOutcome(RestFrameState.REFUSED, RestFrameReason.OTHER_TIP)
    with pytest.raises(hostlink.RestFrameRefused, match="calibration refused: the pins are not those of the"):
        finger.upload_calibration(b"{}")
    application.outcome = RestFrameOutcome(
        RestFrameState.FORCED, RestFrameReason.UNSTEADY, "pins moved by 2 px"
    )
    assert finger.tare(force=True) == application.outcome
    application.outcome = RestFrameOutcome(RestFrameState.BUSY)
    with pytest.raises(hostlink.LinkTimeout, match="no outcome of the tare"):
        finger.tare(timeout_s=0.01)
    application.outcome = RestFrameOutcome(RestFrameState.UNKNOWN)
    with pytest.raises(hostlink.LinkError, match="cannot say what became of it"):
        finger.tare()


def test_round_trip_bounds_the_clock_without_assumptions(pair: Pair) -> None:
    node, _, hand = pair
    node.send(state(0))
    finger = hand.finger()
    finger.clock._transit_s = 100.0 * SOON_S  # as if nothing were known of the link
    finger.sync_clock()
    sent = state(1)
    node.send(sent)
    until_sample(hand, 1)
    sample = present(hand.latest(max_age_s=None))
    assert sample.host_error_s < SOON_S / 2  # half the round trip at the most, not what was assumed
    # Both ends share this machine's clock, so the truth is known.
    assert abs(sample.host_time_s - sent.capture_time_us * 1e-6) <= sample.host_error_s + ROUNDING_S


def test_a_slow_reader_loses_the_oldest_and_counts_it(wire: Wire) -> None:
    hand = wire.hand
    reader = hand.samples(timeout_s=SOON_S)
    threading.Timer(0.05, wire.send_state, (1, State(sample=0))).start()
    assert next(reader).state.sample == 0
    for number in range(1, QUEUE + 11):
        wire.send_state(1, State(sample=number))
    until(lambda: hand.finger(1).statistics.received_n == QUEUE + 11, "all came")
    until(lambda: hand.unread_n == 10, "ten are gone")
    assert next(reader).state.sample == 11
    assert hand.statistics[1].lost_n == 0  # lost by the reader, not by the link
