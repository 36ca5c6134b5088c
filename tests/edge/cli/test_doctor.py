"""The doctor finds each problem that a user can have, and gives advice."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from calib.sim import Camera as SimulatedCamera
from calib.sim import Simulator, Tip, ToolPose
from edge.calibration import Calibration
from edge.cli import checks
from edge.cli.checks import Line
from edge.cli.doctor import examine
from edge.cli.machine import Machine
from edge.config import Config, LinkTable, SourceTable, StateTable
from edge.errors import SourceError
from edge.runtime.board_monitor import STORED_BYTES
from edge.sources.live import PARAMS as LIVE
from edge.types import Clock, Frame, Image
from tests.support import finger
from tests.support.commands import run_edge
from tests.support.fault_injection import _PICTURES

UP: dict[str, Any] = {
    "ifname": "can0", "flags": ["NOARP", "UP", "LOWER_UP"], "mtu": 72,
    "linkinfo": {"info_kind": "can", "info_data": {
        "state": "ERROR-ACTIVE", "berr_counter": {"tx": 0, "rx": 0},
        "bittiming": {"bitrate": 1_000_000}, "data_bittiming": {"bitrate": 5_000_000},
    }},
}  # fmt: skip


def well(**changed: Any) -> Machine:
    """A machine without problems but for these facts: what its functions return, or functions."""
    facts: dict[str, Any] = {
        "interface": UP, "governors": {"performance"}, "temperature_degc": 50.0, "clock_synchronised": True,
        "free_bytes": 1 << 34, "write_s": lambda folder, n_bytes: n_bytes / 400e6,
    }  # fmt: skip
    machine = Machine()
    for name, fact in (facts | changed).items():
        setattr(machine, name, fact if callable(fact) else Mock(return_value=fact))
    return machine


class Camera(finger.Camera):
    """A camera that shows the given images, at 100 frames/s."""

    name = "camera v4l2:0"

    def __init__(self, images: list[Image], period_ns: int = 10_000_000) -> None:
        super().__init__()
        self._images, self._period_ns, self._n = images, period_ns, 0

    def read(self, timeout_s: float) -> Frame | None:  # type: ignore[override]
        if not self._images:
            return None
        self._n += 1
        image = self._images[self._n % len(self._images)]
        return Frame(image, self._n * self._period_ns, self._n, Clock.HOST)


@pytest.fixture(scope="module")
def rest(frames: list[Frame]) -> list[Image]:
    return [frame.image for frame in frames[:8]]


@pytest.fixture
def config(tmp_path: Path) -> Config:
    return Config(
        source=SourceTable(width=320, height=320, rate_hz=100.0),
        link=LinkTable(sinks=("can:can0",)),
        state=StateTable(directory=str(tmp_path)),
    )


@pytest.fixture
def examined(config: Config, rest: list[Image], data_dir: Path) -> Callable[..., dict[str, Line]]:
    """Examine, with one thing changed; the worst line of each topic."""

    def examine_it(
        images: list[Image] | None = None,
        machine: Machine | None = None,
        calibration: Path | None = data_dir / "rings331_ball.json",
        camera: Camera | Exception | None = None,
    ) -> dict[str, Line]:
        chosen = camera or Camera(rest if images is None else images)
        opener = Mock(side_effect=[chosen])  # an exception is raised
        found: dict[str, Line] = {}
        for line in examine(config, opener, calibration, machine or well()):
            if line.topic not in found or line.level != "ok":
                found[line.topic] = line
        if isinstance(chosen, Camera):
            assert chosen.ended  # it was closed
        return found

    return examine_it


Examined = Callable[..., dict[str, Line]]


def bad(found: dict[str, Line]) -> dict[str, str]:
    """Topics that are not ok; each of them has advice."""
    assert all(line.advice for line in found.values() if line.level != "ok")
    return {topic: line.level for topic, line in found.items() if line.level != "ok"}


def test_a_number_that_another_camera_may_get_is_a_warning(
    examined: Examined, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checks, "lasting_name", lambda where: "v4l2:AB12" if where == "0" else "")
    line = examined()["camera"]
    assert (line.level, line.advice) == ("warn", "give v4l2:AB12, which stays")


def test_everything_in_order_gives_ok(examined: Examined) -> None:
    found = examined()
    assert bad(found) == {}
    assert set(found) == {
        "camera", "rate", "light", "pins", "focus", "margin", "calibration", "age", "residual", "link",
        "errors", "processor", "temperature", "clock", "disk", "sensor", "touch", "holes", "motion",
        "contrast",
    }  # fmt: skip
    assert found["link"].message == "can0 is up, 1 Mbit/s and 5"


def test_no_camera_and_one_without_images(examined: Examined, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("edge.cli.picture.LIVE", replace(LIVE, first_s=0.05))
    silent = Camera([])
    silent.condition = "stalled"
    absent = SourceError("source v4l2:0: no such camera; cameras here: none")
    for camera, stated in ((absent, "no such camera"), (silent, "stalled")):
        found = examined(camera=camera)
        assert bad(found) == {"camera": "fail"}
        assert stated in found["camera"].message
        assert not {"light", "pins", "focus"} & set(found)  # topics that cannot be checked are not guessed


@pytest.mark.parametrize(
    ("seen", "levels", "words"),
    [
        (_PICTURES["black"], {"light": "fail", "pins": "fail"}, "LED"),
        (lambda image, random: np.full_like(image, 255), {"light": "fail"}, "overexposed"),
        (_PICTURES["cover"], {"pins": "fail"}, "of the calibration's 331 pins"),
    ],
    ids=["dark", "overexposed", "most of the pins lost"],
)
def test_images_without_their_pins(
    examined: Examined, rest: list[Image], seen: Callable[..., Image], levels: dict[str, str], words: str
) -> None:
    random = np.random.default_rng(0)
    found = examined([seen(image, random) for image in rest])
    assert bad(found).items() >= levels.items()
    worst = found[next(iter(levels))]
    assert words in worst.message + worst.advice


def test_a_slow_camera_and_a_touch(examined: Examined, rest: list[Image]) -> None:
    found = examined(camera=Camera(rest, period_ns=20_000_000))
    assert bad(found) == {"rate": "fail"}
    assert found["rate"].message == "50.0 frames/s, 100 asked"
    tip = Simulator(SimulatedCamera(tip=Tip(n_pins=127, kind="hex"), size_px=(320, 320)))
    line = examined([tip.frame((ToolPose(depth_mm=3.0, tilt_x_deg=15.0),)).image])["touch"]
    assert line.level == "warn"
    assert "lopsided" in line.message


def test_a_calibration_that_cannot_be_read_or_is_another_tip_s(
    examined: Examined, data_dir: Path, tmp_path: Path
) -> None:
    (tmp_path / "a.json").write_text("{}")
    assert bad(examined(calibration=tmp_path / "a.json")) == {"calibration": "fail"}
    assert bad(examined(calibration=None)) == {"calibration": "warn"}
    other = data_dir / "hex127_flat.json"
    line = examined(calibration=other)["calibration"]
    assert line.level == "fail"
    assert Calibration.load(other).content.sensor.serial in line.advice


def up(**data: Any) -> dict[str, Any]:
    """An interface that is up, and has this state."""
    return UP | {"linkinfo": {"info_kind": "can", "info_data": UP["linkinfo"]["info_data"] | data}}


@pytest.mark.parametrize(
    ("interface", "expected", "message"),
    [
        (None, {"link": "fail"}, "no CAN interface can0"),
        (UP | {"flags": ["NOARP"]}, {"link": "fail"}, "can0 is down"),
        (UP | {"mtu": 16}, {"link": "fail"}, "classic frames only"),
        (up(state="BUS-OFF"), {"errors": "fail"}, "BUS-OFF"),
        (up(state="ERROR-PASSIVE"), {"errors": "warn"}, "ERROR-PASSIVE"),
        (up(berr_counter={"tx": 128, "rx": 0}), {"errors": "warn"}, "tx 128"),
    ],
)
def test_can(
    examined: Examined, interface: dict[str, Any] | None, expected: dict[str, str], message: str
) -> None:
    found = examined(machine=well(interface=interface))
    assert bad(found) == expected
    assert message in found[next(iter(expected))].message


@pytest.mark.parametrize(
    ("fact", "value", "topic", "level"),
    [
        ("write_s", lambda folder, n_bytes: n_bytes / 5e6, "disk", "warn"),
        ("write_s", Mock(side_effect=PermissionError(13, "Permission denied")), "disk", "fail"),
        ("free_bytes", STORED_BYTES, "disk", "fail"),
        ("governors", {"powersave"}, "processor", "warn"),
        ("temperature_degc", 85.0, "temperature", "warn"),
        ("clock_synchronised", False, "clock", "warn"),
    ],
)
def test_the_board(examined: Examined, fact: str, value: object, topic: str, level: str) -> None:
    assert bad(examined(machine=well(**{fact: value}))) == {topic: level}


def test_the_machine_itself(tmp_path: Path) -> None:
    """The facts faked above, read from the real machine where it has them."""
    cpu = tmp_path / "sys/devices/system/cpu/cpu0/cpufreq"
    cpu.mkdir(parents=True)
    (cpu / "scaling_governor").write_text("ondemand\n")
    machine = Machine(tmp_path)
    assert machine.governors() == {"ondemand"}
    assert machine.free_bytes(tmp_path) > 0
    assert machine.write_s(tmp_path, 1 << 20) > 0
    assert [p.name for p in tmp_path.iterdir()] == ["sys"]
    assert machine.interface("no-such-interface") is None


def test_on_the_command_line(data_dir: Path) -> None:
    arguments = ("doctor", "--source", data_dir / "press.mcap", "--sink", "virtual:doctor", "--json")
    done = run_edge(*arguments, "--calibration", data_dir / "rings331_ball.json")
    reported = json.loads(done.out)
    assert done.code == (reported["worst"] == "fail")
    levels = {line["topic"]: line["level"] for line in reported["lines"]}
    assert levels["pins"] == levels["calibration"] == levels["link"] == "ok"
    done = run_edge("doctor", "--source", "nothing.mcap")
    assert done.code == 1
    assert "no such file" in done.out
