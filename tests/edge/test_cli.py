"""`python -m edge` as a user types it: results, and every mistake one line and exit code 2."""

from __future__ import annotations

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from edge.__main__ import main
from edge.recording import Recorder
from edge.sources import open_source


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


@pytest.mark.parametrize(("speed", "way_out"), [("100", "--loop plays it on"), ("max", "a longer one")])
def test_a_recording_that_ends_within_its_tare_says_so(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    tip_image: Path,
    speed: str,
    way_out: str,
) -> None:
    assert run(monkeypatch, "replay", tip_image, "--speed", speed, "-q") == 0
    (said,) = [record.getMessage() for record in caplog.records if record.name == "edge"]
    assert said.startswith(f"{tip_image}: ended while the rest frame was being taken (8 images and a search)")
    assert way_out in said


def test_images_that_pass_during_the_tare_are_told(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, data_dir: Path
) -> None:
    """A search takes longer than 40 images do at a hundred times their rate."""
    assert run(monkeypatch, "replay", data_dir / "press_shear.mcap", "--speed", "100", "-q") == 0
    (said,) = [record.getMessage() for record in caplog.records if record.name == "edge"]
    assert "while the rest frame was being taken" in said
    assert "--loop" in said


def test_a_recording_that_was_cut_off_is_told_and_its_rest_replayed(
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
    said = f"{tmp_path}/cut.mcap: not whole (cut off at its end); what could be read was taken"
    assert said in caplog.text
    caplog.clear()
    assert run(monkeypatch, "render", tmp_path / "cut.mcap", "-o", tmp_path / "a.mkv", "-q") == 0
    assert said in caplog.text


def test_a_finger_without_a_sink_says_that_nobody_hears(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    arguments = ("run", "--source", "sim:nothing?pins=37&layout=hex&paced=0", "--frames", "1", "-q")
    assert run(monkeypatch, *arguments) == 0
    assert "nobody will hear: no sink; give --sink can:can0" in caplog.text
    caplog.clear()
    assert run(monkeypatch, *arguments, "--sink", "memory:") == 0
    assert run(monkeypatch, *arguments, "--record", tmp_path / "a.mcap") == 0
    assert "nobody" not in caplog.text


BLACK, WHITE = np.zeros((240, 320), np.uint8), np.full((240, 320), 255, np.uint8)


@pytest.mark.parametrize("image", [BLACK, WHITE], ids=["black", "white"])
def test_inspect_says_when_there_are_no_pins(
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
        (["replay", "{press}", "--speed", "fast"], "--speed fast"),
        (["replay", "{press}", "--speed", "0"], "--speed 0"),
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
        (["run", "--source", "v4l2:0?width=wide"], "width=wide: give a whole number, e.g. width=1"),
        (["replay", "{press}", "--sink", "udp:8.8.8.8"], "8.8.8.8 is no multicast group"),
        (["replay", "{press}", "--sink", "can:can77"], "can77"),
        (["replay", "{press}", "--sink", "serial:/dev/absent"], "/dev/absent"),
        (["replay", "{press}", "--sink", "smoke:signals"], "smoke"),
        (["replay", "{press}", "--record", "no/such/folder.mcap"], "folder.mcap"),
        (["run", "--source", "v4l2:77"], "77"),
        (["run", "--source", "nothing:here"], "nothing"),
        (["inspect", "text.png"], "text.png"),
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
    write(tmp_path / "black.png", BLACK)
    write(tmp_path / "white.png", WHITE)
    places = {"press": str(data_dir / "press_shear.mcap"), "other": str(data_dir / "rings331_ball.json")}
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, *[word.format(**places) for word in arguments]) == 2
    error = capfd.readouterr().err.strip().splitlines()
    assert len(error) == 1, error
    assert error[0].startswith("error: ")
    assert expected in error[0]


def test_a_dark_stretch_is_a_status_bit_and_a_count(
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
    assert summary["unsure_n"] == 4
    assert summary["faults"]["IMAGE_DARK"] == 1
    from hostlink.wire import Status

    lost = [bool(Status(sample["status"]) & Status.TRACKER_LOST) for sample in samples]
    assert lost == [False] * 3 + [True] * 4 + [False] * (len(samples) - 7)
    assert samples[-1]["pins_tracked"] == 1.0
