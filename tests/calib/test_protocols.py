"""Protocols: the paper's, and files."""

import math
import re
from pathlib import Path

import pytest

from calib.errors import ProtocolError
from calib.protocols import PROTOCOLS, load_protocol
from calib.rig import Pose
from calib.sim import Tip, deform
from calib.sim.mechanics import ToolPose
from tests.support.refusals import one_line


def sampled(name: str) -> list[Pose]:
    return [s.pose for s in load_protocol(name).steps if s.frames and s.role == "sample"]


def test_displacement_is_the_paper_s() -> None:
    plan = load_protocol("displacement")
    samples = [s for s in plan.steps if s.role == "sample"]
    assert [s.pose for s in samples] == [Pose(depth_mm=k / 10) for k in range(51)]
    assert {s.frames for s in samples} == {10}
    assert {s.tool.kind for s in samples} == {"flat"}


def test_shear_contacts_and_surface_hold_what_they_promise() -> None:
    poses = sampled("shear")  # the paper's
    assert [p.shear_x_mm for p in poses] == [k / 10 for k in range(21)]
    assert {p.depth_mm for p in poses} == {3.0}
    steps = [s for s in load_protocol("contacts").steps if s.frames and s.role == "sample"]
    assert {s.tool.kind for s in steps} == {"sphere", "two"}
    assert min(s.tool.distance_mm for s in steps if s.tool.kind == "two") == 4
    assert max(math.hypot(s.pose.x_mm, s.pose.y_mm) for s in steps) == 12
    poses = sampled("surface")
    assert len(set(poses)) == 600
    assert 1 <= min(p.depth_mm for p in poses) < 1.1
    assert 4.9 < max(p.depth_mm for p in poses) <= 5
    digests = [load_protocol(name).digest for name in PROTOCOLS]
    assert len(set(digests)) == len(PROTOCOLS)
    assert digests == [load_protocol(name).digest for name in PROTOCOLS], "the same each time"


def test_direction_is_the_paper_s_and_every_shear_starts_from_a_fresh_press() -> None:
    plan = load_protocol("direction")
    poses = sampled("direction")
    angles = [math.degrees(math.atan2(p.shear_y_mm, p.shear_x_mm)) % 360 for p in poses]
    assert angles == pytest.approx([10 * k for k in range(36)], abs=1e-6)
    assert [math.hypot(p.shear_x_mm, p.shear_y_mm) for p in poses] == pytest.approx([2.0] * 36)
    steps = plan.steps
    for i, step in enumerate(steps):
        if step.role == "sample" and step.frames:
            assert steps[i - 1].pose == Pose(depth_mm=3.0)
            assert steps[i - 2].pose.depth_mm < 0


@pytest.mark.parametrize("name", PROTOCOLS)
def test_every_protocol_starts_untouched_and_can_be_done(name: str) -> None:
    plan = load_protocol(name)
    assert plan.steps[0].role == "rest"
    assert plan.steps[0].pose.depth_mm < 0
    assert plan.steps[0].frames >= 8
    assert plan.n_frames == sum(s.frames for s in plan.steps)
    tip = Tip(127)
    for step in plan.steps[:: max(1, len(plan.steps) // 12)]:
        fields = {n: getattr(step.pose, n) for n in Pose.__dataclass_fields__}
        deform(tip, (ToolPose(tool=step.tool, **fields),))


def test_file_takes_every_combination_of_lists_and_ranges(tmp_path: Path) -> None:
    path = tmp_path / "corner.toml"
    path.write_text(
        'rest_frames = 3\nframes = 2\ntool = { kind = "sphere", radius_mm = 2.5 }\n'
        "[[step]]\nx_mm = [0, 2]\ndepth_mm = { from = 0.5, to = 1.5, by = 0.5 }\nlift = true\n"
        '[[step]]\ndepth_mm = 1\nframes = 7\ntool = { kind = "flat" }\n'
    )
    plan = load_protocol(str(path))
    assert plan.name == "corner"
    taken = [s for s in plan.steps if s.frames]
    assert [(s.pose.x_mm, s.pose.depth_mm) for s in taken[1:7]] == [
        (x, z) for x in (0, 2) for z in (0.5, 1.0, 1.5)
    ]
    assert plan.n_frames == 3 + 6 * 2 + 7
    assert sum(s.frames == 0 and s.pose.depth_mm < 0 for s in plan.steps) == 6
    assert taken[1].tool.radius_mm == 2.5
    assert taken[-1].tool.kind == "flat"


@pytest.mark.parametrize(("text", "word"), [
    ("step = []", "step"),
    ("[[step]]\ndepth = 1", "depth"),
    ("[[step]]\ndepth_mm = 'deep'", "depth_mm"),
    ("[[step]]\ndepth_mm = {from=1, to=0, by=0.5}", "never arrives"),
    ("tool = {kind='spoon'}\n[[step]]\ndepth_mm = 1", "flat, sphere"),
    ("rest_frames = 0\n[[step]]\ndepth_mm = 1", "rest_frames"),
    ("[[step]]\nframes = -1", "frames"),
    ("[[step]]\ndepth_mm = nan", r"step\[0\].depth_mm: .* from -360 to 360 or a list.*, is NaN"),
    ("[[step]]\ndepth_mm = 1e300", r"step\[0\].depth_mm: .* from -360 to 360 or a list.*, is 1e\+300"),
    ("[[step]]\ndepth_mm = {from=0, to=1, by=1e-12}", "makes more than 100000 poses"),
    ("[[step]]\n" + "\n".join(f"{a} = {{from=0, to=99, by=1}}" for a in ("x_mm", "y_mm", "depth_mm")),
     "step 1: makes more than 100000 poses in all"),
])  # fmt: skip
def test_wrong_file_is_one_line_with_the_key(tmp_path: Path, text: str, word: str) -> None:
    path = tmp_path / "p.toml"
    path.write_text(text)
    message = one_line(ProtocolError, load_protocol, str(path))
    assert re.search(word, message)
    assert str(path) in message
