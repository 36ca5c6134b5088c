"""`edge hand` on host nodes of depthai's own: one process a finger, which may die."""

import os
import signal
import subprocess
import sys
from itertools import islice
from pathlib import Path

import pytest

from hostlink import connect
from tests.support.commands import run_edge
from tests.support.fingers import free_port, need_multicast
from tests.support.waiting import SOON_S

pytest.importorskip("depthai", reason="OAK modules need voronoi-touch[oak]")
GROUP = "239.255.43.22"


def config(folder: Path, name: str, spec: str, more: str = "") -> Path:
    file = folder / f"{name}.toml"
    file.write_text(f'[source]\nspec = "{spec}"\nwidth = 160\nheight = 160\n{more}')
    return file


@pytest.mark.parametrize(
    ("specs", "stated"),
    [
        (("oak:?socket=CAM_A", "v4l2:0"), "1.toml: v4l2:0: a hand has one module"),
        (("oak:A?socket=CAM_A", "oak:B?socket=CAM_B"), "1.toml: oak:B?socket=CAM_B: a hand has one module"),
        (("oak:", "oak:?socket=CAM_B"), "1.toml: oak:?socket=CAM_B: CAM_B is another finger's"),
        (("oak:", "oak:?socket=CAM_Q"), "no socket 'CAM_Q'"),
        (("oak:?socket=CAM_A", "oak:?socket=CAM_B"), "no such OAK module"),
    ],
)
def test_cameras_of_no_one_module_are_refused_in_one_line(
    tmp_path: Path, specs: tuple[str, str], stated: str
) -> None:
    done = run_edge("hand", *(config(tmp_path, str(n), spec) for n, spec in enumerate(specs)))
    assert stated in done.refusal


def process_of(hand: subprocess.Popen[str], file: Path) -> int:
    children = Path(f"/proc/{hand.pid}/task").glob("*/children")
    pids = [int(pid) for listed in children for pid in listed.read_text().split()]
    return next(pid for pid in pids if str(file) in Path(f"/proc/{pid}/cmdline").read_text())


def test_a_finger_that_dies_is_started_again_and_the_others_go_on(tmp_path: Path) -> None:
    need_multicast()
    bus = f"udp:{GROUP}?port={free_port()}&ttl=0"
    files = [
        config(
            tmp_path, f"{node}", f"oak:?socket={socket}&check_rate=no",
            f'[sensor]\nnode_id = {node}\n[link]\nsinks = ["{bus}&node={node}"]\n',
        )
        for node, socket in ((1, "CAM_A"), (2, "CAM_B"))
    ]  # fmt: skip
    command = [sys.executable, "-m", "tests.support.oak_nodes", "hand", *map(str, files)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as hand, connect(bus) as host:
        try:
            samples = host.samples(timeout_s=SOON_S)
            times: dict[int, set[int]] = {1: set(), 2: set()}
            number = {1: 0, 2: 0}
            while len(times[1] & times[2]) < 20 or not all(number.values()):  # of one exposure: one time
                sample = next(samples)
                times[sample.finger].add(sample.state.capture_time_us)
                number[sample.finger] = sample.state.sample
            os.kill(process_of(hand, files[0]), signal.SIGKILL)
            while (sample := next(samples)).state.sample >= number[sample.finger]:
                number[sample.finger] = sample.state.sample
            assert sample.finger == 1
            assert any(s.finger == 2 and s.state.sample > number[2] for s in islice(samples, 50))
            hand.terminate()
            _, errors = hand.communicate(timeout=SOON_S)
        finally:
            hand.kill()
    assert hand.returncode == 0, errors
    assert "is started again" in errors
