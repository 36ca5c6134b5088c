"""The program as a process on a bus: killed, it keeps what it has acknowledged; flooded, it goes on.

What is being written when it is killed is whole or absent.
"""

import json
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from random import Random

import can
import pytest

from edge.calibration import Calibration
from hostlink import connect
from hostlink.client import Connection, Finger
from hostlink.errors import LinkError
from hostlink.output_file import find_unfinished
from hostlink.wire import CanIds, Kind
from tests.bench.soak import CALIBRATION
from tests.support.fingers import free_port, need_multicast
from tests.support.seeds import SEED
from tests.support.waiting import SOON_S

NODE = 5
GROUP = "239.255.43.21"


@pytest.fixture(autouse=True)
def multicast() -> None:
    """The bus that two processes can share without hardware."""
    need_multicast()


@dataclass(frozen=True)
class Running:
    """The program as a process, and a host that has its first sample."""

    process: subprocess.Popen[bytes]
    port: int
    host: Connection

    @property
    def finger(self) -> Finger:
        return self.host.finger(NODE)


@contextmanager
def running(folder: Path) -> Iterator[Running]:
    """Started with its state in this folder; killed at the end."""
    port = free_port()
    address = f"udp:{GROUP}?port={port}&ttl=0&node={NODE}"
    config = folder / "edge.toml"
    config.write_text(
        f'[sensor]\nnode_id = {NODE}\n[source]\nspec = "sim:nothing?width=320&height=320"\nrate_hz = 60\n'
        f'[link]\nsinks = ["{address}"]\n[state]\ndirectory = "{folder}"\n'
    )
    command = [sys.executable, "-m", "edge", "run", "-c", str(config), "-q"]
    with subprocess.Popen(command) as process, connect(address) as host:
        try:
            next(host.samples(timeout_s=SOON_S))
            yield Running(process, port, host)
        finally:
            process.kill()


@pytest.mark.generative
def test_a_kill_while_settings_are_written_loses_none_that_was_acknowledged(tmp_path: Path) -> None:
    random = Random(SEED)
    tried = acknowledged = 50.0
    with running(tmp_path) as program:
        program.finger.set_rate(acknowledged)
        timer = threading.Timer(random.uniform(0.02, 1.0), program.process.kill)
        timer.start()
        with suppress(LinkError):  # the answer to the last request never comes
            while timer.is_alive():
                tried = float(random.randrange(10, 200))
                program.finger.set_rate(tried)
                acknowledged = tried
    assert json.loads((tmp_path / "settings.json").read_text())["rate_hz"] in (acknowledged, tried)


def test_a_kill_while_a_calibration_is_written_keeps_the_old_or_the_new_one(tmp_path: Path) -> None:
    file = tmp_path / "calibration.json"
    old = Calibration.load(CALIBRATION)
    made = json.loads(CALIBRATION.read_bytes())
    made["data"]["created"] = "another one"
    new = Calibration.parse(json.dumps(made).encode(), "new")
    file.write_bytes(old.encoded)
    over = threading.Event()

    def kill_at_the_write(process: subprocess.Popen[bytes]) -> None:
        while not (find_unfinished(file) or over.wait(0.001)):
            pass
        process.kill()

    acknowledged = False
    with running(tmp_path) as program:
        killer = threading.Thread(target=kill_at_the_write, args=(program.process,))
        killer.start()
        with suppress(LinkError):
            program.finger.upload_calibration(new.encoded)
            acknowledged = True
        over.set()
        killer.join()
    stored = file.read_bytes()
    assert stored in ((new.encoded,) if acknowledged else (old.encoded, new.encoded))
    with running(tmp_path) as again:
        assert again.finger.info().calibration_id == f"{Calibration.parse(stored, 'stored').content_id:08x}"
        assert not find_unfinished(file)


def test_samples_go_on_while_the_bus_is_flooded(tmp_path: Path) -> None:
    """Junk datagrams, and 2,000 requests a second that nobody waits for."""
    over, random = threading.Event(), Random(SEED)
    requests = CanIds().of(Kind.SDO_REQUEST, NODE)

    def flood(port: int) -> None:
        with (
            can.Bus(interface="udp_multicast", channel=GROUP, port=port, hop_limit=0) as bus,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as junk,
        ):
            junk.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            while not over.wait(0.0005):
                data = bytes((random.choice((0x00, 0x10, 0x20, 0x40, 0x60)), 0x30, 0x20, 0)) + bytes(4)
                bus.send(can.Message(arbitration_id=requests, data=data, is_extended_id=False))
                junk.sendto(random.randbytes(20), (GROUP, port))

    with running(tmp_path) as program:
        thread = threading.Thread(target=flood, args=(program.port,))
        thread.start()
        assert sum(1 for _ in islice(program.host.samples(timeout_s=SOON_S), 200)) == 200
        over.set()
        thread.join()
        assert program.host.reconnects == 0
        assert program.process.poll() is None
