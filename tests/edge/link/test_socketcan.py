"""CAN frames of the kernel, with python-can as oracle: on a local socket, and on vcan0 where there is one."""

import socket
import threading
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

import can
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame, dissect_can_frame

from edge.link.medium import CAN_ERR_BUSOFF, CAN_ERR_RESTARTED, CanFrame, MediumFull
from edge.link.sinks import CanFdSink
from edge.link.socketcan import SocketCanMedium, open_socket
from hostlink.wire import FaultCode, State, unpack_state
from tests.support.waiting import SOON_S, until

FRAMES = [
    CanFrame(0x181, bytes(range(64)), fd=True),
    CanFrame(0x481, bytes(range(12)), fd=True),
    CanFrame(0x701, b"\5"),
    CanFrame(0x7FF, b"12345678"),
    CanFrame(0x080, b""),
]


def as_python_can(frame: CanFrame, **more: bool) -> can.Message:
    return can.Message(
        arbitration_id=frame.can_id, data=frame.data, is_fd=frame.fd, bitrate_switch=frame.fd,
        **({"is_extended_id": False} | more),
    )  # fmt: skip


class Bus:
    """A medium, and the other end of its socket."""

    def __init__(self, carrier: Path) -> None:
        self.ours, self.kernel = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.ours.setblocking(False)
        self.carrier = carrier
        self.medium = SocketCanMedium(self.ours, carrier)

    def error(self, kind: int) -> None:
        self.kernel.send(build_can_frame(can.Message(arbitration_id=kind, is_error_frame=True)))


@pytest.fixture
def bus(tmp_path: Path) -> Iterator[Bus]:
    bus = Bus(tmp_path / "carrier")
    yield bus
    bus.medium.close()
    bus.kernel.close()


@pytest.mark.parametrize("frame", FRAMES, ids=lambda frame: f"{frame.can_id:x}")
def test_frames_are_the_kernels(bus: Bus, frame: CanFrame) -> None:
    bus.medium.write(frame)
    written = bus.kernel.recv(128)
    # Behind the flags are bytes that only receivers of other protocols look at.
    theirs = build_can_frame(as_python_can(frame))
    assert len(written) == len(theirs)
    assert dissect_can_frame(written)[::3] == dissect_can_frame(theirs)[::3] == (frame.can_id, frame.data)
    if frame.fd:
        assert written[5] == theirs[5]  # FD, second bit rate
    bus.kernel.send(theirs)
    assert bus.medium.read(SOON_S) == frame
    assert bus.medium.read(0.0) is None


@pytest.mark.parametrize("more", [{"is_extended_id": True}, {"is_remote_frame": True}])
def test_frames_that_no_node_listens_to_are_dropped(bus: Bus, more: dict[str, bool]) -> None:
    bus.kernel.send(build_can_frame(as_python_can(FRAMES[2], **more)))
    assert bus.medium.read(SOON_S) is None


def test_a_reader_woken_for_an_error_that_a_writer_got_does_not_block(
    bus: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kernel reports once that an interface is down; a reader after that must not block the link."""
    monkeypatch.setattr("select.select", lambda *_: ([bus], [], []))
    late = threading.Timer(SOON_S, bus.kernel.close)  # ends the wait of a blocking reader with an error
    late.start()
    assert bus.medium.read(0.01) is None
    late.cancel()


def test_a_full_buffer_keeps_the_medium(bus: Bus) -> None:
    with suppress(BlockingIOError):
        while bus.ours.send(bytes(72)):
            pass
    with pytest.raises(MediumFull):
        bus.medium.write(FRAMES[0])
    assert len(bus.kernel.recv(128)) == 72
    bus.medium.write(FRAMES[0])


def test_a_bus_that_is_gone_is_an_error(bus: Bus) -> None:
    bus.kernel.close()
    with pytest.raises(SocketCanMedium.broken):
        bus.medium.write(FRAMES[0])
    with pytest.raises(SocketCanMedium.broken):
        bus.medium.read(SOON_S)
    bus.medium.close()
    with pytest.raises(SocketCanMedium.broken):
        bus.medium.read(SOON_S)


def test_bus_off_lasts_until_the_carrier_is_back(bus: Bus) -> None:
    bus.carrier.write_text("0\n")
    with closing(CanFdSink("kernel", lambda: bus.medium)) as sink:
        bus.error(CAN_ERR_BUSOFF)
        until(lambda: sink.faults == {FaultCode.BUS_OFF}, "bus-off")
        assert not sink.send(State(sample=0))  # the kernel would take it, and discard it
        assert sink.faults == {FaultCode.BUS_OFF}
        bus.carrier.write_text("1\n")
        until(lambda: sink.send(State(sample=1)), "carrier")
        assert sink.faults == frozenset()
        assert unpack_state(dissect_can_frame(bus.kernel.recv(128))[3]).sample == 1


def test_an_error_frame_is_known_by_its_flag_and_a_restart_ends_bus_off(bus: Bus) -> None:
    bus.kernel.send(build_can_frame(as_python_can(CanFrame(CAN_ERR_BUSOFF, bytes(8)))))
    assert bus.medium.read(SOON_S) == CanFrame(CAN_ERR_BUSOFF, bytes(8))
    assert not bus.medium.bus_off
    assert dissect_can_frame(build_can_frame(can.Message(is_error_frame=True)))[0] & socket.CAN_ERR_FLAG
    bus.carrier.write_text("0\n")
    for kind, is_off in ((CAN_ERR_BUSOFF, True), (CAN_ERR_RESTARTED, False)):
        bus.error(kind)
        assert bus.medium.read(SOON_S) is None
        assert bus.medium.bus_off is is_off


@pytest.fixture
def host() -> Iterator[can.BusABC]:
    """An interface of the kernel; docs/firmware.md says how to make one."""
    if not Path("/sys/class/net/vcan0").exists():
        pytest.skip("no interface vcan0")
    with can.Bus(interface="socketcan", channel="vcan0", fd=True) as bus:
        yield bus


def test_the_kernel_passes_on_what_is_wanted(host: can.BusABC) -> None:
    with closing(open_socket("vcan0", True, (0x000, 0x601))) as medium:
        for can_id in (0x600, 0x602, 0x181):
            host.send(as_python_can(CanFrame(can_id, b"1")))
        host.send(as_python_can(CanFrame(0x601, b"2"), is_extended_id=True))
        host.send(as_python_can(CanFrame(0x601, b""), is_remote_frame=True))
        host.send(as_python_can(CanFrame(0x181, bytes(64), fd=True)))
        wanted = [CanFrame(0x601, b"3"), CanFrame(0x000, b"4")]
        for frame in wanted:
            host.send(as_python_can(frame))
        assert [medium.read(SOON_S) for _ in wanted] == wanted
        assert medium.read(0.0) is None


def test_a_node_in_classic_frames_does_not_see_fd(host: can.BusABC) -> None:
    with closing(open_socket("vcan0", False, (0x601,))) as medium:
        host.send(as_python_can(CanFrame(0x601, bytes(64), fd=True)))
        host.send(as_python_can(CanFrame(0x601, b"5")))
        assert medium.read(SOON_S) == CanFrame(0x601, b"5")
