"""`python -m edge` as a user types it: results, and every mistake one line and exit code 2."""

from __future__ import annotations

import gc
import json
import os
import re
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields
from importlib.metadata import version
from itertools import count
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from calib.sim.camera import Camera
from calib.sim.mechanics import ToolPose
from calib.sim.simulator import Simulator
from calib.sim.tip import Tip
from edge.__main__ import main
from edge.cli.options import LoopOptions
from edge.recording.reader import read_messages
from edge.recording.writer import Recorder
from edge.runtime.loop import Loop
from edge.runtime.statistics import LoopStatistics
from edge.sensors import load_sensor
from edge.sources import open_source
from hostlink.interrupt import ENDING
from tests.support.waiting import SOON_S, until


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str | Path) -> int:
    """Exit code of a command line."""
    monkeypatch.setattr("sys.argv", ["edge", *map(str, arguments)])
    try:
        main()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 1
    return 0


@pytest.fixture
def tip_image(data_dir: Path, tmp_path: Path) -> Path:
    """The first frame of a bundled recording as a picture."""
    source = open_source(str(data_dir / "nothing.mcap"))
    frame = next(iter(source))
    source.close()
    path = tmp_path / "tip.png"
    cv2.imwrite(str(path), frame.image)
    return path


def write(path: Path, image: np.ndarray) -> Path:
    cv2.imwrite(str(path), image)
    return path


def test_inspect_lists_the_pins(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tip_image: Path, tmp_path: Path
) -> None:
    assert run(monkeypatch, "inspect", tip_image, "--json", "--overlay", tmp_path / "seen") == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found["image"] == str(tip_image)
    assert found["n_pins"] == len(found["xy_px"]) == 127
    assert (tmp_path / "seen" / "tip_pins.png").is_file()


def test_inspect_names_the_sensor_and_its_scale(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tip_image: Path
) -> None:
    assert run(monkeypatch, "inspect", tip_image) == 0
    assert "127 bright pins, as of TacTip, 127 pins (tactip-127), 0." in capsys.readouterr().out
    assert run(monkeypatch, "inspect", tip_image, "--sensor", "tactip-331") == 0
    assert "not as of TacTip, 331 pins: 127 pins found" in capsys.readouterr().out


def test_a_sensor_of_ones_own_is_made_from_one_image_and_one_length(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tip_image: Path, tmp_path: Path
) -> None:
    mine = tmp_path / "mine.toml"
    assert run(monkeypatch, "sensor", tip_image, "-o", mine, "--across-mm", "36", "--title", "my tip") == 0
    made = load_sensor(str(mine))
    assert (made.title, made.pins.count, made.pins.layout, made.pins.polarity) == (
        "my tip",
        127,
        "hex",
        "bright",
    )
    # Twelve pitches across; the lens of the picture makes those outside narrower.
    assert made.pins.pitch_mm == pytest.approx(3.0, rel=0.04)
    before = mine.read_bytes()
    assert run(monkeypatch, "sensor", tip_image, "-o", mine) == 2
    assert mine.read_bytes() == before
    capsys.readouterr()
    assert run(monkeypatch, "inspect", tip_image, "--sensor", mine, "--json") == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found["sensor"] == "mine"
    pins = np.array(found["xy_px"])
    across_px = np.hypot(*(pins[:, None] - pins).transpose(2, 0, 1)).max()
    assert found["mm_per_px"] * across_px == pytest.approx(36.0, rel=0.001)


def test_a_sensor_from_a_touched_image_is_made_with_a_warning(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], real_dir: Path, tmp_path: Path
) -> None:
    for image, touched in (("tactip331_gray/frames/image_1.png", True), ("tactip331_binary/rest.png", False)):
        made = tmp_path / f"{touched}.toml"
        assert run(monkeypatch, "sensor", real_dir / image, "-o", made) == 0
        assert ("something touches the tip" in capsys.readouterr().err) == touched
        assert load_sensor(str(made)).pins.count == 331


def test_run_warns_of_fewer_pins_than_the_sensor_has(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    source = "sim:nothing?sensor=tactip-127&paced=0"
    assert (
        run(monkeypatch, "run", "--source", source, "--sink", "memory:", "--sensor", "tactip-331", "-q") == 0
    )
    missing = [
        message for message in caplog.messages if "127 pins found, TacTip, 331 pins has 331" in message
    ]
    assert len(missing) == 1


@pytest.mark.parametrize(
    "command",
    ["replay {data}/nothing.mcap --loop --speed 100", "run --source sim:nothing?rate_hz=1000&{size}"],
)
def test_memory_does_not_grow_with_the_samples(
    monkeypatch: pytest.MonkeyPatch, data_dir: Path, command: str
) -> None:
    early_n, late_n, window_n = 300, 1300, 200
    blocks = dict[int, int]()  # by the number of the sample
    run_loop = Loop.run

    def watched(loop: Loop, frames_max: int | None = None) -> LoopStatistics:
        numbers = count()

        def look(*result: object) -> None:
            n = next(numbers)
            if n % 10 == 0:
                gc.collect()
                blocks[n] = sys.getallocatedblocks()
            if n == late_n + window_n:
                loop.stop()

        loop.result_callbacks.append(look)
        return run_loop(loop, frames_max)

    def least(from_n: int) -> int:
        return min(blocks[n] for n in range(from_n, from_n + window_n, 10))  # what other threads hold differs

    monkeypatch.setattr(Loop, "run", watched)
    line = command.format(data=data_dir, size="width=160&height=160")
    assert run(monkeypatch, *line.split(), "--sink", "virtual:memory", "-q") == 0
    assert least(late_n) - least(early_n) < 0.5 * (late_n - early_n)


def test_replay_prints_what_was_held_and_sent(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], data_dir: Path
) -> None:
    arguments = ("replay", data_dir / "press_shear.mcap", "--speed", "max", "--sink", "memory:", "--json")
    calibration = ("--calibration", data_dir / "hex127_flat.json")
    assert run(monkeypatch, *arguments, *calibration) == 0
    table = json.loads(capsys.readouterr().out)
    assert table["frames_n"] == table["sent_n"] == 40
    assert table["pins_held_min"] == table["pins_n"] == 127
    assert table["displacement_max_mm"] == pytest.approx(3.0, abs=0.15)
    # The scene shears by (1.2, -0.9) mm.
    assert table["shear_peak_deg"] == pytest.approx(np.degrees(np.arctan2(-0.9, 1.2)), abs=3.0)


def test_replay_prints_samples_as_json_lines(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], data_dir: Path
) -> None:
    assert run(monkeypatch, "replay", data_dir / "nothing.mcap", "--speed", "max", "--samples", "--json") == 0
    *samples, summary = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(samples) == summary["frames_n"] - 7  # frames that became the rest frame have no result
    assert all(sample["contact_n"] == 0 for sample in samples)


def test_a_recording_of_a_replay_replays_the_same(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], data_dir: Path, tmp_path: Path
) -> None:
    first = ("replay", data_dir / "press_shear.mcap", "--speed", "max", "--samples")
    assert run(monkeypatch, *first, "--record", tmp_path / "again.mcap") == 0
    once = capsys.readouterr().out.splitlines()
    assert run(monkeypatch, "replay", tmp_path / "again.mcap", "--speed", "max", "--samples") == 0
    again = capsys.readouterr().out.splitlines()

    def values(lines: list[str]) -> list[dict[str, object]]:
        samples = [json.loads(line) for line in lines if line.startswith("{")]
        return [{k: v for k, v in s.items() if k not in ("latency_us", "capture_time_us")} for s in samples]

    assert values(once) == values(again)
    assert len(values(once)) == 33


@pytest.mark.parametrize(
    ("sink", "finger"), [("virtual:numbered?node=5", 5), ("virtual:numbered", 4), ("memory:", 4)]
)
def test_a_recording_numbers_the_finger_as_the_bus_does(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, sink: str, finger: int
) -> None:
    (tmp_path / "edge.toml").write_text("[sensor]\nnode_id = 4\n")
    arguments = (
        "run",
        "--config",
        tmp_path / "edge.toml",
        "--source",
        "sim:nothing?pins=37&layout=hex&paced=0",
    )
    path = tmp_path / "a.mcap"
    assert run(monkeypatch, *arguments, "--frames", "2", "-q", "--sink", sink, "--record", path) == 0
    topics = {topic for topic, _, _ in read_messages(path)}
    assert {topic for topic in topics if topic.startswith("/finger")} == {
        f"/finger_{finger}/sample",
        f"/finger_{finger}/contacts",
    }


@pytest.mark.parametrize(("speed", "way_out"), [("100", "--loop plays it on"), ("max", "a longer one")])
def test_a_recording_that_ends_within_its_tare_is_reported(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tip_image: Path,
    speed: str,
    way_out: str,
) -> None:
    """No values is no success."""
    assert run(monkeypatch, "replay", tip_image, "--speed", speed, "-q") == 1
    *_, output = capsys.readouterr().err.splitlines()
    assert output.startswith(
        f"error: {tip_image}: ended while the rest frame was being taken (8 images and a search), no values"
    )
    assert way_out in output


def test_images_that_pass_during_the_tare_are_reported(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    capsys: pytest.CaptureFixture[str],
    data_dir: Path,
) -> None:
    """A search takes longer than 40 images at a hundred times their rate, on a busy machine than all."""
    ended = run(monkeypatch, "replay", data_dir / "press_shear.mcap", "--speed", "100", "-q")
    warnings = [record.getMessage() for record in caplog.records if record.name == "edge"]
    *_, error = ["", *capsys.readouterr().err.splitlines()]
    (output,) = warnings if ended == 0 else [error]
    assert "while the rest frame was being taken" in output
    assert "--loop" in output


def test_a_truncated_recording_is_reported_and_replayed(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    capsys: pytest.CaptureFixture[str],
    data_dir: Path,
    tmp_path: Path,
) -> None:
    with Recorder(tmp_path / "cut.mcap") as recorder:
        for _ in range(3):  # more than one chunk
            for frame in open_source(str(data_dir / "press_shear.mcap")):
                recorder.frame(frame)
    os.truncate(tmp_path / "cut.mcap", (tmp_path / "cut.mcap").stat().st_size * 2 // 3)
    assert run(monkeypatch, "replay", tmp_path / "cut.mcap", "--speed", "max", "--json") == 0
    assert 8 < json.loads(capsys.readouterr().out)["frames_n"] < 120
    output = f"{tmp_path}/cut.mcap: not whole (cut off at its end); what could be read was taken"
    assert output in caplog.text
    caplog.clear()
    assert run(monkeypatch, "render", tmp_path / "cut.mcap", "-o", tmp_path / "a.mkv", "-q") == 0
    assert output in caplog.text


def test_without_a_sink_a_warning_is_logged(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    arguments = ("run", "--source", "sim:nothing?pins=37&layout=hex&paced=0", "--frames", "1", "-q")
    assert run(monkeypatch, *arguments) == 0
    assert "no sink: samples are not sent; give --sink can:can0" in caplog.text
    caplog.clear()
    assert run(monkeypatch, *arguments, "--sink", "memory:") == 0
    assert run(monkeypatch, *arguments, "--record", tmp_path / "a.mcap") == 0
    assert "no sink" not in caplog.text


def test_inspect_shows_the_rest_frame_of_a_recording(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], data_dir: Path, tmp_path: Path
) -> None:
    press = data_dir / "press.mcap"
    assert run(monkeypatch, "inspect", press, "--rest", "auto", "--json", "--overlay", tmp_path) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found["untouched"] is True
    assert found["n_pins"] == 331
    assert "cells are" in found["rest"]
    assert (tmp_path / "press_pins.png").is_file()
    calibration = data_dir / "rings331_ball.json"
    assert run(monkeypatch, "inspect", press, "--rest", "none", "--calibration", calibration) == 0
    assert "the calibration's rest pins are moved onto it" in capsys.readouterr().out
    assert run(monkeypatch, "inspect", press, "--rest", "25", "--json") == 0
    assert json.loads(capsys.readouterr().out)[0]["untouched"] is None


def test_replay_of_a_recording_that_begins_touched_corrects_its_rest_frame(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    tip = Simulator(Camera(tip=Tip(n_pins=127, kind="hex"), size_px=(320, 320)))
    touch = (ToolPose(depth_mm=3.0, tilt_x_deg=15.0),)
    for number in range(24):
        write(tmp_path / f"{number}.png", tip.frame(touch if number < 8 else ()).image)
    assert run(monkeypatch, "replay", tmp_path, "--sink", "memory:", "--speed", "max", "--samples", "-q") == 0
    lines = capsys.readouterr().out.strip().splitlines()
    contacts = [json.loads(line)["contact_n"] > 0 for line in lines]
    assert contacts == [True] * 8 + [False] * 16


BLACK, WHITE = np.zeros((240, 320), np.uint8), np.full((240, 320), 255, np.uint8)


@pytest.mark.parametrize("image", [BLACK, WHITE], ids=["black", "white"])
def test_inspect_reports_an_image_without_pins(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, image: np.ndarray
) -> None:
    path = write(tmp_path / "image.png", image)
    assert run(monkeypatch, "inspect", path, "--json") == 2
    output = capsys.readouterr()
    assert json.loads(output.out)[0]["n_pins"] == 0
    assert len(output.err.strip().splitlines()) == 1
    assert str(path) in output.err


def test_inspect_goes_on_after_a_bad_image(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, tip_image: Path
) -> None:
    assert run(monkeypatch, "inspect", tmp_path / "absent.png", tip_image, "--json") == 2
    output = capsys.readouterr()
    assert [entry["n_pins"] for entry in json.loads(output.out)] == [0, 127]
    assert "absent.png" in output.err


def _text(folder: Path, name: str, content: str) -> Path:
    path = folder / name
    path.write_text(content)
    return path


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["replay", "absent.mcap"], "absent.mcap"),
        (["replay", "text.mcap"], "text.mcap"),
        (["replay", "text.png"], "text.png"),
        (["replay", "empty"], "empty"),
        (["replay", "black.png", "--speed", "max"], "black.png"),
        (["replay", "white.png", "--speed", "max"], "white.png"),
        (
            ["replay", "{press}", "--speed", "fast"],
            "'fast' is not a speed; give a factor from 0.01 to 100, or max",
        ),
        (["replay", "{press}", "--speed", "0"], "'0' is not a speed"),
        (["replay", "{press}", "--speed", "nan"], "'nan' is not a speed"),
        (["replay", "{press}", "--speed", "max", "--loop"], "--loop: has no end at --speed max"),
        (["replay", "{press}", "--record", "a.avi"], "a.avi: the name must end in .mcap"),
        (["replay", "there.mcap", "--record", "there.mcap"], "there.mcap: is an input of this command"),
        (["replay", "{press}", "--record", "there.mcap"], "there.mcap: exists already; give another name"),
        (["run", "--record", "there.mcap"], "there.mcap: exists already"),
        (["render", "video.mp4", "-o", "video.mp4"], "video.mp4: is an input of this command"),
        (["render", "video.mp4", "-o", "video.mp4", "--overwrite"], "video.mp4: is an input of this command"),
        (["render", "{press}", "-o", "video.mp4"], "video.mp4: exists already; give another name"),
        (["render", "{press}", "-o", "a.png"], "a.png: the name must end in .mp4 or .webm or .mkv or .avi"),
        (["render", "{press}", "-o", "a.mp4", "--rate", "nan"], "'nan' is not a number"),
        (["render", "{press}", "-o", "a.mp4", "--rate", "inf"], "'inf' is not finite"),
        (["run", "--frames", "1e3"], "'1e3' is not a whole number"),
        (["inspect", "black.png", "--overlay", "seen"], "black_pins.png: exists already"),
        (["inspect", "black.png", "--overlay", "."], "black.png is there too; give another folder"),
        (
            ["inspect", "black.png", "--calibration", "a.json"],
            "--calibration: is for the rest frame of a rec",
        ),
        (["inspect", "{press}", "--rest", "none"], "--rest none: needs --calibration"),
        (["inspect", "{press}", "--rest", "9999"], "has no image 9999"),
        (["inspect", "missing.png"], "error: image missing.png: no such file"),
        (["inspect", "{press}"], "; for a recording add --rest auto"),
        (["inspect", "seen"], "error: image seen: is a folder; give the images in it, one by one"),
        (["inspect", "black.png", "seen/black.png", "--overlay", "new"], "two images are named black"),
        (["replay", "{press}", "--view", "--view-token-file", "absent"], "absent: No such file"),
        (["replay", "{press}", "--view", "--view-token-file", "nothing"], "its first line is empty"),
        (["replay", "{press}", "--view-token", "12345678"], "there is no page; give --view too"),
        (["replay", "{press}", "--calibration", "text.png"], "not a calibration file"),
        (["replay", "{press}", "--calibration", "absent.json"], "absent.json: cannot be read"),
        (["replay", "{press}", "--speed", "max", "--calibration", "{other}"], "calibration"),
        (["replay", "{press}", "--config", "bad.toml"], "unknown key 'speck' in [source]"),
        (["replay", "float.tiff"], "float.tiff: pixels of type float32; save it with 8 or 16 bits"),
        (["inspect", "float.tiff"], "float.tiff: pixels of type float32; save it with 8 or 16 bits"),
        (["replay", "cut.mcap"], "cut.mcap: cut off before its first whole image; copy or record it again"),
        (["replay", "{press}", "--view-at", "no host"], "no host 'no host' is known; give HOST:PORT"),
        (
            ["render", "{press}", "-o", "a.mp4", "--calibration", "{other}"],
            "give the calibration of this tip",
        ),
        (["run", "--source", "sim:tour?paced=x"], "sim:tour: paced=x: give 0 or 1, e.g. paced=1"),
        (["run", "--source", "sim:tour?pins=many"], "sim:tour: pins=many: give a whole number"),
        (["run", "--source", "v4l2:abc"], "v4l2:abc: no such camera; give v4l2:NUMBER"),
        (
            ["run", "--source", "v4l2:0?width=wide"],
            "width=wide: give a whole number from 0 to 8192, e.g. width=1",
        ),
        (["replay", "{press}", "--sink", "udp:8.8.8.8"], "8.8.8.8 is no multicast group"),
        (["replay", "{press}", "--sink", "can:can77"], "can77"),
        (["replay", "{press}", "--sink", "serial:/dev/absent"], "/dev/absent"),
        (["replay", "{press}", "--sink", "smoke:signals"], "smoke"),
        (["replay", "{press}", "--record", "no/such/folder.mcap"], "folder.mcap"),
        (["run", "--source", "v4l2:77"], "77"),
        (["run", "--source", "nothing:here"], "nothing"),
        (["inspect", "text.png"], "text.png"),
        (["inspect", "black.png", "--sensor", "thumb"], "sensor 'thumb' is unknown; one of digitac, "),
        (["run", "--sensor", "absent.toml"], "absent.toml: cannot be read"),
        (
            ["run", "--source", "sim:tour?sensor=digitac"],
            "digitac cannot be simulated: its file has no pins.layout",
        ),
        (["run", "--source", "sim:tour?sensor=tactip-127&pins=7"], "pins= beside sensor="),
        (["sensor", "black.png", "-o", "mine.toml"], "no pattern of pins"),
        (["sensor", "black.png", "-o", "mine.txt"], "mine.txt"),
        (["sensor", "black.png", "-o", "mine.toml", "--across-mm", "0"], "give a number from 0.1 to 1000"),
        (["inspect"], "IMAGE"),
        (["dance"], "No such command 'dance'; see python -m edge --help"),
        (["run", "--frames", "few"], "'few'"),
    ],
    ids=lambda value: "_".join(value)[:40] if isinstance(value, list) else "",
)
def test_a_mistake_is_one_line_and_exit_code_2(
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    data_dir: Path,
    tmp_path: Path,
    arguments: list[str],
    expected: str,
) -> None:
    _text(tmp_path, "text.mcap", "this is a letter, not a recording\n")
    _text(tmp_path, "text.png", "this is a letter, not an image\n")
    _text(tmp_path, "bad.toml", "[source]\nspeck = 'v4l2:0'\n")
    cv2.imwrite(str(tmp_path / "float.tiff"), np.full((240, 320), 0.5, np.float32))
    whole = (data_dir / "press.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "empty").mkdir()
    (tmp_path / "seen").mkdir()
    write(tmp_path / "seen" / "black_pins.png", BLACK)
    (tmp_path / "nothing").touch()
    kept = {_text(tmp_path, name, "keep me").name: "keep me" for name in ("there.mcap", "video.mp4")}
    write(tmp_path / "black.png", BLACK)
    write(tmp_path / "white.png", WHITE)
    places = {"press": str(data_dir / "press_shear.mcap"), "other": str(data_dir / "rings331_ball.json")}
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, *[word.format(**places) for word in arguments]) == 2
    error = capfd.readouterr().err.strip().splitlines()
    assert len(error) == 1, error
    assert error[0].startswith("error: ")
    assert expected in error[0]
    assert {name: (tmp_path / name).read_text() for name in kept} == kept


def test_a_dark_period_is_a_status_bit_and_a_count(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], data_dir: Path, tmp_path: Path
) -> None:
    source = open_source(str(data_dir / "nothing.mcap"))
    images = [frame.image for frame in source]
    source.close()
    folder = tmp_path / "frames"
    folder.mkdir()
    for i, image in enumerate([*images[:10], *[np.zeros_like(images[0])] * 4, *images[10:]]):
        cv2.imwrite(str(folder / f"{i:03d}.png"), image)
    assert run(monkeypatch, "replay", folder, "--speed", "max", "--samples", "--json") == 0
    *samples, summary = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert summary["unidentified_n"] == 4
    assert summary["faults"]["IMAGE_DARK"] == 1
    from hostlink.wire import Status

    lost = [bool(Status(sample["status"]) & Status.TRACKER_LOST) for sample in samples]
    assert lost == [False] * 3 + [True] * 4 + [False] * (len(samples) - 7)
    assert samples[-1]["pins_tracked"] == 1.0


# ---- files that are written, and readers that go away -------------------------------------------------


def edge(*arguments: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    """The program in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "edge", *map(str, arguments)],
        capture_output=True, text=True, timeout=SOON_S, check=False, **options,
    )  # fmt: skip


def with_a_small_disk(n_bytes: int) -> Callable[[], None]:
    """No file of the process may grow beyond this: like on a full disk, except for the error number."""

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, n_bytes))

    return limit


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".avi", ".webm"])
def test_a_video_that_does_not_fit_on_the_disk_is_one_line_and_no_file(
    data_dir: Path, tmp_path: Path, suffix: str
) -> None:
    arguments = ("render", data_dir / "press_shear.mcap", "-o", tmp_path / f"a{suffix}", "--height", "240")
    done = edge(*arguments, preexec_fn=with_a_small_disk(60_000))
    assert done.returncode == 1
    *noise, output = done.stderr.strip().splitlines()
    assert output == f"error: {tmp_path}/a{suffix}: cannot be written: No space left on device"
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
    monkeypatch.setattr("edge.worker.feeds.RecordingFeed.fault", property(lambda feed: fault))
    arguments = ("replay", data_dir / "press_shear.mcap", "--speed", "max", "-q")
    assert run(monkeypatch, *arguments, "--record", tmp_path / "a.mcap") == (1 if fault else 0)
    assert (f"recording: {fault}" in caplog.text) == (fault is not None)


def test_a_recorder_without_shared_memory_is_one_line_and_no_file(data_dir: Path, tmp_path: Path) -> None:
    """A limit on the size of files holds for memory that is shared with the recorder's process, too."""
    arguments = ("replay", data_dir / "press.mcap", "--record", tmp_path / "a.mcap")
    done = edge(*arguments, preexec_fn=with_a_small_disk(20_000))
    assert done.returncode == 1
    assert re.fullmatch(r"error: shared memory of \d+ MB: File too large\n", done.stderr)
    assert list(tmp_path.iterdir()) == []


def test_a_video_is_complete_before_it_replaces_another(data_dir: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    path.write_text("the old one")
    arguments = ("render", data_dir / "nothing.mcap", "-o", path, "--height", "240", "--overwrite", "-q")
    assert edge(*arguments, preexec_fn=with_a_small_disk(20_000)).returncode == 1
    assert path.read_text() == "the old one"
    done = edge(*arguments)
    assert (done.returncode, done.stderr) == (0, "")
    assert path.read_bytes()[4:8] == b"ftyp"
    assert list(tmp_path.iterdir()) == [path]


def test_a_signal_leaves_no_part_of_a_video(data_dir: Path, tmp_path: Path) -> None:
    press = tmp_path / "frames"
    press.mkdir()
    frames_n = 0
    for frames_n, frame in enumerate(open_source(str(data_dir / "press_shear.mcap")), 1):
        cv2.imwrite(str(press / f"{frames_n:05d}.png"), frame.image)
    # Minutes of video, so that Ctrl-C always comes first.
    for n in range(frames_n + 1, 20_000):
        (press / f"{n:05d}.png").symlink_to(press / f"{n % frames_n + 1:05d}.png")
    out = tmp_path / "out"
    out.mkdir()
    command = [sys.executable, "-m", "edge", "render", str(press), "-o", str(out / "a.mp4")]
    for number in ENDING:
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
            until(lambda: any(out.iterdir()) or process.poll() is not None, "it writes")
            assert process.poll() is None
            process.send_signal(number)
            assert process.stderr is not None
            output = process.stderr.read()
            assert process.wait() == 128 + number
        assert output.strip() == ""
        assert list(out.iterdir()) == []


@pytest.mark.parametrize("more", [[], ["--loop"]], ids=["once", "loop"])
def test_closing_stdout_ends_the_replay(data_dir: Path, more: list[str]) -> None:
    command = [sys.executable, "-m", "edge", "replay", str(data_dir / "press_shear.mcap"), "--samples"]
    speed = [] if more else ["--speed", "max"]
    with subprocess.Popen(
        [*command, *speed, *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert "contact_n" in json.loads(process.stdout.readline())
        process.stdout.close()
        output = process.stderr.read()
        assert process.wait(SOON_S) == 0
    # where the recording begins again the pins jump, which is reported
    assert all(line.startswith("WARNING edge.runtime") for line in output.splitlines()), output


@pytest.mark.parametrize("samples", [["--samples", "-q"], ["--json"], []], ids=["samples", "json", "table"])
def test_a_full_disk_behind_stdout_is_one_line(data_dir: Path, samples: list[str]) -> None:
    with open("/dev/full", "w") as full:
        replay = ["replay", str(data_dir / "nothing.mcap"), "--speed", "max", *samples]
        done = subprocess.run(
            [sys.executable, "-m", "edge", *replay],
            stdout=full, stderr=subprocess.PIPE, text=True, timeout=SOON_S, check=False,
        )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr == "error: stdout: cannot be written: No space left on device\n"


def test_a_recording_that_replaces_another_is_asked_for(data_dir: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_text("the old one")
    arguments = ("replay", data_dir / "nothing.mcap", "--speed", "max", "-q", "--record", path)
    assert edge(*arguments).returncode == 2
    assert path.read_text() == "the old one"
    done = edge(*arguments, "--overwrite")
    assert (done.returncode, done.stderr) == (0, "")
    assert len(list(open_source(str(path)))) == len(list(open_source(str(data_dir / "nothing.mcap"))))


def test_a_picture_with_pins_is_replaced_only_if_asked_for(tip_image: Path, tmp_path: Path) -> None:
    arguments = ("inspect", tip_image, "--overlay", tmp_path / "seen")
    assert edge(*arguments).returncode == 0
    assert edge(*arguments).returncode == 2
    assert edge(*arguments, "--overwrite").returncode == 0
    assert [path.name for path in (tmp_path / "seen").iterdir()] == ["tip_pins.png"]


@pytest.mark.parametrize("missing", ["numpy", "cv2"])
def test_without_the_edge_extra_a_command_names_the_package(tmp_path: Path, missing: str) -> None:
    code = (
        f"import sys; sys.modules[{missing!r}] = None; sys.argv = ['edge', *sys.argv[1:]]\n"
        "from edge.__main__ import main; main()"
    )
    for arguments in (["inspect", "a.png"], ["doctor"], ["replay", "a.mcap"], ["render", "a", "-o", "a.mp4"]):
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments],
            capture_output=True, text=True, timeout=SOON_S, check=False, cwd=tmp_path,
        )  # fmt: skip
        assert done.returncode == 2, done.stderr
        (output,) = done.stderr.splitlines()
        assert output.endswith("install voronoi-touch[edge]")


def test_the_version_is_printed() -> None:
    done = edge("--version")
    assert done.returncode == 0
    assert done.stdout == f"python -m edge {version('voronoi-touch')}\n"


def test_a_token_can_be_kept_off_the_command_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, data_dir: Path
) -> None:
    """From the environment or a file; and then it is the page's."""
    path = _text(tmp_path, "token", "from-a-file\nand more\n")

    def token(**options: Any) -> str | None:
        given: dict[str, Any] = dict.fromkeys(field.name for field in fields(LoopOptions))
        listen = LoopOptions(**given | options).listen()
        return None if listen is None else listen.token

    assert token(view_here=True, view_token_file=path) == "from-a-file"
    monkeypatch.setenv("VORONOI_TOUCH_VIEW_TOKEN", "from-the-environment")
    assert token(view_here=True) == "from-the-environment"
    assert token() is None
