"""Commands that the documentation shows run word for word, each page from its top to its end.

They run in a folder with the files that the pages speak of. LEFT_OUT lists what needs more than that, with
the reason; a new command runs without being listed.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.sim import Camera, Simulator, Tip, ToolPose
from edge import open_source
from edge.examples import example_file
from hostlink import connect
from tests.calib.test_lens_command import board_pictures
from tests.hostlink.test_recording import write_buses
from tests.support.captures import write_table
from tests.support.fingers import need_multicast
from tests.support.processes import python
from tests.support.waiting import SOON_S

ROOT = Path(__file__).resolve().parent.parent
PAGES = ("README.md", *(f"docs/{page.name}" for page in sorted(ROOT.glob("docs/*.md"))), "deploy/README.md")
LEFT_OUT = {
    r"^sudo": "root, on a board",
    r"^git ": "the network",
    r"^make |tests\.|pytest|calib report": "minutes to hours",
    r"^pip ": "an environment of its own: tests/test_wheel.py",
    r"\bcan:|candump": "a CAN interface",
    r"v4l2:|oak:|edge hand |doctor$|run --(view|record|json)": "a camera",
    r"gcode:|--rig manual": "a stage, or hands",
    r"serial:|socat|xxd": "a serial line",
    r"^ros2 |--ros": "ROS",
    r"\.\.\.|FILE\b": "a pattern, not a command",
    r"^(voronoi-touch-(edge|host) \w+|python -m hostlink|.* --help)$": "a name in a sentence",
}
SLOW = ("docs/calibrate.md",)  # its captures and fits take minutes
ENDLESS = r"--loop| monitor | view | --source (sim:nothing|sim-remote:)"
SHOWN = re.compile(
    r"(?: {4,}(?:\$ )?|\$ )((?:python|pip|voronoi-touch-\w+|sudo\w*|git|make|candump|socat|xxd|ros2|eval) .*)"
)
IN_TEXT = re.compile(r"`((?:python -m|voronoi-touch-\w+|pip) [^`]+)`")


def commands(page: str) -> list[list[str]]:
    """Blocks of commands as they are shown, without the remarks behind them; one in a text is a block."""
    blocks: list[list[str]] = [[]]
    for line in (ROOT / page).read_text(encoding="utf-8").splitlines():
        if found := SHOWN.fullmatch(line):
            blocks[-1].append(re.split(r"  +#", found[1])[0].strip())
        else:
            blocks += [[command] for command in IN_TEXT.findall(line)] + [[]]
    return [block for block in blocks if block]


def left_out(command: str) -> bool:
    return any(re.search(pattern, command) for pattern in LEFT_OUT)


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what a reader has."""
    folder = tmp_path_factory.mktemp("reader")
    (folder / "docs").symlink_to(ROOT / "docs")
    (hand,) = re.findall(r"```toml\n(.*?)```", (ROOT / "docs/robot.md").read_text(), re.DOTALL)
    (folder / "hand.toml").write_text(hand)
    (folder / "smooth.toml").write_text("[tip]\nfriction = 0.5\n")
    images = [frame.image for frame in open_source("example:press")]
    size = images[0].shape[::-1]
    video = cv2.VideoWriter(str(folder / "touch.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 25.0, size, False)
    for image in images:
        video.write(image)
    video.release()
    shutil.copy(example_file("example:press", ".mcap"), folder / "press.mcap")
    cv2.imwrite(str(folder / "skin.png"), np.full_like(images[0], 255))
    finger = Simulator(Camera(tip=Tip(127, "hex", pin_radius_mm=0.8), size_px=(480, 360)))
    poses = [(), (), *((ToolPose(depth_mm=mm),) for mm in np.random.default_rng(1).uniform(0.3, 3.5, 48))]
    frames = [finger.frame(pose) for pose in poses]
    force_n = np.array([sum((frame.truth or {})["forces_n"]) for frame in frames])
    for name in ("frames", "pressed", "FOLDER"):
        (folder / name).mkdir()
        table = write_table(folder / name, [frame.image for frame in frames], {"force_z": force_n})
    for name in ("targets.csv", "TARGETS.csv"):
        shutil.copy(table, folder / name)
    for name in ("rest.png", "picture.png"):
        cv2.imwrite(str(folder / name), frames[0].image)
    board_pictures(folder)
    for name in ("hand.log", "press.log"):
        write_buses(folder / name, {0: 1})
    return folder


@pytest.mark.parametrize(
    "page",
    [pytest.param(p, marks=[pytest.mark.slow, pytest.mark.timeout(3600)] * (p in SLOW)) for p in PAGES],
)
def test_the_commands_of_a_page_run_as_they_are_shown(page: str, reader: Path, tmp_path: Path) -> None:
    shutil.copytree(reader, tmp_path, symlinks=True, dirs_exist_ok=True)
    if page in SLOW:
        for name in ("other-capture", "new"):
            rig = ("--rig", "sim", "--protocol", "displacement", "-o", f"{name}.mcap")
            assert python("-m", "calib", "capture", *rig, cwd=tmp_path).returncode == 0
    for block in commands(page):
        with ExitStack() as running:
            for command in block:
                if not left_out(command):
                    run(command, tmp_path, running)


def run(command: str, folder: Path, running: ExitStack) -> None:
    """To its end, or, an endless one, until it has begun: it is interrupted when `running` is left."""
    for made in re.findall(r"(?:-o|--out|--csv) (\S+)", command):
        (folder / made).unlink(missing_ok=True)
    if "udp:" in command:
        need_multicast()
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    process = running.enter_context(
        subprocess.Popen(
            ["bash", "-o", "pipefail", "-c", command], cwd=folder, env=os.environ | {"PATH": path},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
        )
    )  # fmt: skip
    running.callback(process.kill)
    if not re.search(ENDLESS, command):
        ends(command, process)
        return
    running.callback(ends, command, process, by=signal.SIGINT)
    if "--sink" in command:
        with connect("udp:239.0.0.1") as hand:
            next(iter(hand.samples(timeout_s=SOON_S)))
    else:
        assert process.stdout is not None
        assert process.stdout.readline()


def ends(command: str, process: subprocess.Popen[str], by: signal.Signals | None = None) -> None:
    """As it should: with 0, or, interrupted, with what `hostlink/cli_exit.py` says."""
    if by:
        os.killpg(process.pid, by)
    out, _ = process.communicate()
    assert process.returncode in ((0, 128 + by) if by else (0,)), f"{command}\n{out}"
    assert "CALIBRATION_FOREIGN" not in out, f"{command}\n{out}"


def test_all_that_is_left_out_is_shown() -> None:
    shown = [command for page in PAGES for block in commands(page) for command in block]
    assert sum(not left_out(command) for command in shown) > 50
    assert not [pattern for pattern in LEFT_OUT if not any(re.search(pattern, c) for c in shown)]
