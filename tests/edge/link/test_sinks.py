"""Sinks: sending, dropping and counting when the medium fails or is flooded, without blocking the loop."""

import errno
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import can
import pytest
from can.interfaces.virtual import VirtualBus

from edge.link.link_sink import ReadBudget
from edge.link.medium import CanFrame, MediumError
from edge.link.params import PARAMS
from edge.link.python_can import CanMedium
from edge.link.sinks import CanFdSink, SerialSink, open_sink
from hostlink.can_bus import OpenBus
from hostlink.wire import FaultCode, State, unpack_state
from hostlink.wire.serial import decode_frame
from tests.support.fingers import state
from tests.support.ptys import Ptys
from tests.support.waiting import SOON_S, until


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return f"bus-{request.node.name}"


class Flaky:
    """Opens virtual buses of one interface, which can be taken down, filled up or made to hang.

    trouble  number of the error that each write raises until it is opened anew
    free     cleared: writes do not return
    """

    def __init__(self, channel: str, instant: bool = True) -> None:
        self.channel, self.instant = channel, instant
        self.down, self.trouble, self.opened_n = False, 0, 0
        self.free = threading.Event()
        self.free.set()

    def __call__(self) -> CanMedium:
        if self.down:
            raise MediumError("no such device")
        self.trouble, self.opened_n = 0, self.opened_n + 1
        bus = VirtualBus(channel=self.channel)
        bus.send = partial(self._send, bus.send)  # type: ignore[method-assign]  # fails on demand
        return CanMedium(bus, self.instant)

    def _send(self, send: Callable[..., None], *arguments: Any, **options: Any) -> None:
        self.free.wait()
        if self.trouble:
            raise can.CanOperationError("Failed to transmit", self.trouble)
        send(*arguments, **options)


@pytest.fixture
def flaky(channel: str) -> Flaky:
    return Flaky(channel)


@pytest.fixture
def fd_sink(flaky: Flaky) -> Iterator[CanFdSink]:
    with closing(CanFdSink("flaky", flaky)) as sink:
        yield sink


@pytest.fixture
def slow(channel: str) -> Iterator[tuple[Flaky, CanFdSink]]:
    """A bus whose writes may take their time, and its sink."""
    flaky = Flaky(channel, instant=False)
    with closing(CanFdSink("slow", flaky)) as sink:
        yield flaky, sink
        flaky.free.set()


class Reports:
    """What a sink reports of its faults, one after the other."""

    def __init__(self, sink: CanFdSink) -> None:
        self._reported: list[frozenset[FaultCode]] = []
        sink.on_faults = lambda: self._reported.append(sink.faults)

    def wait(self, *faults: FaultCode) -> None:
        """Until these are what was reported last."""
        until(lambda: self._reported[-1:] == [frozenset(faults)], f"{faults} to be reported")


def test_interface_down_and_back(channel: str, flaky: Flaky, fd_sink: CanFdSink) -> None:
    with can.Bus(interface="virtual", channel=channel) as host:
        assert fd_sink.send(state(0))
        flaky.down = True
        flaky.trouble = errno.ENETDOWN
        for k in range(1, 20):
            assert not fd_sink.send(state(k))
        assert not fd_sink.up
        assert fd_sink.faults == {FaultCode.LINK_DOWN}
        assert fd_sink.counters.dropped == 19
        flaky.down = False
        until(lambda: fd_sink.send(state(20)), "the link is back")
        assert fd_sink.up
        received = [host.recv(SOON_S) for _ in range(2)]
    assert [unpack_state(bytes(m.data)).sample for m in received if m] == [0, 20]
    assert fd_sink.counters.reconnects == 1
    assert fd_sink.faults == frozenset()


def test_full_buffer_drops_and_keeps_the_bus(
    flaky: Flaky, fd_sink: CanFdSink, monkeypatch: pytest.MonkeyPatch
) -> None:
    reports = Reports(fd_sink)
    flaky.trouble = errno.ENOBUFS
    until(lambda: not (fd_sink.send(state(1)) or fd_sink.up), "drops for long are a lost link")
    flaky.trouble = 0
    assert fd_sink.send(state(2))
    assert fd_sink.up
    flaky.trouble = errno.ENOBUFS
    fd_sink.post(CanFrame(0x85, bytes(8)))  # an emergency: the stall is reported without further samples
    reports.wait(FaultCode.LINK_DOWN)
    flaky.trouble = 0
    fd_sink.post(CanFrame(0x85, bytes(8)))
    reports.wait()
    assert flaky.opened_n == 1
    assert fd_sink.counters.reconnects == 0
    monkeypatch.setattr("edge.link.link_sink.PARAMS", replace(PARAMS, stall_s=SOON_S))
    with closing(CanFdSink("patient", flaky)) as patient:
        flaky.trouble = errno.ENOBUFS
        assert not patient.send(state(3))
        assert patient.up  # one full buffer is no lost link


def test_bus_off_is_reported_by_the_link(channel: str, fd_sink: CanFdSink) -> None:
    reports = Reports(fd_sink)
    with can.Bus(interface="virtual", channel=channel) as host:
        host.send(can.Message(is_error_frame=True, arbitration_id=0x40))
        reports.wait(FaultCode.BUS_OFF)
        assert fd_sink.send(state(1))
        assert fd_sink.faults == frozenset()
        reports.wait()


def test_a_blocked_medium_does_not_block_the_loop(channel: str, slow: tuple[Flaky, CanFdSink]) -> None:
    flaky, sink = slow
    reports = Reports(sink)
    with can.Bus(interface="virtual", channel=channel) as host:
        flaky.free.clear()
        results = [sink.send(state(k)) for k in range(100)]  # would never end if it waited
        reports.wait(FaultCode.LINK_DOWN)  # a write that does not end is a lost link
        assert not sink.up
        flaky.free.set()
        assert sink.drain(SOON_S)
        reports.wait()
        samples = []
        while (message := host.recv(0.05)) is not None:
            samples.append(unpack_state(bytes(message.data)).sample)
    assert samples[-4:] == [96, 97, 98, 99]  # newest wins
    assert len(samples) <= 5
    assert results.count(False) == sink.counters.dropped == 100 - len(samples)
    assert sink.counters.sent == len(samples)


def test_answers_overtake_samples_and_detail_waits(channel: str, slow: tuple[Flaky, CanFdSink]) -> None:
    flaky, sink = slow

    def detail_taken() -> bool:
        return sink.post_spaced("detail", [sink.encode_detail(bytes(64))], 0.0)

    with can.Bus(interface="virtual", channel=channel) as host:
        flaky.free.clear()
        sink.send(state(0))
        until(lambda: sink._writing_since_s, "the worker writes")
        assert [detail_taken(), detail_taken()] == [True, False]
        sink.send(state(1))
        sink.post(CanFrame(0x581, b"answer"))
        assert not detail_taken()
        flaky.free.set()
        ids = [m.arbitration_id for m in (host.recv(SOON_S) for _ in range(4)) if m]
        assert sink.drain(SOON_S)
        until(lambda: sink.counters.detail_sent == 1, "detail counted")
    assert ids == [0x181, 0x581, 0x181, 0x481]
    assert sink.counters.detail_skipped == 2


def test_a_sample_that_is_encoded_while_the_line_is_lost_is_dropped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That both ends come back: `test_line_lost_and_back` of the host."""
    pty = Ptys(tmp_path)
    with closing(open_sink(f"serial:{pty.paths[0]}")) as sink:
        assert isinstance(sink, SerialSink)
        encode = sink.encode

        def lose_meanwhile(sample: State, counter: int) -> Sequence[Any]:
            pty.close()
            until(lambda: sink._medium is None, "the loss is noticed")
            return encode(sample, counter)

        monkeypatch.setattr(sink, "encode", lose_meanwhile)
        assert not sink.send(state(0))
        assert not sink.up
        assert sink.counters.dropped == 1


def test_line_that_nobody_reads_is_full_not_fatal(tmp_path: Path) -> None:
    pty, numbers, seen = Ptys(tmp_path), count(), list[int]()
    with closing(open_sink(f"serial:{pty.paths[0]}")) as sink:
        assert isinstance(sink, SerialSink)
        until(lambda: sink.send(state(next(numbers))) and sink.counters.dropped, "the buffer is full")
        oldest = next(numbers) - 2000  # a pty holds 4 kB, 60 frames; its contents were discarded
        reader = os.open(pty.paths[1], os.O_RDONLY | os.O_NONBLOCK)

        def newest_arrives() -> bool:
            sink.send(state(next(numbers)))
            with suppress(BlockingIOError):
                blocks = os.read(reader, 65536).split(b"\0")
                frames = [decode_frame(b) for b in blocks if len(b) == 70]
                seen.extend(unpack_state(f[1]).sample for f in frames)
            return len(seen) > 200

        until(newest_arrives, "samples flow again")
        until(lambda: sink.up, "and the link is up")
    os.close(reader)
    pty.close()
    assert seen == sorted(seen)
    assert seen[0] > oldest


def test_detail_is_spaced_by_what_a_frame_takes(channel: str) -> None:
    for address, frame_s in (
        ("serial:loop://?baud=115200", 72 * 10 / 115_200),
        (f"virtual:{channel}?bitrate=500000&dbitrate=2000000", 405.5e-6),
    ):
        with closing(open_sink(address)) as sink:
            assert isinstance(sink, SerialSink | CanFdSink)
            assert sink.frame_s(64) == pytest.approx(frame_s)


def failing(interface: str, error: Exception, cause: Exception | None) -> OpenBus:
    """A bus whose `recv` raises."""
    error.__cause__ = cause
    return OpenBus(Mock(recv=Mock(side_effect=error)), interface)


def test_a_datagram_without_a_frame_is_counted_and_dropped() -> None:
    error = can.CanOperationError("could not unpack received message")
    bus = failing("udp_multicast", error, ValueError("extra data"))
    medium = CanMedium(bus, instant=True)
    assert [medium.read(0.0) for _ in range(1000)] == [None] * 1000
    assert bus.junk_n == 1000


@pytest.mark.parametrize(
    ("interface", "cause"),
    [
        ("udp_multicast", OSError("the interface went down")),
        ("udp_multicast", None),
        ("slcan", OSError("the adapter was unplugged")),
        ("slcan", ValueError("the descriptor is closed")),
        ("pcan", ValueError("a driver's own error, which no datagram caused")),
        ("kvaser", IndexError("the same")),
    ],
)
def test_a_failed_bus_is_not_counted_as_junk(interface: str, cause: Exception | None) -> None:
    bus = failing(interface, can.CanOperationError("failed"), cause)
    with pytest.raises(CanMedium.broken):
        CanMedium(bus, instant=True).read(0.0)
    assert bus.junk_n == 0


@pytest.mark.parametrize("cost_s", [20e-6, 100e-6, 1e-3])
def test_a_reader_that_never_waits_is_throttled_to_its_share(cost_s: float) -> None:
    """Simulated: endless messages, each with this processor time."""
    now_s = cpu_s = 0.0
    budget = ReadBudget(cpu_s, now_s)
    while now_s < 10.0:
        now_s, cpu_s = now_s + cost_s, cpu_s + cost_s
        now_s += budget.pause_s(cpu_s, now_s)
    assert cpu_s / now_s < 1.2 * PARAMS.read_rel


def test_a_reader_that_mostly_waits_is_not_throttled() -> None:
    budget, now_s, cpu_s = ReadBudget(0.0, 0.0), 0.0, 0.0
    for _ in range(5000):
        now_s, cpu_s = now_s + 400e-6, cpu_s + 80e-6  # an upload: a segment, its answer, and waiting
        assert budget.pause_s(cpu_s, now_s) == 0.0
