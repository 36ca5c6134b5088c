"""`python -m edge` as a user types it: results, and every mistake one line and exit code 2."""

import gc
import json
import logging
import os
import pty
import re
import shlex
import subprocess
import sys
from contextlib import closing, suppress
from itertools import count
from pathlib import Path
from shutil import copytree, ignore_patterns
from typing import Any

import cv2
import numpy as np
import pytest

from calib.sim import Camera, Simulator, Tip, ToolPose
from edge.calibration import Calibration
from edge.cli.progress import counting, waiting
from edge.examples import example_file
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.recording.writer import Recorder
from edge.rest.tip_match import match_tip
from edge.runtime.loop import Loop
from edge.runtime.statistics import LoopStatistics, StatisticsCollector
from edge.sensors import load_sensor
from edge.sources import open_source
from edge.types import Frame
from hostlink.wire import Status
from tests.support.commands import run_edge as command
from tests.support.messages import read_messages
from tests.support.processes import edge, python, small_disk
from tests.support.waiting import SOON_S, present


@pytest.fixture
def tip_image(data_dir: Path, tmp_path: Path) -> Path:
    """The first frame of a bundled recording as a picture."""
    with closing(open_source(str(data_dir / "nothing.mcap"))) as source:
        return write(tmp_path / "tip.png", next(iter(source)).image)


def write(path: Path, image: np.ndarray) -> Path:
    cv2.imwrite(str(path), image)
    return path


def test_inspect_lists_the_pins_and_names_the_sensor(tip_image: Path, tmp_path: Path) -> None:
    (found,) = json.loads(command("inspect", tip_image, "--json", "--overlay", tmp_path / "seen").printed)
    assert found["image"] == str(tip_image)
    assert found["n_pins"] == len(found["xy_px"]) == 127
    assert (tmp_path / "seen" / "tip_pins.png").is_file()
    assert "127 bright pins; they fit TacTip, 127 pins (tactip-127), 0." in command("inspect", tip_image).out
    other = command("inspect", tip_image, "--sensor", "tactip-331").printed
    assert "do not fit TacTip, 331 pins: 127 pins found" in other


def test_a_sensor_of_ones_own_is_made_from_one_image_and_one_length(tip_image: Path, tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    assert command("sensor", tip_image, "-o", mine, "--across-mm", "36", "--title", "my tip").code == 0
    made = load_sensor(str(mine))
    pins = made.pins
    assert (made.title, pins.count, pins.layout, pins.polarity) == ("my tip", 127, "hex", "bright")
    # Twelve pitches across; the lens of the picture makes those outside narrower.
    assert pins.pitch_mm == pytest.approx(3.0, rel=0.04)
    before = mine.read_bytes()
    assert command("sensor", tip_image, "-o", mine).code == 2
    assert mine.read_bytes() == before
    (found,) = json.loads(command("inspect", tip_image, "--sensor", mine, "--json").out)
    assert found["sensor"] == "mine"
    xy = np.array(found["xy_px"])
    across_px = np.hypot(*(xy[:, None] - xy).transpose(2, 0, 1)).max()
    assert found["mm_per_px"] * across_px == pytest.approx(36.0, rel=0.001)


def test_a_sensor_from_a_touched_image_is_made_with_a_warning(real_dir: Path, tmp_path: Path) -> None:
    for image, touched in (("tactip331_gray/frames/image_1.png", True), ("tactip331_binary/rest.png", False)):
        made = tmp_path / f"{touched}.toml"
        done = command("sensor", real_dir / image, "-o", made)
        assert done.code == 0
        assert ("something touches the tip" in done.err) == touched
        assert load_sensor(str(made)).pins.count == 331


def test_run_warns_of_fewer_pins_than_the_sensor_has(caplog: pytest.LogCaptureFixture) -> None:
    source = "sim:nothing?sensor=tactip-127&paced=0"
    run = command("run", "--source", source, "--sink", "memory:", "--sensor", "tactip-331", "-q")
    assert run.code == 0
    assert sum("127 pins found, TacTip, 331 pins has 331" in message for message in caplog.messages) == 1


def test_memory_does_not_grow_with_the_samples(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.CRITICAL, "edge")  # pytest keeps reports, and a busy machine makes more
    early_n, late_n, window_n = 300, 1300, 200
    least = dict.fromkeys((early_n, late_n), sys.maxsize)  # blocks: what other threads hold differs
    run_loop = Loop.run

    def watched(loop: Loop, frames_max: int | None = None) -> LoopStatistics:
        numbers = count()
        loop._counters = StatisticsCollector(early_n)  # full before the first look that counts

        def look(*result: object) -> None:
            n = next(numbers)
            for from_n in least:
                if n in range(from_n, from_n + window_n, 10):
                    gc.collect()
                    least[from_n] = min(least[from_n], sys.getallocatedblocks())
            if n == late_n + window_n:
                loop.stop()

        loop.result_callbacks.append(look)
        return run_loop(loop, frames_max)

    monkeypatch.setattr(Loop, "run", watched)
    source = "sim:nothing?rate_hz=1000&width=160&height=160"
    assert command("run", "--source", source, "--sink", "virtual:memory", "-q").code == 0
    assert least[late_n] - least[early_n] < 0.5 * (late_n - early_n)


def test_replay_prints_what_was_held_and_sent(data_dir: Path) -> None:
    arguments = ("replay", data_dir / "press_shear.mcap", "--speed", "max", "--sink", "memory:", "--json")
    table = json.loads(command(*arguments, "--calibration", data_dir / "hex127_flat.json").printed)
    assert table["frames_n"] == table["sent_n"] == 40
    assert table["pins_held_min"] == table["pins_n"] == 127
    assert table["displacement_max_mm"] == pytest.approx(3.0, abs=0.15)
    # The scene shears by (1.2, -0.9) mm.
    assert table["shear_peak_deg"] == pytest.approx(np.degrees(np.arctan2(-0.9, 1.2)), abs=3.0)


def calibrated(example: str, frames: list[Frame]) -> Pipeline:
    """The pipeline of an example's tip, with its calibration."""
    calibration = Calibration.load(example_file(example, ".json"))
    return Pipeline(match_tip(calibration, take_rest([frame.image for frame in frames[:8]]))[0], calibration)


def test_the_simulator_has_a_calibration() -> None:
    frames = list(open_source("sim:press?paced=0"))
    pipeline = calibrated("example:sim", frames)
    last = [pipeline.process(frame) for frame in frames[8:]][-1]
    assert last.reading.contacts[0] == pytest.approx([4.0, -3.0, 3.0], abs=0.2)


def test_the_example_loops_without_a_search_and_fits_its_truth() -> None:
    frames = list(open_source("example:press"))
    pipeline = calibrated("example:press", frames)
    assert pipeline.process(frames[8]).searched
    for frame in (*frames[9:], *frames):
        result, truth = pipeline.process(frame), frame.truth or {}
        assert not result.searched
        values = result.reading.values
        assert values["displacement_mm"] == pytest.approx(truth["depth_mm"], abs=0.2)
        assert values["force_n"] == pytest.approx(sum(truth["forces_n"]), abs=0.1)


def replayed(*arguments: str | Path) -> list[dict[str, Any]]:
    """Samples of a replay, and behind them its summary."""
    done = command("replay", *arguments, "--speed", "max", "--samples", "--json")
    return [json.loads(line) for line in done.printed.splitlines()]


def values(recording: Path, *more: str | Path) -> list[dict[str, object]]:
    """Samples of a replay, without their times."""
    *samples, summary = replayed(recording, *more)
    assert len(samples) == summary["frames_n"] - 7  # frames that became the rest frame have no result
    return [{k: v for k, v in s.items() if k not in ("latency_us", "capture_time_us")} for s in samples]


def test_a_recording_of_a_replay_replays_the_same(data_dir: Path, tmp_path: Path) -> None:
    once = values(data_dir / "press_shear.mcap", "--record", tmp_path / "again.mcap")
    assert values(tmp_path / "again.mcap") == once
    assert len(once) == 33


def test_values_are_smoothed_by_the_option_or_else_by_the_file(data_dir: Path, tmp_path: Path) -> None:
    press = data_dir / "press_shear.mcap", "--calibration", data_dir / "hex127_flat.json"
    (tmp_path / "edge.toml").write_text("[features]\nsmooth_ms = 200\n")
    config = "--config", tmp_path / "edge.toml"
    plain, smooth = values(*press), values(*press, "--smooth", "200")
    assert values(*press, *config) == smooth
    assert values(*press, *config, "--smooth", "0") == plain
    differ = {name for a, b in zip(plain, smooth, strict=True) for name in a if a[name] != b[name]}
    assert {"displacement_mm", "shear_x_mm"} <= differ
    assert differ.isdisjoint({"status", "contact_n", "contacts", "slip_probability", "displacement_sigma_mm"})


RUN_ONE = ("run", "--source", "sim:nothing?pins=37&layout=hex&paced=0", "-q", "--frames", "1")


@pytest.mark.parametrize(
    ("sink", "finger"), [("virtual:numbered?node=5", 5), ("virtual:numbered", 4), ("memory:", 4)]
)
def test_a_recording_numbers_the_finger_as_the_bus_does(tmp_path: Path, sink: str, finger: int) -> None:
    (tmp_path / "edge.toml").write_text("[sensor]\nnode_id = 4\n")
    path = tmp_path / "a.mcap"
    options = ("--config", tmp_path / "edge.toml", "--sink", sink, "--record", path)
    assert command(*RUN_ONE, "--frames", "2", *options).code == 0
    topics = {topic for topic, _, _ in read_messages(path) if topic.startswith("/finger")}
    assert topics == {f"/finger_{finger}/sample", f"/finger_{finger}/contacts"}


@pytest.mark.parametrize(
    ("speed", "way_out"), [("100", "--loop plays it on"), ("max", "replay a longer one")]
)
def test_a_recording_that_ends_within_its_tare_is_reported(tip_image: Path, speed: str, way_out: str) -> None:
    """No values is no success."""
    output = command("replay", tip_image, "--speed", speed).refusal
    assert output.startswith(
        f"error: {tip_image}: ended while the rest frame was being taken (8 images and a search), no values"
    )
    assert output.endswith(way_out)  # at full speed it is too short too


@pytest.mark.parametrize("speed", ["10", "max"])
def test_images_without_pins_are_refused_at_any_speed(tmp_path: Path, speed: str) -> None:
    for n in range(40):
        cv2.imwrite(str(tmp_path / f"{n}.png"), np.full((1, 1), 90 + n, np.uint8))
    done = command("replay", tmp_path, "--speed", speed, "-q")
    assert done.code == 2
    assert "no pattern of pins in the image" in done.err.splitlines()[-1]


def test_images_passed_during_the_tare_are_reported(caplog: pytest.LogCaptureFixture, data_dir: Path) -> None:
    """A search takes longer than 40 images at a hundred times their rate, on a busy machine than all."""
    done = command("replay", data_dir / "press_shear.mcap", "--speed", "100", "-q")
    warnings = [record.getMessage() for record in caplog.records if record.name == "edge"]
    (output,) = warnings if done.code == 0 else done.err.splitlines()[-1:]
    assert "while the rest frame was being taken" in output
    assert "--loop" in output


def test_a_truncated_recording_is_reported_and_replayed(
    caplog: pytest.LogCaptureFixture, data_dir: Path, tmp_path: Path
) -> None:
    cut = tmp_path / "cut.mcap"
    with Recorder(cut) as recorder:
        for _ in range(3):  # more than one chunk
            for frame in open_source(str(data_dir / "press_shear.mcap")):
                recorder.frame(frame)
    os.truncate(cut, cut.stat().st_size * 2 // 3)
    warning = f"{cut}: not whole (cut off at its end); what could be read was taken"
    assert 8 < json.loads(command("replay", cut, "--speed", "max", "--json").printed)["frames_n"] < 120
    assert warning in caplog.text
    caplog.clear()
    assert command("render", cut, "-o", tmp_path / "a.mkv", "--height", "120", "-q").code == 0
    assert warning in caplog.text


def test_without_a_sink_a_warning_is_logged(caplog: pytest.LogCaptureFixture, tmp_path: Path) -> None:
    for options in ((), ("--sink", "memory:"), ("--record", tmp_path / "a.mcap")):
        caplog.clear()
        assert command(*RUN_ONE, *options).code == 0
        assert ("no sink: samples are not sent; give --sink can:can0" in caplog.text) == (not options)


def test_inspect_shows_the_rest_frame_of_a_recording(data_dir: Path, tmp_path: Path) -> None:
    inspect = ("inspect", data_dir / "press.mcap", "--rest")
    (found,) = json.loads(command(*inspect, "auto", "--json", "--overlay", tmp_path).printed)
    assert found["untouched"] is True
    assert found["n_pins"] == 331
    assert "cells are" in found["rest"]
    assert (tmp_path / "press_pins.png").is_file()
    done = command(*inspect, "none", "--calibration", data_dir / "rings331_ball.json")
    assert "the calibration's rest pins are moved onto it" in done.out
    assert json.loads(command(*inspect, "25", "--json").out)[0]["untouched"] is None


def test_replay_of_a_recording_that_begins_touched_corrects_its_rest_frame(tmp_path: Path) -> None:
    tip = Simulator(Camera(tip=Tip(n_pins=127, kind="hex"), size_px=(320, 320)))
    touch = (ToolPose(depth_mm=3.0, tilt_x_deg=15.0),)
    for number in range(24):
        write(tmp_path / f"{number}.png", tip.frame(touch if number < 8 else ()).image)
    *samples, _ = replayed(tmp_path, "--sink", "memory:")
    assert [sample["contact_n"] > 0 for sample in samples] == [True] * 8 + [False] * 16
    alone = command("replay", tmp_path / "0.png", "--sink", "memory:", "--speed", "max", "-q")
    assert alone.code == 2  # there is no untouched image


BLACK, WHITE = np.zeros((240, 320), np.uint8), np.full((240, 320), 255, np.uint8)


def test_inspect_reports_what_has_no_pins_and_goes_on(tmp_path: Path, tip_image: Path) -> None:
    images = [tmp_path / name for name in ("black.png", "white.png", "absent.png")]
    write(images[0], BLACK)
    write(images[1], WHITE)
    done = command("inspect", *images, tip_image, "--json")
    assert done.code == 2
    assert [entry["n_pins"] for entry in json.loads(done.out)] == [0, 0, 0, 127]
    for image, line in zip(images, done.err.splitlines(), strict=True):
        assert str(image) in line


@pytest.fixture
def mistaken(data_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with files that are not what their names say."""
    for name, text in {
        "text.mcap": "this is a letter, not a recording\n",
        "text.png": "this is a letter, not an image\n",
        "bad.toml": "[source]\nspeck = 'v4l2:0'\n",
        "nothing": "",
        "there.mcap": "keep me",
        "video.mp4": "keep me",
    }.items():
        (tmp_path / name).write_text(text)
    whole = (data_dir / "press.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    for folder in ("empty", "seen"):
        (tmp_path / folder).mkdir()
    for name in ("black.png", "seen/black_pins.png"):
        write(tmp_path / name, BLACK)
    write(tmp_path / "float.tiff", np.full((240, 320), 0.5, np.float32))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("replay text.mcap", "text.mcap"),
        ("replay {press} --speed fast", "'fast' is not a speed; give a factor from 0.01 to 100, or max"),
        ("replay {press} --speed max --loop", "--loop: has no end at --speed max"),
        ("replay {press} --record a.avi", "a.avi: the name must end in .mcap"),
        ("replay there.mcap --record there.mcap", "there.mcap: is an input of this command"),
        ("replay {press} --record there.mcap", "there.mcap: exists already; give another name"),
        ("render video.mp4 -o video.mp4", "video.mp4: is an input of this command"),
        ("render {press} -o video.mp4", "video.mp4: exists already; give another name"),
        ("render {press} -o a.png", "a.png: the name must end in .mp4 or .webm or .mkv or .avi"),
        ("render {press} -o a.mp4 --rate nan", "'nan' is not a number"),
        ("inspect black.png --overlay seen", "black_pins.png: exists already"),
        ("inspect black.png --overlay .", "black.png is there too; give another folder"),
        ("inspect black.png --calibration a.json", "--calibration: is for the rest frame of a rec"),
        ("inspect {press} --rest none", "--rest none: needs --calibration"),
        ("inspect {press} --rest 9999", "has no image 9999"),
        ("inspect black.png seen --out a.png", "--out: is for a single image; give --overlay"),
        ("inspect black.png --out black.png", "black.png: is an input of this command"),
        ("inspect black.png seen/black.png --overlay new", "two images are named black"),
        ("replay {press} --view --view-token-file absent", "absent: No such file"),
        ("replay {press} --view-token 12345678", "there is no page; give --view too"),
        ("replay {press} --calibration text.png", "not a calibration file"),
        ("replay {press} --calibration {other} --record there.mcap --overwrite", "calibration"),
        ("replay {press} --config bad.toml", "source: unknown key 'speck'"),
        ("replay float.tiff", "float.tiff: pixels of type float32; save it with 8 or 16 bits"),
        ("replay cut.mcap", "cut.mcap: cut off before its first whole image; copy or record it again"),
        ("replay {press} --view-at 'no host'", "no host 'no host' is known; give HOST:PORT"),
        ("replay {press} --view-at 0.0.0.0:8765", "give a token"),
        ("render {press} -o a.mp4 --calibration {other}", "give the calibration of this tip"),
        ("run --source sim:tour?paced=x", 'sim:tour: paced: must be true or false, is "x"'),
        ("replay {press} --record no/such/folder.mcap", "folder.mcap"),
        ("inspect black.png --sensor thumb", "sensor 'thumb' is unknown; one of digitac, "),
        ("run --smooth 1001", "'--smooth': 1001 is out of range; give a number from 0 to 1000"),
        ("run --sensor absent.toml", "absent.toml: cannot be read"),
        ("run --source sim:tour?sensor=tactip-127&pins=7", "pins= beside sensor="),
        ("run --source sim:tour?sensor=digitac", "digitac cannot be simulated: its file has no pins.layout"),
        ("sensor black.png -o mine.toml", "no pattern of pins"),
        ("sensor black.png -o mine.toml --across-mm 0", "give a number from 0.1 to 1000"),
        ("inspect", "IMAGE"),
        ("dance", "No such command 'dance'; see python -m edge --help"),
    ],
    ids=lambda value: value[:40],
)
def test_a_mistake_is_one_line_and_code_2(mistaken: Path, data_dir: Path, line: str, expected: str) -> None:
    places = {"press": data_dir / "press_shear.mcap", "other": data_dir / "rings331_ball.json"}
    assert expected in command(*[word.format(**places) for word in shlex.split(line)]).refusal
    assert {(mistaken / name).read_text() for name in ("there.mcap", "video.mp4")} == {"keep me"}


def test_a_dark_period_is_a_status_bit_and_a_count(data_dir: Path, tmp_path: Path) -> None:
    images = [frame.image for frame in open_source(str(data_dir / "nothing.mcap"))]
    for i, image in enumerate([*images[:10], *[np.zeros_like(images[0])] * 4, *images[10:]]):
        write(tmp_path / f"{i:03d}.png", image)
    *samples, summary = replayed(tmp_path)
    assert summary["faults"]["IMAGE_DARK"] == 1
    assert summary["without_values"]["IMAGE_DARK"] == 4
    shown = command("render", tmp_path, "--height", "120", "--json", "-o", tmp_path.with_suffix(".mkv"))
    assert json.loads(shown.out)["without_values"] == summary["without_values"]
    lost = [bool(Status(sample["status"]) & Status.TRACKER_LOST) for sample in samples]
    assert lost == [False] * 3 + [True] * 4 + [False] * (len(samples) - 7)
    assert samples[-1]["pins_tracked"] == 1.0


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".avi", ".webm"])
def test_a_video_that_does_not_fit_on_the_disk_is_one_line_and_no_file(
    data_dir: Path, tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"a{suffix}"
    done = edge("render", data_dir / "press_shear.mcap", "-o", path, "--height", "240", **small_disk(60_000))
    assert done.returncode == 1
    *noise, output = done.stderr.strip().splitlines()
    assert output == f"error: {path}: cannot be written: No space left on device"
    assert all("codec id" in line for line in noise)  # OpenCV's message about a tag, which bypasses its log
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("fault", ["a.mcap: No space left on device", None])
def test_a_recording_that_does_not_fit_on_the_disk_is_no_success(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    data_dir: Path,
    tmp_path: Path,
    fault: str | None,
) -> None:
    """As the worker reports it."""
    stays = property(lambda feed: fault, lambda feed, value: None)
    monkeypatch.setattr("edge.recording.session.RecordingSession.fault", stays, raising=False)
    replay = ("replay", data_dir / "press_shear.mcap", "--speed", "max", "-q")
    assert command(*replay, "--record", tmp_path / "a.mcap").code == (1 if fault else 0)
    assert (f"recording: {fault}" in caplog.text) == (fault is not None)


def test_a_recorder_without_shared_memory_is_one_line_and_no_file(data_dir: Path, tmp_path: Path) -> None:
    """A limit on the size of files holds for memory that is shared with the recorder's process, too."""
    done = edge("replay", data_dir / "press.mcap", "--record", tmp_path / "a.mcap", **small_disk(20_000))
    assert done.returncode == 1
    assert re.fullmatch(r"error: shared memory of \d+ MB: File too large\n", done.stderr)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("more", [[], ["--loop"]], ids=["once", "loop"])
def test_closing_stdout_ends_the_replay(data_dir: Path, more: list[str]) -> None:
    command = [sys.executable, "-m", "edge", "replay", str(data_dir / "press_shear.mcap"), "--samples"]
    speed = [] if more else ["--speed", "max"]
    with subprocess.Popen(
        [*command, *speed, *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        stdout, stderr = present(process.stdout), present(process.stderr)
        assert "contact_n" in json.loads(stdout.readline())
        stdout.close()
        output = stderr.read()
        assert process.wait(SOON_S) == 0
    # where the recording begins again the pins jump, which is reported
    assert all(line.startswith("WARNING edge.faults") for line in output.splitlines()), output


@pytest.mark.parametrize("samples", [["--samples", "-q"], ["--json"], []], ids=["samples", "json", "table"])
def test_a_full_disk_behind_stdout_is_one_line(data_dir: Path, samples: list[str]) -> None:
    with open("/dev/full", "w") as full:
        done = edge("replay", data_dir / "nothing.mcap", "--speed", "max", *samples, stdout=full)
    assert done.returncode == 1
    assert done.stderr == "error: stdout: cannot be written: No space left on device\n"


def test_files_are_replaced_if_that_is_asked_for(tip_image: Path, data_dir: Path, tmp_path: Path) -> None:
    """Without, it is a mistake: see the table."""
    path, source = tmp_path / "a.mcap", data_dir / "nothing.mcap"
    path.write_text("the old one")
    replay = ("replay", source, "--speed", "max", "-q", "--record", path, "--overwrite")
    assert command(*replay).code == 0
    assert len(list(open_source(str(path)))) == len(list(open_source(str(source))))
    for _ in range(2):
        assert command("inspect", tip_image, "--overlay", tmp_path / "seen", "--overwrite").code == 0
    assert [path.name for path in (tmp_path / "seen").iterdir()] == ["tip_pins.png"]


@pytest.mark.parametrize("missing", ["numpy", "cv2", "cython"])
def test_without_the_edge_extra_a_command_names_the_cure(tmp_path: Path, missing: str) -> None:
    for name in ("edge", "hostlink"):  # source that is not compiled
        copytree(Path(__file__).parents[3] / name, tmp_path / name, ignore=ignore_patterns("*.so"))
    code = (
        f"import sys; sys.modules[{missing!r}] = None; sys.argv = ['edge', *sys.argv[1:]]\n"
        "from edge.__main__ import main; main()"
    )
    for arguments in (["inspect", "a.png"], ["doctor"], ["replay", "a.mcap"], ["render", "a", "-o", "a.mp4"]):
        done = python("-c", code, *arguments, cwd=tmp_path)
        assert done.returncode == 2, done.stderr
        (output,) = done.stderr.splitlines()
        assert output.endswith("another folder" if missing == "cython" else "[edge] or -e .[edge]")


def on_a_terminal(command: list[str]) -> str:
    """What a command writes to a terminal as its stderr."""
    master, slave = pty.openpty()
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=slave, env={**os.environ, "TERM": "xterm"}
    ):
        os.close(slave)
        seen = b""
        with suppress(OSError):  # Linux raises it when the last user of the terminal has closed it
            while data := os.read(master, 65536):
                seen += data
    os.close(master)
    return seen.decode(errors="replace")


@pytest.mark.parametrize("quiet", [False, True])
def test_a_replay_counts_its_frames(data_dir: Path, quiet: bool) -> None:
    command = [sys.executable, "-m", "edge", "replay", str(data_dir / "nothing.mcap"), "--sink", "memory:"]
    seen = on_a_terminal([*command, "--speed", "1", *(["--quiet"] if quiet else [])])
    assert ("opening" in seen) is not quiet
    assert ("replay" in seen and "/16" in seen) is not quiet


def test_without_a_terminal_nothing_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    with waiting("long work", True), counting("frames", 3, True) as counted:
        counted(1)
    assert capsys.readouterr() == ("", "")
