"""Capturing: what is written, resuming after a break, the command."""

import csv
from pathlib import Path

import numpy as np
import pytest

from calib.capture import POSE_COLUMNS, capture, parts, pose_of, progress_of, read_capture, read_rows
from calib.commands.cli import COMMANDS
from calib.errors import CaptureError, RigError
from calib.protocols import Plan, Step
from calib.rig import Pose
from calib.rig.base import CLEAR
from calib.sim import Tool
from edge.errors import InputError
from edge.recording.reader import RecordingSource
from tests.support.captures import breaking_after, simulated
from tests.support.commands import run_calib

FLAT, BALL = Tool("flat"), Tool("sphere", 3.0)
PLAN = Plan(
    "short",
    (
        Step(CLEAR, FLAT, 3, "rest"),
        Step(Pose(depth_mm=1.0), FLAT, 2),
        Step(Pose(depth_mm=2.0, shear_x_mm=0.5), FLAT, 2),
        Step(CLEAR, BALL, 0),
        Step(Pose(x_mm=3.0, depth_mm=1.0), BALL, 2),
    ),
)


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.with_suffix(".csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_recording_and_table_hold_every_frame_with_its_pose(tmp_path: Path) -> None:
    path = tmp_path / "short.mcap"
    seen: list[int] = []
    assert capture(simulated, PLAN, path, on_frame=lambda step, done: seen.append(done)) == 9
    assert seen == list(range(1, 10))
    rows = rows_of(path)
    assert [r["role"] for r in rows] == ["rest"] * 3 + ["sample"] * 6
    assert [float(r["pose_z"]) for r in rows] == [0, 0, 0, 1, 1, 2, 2, 1, 1]
    assert [float(r["shear_x"]) for r in rows] == [0, 0, 0, 0, 0, 0.5, 0.5, 0, 0]
    assert {r["tool"] for r in rows[-2:]} == {"sphere"}
    assert float(rows[-1]["place_x"]) == 3.0
    assert float(rows[-1]["force_n"]) > 0.05
    frames = list(RecordingSource(path))
    assert [f.sequence for f in frames] == [int(r["sequence"]) for r in rows]
    assert frames[-1].truth is not None
    assert frames[-1].truth["pose"]["x_mm"] == 3.0
    assert len(frames[-1].truth["pins_img"]) == 37


@pytest.mark.parametrize(
    ("breaks", "kept", "frames"),
    [
        *(([after], 1.0, (after - 2, after)) for after in (0, 2, 3, 4, 5, 7, 8)),
        ([7], 0.6, (0, 6)),
        ([3, 2], 1.0, (5, 5)),
    ],
)
def test_resumed_capture_equals_one_that_ran_through(
    tmp_path: Path, breaks: list[int], kept: float, frames: tuple[int, int]
) -> None:
    """After so many frames before each break; of the file a share was written, like after a kill."""
    through, broken = tmp_path / "through.mcap", tmp_path / "broken.mcap"
    capture(simulated, PLAN, through)
    for n, after in enumerate(breaks):
        with pytest.raises(RigError, match="cable"):
            capture(breaking_after(after), PLAN, broken, resume=n > 0)
        assert not broken.with_suffix(".csv").exists()
    data = broken.read_bytes()
    broken.write_bytes(data[: int(len(data) * kept)])
    complete = progress_of(broken, PLAN).frames
    assert frames[0] <= complete <= frames[1]
    assert capture(simulated, PLAN, broken, resume=True) == 9 - complete
    names = ["broken.mcap", "broken.2.mcap", "broken.3.mcap"]
    assert [part.name for part in parts(broken)] == names[: 1 + len(breaks)]
    whole, joined = list(read_capture(through)), list(read_capture(broken))
    assert len(joined) == 9
    for (a, row_a), (b, row_b) in zip(whole, joined, strict=True):
        np.testing.assert_array_equal(a.image, b.image)
        assert row_a | {"recording": ""} == row_b | {"recording": ""}
    assert capture(simulated, PLAN, broken, resume=True) == 0


def test_nothing_is_overwritten_and_no_other_protocol_s_recording_is_continued(tmp_path: Path) -> None:
    path = tmp_path / "short.mcap"
    capture(simulated, PLAN, path)
    size = path.stat().st_size
    with pytest.raises(CaptureError, match="--resume"):
        capture(simulated, PLAN, path)
    other = Plan("other", PLAN.steps[:2])
    with pytest.raises(CaptureError, match=r"'short', not this 'other'"):
        capture(simulated, other, path, resume=True)
    assert path.stat().st_size == size


def _write(tmp_path: Path) -> tuple[Path, Path]:
    simulation, protocol = tmp_path / "tip.toml", tmp_path / "tiny.toml"
    simulation.write_text('[tip]\nn_pins = 37\nkind = "hex"\n[camera]\nsize_px = [96, 96]\n')
    protocol.write_text("rest_frames = 2\nframes = 1\n[[step]]\ndepth_mm = [0.5, 1.0]\n")
    return simulation, protocol


def test_command_captures_and_resumes(tmp_path: Path) -> None:
    simulation, protocol = _write(tmp_path)
    out = tmp_path / "out.mcap"
    options = ["capture", "--rig", f"sim:{simulation}", "--protocol", str(protocol), "-o", str(out)]
    assert "out.mcap: complete, 4 frames of protocol tiny; table" in run_calib(*options).out
    assert len(rows_of(out)) == 4
    again = run_calib(*options, "--resume").out
    assert "out.mcap: complete, 4 frames of protocol tiny (none of them now); table" in again


def test_help_names_every_command_without_importing_them(monkeypatch: pytest.MonkeyPatch) -> None:
    place = "hostlink.command_group.import_module"
    monkeypatch.setattr(place, lambda name: pytest.fail(f"{name} was imported"))
    assert all(name in run_calib("--help").out for name in COMMANDS)
    assert run_calib("dance").refusal


@pytest.mark.parametrize("resume", [(), ("--resume",)])
def test_a_table_that_is_not_the_capture_s_own_is_kept(tmp_path: Path, resume: tuple[str, ...]) -> None:
    simulation, protocol = _write(tmp_path)
    table = tmp_path / "x.csv"
    table.write_text("sensor_image,pose_z\nmine.png,1.0\n")
    rig, out = f"sim:{simulation}", tmp_path / "x.mcap"
    done = run_calib("capture", "--rig", rig, "--protocol", protocol, "-o", out, *resume)
    assert "x.csv: exists" in done.refusal
    assert table.read_text() == "sensor_image,pose_z\nmine.png,1.0\n"
    assert not out.exists()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "no column pose_Rx"),
        (b"\x8c\xff\x00rubbish", "not a table"),
        (b"recording,sequence,role\n", "no column pose_Rx"),
        (b"HEAD\nshort.mcap,many,rest" + b",0" * 8 + b"\n", "line 2 is not one"),
        (b"HEAD\nshort.mcap,3\n", "line 2 is not one"),
        (b"HEAD\nshort.mcap," + b"9" * 5000 + b",rest" + b",0" * 8 + b"\n", "line 2 is not one"),
        ("HEAD\nshort.mcap,\u0663,rest".encode() + b",0" * 8 + b"\n", "line 2 is not one"),
        (b"HEAD\nshort.mcap,3,rest" + b",0" * 9 + b"\n", "line 2: 12 cells for 11 headings"),
        (
            b"HEAD\nshort.mcap,3,rest" + b",0" * 7 + b",1_0\n",
            "line 2, column shear_Rz: '1_0' is not a number",
        ),
        (b"HEAD\nother.mcap,3,rest" + b",0" * 8 + b"\n", "line 2: no recording other.mcap beside it"),
        (b"HEAD" + 2 * (b"\nshort.mcap,3,rest" + b",0" * 8), "line 3: its frame is in line 2 already"),
        (b'HEAD\n"short.mcap,3,rest' + b",0" * 8 + b"\n", "line 2: no row of a table"),
        (b"HEAD,pose_z\nshort.mcap,3,rest" + b",0" * 9 + b"\n", "line 1: 2 columns pose_z"),
    ],
)
def test_a_damaged_table_is_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    head = ",".join(("recording", "sequence", "role", *POSE_COLUMNS)).encode()
    (tmp_path / "short.csv").write_bytes(content.replace(b"HEAD", head))
    (tmp_path / "short.mcap").write_bytes(b"")
    with pytest.raises(InputError, match=message) as caught:
        read_rows(tmp_path / "short.mcap")
    assert str(caught.value).isprintable()


def test_frames_have_their_rows_however_these_are_sorted(tmp_path: Path) -> None:
    path = tmp_path / "short.mcap"
    capture(simulated, PLAN, path)
    pairs = list(read_capture(path))
    assert len(pairs) == 9
    poses = [pose_of(row) for _, row in pairs if row["role"] == "sample"]
    assert poses == [Pose(**(frame.truth or {})["pose"]) for frame, _ in pairs[3:]]
    before = [(frame.sequence, row) for frame, row in pairs]
    head, *lines = path.with_suffix(".csv").read_text().splitlines()
    path.with_suffix(".csv").write_text("\n".join([head, *lines[::-1]]))
    assert read_rows(path) == [row for _, row in before]
    assert [(frame.sequence, row) for frame, row in read_capture(path)] == before
    path.with_suffix(".csv").write_text("\n".join([head, *lines, lines[-1].replace(",8,", ",999,", 1)]))
    with pytest.raises(CaptureError, match=r"frame 999 is not in short\.mcap; leave out its row"):
        list(read_capture(path))
    path.with_suffix(".csv").unlink()
    for missing, message in ((path, "--resume"), (tmp_path / "none.mcap", r"none\.mcap: no such recording")):
        with pytest.raises(CaptureError, match=message):
            list(read_capture(missing))
