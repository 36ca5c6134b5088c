"""slcan adapters over ptys, with noise; drivers and callbacks that raise anything; addresses."""

import os
import sys
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path

import can
import pytest
from can.interfaces.virtual import VirtualBus
from hypothesis import given, settings
from hypothesis import strategies as st

import hostlink
from hostlink import can_bus, links
from hostlink.can_bus import open_can_bus
from hostlink.wire.address import Address, parse_address
from tests.edge.link.test_node import UNFORESEEN
from tests.support.fingers import make_node, node_at, state
from tests.support.media import Trouble
from tests.support.ptys import Ptys
from tests.support.states import as_seen
from tests.support.waiting import SOON_S, until


class Adapters(Ptys):
    """Two slcan adapters on one imagined bus: what one sends, the other receives.

    Speaks what python-can's slcan does: S, Y, O, C; t (classic), d and b (FD without, with rate switch).
    """

    def __init__(self, directory: Path) -> None:
        self.commands: list[list[str]] = [[], []]
        self._begun = [b"", b""]
        super().__init__(directory)

    def carry(self, k: int, data: bytes) -> None:
        *lines, self._begun[k] = (self._begun[k] + data).split(b"\r")
        for text in lines:
            if text[:1] in (b"t", b"d", b"b"):
                super().carry(k, text + b"\r")
            else:
                self.commands[k].append(text.decode())

    def noise(self, data: bytes) -> None:
        """Both adapters give these bytes."""
        for master in self.masters:
            os.write(master, data)


@pytest.fixture
def adapters(tmp_path: Path) -> Iterator[Adapters]:
    with closing(Adapters(tmp_path)) as adapters:
        yield adapters


@pytest.mark.parametrize(
    ("options", "reported"),
    [("bitrate=1000000", ["S8"]), ("fd=1&bitrate=1000000&dbitrate=5000000", ["S8", "Y5"])],
)
def test_slcan_carries_samples_and_objects(adapters: Adapters, options: str, reported: list[str]) -> None:
    edge, host = (f"slcan:{path}?{options}" for path in adapters.paths)
    received: list[hostlink.Sample] = []
    with node_at(f"{edge}&node=9") as (node, application), hostlink.connect(host) as hand:
        hand.on_sample(received.append)
        sent = [state(k) for k in range(30)]
        for s in sent:
            assert node.send(s)
            assert node.drain(SOON_S)
        until(lambda: len(received) == 30, "all samples")
        assert [h.state for h in received] == [as_seen(s) for s in sent]
        assert hand.finger(9).info().serial_number == application.serial
    for commands in adapters.commands:
        assert [c for c in commands if c[:1] in ("S", "Y")] == reported


NOISE = [
    b"\xff", b"\xff\r", b"\x80\xfe\r\x07\r\r", b"t", b"t1\r", b"t18", b"tzzz8\r", b"t1018AB\r", b"tFFF0\r",
    b"t-010\r", b"t1019" + b"00" * 9 + b"\r", b"T1FFFF\r", b"TFFFFFFFF0\r", b"b183F\r", b"bxF\r", b"d101?\r",
    b"r\r", b"x\r", b"R1\r", b"z" * 3000, b"\xc3" * 3000, bytes(range(256)) * 8,
]  # fmt: skip


def test_noise_of_an_adapter_costs_its_line_alone(adapters: Adapters) -> None:
    edge, host = (f"slcan:{path}?fd=1&dbitrate=5000000&node=9" for path in adapters.paths)
    received: list[int] = []
    with node_at(edge) as (node, application), hostlink.connect(host) as hand:
        hand.on_sample(lambda sample: received.append(sample.state.sample))

        def both_hear(sample: int) -> bool:
            node.send(state(sample))
            return received[-1:] == [sample]

        for k, noise in enumerate(NOISE):
            adapters.noise(noise)
            until(partial(both_hear, k), f"a sample after {noise!r}")
            hand.sync()  # the edge's line that the noise began ends here
            assert hand.finger(9).get("serial_number") == application.serial, noise
        assert (hand.reconnects, node.counters.reconnects, hand.unforeseen_n) == (0, 0, 0)
        adapters.noise(b"t1018A\r" * can_bus.JUNK_LINES)
        until(lambda: both_hear(99) and hand.reconnects and node.counters.reconnects, "both reopened")
        assert hand.finger(9).get("serial_number") == application.serial


hexadecimal = st.text("0123456789ABCDEFg- _", max_size=30)
lines = st.one_of(
    st.binary(max_size=300),
    st.builds(lambda kind, rest: (kind + rest).encode(), st.sampled_from("tTrRdDbBxVNzZ"), hexadecimal),
)


@pytest.mark.generative
@given(st.lists(lines, max_size=20))
@settings(max_examples=200)
def test_any_lines_of_an_adapter_are_frames_or_are_counted(noise: list[bytes]) -> None:
    bus = open_can_bus(parse_address("slcan:loop://"))
    port = bus._bus.serialPortOrig
    for line in noise:
        port.write(line + b"\r")
        while port.in_waiting:
            message = bus.recv(0.0)
            assert message is None or message.is_remote_frame or len(message.data) == message.dlc
    port.write(b"\rt1232AB01\r")
    found = [bus.recv(0.0) for _ in range(3)]
    assert [(m.arbitration_id, bytes(m.data)) for m in found if m] == [(0x123, b"\xab\x01")]
    bus.shutdown()


class Troubled(VirtualBus):
    """A bus with a driver that raises anything, once, in one of its calls."""

    def __init__(self, channel: str, trouble: Trouble) -> None:
        super().__init__(channel=channel)
        self._call = trouble.call

    def recv(self, timeout: float | None = None) -> can.Message | None:
        self._call("recv")
        return super().recv(timeout)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self._call("send")
        super().send(msg, timeout)

    def shutdown(self) -> None:
        super().shutdown()
        self._call("shutdown")


@pytest.mark.parametrize("where", ["recv", "send", "open", "shutdown"])
@pytest.mark.parametrize("error", UNFORESEEN, ids=repr)
def test_whatever_a_driver_raises_the_link_comes_back(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, where: str, error: BaseException
) -> None:
    if where == "send" and isinstance(error, SystemExit):
        pytest.skip("the user's own thread sends, and may end")
    channel, trouble = request.node.name, Trouble()

    def opener(address: Address) -> can_bus.OpenBus:
        trouble.call("open")
        return can_bus.OpenBus(Troubled(channel, trouble), "virtual")

    monkeypatch.setattr(links, "open_can_bus", opener)
    at = f"virtual:{channel}"
    with node_at(f"{at}?node=9") as (node, application), hostlink.connect(at) as hand:
        if where in ("open", "shutdown"):
            trouble["recv"] = OSError("unplugged")
        trouble[where] = error
        if where == "send":
            with pytest.raises(hostlink.LinkDown):
                hand.sync()
        until(lambda: not trouble and hand.reconnects == 1, "the link is back")
        until(lambda: node.send(state(1)) and hand.latest(9) is not None, "a sample")
        assert hand.finger(9).get("serial_number") == application.serial
        foreseen = where in ("open", "shutdown") and isinstance(error, Exception)
        assert hand.unforeseen_n == (not foreseen)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems keep groups apart by themselves")
@pytest.mark.parametrize("buses", [("239.0.0.1", "239.0.0.2"), ("ff11::7:1", "ff11::7:2")])
def test_udp_buses_of_one_machine_are_apart(buses: tuple[str, str]) -> None:
    other, own = (
        make_node(f"udp:{group}?ttl=0&node={node}&port=43117")[0] for node, group in enumerate(buses, 8)
    )
    with hostlink.connect(f"udp:{buses[1]}?port=43117") as hand:
        until(lambda: other.send(state(1)) and own.send(state(1)) and 9 in hand.fingers, "a sample")
        assert list(hand.fingers) == [9]
    other.close()
    own.close()


@pytest.mark.parametrize("kind", ["on_sample", "on_raw", "on_detail"])
def test_a_callback_may_exit_or_ask_and_the_link_goes_on(request: pytest.FixtureRequest, kind: str) -> None:
    """`sys.exit()` ends nothing; what waits for the finger is refused at once, in one line."""
    bus = f"virtual:{request.node.name}"
    refused, failed = list[str](), list[object]()
    ended, received = list[hostlink.Sample](), list[hostlink.Sample]()
    with node_at(f"{bus}?node=9") as (node, _), hostlink.connect(bus) as hand:

        def fail(*what: object) -> None:
            failed.append(what)
            raise RuntimeError("of its own making")

        def ask(*what: object) -> None:
            for wait in (
                lambda: hand.finger(9).get("serial_number"),
                lambda: hand.finger(9).tare(),
                lambda: hand.finger(77),
                lambda: next(hand.samples()),
            ):
                with pytest.raises(hostlink.UsageError) as caught:
                    wait()
                refused.append(str(caught.value))

        getattr(hand, kind)(lambda *what: sys.exit("done"))
        end_failing = getattr(hand, kind)(fail)
        end = hand.on_sample(ended.append)
        until(lambda: node.send(state(0)) and hand.latest(9) is not None and ended, "the finger")
        end()
        getattr(hand, kind)(ask)
        hand.on_sample(received.append)
        hand.finger(9).set("detail_divider", 1)
        detail = [(0.0, 0.0, 0.0)]
        until(lambda: node.send(state(1)) and node.send_detail(1, detail) and len(refused) >= 4, "asked")
        received.clear()
        until(lambda: node.send(state(2)) and received, "a sample")
        assert hand.up
        assert hand.reconnects == 0
        end_failing()  # that it has ended already is no error
        assert len(failed) == 1 or kind == "on_sample", "one that fails is removed"
    assert {sample.state.sample for sample in ended} == {0}, "after its end it is called no more"
    assert {message.count("\n") for message in refused} == {0}
    assert "callback" in refused[0]


@pytest.mark.parametrize(
    ("text", "arguments"),
    [
        ("can:can0", {"interface": "socketcan", "channel": "can0", "fd": True}),
        ("can:can0?fd=0", {"interface": "socketcan", "channel": "can0", "fd": False}),
        ("virtual:a?fd=0", {"interface": "virtual", "channel": "a"}),
        (
            "can:PCAN_USBBUS1?interface=pcan&bitrate=500000&fd=0",
            {"interface": "pcan", "channel": "PCAN_USBBUS1", "fd": False, "bitrate": 500_000},
        ),
        (
            "udp:239.0.0.1",
            {"interface": "udp_multicast", "channel": "239.0.0.1", "port": 43113, "hop_limit": 0, "fd": True},
        ),
    ],
)
def test_addresses_open_their_links(text: str, arguments: dict[str, object]) -> None:
    assert parse_address(text).bus_arguments() == arguments


def test_addresses_of_lines() -> None:
    address = parse_address("serial:socket://10.0.0.1:700?baud=115200&node=4")
    assert (address.channel, address.baud, address.node) == ("socket://10.0.0.1:700", 115_200, 4)
    assert not address.is_can
    assert parse_address("slcan:/dev/ttyACM0").fd is False
    assert parse_address("can:c?interface=kvaser&dbitrate=2000000").fd_timing() == (1_000_000, 2_000_000)
    assert parse_address("can:c?dbitrate=2000000").fd_timing() is None, "the system configures SocketCAN"
    assert parse_address("can:a?").channel == "a", "nothing asked, nothing wrong"
    assert parse_address("udp:ff15::5").channel == "ff15::5"
