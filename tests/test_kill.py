"""A killed program keeps what it has acknowledged; what is being written is whole or absent."""

import json
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random

import pytest

from edge.calibration import Calibration
from hostlink import connect
from hostlink.client import Finger
from hostlink.errors import ConnectError, LinkError
from hostlink.output_file import find_unfinished
from tests.bench.soak import CALIBRATION
from tests.support.seeds import SEED
from tests.support.waiting import SOON_S

NODE = 5
GROUP = "239.255.43.21"


@pytest.fixture(autouse=True)
def multicast() -> None:
    """The bus that two processes can share without hardware."""
    try:
        connect(f"udp:{GROUP}?ttl=0").close()
    except ConnectError as error:
        pytest.skip(f"no UDP multicast here: {error}")


@contextmanager
def running(folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], Finger]]:
    """The program as a process that keeps its state in this folder, and a host that has its first sample."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        address = f"udp:{GROUP}?port={free.getsockname()[1]}&ttl=0&node={NODE}"
    config = folder / "edge.toml"
    config.write_text(
        f'[sensor]\nnode_id = {NODE}\n[source]\nspec = "sim:nothing?width=320&height=320"\nrate_hz = 60\n'
        f'[link]\nsinks = ["{address}"]\n[state]\ndirectory = "{folder}"\n'
    )
    command = [sys.executable, "-m", "edge", "run", "-c", str(config), "-q"]
    with subprocess.Popen(command) as program, connect(address) as host:
        try:
            next(host.samples(timeout_s=SOON_S))
            yield program, host.finger(NODE)
        finally:
            program.kill()


@pytest.mark.generative
def test_a_kill_while_settings_are_written_loses_none_that_was_acknowledged(tmp_path: Path) -> None:
    random = Random(SEED)
    tried = acknowledged = 50.0
    with running(tmp_path) as (program, finger):
        finger.set_rate(acknowledged)
        timer = threading.Timer(random.uniform(0.02, 1.0), program.kill)
        timer.start()
        with suppress(LinkError):  # the answer to the last request never comes
            while timer.is_alive():
                tried = float(random.randrange(10, 200))
                finger.set_rate(tried)
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

    def kill_at_the_write(program: subprocess.Popen[bytes]) -> None:
        while not (find_unfinished(file) or over.wait(0.001)):
            pass
        program.kill()

    acknowledged = False
    with running(tmp_path) as (program, finger):
        killer = threading.Thread(target=kill_at_the_write, args=(program,))
        killer.start()
        with suppress(LinkError):
            finger.upload_calibration(new.encoded)
            acknowledged = True
        over.set()
        killer.join()
    stored = file.read_bytes()
    assert stored in ((new.encoded,) if acknowledged else (old.encoded, new.encoded))
    with running(tmp_path) as (_, finger):
        assert finger.info().calibration_id == f"{Calibration.parse(stored, 'stored').content_id:08x}"
        assert not find_unfinished(file)
