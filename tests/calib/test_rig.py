"""Rigs: the simulated one, a G-code stage against a fake on a pty, a person."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from calib.errors import RigError
from calib.rig import Pose, open_rig
from calib.rig.base import CLEAR
from calib.rig.camera import STALE_FRAMES, SettledCamera
from calib.rig.gcode import GcodeRig, axes_of
from calib.rig.manual import ManualRig, describe_pose
from calib.rig.simulated import SimulatedRig, load_simulation
from calib.rig.stage import AxisTable, GcodeStage, StageFile, StageTable, load_stage
from calib.sim import Tool
from edge.pins import take_rest
from edge.types import Clock, Frame, Lens, Polarity, Region
from tests.support.fake_stage import FakeStage
from tests.support.refusals import one_line
from tests.support.waiting import SOON_S

StageAt = Callable[..., tuple[FakeStage, StageFile]]


class FakeCamera:
    """Live; frame k was taken at k ms of its own clock, or of a host's clock that a test moves."""

    live = True
    name = "fake camera"
    size_px = (4, 4)
    rate_hz = 1000.0
    polarity = Polarity.FOUND
    region: Region | None = None
    lens: Lens | None = None
    dropped_n = 0

    def __init__(self, clock: Clock = Clock.HOST, n: int = 1000, step_ns: int = 1_000_000) -> None:
        self.clock = clock
        self.n = n
        self.step_ns = step_ns
        self.closed = False

    def __iter__(self) -> Iterator[Frame]:
        for k in range(self.n):
            yield Frame(np.zeros((4, 4), np.uint8), k * self.step_ns, k, self.clock)

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def stage_at() -> Iterator[StageAt]:
    made: list[FakeStage] = []

    def make(
        dialect: str = "grbl",
        travel: tuple[float, float] = (-200.0, 200.0),
        boots: bool = True,
        **keys: object,
    ) -> tuple[FakeStage, StageFile]:
        fake = FakeStage(dialect, travel, boots)
        made.append(fake)
        table = {"port": fake.port, "dialect": dialect, "boot_s": SOON_S, "answer_s": SOON_S, **keys}
        return fake, StageFile(stage=msgspec.convert(table, StageTable))

    yield make
    for fake in made:
        fake.close()


def quiet(text: str) -> None:
    """No questions are expected."""


def rig_on(config: StageFile) -> GcodeRig:
    # Frames of a clock far ahead of the host's: taken after every move.
    return GcodeRig(GcodeStage(config), FakeCamera(step_ns=1 << 61, n=3), quiet)


def test_simulation_file_sets_tip_camera_and_look(tmp_path: Path) -> None:
    path = tmp_path / "tip.toml"
    path.write_text(
        'seed = 4\n[tip]\nn_pins = 127\nkind = "hex"\n[camera]\nsize_px = [320, 240]\n[look]\nbits = 10\n'
    )
    frame = SimulatedRig(load_simulation(path)).frame()
    assert frame.image.shape == (240, 320)
    assert frame.bits == 10
    assert frame.truth is not None
    assert len(frame.truth["pins_img"]) == 127


def stage_of(path: Path) -> StageFile:
    return load_stage(str(path))


@pytest.mark.parametrize(("load", "text", "parts"), [
    (load_simulation, "[tip]\npins = 3", ["pins", "n_pins"]),
    (load_simulation, "[look]\nbits = 9", ["bits", "12"]),
    (load_simulation, "[look]\ndead = [400]", ["dead", "0..330"]),
    (load_simulation, "[tip]\npins_deg = 1", ["pin_radius_mm", "cover one another"]),
    (load_simulation, "[camera]\npins_radius_px = 1e9", ["pins_radius_px", "give 0 to 640"]),
    (load_simulation, "[tip]\nn_pins = 100", ["91"]),
    (load_simulation, "[tip]\nn_pins = 3997", ["3997 pins; give 12 to 3060"]),
    (load_simulation, "[tip]\nskin_mm = nan", ["skin_mm = nan; must be > 0"]),
    (load_simulation, "[camera]\nsize_px = [100000, 100000]", ["100000x100000 pixels are too many"]),
    (load_simulation, "[tip]\ncamera_distance_mm = 5", ["camera_distance_mm"]),
    (stage_of, "[stage]\nport='a'\nspeed=3", ["speed"]),
    (stage_of, "[stage]\nport='a'\ndialect='klipper'", ["marlin"]),
    (stage_of, "[stage]\nport='a'\n[axes.Q]\nat=1", ["axes.Q"]),
    (stage_of, "[stage]\nbaud=9600", ["port"]),
    (stage_of, "[stage]\nport='a'\nfeed_mm_min=inf", ["feed_mm_min: must be a number from 0.1 to 100000"]),
    (stage_of, "[stage]\nport='a'\n[axes.X]\nsign=2", ["axes.X.sign = 2; give 1 or -1"]),
])  # fmt: skip
def test_a_wrong_file_is_one_line_with_the_key(
    tmp_path: Path, load: Callable[[Path], object], text: str, parts: list[str]
) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(text)
    message = one_line(RigError, load, path)
    assert all(word in message for word in [str(path), *parts])


def test_frames_before_the_skin_has_settled_are_discarded() -> None:
    now = 10_000_000
    camera = SettledCamera(FakeCamera(Clock.DRIVER), settle_s=0.005, now_ns=lambda: now)
    camera.moved()
    assert [camera.frame().sequence for _ in range(3)] == [15, 16, 17]


def test_a_few_frames_of_a_camera_with_its_own_clock_are_discarded() -> None:
    camera = SettledCamera(FakeCamera(Clock.DEVICE), settle_s=0.0, now_ns=lambda: 1 << 62)
    camera.moved()
    assert camera.frame().sequence == STALE_FRAMES
    assert camera.frame().sequence == STALE_FRAMES + 1


def test_a_camera_that_ends_is_an_error_and_a_recording_is_refused() -> None:
    camera = SettledCamera(FakeCamera(n=0))
    with pytest.raises(RigError, match="resume"):
        camera.frame()
    recording = FakeCamera()
    recording.live = False
    with pytest.raises(RigError, match="live"):
        SettledCamera(recording)
    assert recording.closed


@pytest.mark.parametrize("boots", [True, False])
@pytest.mark.parametrize("dialect", ["grbl", "marlin"])
def test_stage_homes_moves_and_waits_until_it_stands(stage_at: StageAt, dialect: str, boots: bool) -> None:
    fake, config = stage_at(dialect, boots=boots, boot_s=5.0 if boots else 0.2)
    stage = GcodeStage(config)
    stage.go(X=1.5, Y=-2.0)
    stage.go(Z=-0.25)
    stage.close()
    home, sync = ("$H", "G4 P0.01") if dialect == "grbl" else ("G28", "M400")
    sent = [home, "G21", "G90", "G1 X1.5000 Y-2.0000 F300", sync, "G1 Z-0.2500 F300", sync]
    assert [line for line in fake.lines if line != "M115"] == sent
    assert fake.moves[-1] == {"X": 1.5, "Y": -2.0, "Z": -0.25}


def test_stage_axes_have_origin_sign_and_travel_that_is_checked_before_sending(stage_at: StageAt) -> None:
    fake, config = stage_at()
    axes = {"X": AxisTable(at=50.0, sign=-1.0, min=40.0, max=60.0)}
    stage = GcodeStage(StageFile(stage=config.stage, axes=axes))
    stage.go(X=4.0)
    assert fake.moves == [{"X": 46.0}]
    sent = len(fake.lines)
    with pytest.raises(RigError, match=r"X = 38\.000.*40\.\.60"):
        stage.go(X=12.0)
    assert len(fake.lines) == sent
    stage.close()


@pytest.mark.parametrize(
    ("keys", "board", "line", "message"),
    [
        ({}, {}, "G5.1", r"G5\.1.*error:20.*unsupported"),
        ({"travel": (-5.0, 5.0)}, {}, "G1 X6", r"ALARM:2.*travel"),
        ({}, {"locked": True}, "G1 X1", r"error:9.*home"),
        ({}, {"homing_fails": True}, "", r"ALARM:9.*no limit switch"),
        ({"answer_s": 0.3}, {"mute": "G1"}, "G1 X1", r"no answer.*G1"),
        ({}, {"reset_on": "G1"}, "G1 X1", "restarted"),
    ],
)
def test_errors_of_a_board_are_reported_with_their_texts(
    stage_at: StageAt, keys: dict[str, Any], board: dict[str, Any], line: str, message: str
) -> None:
    fake, config = stage_at(**keys)
    fake.homing_fails = "homing_fails" in board

    def send() -> None:
        with closing(GcodeStage(config)) as stage:
            vars(fake).update(board)
            stage.command(line)

    with pytest.raises(RigError, match=message):
        send()


def test_another_dialect_is_no_greeting(stage_at: StageAt) -> None:
    _, config = stage_at("marlin")
    with pytest.raises(RigError, match="no grbl greeting"):
        GcodeStage(StageFile(stage=StageTable(port=config.stage.port, boot_s=0.3)))


def test_the_tool_lifts_off_where_the_history_of_friction_would_count(stage_at: StageAt) -> None:
    """Every new place is reached over a clear tip; it is pressed before it is sheared."""
    fake, config = stage_at()
    rig = rig_on(config)
    rig.mount(Tool("flat"))
    rig.move(Pose(depth_mm=2.0, shear_x_mm=1.0))
    assert fake.moves[-2:] == [{"X": 0.0, "Y": 0.0, "Z": -2.0}, {"X": 1.0, "Y": 0.0, "Z": -2.0}]
    for depth_mm, shear_x_mm, shear_y_mm, lifts in (
        (2.0, 0.0, 1.0, True),  # another direction
        (1.0, 0.0, 0.0, True),
        (1.1, 0.0, 0.0, False),
        (3.0, 0.0, 0.0, False),
        (3.0, 0.1, 0.0, False),
        (3.0, 0.2, 0.0, False),
        (2.0, 0.0, 0.0, True),  # back
    ):
        fake.moves.clear()
        rig.move(Pose(depth_mm=depth_mm, shear_x_mm=shear_x_mm, shear_y_mm=shear_y_mm))
        assert fake.moves[-1] == {"X": shear_x_mm, "Y": shear_y_mm, "Z": -depth_mm}
        assert (max(move["Z"] for move in fake.moves) == 5.0) == lifts
    assert rig.frame().sequence == 1
    rig.close()
    assert fake.moves[-1]["Z"] == 5.0


def test_a_ball_comes_down_along_the_dome_s_normal() -> None:
    tool, r = Tool("sphere", 2.0), 20.0
    touch = axes_of(Pose(x_mm=10.0), tool, r)
    centre = np.array([touch["X"], touch["Y"], touch["Z"] + r + 2.0])
    assert np.linalg.norm(centre) == pytest.approx(r + 2.0)
    np.testing.assert_allclose(centre[:2] * r / (r + 2.0), [10.0, 0.0], atol=1e-9)
    deep = axes_of(Pose(x_mm=10.0, depth_mm=1.0), tool, r)
    moved = np.array([deep[k] - touch[k] for k in "XYZ"])
    np.testing.assert_allclose(moved, -centre / (r + 2.0), atol=1e-9)
    with pytest.raises(RigError, match="dome"):
        axes_of(Pose(x_mm=21.0), tool, r)


def test_poses_that_the_stage_cannot_reach_are_refused(stage_at: StageAt) -> None:
    _, config = stage_at()
    rig = rig_on(config)
    with pytest.raises(RigError, match="tilt"):
        rig.move(Pose(depth_mm=1.0, tilt_x_deg=5.0))
    with pytest.raises(RigError, match=r"axes\.A"):
        rig.move(Pose(depth_mm=1.0, twist_deg=5.0))
    rig.close()
    _, config = stage_at()
    rig = rig_on(StageFile(stage=config.stage, axes={"A": AxisTable()}))
    rig.move(Pose(depth_mm=1.0, twist_deg=5.0))
    rig.close()


def test_the_manual_rig_gives_instructions_and_then_takes_an_image() -> None:
    asked: list[str] = []
    rig = ManualRig(FakeCamera(step_ns=1 << 61, n=3), asked.append)
    rig.mount(Tool("sphere", 3.0))
    rig.move(Pose(x_mm=1.0, depth_mm=2.0, shear_y_mm=-0.5))
    before = time.monotonic_ns()
    assert rig.frame().capture_ns > before
    assert asked == ["Use a ball of 3 mm radius", "X +1.00 mm, press 2.00 mm, then shear y -0.50 mm"]
    rig.close()


def test_every_field_of_a_pose_has_an_instruction() -> None:
    assert describe_pose(CLEAR) == "take the tool off the tip"
    pressed = Pose(depth_mm=1.0)
    for name in ("x_mm", "y_mm", "tilt_x_deg", "tilt_y_deg", "shear_x_mm", "shear_y_mm", "twist_deg"):
        assert describe_pose(replace(pressed, **{name: 1.0})) != describe_pose(pressed)


def test_a_known_sensor_is_a_simulated_rig() -> None:
    rig = open_rig("sim:gelsight-mini")
    rig.mount(Tool("sphere"))
    resting = take_rest([rig.frame().image])
    assert resting.pattern.dark
    assert resting.pattern.size_px == (320, 240)
    rig.move(Pose(depth_mm=1.0))
    pressed = rig.frame()
    assert pressed.truth is not None
    assert pressed.truth["depth_mm"] == 1.0
