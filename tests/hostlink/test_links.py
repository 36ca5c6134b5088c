"""slcan adapters over ptys, classic and FD; addresses; modules that `import hostlink` does not load."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import threading
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

import hostlink
from edge.errors import SinkError
from edge.link.sinks import open_sink
from hostlink.wire import pack_state, unpack_state
from hostlink.wire.address import AddressError, parse_address
from tests.hostlink.test_client import make_node, state
from tests.support.waiting import SOON_S, until


class Adapters:
    """Two slcan adapters on one imagined bus: what one sends, the other receives.

    Speaks what python-can's slcan does: S, Y, O, C; t (classic), d and b (FD without, with rate switch).
    """

    def __init__(self, directory: Path) -> None:
        self.paths = [directory / "edge", directory / "host"]
        self.commands: list[list[str]] = [[], []]
        self._masters, self._slaves = [], []
        for path in self.paths:
            master, slave = os.openpty()
            tty.setraw(slave)
            path.symlink_to(os.ttyname(slave))
            self._masters.append(master)
            self._slaves.append(slave)
        self._wake, self._stop = os.pipe()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        buffers = [b"", b""]
        while True:
            ready, _, _ = select.select([*self._masters, self._wake], [], [])
            if self._wake in ready:
                return
            for k in range(2):
                if self._masters[k] not in ready:
                    continue
                *lines, buffers[k] = (buffers[k] + os.read(self._masters[k], 65536)).split(b"\r")
                for text in lines:
                    if text[:1] in (b"t", b"d", b"b"):
                        os.write(self._masters[1 - k], text + b"\r")
                    else:
                        self.commands[k].append(text.decode())

    def close(self) -> None:
        os.close(self._stop)
        self._thread.join()
        for number in (*self._masters, *self._slaves, self._wake):
            os.close(number)


@pytest.fixture
def adapters(tmp_path: Path) -> Iterator[Adapters]:
    adapters = Adapters(tmp_path)
    yield adapters
    adapters.close()


@pytest.mark.parametrize(
    ("options", "reported"),
    [("bitrate=1000000", ["S8"]), ("fd=1&bitrate=1000000&dbitrate=5000000", ["S8", "Y5"])],
)
def test_slcan_carries_samples_and_objects(adapters: Adapters, options: str, reported: list[str]) -> None:
    edge, host = (f"slcan:{path}?{options}" for path in adapters.paths)
    node, application = make_node(f"{edge}&node=9")
    received: list[hostlink.Sample] = []
    with hostlink.connect(host) as hand:
        hand.on_sample(received.append)
        sent = [state(k) for k in range(30)]
        for s in sent:
            assert node.send(s)
            assert node.drain(SOON_S)
        until(lambda: len(received) == 30, "all samples")
        assert [h.state for h in received] == [unpack_state(pack_state(s, 0)) for s in sent]
        assert hand.finger(9).info().serial_number == application.serial
    node.close()
    for commands in adapters.commands:
        assert [c for c in commands if c[:1] in ("S", "Y")] == reported


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
    assert (
        parse_address("can:c?dbitrate=2000000").fd_timing() is None
    )  # SocketCAN is configured by the system


@pytest.mark.parametrize(
    "text", ["", "can0", "can:", "can:a?", "can:a?fd", "can:a?fd=2", "can:a?baud=9600", "x:y"]
)
def test_an_invalid_address_is_one_line(text: str) -> None:
    if text == "can:a?":
        assert parse_address(text).channel == "a"  # nothing asked, nothing wrong
        return
    with pytest.raises(AddressError) as caught:
        parse_address(text)
    assert "\n" not in str(caught.value)


def test_importing_loads_no_heavy_library() -> None:
    code = (
        "import sys, hostlink\n"
        "heavy = {'numpy', 'cv2', 'can', 'serial', 'canopen', 'rich', 'click', 'edge'}\n"
        "print(*sorted(heavy & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []


def test_rates_that_no_timing_gives_are_one_line() -> None:
    with pytest.raises(hostlink.ConnectError, match="cannot open CAN interface") as caught:
        hostlink.connect("can:x?interface=pcan&bitrate=999983&dbitrate=7999993")
    assert "\n" not in str(caught.value)
    with pytest.raises(SinkError, match="cannot open CAN interface"):
        open_sink("can:x?interface=pcan&bitrate=999983&dbitrate=7999993")
