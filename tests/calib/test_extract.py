"""Many frames: identical results wherever they are computed; captures; the commands from end to end."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.capture import capture
from calib.dataset import Dataset, open_dataset
from calib.errors import CaptureError, TableError
from calib.extract import Extract, executor
from calib.fit import ModelKind, Search
from calib.protocols import Plan, Step
from calib.rig.base import CLEAR, Pose
from calib.rig.simulated import CameraTable, SimulatedRig, Simulation
from calib.sim import Tip, Tool
from edge.calibration import Calibration
from edge.errors import SourceError
from edge.sources.files import read_image
from tests.support.captures import write_table
from tests.support.commands import run_calib
from tests.support.processes import python
from tests.support.waiting import until

SMALL = Simulation(tip=Tip(127, "hex"), camera=CameraTable(size_px=(240, 240)))
BALL = Tool("sphere", 3.0)
pytestmark = pytest.mark.usefixtures("quick_fits")


def plan(n: int = 36) -> Plan:
    """Presses of a ball at random places, depths and shears."""
    rng = np.random.default_rng(2)
    steps = [Step(CLEAR, BALL, 3, "rest")]
    for _ in range(n):
        x, y, sx, sy = np.round(rng.uniform(-1, 1, 4) * [5, 5, 0.8, 0.8], 3).tolist()
        depth = round(float(rng.uniform(0.8, 3.0)), 3)
        steps.append(Step(Pose(x_mm=x, y_mm=y, depth_mm=depth, shear_x_mm=sx, shear_y_mm=sy), BALL, 1))
    return Plan("random", tuple(steps))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("capture") / "random.mcap"
    capture(lambda first: SimulatedRig(SMALL, first), plan(), path)
    return path


@pytest.fixture(scope="module")
def seen_here(recording: Path) -> Extract:
    """Computed in this process."""
    with ThreadPoolExecutor(1) as here:
        return open_dataset([recording], None, None).extract(here)


def assert_same(a: Extract, b: Extract) -> None:
    for name in ("inputs", "contact", "confidence", "seen_n", "trusted", "in_contact", "counts", "angle_rad"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


def test_processes_give_the_same_bits(recording: Path, seen_here: Extract) -> None:
    done: list[int] = []
    with executor(workers=2) as pool:
        seen = open_dataset([recording], None, None).extract(pool, done.append)
    assert_same(seen, seen_here)
    assert sum(done) == len(seen.trusted) == 36


def test_a_cluster_gives_identical_results(recording: Path, seen_here: Extract) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
        ) as cluster,
        executor(cluster.scheduler_address) as pool,
    ):
        seen = open_dataset([recording], None, None).extract(pool)
    assert_same(seen, seen_here)


def test_no_cluster_at_the_address_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("calib.extract.CLUSTER_TIMEOUT_S", 0.5)
    with pytest.raises(TableError, match="no scheduler answers"), executor("tcp://127.0.0.1:1"):
        pass


def test_frames_are_evaluated_independently(recording: Path, seen_here: Extract) -> None:
    """The order of the frames changes nothing."""
    data = open_dataset([recording], None, None)
    part = data.parts[0]
    backward = Dataset((type(part)(part.rest, part.targets, lambda: list(part.frames())[::-1], part.rows),))
    with ThreadPoolExecutor(1) as here:
        np.testing.assert_array_equal(backward.extract(here).inputs[::-1], seen_here.inputs)


Images = tuple[Path, Path, Path]


@pytest.fixture(scope="module")
def images(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Images:
    """The capture as a table beside a folder of images: table, folder, rest image."""
    folder = tmp_path_factory.mktemp("images")
    data = open_dataset([recording], None, None)
    names = {name: f"{name}_mm" for name in ("shear_x", "shear_y", "contact_x", "contact_y")}
    names |= {"pose_z": "displacement_mm", "force_z": "force_n"}
    columns = {column: data.targets.values[name] for column, name in names.items()}
    table = write_table(folder, data.parts[0].frames(), columns)
    rest = folder / "rest.png"
    cv2.imwrite(str(rest), SimulatedRig(SMALL).frame().image)
    return table, folder, rest


def run(*arguments: str | Path) -> str:
    done = run_calib(*arguments)
    assert done.code == 0, done
    return done.out


@pytest.fixture(scope="module")
def fitted(recording: Path, quick_fits: None) -> tuple[Path, str]:
    """The capture's calibration, and what the command printed."""
    path = recording.with_name("cal.json")
    return path, run("fit", recording, "-o", path, "--workers", "1", "-q", "--json", "--serial", "A1")


def test_fit_and_evaluate_a_capture(recording: Path, fitted: tuple[Path, str]) -> None:
    path, out = fitted
    assert {tuple(m["outputs"]) for m in json.loads(out)["models"]} >= {("displacement_mm",), ("force_n",)}
    calibration = Calibration.load(path)
    assert calibration.mm_per_px is not None
    assert calibration.content.sensor.serial == "A1"
    assert 0.1 < calibration.mm_per_px / (2 * 16.7 / (2 * 0.38 * 240)) < 2.0
    report = json.loads(run("evaluate", path, recording, "--workers", "1", "-q", "--json"))
    assert report["n_frames"] == 36
    assert report["n_refused"] == 0
    assert report["displacement_mae_mm"] < 0.15
    assert report["contact_place_mean_mm"] < 0.5


def test_fit_is_evaluated_on_held_out_frames(
    recording: Path, fitted: tuple[Path, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file is the same as without, and the errors are in evaluate's table."""
    path = tmp_path / "cal.json"
    words = "fit", recording, "-o", path, "--workers", "1", "-q", "--hold-out", "0.25"
    out = run(*words)
    assert "9 frames; 0 refused" in out
    assert "is fitted to all frames" in out
    models = Calibration.load(path).content.models
    assert models == Calibration.load(fitted[0]).content.models
    plain = partial(Search, kinds=frozenset({ModelKind.PLAIN}))  # quick
    monkeypatch.setattr("calib.commands.fit.Search", plain)
    assert json.loads(run(*words, "--overwrite", "--json"))["held_out"]["n_frames"] == 9


INTERRUPTED = """
import os, signal
from calib.extract import executor
try:
    with executor(None, 2):
        os.killpg(0, signal.SIGINT)
        signal.pause()
except KeyboardInterrupt:
    print("interrupted")
"""


def test_an_interrupt_while_processes_start_prints_nothing() -> None:
    """A terminal sends Ctrl-C to all of them; none may print a traceback."""
    done = python("-c", INTERRUPTED, start_new_session=True)
    assert (done.stdout, done.stderr) == ("interrupted\n", "")


def test_workers_end_with_a_program_that_was_killed() -> None:
    code = (
        "import os, sys; from calib.extract import executor\n"
        "with executor(workers=2) as pool:\n"
        "    print(pool.submit(os.getpid).result(), flush=True)\n"
        "    sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as program:
        assert program.stdout is not None
        worker = Path("/proc") / program.stdout.readline().strip()
        assert (worker / "cmdline").exists()
        program.kill()
    until(lambda: not worker.exists(), "the end of the worker")


def test_another_tip_s_frames_are_refused(recording: Path, fitted: tuple[Path, str], tmp_path: Path) -> None:
    other = tmp_path / "other.mcap"
    tip = Simulation(tip=Tip(91, "hex"), camera=CameraTable(size_px=(240, 240)))
    capture(lambda first: SimulatedRig(tip, first), plan(2), other)
    refusal = run_calib("evaluate", fitted[0], other, "--workers", "1", "-q").refusal
    assert "pins" in refusal
    with pytest.raises(TableError, match="shows another tip than"):
        open_dataset([recording, other], None, None)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["{table}", "--rest", "{rest}"], "a table needs --frames DIR"),
        (["{table}", "{table}", "--frames", "{frames}", "--rest", "{rest}"], "one table at a time"),
        (["{table}", "{capture}"], "not both"),
        (["{capture}", "--rest", "{rest}"], "a capture has its own frames"),
        (["{table}", "--frames", "{frames}", "--rest", "{table}"], "targets.csv"),
        (["{table}", "--frames", "{frames}", "--rest", "{black}"], "an image of the untouched tip is needed"),
        (["{none}.mcap"], "no such recording"),
    ],
)
def test_mistakes_are_one_line_and_exit_code_2(
    recording: Path, images: Images, tmp_path: Path, arguments: list[str], expected: str
) -> None:
    black = tmp_path / "black.png"
    cv2.imwrite(str(black), np.zeros((240, 240), np.uint8))
    names = dict(zip(("table", "frames", "rest"), images, strict=True))
    names |= {"capture": recording, "black": black, "none": tmp_path / "none"}
    given = [argument.format(**names) for argument in arguments]
    assert expected in run_calib("fit", *given, "-q", "-o", tmp_path / "cal.json").refusal
    assert not (tmp_path / "cal.json").exists()


@pytest.mark.parametrize(
    ("spoil", "expected"),
    [
        (lambda path: path.write_bytes(b"this is a letter"), r"7\.png"),
        (
            lambda path: cv2.imwrite(str(path), read_image(path)[:-10]),
            r"7\.png: .* both must come from the same camera",
        ),
    ],
)
def test_a_frame_that_cannot_be_used_is_named(
    images: Images, tmp_path: Path, spoil: Callable[[Path], object], expected: str
) -> None:
    table, frames, rest = images
    spoilt = shutil.copytree(frames, tmp_path / "frames")
    spoil(spoilt / "7.png")
    with pytest.raises((SourceError, TableError), match=expected) as caught, executor(workers=1) as pool:
        open_dataset([table], spoilt, rest).extract(pool)
    assert "\n" not in str(caught.value)


def test_a_capture_that_has_only_rest_frames_or_none(recording: Path, tmp_path: Path) -> None:
    empty = tmp_path / "rest.mcap"
    capture(lambda first: SimulatedRig(SMALL, first), Plan("rest", plan(0).steps), empty)
    with pytest.raises(CaptureError, match="no rows but rest frames"):
        open_dataset([empty], None, None)
    bare = tmp_path / "bare.mcap"
    capture(lambda first: SimulatedRig(SMALL, first), Plan("bare", plan(2).steps[1:]), bare)
    with pytest.raises(CaptureError, match="does not begin with frames of the untouched tip"):
        open_dataset([bare], None, None)


@pytest.mark.real
def test_published_frames(real_dir: Path, tmp_path: Path) -> None:
    """A sample: 90 frames fitted, 30 held out. The full run is `python -m tests.bench real`."""
    where = real_dir / "tactip331_binary"
    lines = (where / "targets.csv").read_text().splitlines()
    train, test = tmp_path / "train.csv", tmp_path / "test.csv"
    train.write_text("\n".join([lines[0], *lines[1:91]]) + "\n")
    test.write_text("\n".join([lines[0], *lines[91:121]]) + "\n")
    path = tmp_path / "cal.json"
    place = ("--frames", where / "frames", "--rest", where / "rest.png", "-q")
    run("fit", train, *place, "-o", path)
    report = json.loads(run("evaluate", path, test, *place, "--json"))
    assert report["n_frames"] == 30
    assert report["n_refused"] <= 1
    assert report["displacement_mae_mm"] < 0.25
    assert max(report["tilt_mae_deg"]) < 3.0
    assert max(report["shear_mae_mm"]) < 1.5
    assert report["shear_direction_median_deg"] < 13.0
    assert 0.5 < report["sigma_coverage_68"] < 0.85
