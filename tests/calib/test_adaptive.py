"""Protocol adaptive: what it takes next, resuming, the command."""

from pathlib import Path

import numpy as np
import pytest

from calib.adaptive import PARAMS, AdaptivePlan, letters_of
from calib.capture import capture, pose_of, read_capture
from calib.errors import RigError
from calib.next_poses import choose, predict_inputs
from calib.protocols import SURFACE_HIGH, SURFACE_LOW
from calib.rig import Pose
from calib.rig.base import CLEAR
from edge.calibration.inputs import FRAME_INPUTS
from tests.support.captures import breaking_after, simulated
from tests.support.commands import run_calib

POSES = PARAMS.poses_first + 5  # a whole batch is 6
pytestmark = pytest.mark.usefixtures("quick_fits")


def poses_of(path: Path) -> list[Pose]:
    return [pose_of(row) for _, row in read_capture(path) if row["role"] != "rest"]


def test_resumed_in_a_batch_it_takes_the_same_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    through, broken = tmp_path / "through.mcap", tmp_path / "broken.mcap"
    at: list[Pose] = []
    fitted: list[tuple[int, Pose]] = []
    plan = AdaptivePlan(POSES, on_fitted=lambda n, errors: fitted.append((n, at[-1])))
    rig = simulated(0)
    moved = rig.move

    def move(pose: Pose) -> None:
        at.append(pose)
        moved(pose)

    monkeypatch.setattr(rig, "move", move)
    assert capture(lambda first: rig, plan, through) == 10 + POSES
    assert fitted == [(PARAMS.poses_first, CLEAR)], "the tool is off the tip while it fits"
    with pytest.raises(RigError, match="cable"):
        capture(breaking_after(10 + PARAMS.poses_first + 2), AdaptivePlan(POSES), broken)
    assert capture(simulated, AdaptivePlan(POSES), broken, resume=True) == 3
    for (a, _), (b, _) in zip(read_capture(through), read_capture(broken), strict=True):
        np.testing.assert_array_equal(a.image, b.image)
    poses = poses_of(through)
    assert len(set(poses)) == POSES
    # The poses after the evenly spread ones do not go on with them.
    spread = AdaptivePlan(POSES)._spread
    assert poses[: PARAMS.poses_first] == [steps[-1].pose for steps in spread[: PARAMS.poses_first]]
    assert poses[PARAMS.poses_first :] != [steps[-1].pose for steps in spread[PARAMS.poses_first : POSES]]


def test_it_ends_when_the_errors_are_small_enough(tmp_path: Path) -> None:
    lenient, strict = {"displacement_mm": 100.0}, {"displacement_mm": 1e-9}
    assert (
        capture(simulated, AdaptivePlan(POSES, lenient), tmp_path / "lenient.mcap") == 10 + PARAMS.poses_first
    )
    assert capture(simulated, AdaptivePlan(POSES, strict), tmp_path / "strict.mcap") == 10 + POSES
    # Wanted more, it goes on.
    more = capture(simulated, AdaptivePlan(POSES, strict), tmp_path / "lenient.mcap", resume=True)
    assert more == POSES - PARAMS.poses_first
    assert poses_of(tmp_path / "lenient.mcap") == poses_of(tmp_path / "strict.mcap")


def test_the_pose_that_tells_most_of_the_others_is_first() -> None:
    alike = np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.0], [0.0, 0.0, 1.3]], dtype=np.complex128)
    assert choose([alike], 3) == [0, 2, 1]
    assert choose([alike, 9.0 * np.diag([0.0, 0.0, 1.0]).astype(np.complex128)], 1) == [2]
    assert len(choose([alike], 9)) == 3


@pytest.mark.parametrize("mirrored", [False, True])
def test_inputs_are_expected_from_poses(mirrored: bool) -> None:
    rng = np.random.default_rng(0)
    values = rng.uniform(SURFACE_LOW, SURFACE_HIGH, (80, 6))
    poses = [Pose(0.0, 0.0, *one) for one in values.tolist()]
    letters = letters_of(poses, mirrored=mirrored)
    depth, tilt, shear = letters[:, 1], letters[:, 2], letters[:, 3]
    inputs = np.zeros((80, len(FRAME_INPUTS)), dtype=np.complex128)
    inputs[:, FRAME_INPUTS.index("volume")] = depth.real**2
    inputs[:, FRAME_INPUTS.index("c00")] = (1.0 + 2.0j) * shear * depth + 0.3 * tilt
    inputs[:, FRAME_INPUTS.index("c02")] = tilt * shear * shear
    expected = predict_inputs(letters[:60], inputs[:60], letters[60:])
    for name in ("volume", "c00", "c02"):
        column = FRAME_INPUTS.index(name)
        wrong = np.abs(expected[:, column] - inputs[60:, column]).max()
        assert wrong < 0.02 * np.abs(inputs[:, column]).max(), name


def test_the_command_takes_its_options_for_this_protocol_alone(tmp_path: Path) -> None:
    def run(*arguments: str) -> str:
        refusal = run_calib("capture", "--rig", "sim", "-o", tmp_path / "a.mcap", *arguments).refusal
        assert not list(tmp_path.iterdir())
        return refusal

    assert run("--protocol", "shear", "--poses", "30").endswith("only of protocol adaptive, not shear")
    for goal in ("tilt_x_deg", "tilt_x_deg=much", "tilt_x_deg=-1", "warmth=1", "tilt_x_deg=nan"):
        assert f"--until {goal}: give VALUE=ERROR" in run("--protocol", "adaptive", "--until", goal)
