"""The commands: their output, and that every mistake is one line and exit code 2."""

import json
import os
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from math import isnan
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import can
import pytest

from hostlink import RestFrameOutcome, RestFrameReason, RestFrameState, Sample, decode_recording
from hostlink.commands import live
from hostlink.interrupt import ENDING
from hostlink.output_file import find_unfinished
from hostlink.recording import read_log
from hostlink.wire import VERSION, State, pack_state
from hostlink.wire.address import parse_address
from tests.hostlink.test_recording import as_candump, write_buses, write_edge
from tests.support.commands import Done, run_host_without
from tests.support.commands import run_host as run
from tests.support.fingers import Application, Fingers, need_multicast
from tests.support.processes import small_disk, uncounted
from tests.support.ptys import Ptys
from tests.support.waiting import SOON_S, size_of, until

PORT = 20_000 + os.getpid() % 20_000
HOST = f"udp:239.0.0.8?port={PORT}"


@pytest.fixture
def finger() -> Iterator[Application]:
    need_multicast()
    with Fingers(HOST, (6,)) as fingers:
        yield fingers.applications[6]


def until_enough(command: Callable[[str], bool]) -> None:
    """Run a command for more and more seconds: how much arrives depends on this machine's load."""
    assert any(command(seconds) for seconds in ("0.3", "3", "30"))


def record(address: str, file: Path, samples_n: int = 11) -> str:
    """Record so many samples, or more; returns what the command says at its end."""
    outputs = []

    def enough(seconds: str) -> bool:
        done = run("record", address, file, "--overwrite", "--seconds", seconds)
        outputs.append(done.err)
        return done.code == 0 and sum(isinstance(e, Sample) for e in decode_recording(file)) >= samples_n

    until_enough(enough)
    return outputs[-1]


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The current folder: a recording, files that are none, and some that must be kept; none may change."""
    write_buses(tmp_path / "hand.log", {0: 1, 1: 2})
    for name in ("a.csv", "empty.log"):
        (tmp_path / name).touch()
    (tmp_path / "junk.mcap").write_bytes(b"junk" * 100)
    (tmp_path / "there.parquet").write_text("mine")
    (tmp_path / "empty.png").write_text("mine")
    write_edge(tmp_path / "cut.mcap", [State(sample=k) for k in range(100)])
    os.truncate(tmp_path / "cut.mcap", 500)
    before = contents(tmp_path)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    assert contents(tmp_path) == before


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("nosuch", "No such command 'nosuch'"),
        ("monitor", "Missing argument 'ADDRESS'"),
        ("monitor can:nosuch0", "nosuch0"),
        ("monitor memory:", "no other end"),
        ("monitor can:can0 --colour", "--colour"),
        ("record can:can0 x.asc", "absolute time is lost"),
        ("record can:can0 hand.log", "exists already; give another name, or --overwrite to replace it"),
        ("record can:can0 x.serial", "a bus is recorded as .log or .blf"),
        ("record serial:/dev/nosuch x.log", "a serial line as .serial"),
        ("decode /nosuch.log", "no such file"),
        ("set can:can0 divider 1e9", "divider takes a whole number from 1 to 1000, not '1e9'"),
        ("busload --baud 921600 --classic", "--classic does not go with --baud: leave one of them out"),
        ("busload --baud 921600 --bitrate 500000", "--bitrate does not go with --baud"),
        ("busload --classic --dbitrate 500000", "--dbitrate does not go with --classic"),
        ("tare can:can0 --finger 1.5", "'1.5' is not a whole number; give a whole number from 1 to 127"),
        ("busload --rate x", "'x' is not a number; give "),
        ("set can:can0 colour 5", "no object 'colour'; what can be set: "),
        ("set can:can0 rate_hz -5", "rate_hz = -5 Hz: give 0 to 1000 Hz"),
        ("set can:can0 reboot 1", "reboot = 1: give 0x746F6F62"),
        ("set can:can0 error_n 3", "error_n = 3: give 0"),
        ("set can:can0 rate_hz fast", "takes a number"),
        ("set can:can0 schema_hash 5", "can only be read"),
        ("set can:can0 calibration /nosuch.json", "/nosuch.json: cannot be read: No such file or directory"),
        ("set can:can0 calibration /", "/: cannot be read: Is a directory"),
        ("view can:can0 --hand none.toml", "none.toml: cannot be read: No such file or directory"),
        ("dbc", "dbc: of which fingers? give --node 3 --node 4, or --hand hand.toml"),
        ("dbc --node 3 --node 3", "--node: one is given twice"),
        ("dbc --node 3 -o hand.txt", "hand.txt: the name must end in .dbc"),
        ("view can:can0 --listen no-host!", "no host 'no-host!' is known; give HOST:PORT"),
        ("busload --fingers 0", "--fingers"),
        ("busload --bitrate 1000000 --dbitrate 500000", "data phase"),
        *(
            (f"{command} --seconds {number}", "--seconds")
            for command in ("monitor can:nosuch0", "record can:nosuch0 x.log", "view can:nosuch0")
            for number in ("nan", "inf", "-inf", "1e999", "0", "-1")
        ),
        ("view can:can0 --listen 0.0.0.0:1", "give a token"),
        ("decode hand.log --finger 7", "hand.log: no sample of finger 7; it holds those of 1, 2"),
        ("decode hand.log --csv out.parquet", "out.parquet: the name must end in .csv"),
        ("decode hand.log --csv out.csv --parquet out.parquet", "give one of them"),
        ("decode hand.log --parquet there.parquet", "exists already"),
        ("decode hand.log --csv nowhere/out.csv", "there is no folder nowhere"),
        ("plot hand.log -o a.gif", "the name must end in .png or .pdf or .svg"),
        ("plot hand.log -o empty.png", "empty.png: exists already; give another name, or --overwrite"),
        ("plot hand.log --finger 9", "no finger 9; it holds 1, 2"),
        ("plot a.csv", "FD flags are lost"),
        ("plot cut.mcap", "cut.mcap: cut off or damaged before its first sample; copy or record it again"),
        ("plot empty.log", "empty.log: holds no samples"),  # before its picture, which exists
        ("bridge virtual:none", "where to? give --foxglove, --ros DISTRIBUTION or both"),
        ("bridge virtual:none --ros noetic", "'noetic' is not one of"),
        ("bridge virtual:none --ros jazzy --domain 300", "--domain"),
        ("bridge virtual:none --ros jazzy --namespace left-hand", "left-hand: give names after slashes"),
        ("bridge virtual:none --ros jazzy --router nowhere", "--router nowhere: give an endpoint"),
        ("bridge virtual:none --foxglove --seconds 1e300", "1e300 is out of range; give a number above 0"),
        ("bridge virtual:none --ros jazzy --record x.mcap", "--record"),
        ("bridge can:no-such-bus --ros jazzy --router tcp/127.0.0.1:9", "no-such-bus"),
        ("bridge virtual:none --foxglove --view http://a --view 1=http://b", "finger 1 is given twice"),
        ("bridge virtual:none --foxglove --listen 0.0.0.0:0 --allow-control", "no place for it"),
        ("bridge virtual:none --foxglove --origin http://localhost:8080", "--allow-control"),
        ("bridge virtual:none --foxglove --allow-control --origin localhost", "give scheme and host"),
        ("bridge virtual:none --foxglove --allow-control --origin http://a/panel", "give scheme and host"),
    ],
)
def test_mistakes_are_one_line_and_write_nothing(files: Path, arguments: str, message: str) -> None:
    assert message in run(*arguments.split()).refusal


@pytest.mark.parametrize(
    ("modules", "arguments", "extra"),
    [
        (["numpy", "pandas", "pyarrow", "pyarrow.parquet"], "decode hand.log --parquet out.parquet", "data"),
        (["foxglove"], "bridge virtual:none --foxglove", "foxglove"),
        (["aiohttp"], "bridge virtual:none --ros jazzy --router tcp/127.0.0.1:9 --view http://a", "view"),
        (["zenoh"], "bridge virtual:none --ros jazzy", "ros"),
        (["rosbags.typesys"], "bridge virtual:none --ros jazzy", "ros"),
        (["xxhash"], "bridge virtual:none --ros jazzy", "ros"),
        (["cantools"], "dbc --node 3", "dbc"),
    ],
)
def test_without_the_extra_it_is_one_line(
    files: Path, modules: list[str], arguments: str, extra: str
) -> None:
    assert f'pip install "voronoi-touch[{extra}]"' in run_host_without(modules, *arguments.split()).refusal


def test_a_table_in_csv_needs_no_library(tmp_path: Path) -> None:
    missing = ["numpy", "pandas", "pyarrow", "pyarrow.parquet"]
    written = tmp_path / "a.csv"
    write_buses(tmp_path / "hand.log", {0: 1})
    assert run_host_without(missing, "decode", tmp_path / "hand.log", "--csv", written).code == 0
    assert written.exists()


def test_busload_says_what_fits_and_what_would() -> None:
    for arguments, share in (
        ("--fingers 5", "5 fingers at 250 Hz take 21.2%"),
        ("--classic --rate 100", "1 finger at 100 Hz takes 16.2%"),
        ("--baud 921600", "19.5%"),
    ):
        assert share in run("busload", *arguments.split()).printed
    refusal = run("busload", "--classic", "--fingers", "5").refusal
    assert all(part in refusal for part in ("202", "111 Hz", "CAN FD at 0.5/2 Mbit/s"))


def test_monitor_prints_lines_without_a_terminal(finger: Application) -> None:
    def prints(seconds: str) -> bool:
        done = run("monitor", HOST, "--seconds", seconds)
        return done.code == 0 and "finger=6 displacement=" in done.out and "lost=0" in done.out

    until_enough(prints)


def test_monitor_of_a_silent_bus_is_no_success() -> None:
    done = run("monitor", "virtual:silent", "--seconds", "0.2")
    assert (done.code, done.out) == (1, "virtual:silent: nothing received yet\n")
    assert done.err == "error: virtual:silent: no finger was heard for 0.2 s\n"


def test_info_tare_set(finger: Application) -> None:
    assert json.loads(run("info", HOST, "--json").out)["serial_number"] == finger.serial
    shown = run("info", HOST).out
    assert finger.serial in shown
    assert "rate_hz              0 Hz: no limit, a sample for each image\n" in shown
    assert run("tare", HOST).code == 0
    assert "rest_frame_state     2: the new rest frame is in use\n" in run("info", HOST).out
    finger.touched = True
    refused = run("tare", HOST, "--finger", "6")
    assert refused.code == 1
    assert "error: tare: something touches the tip; let go" in refused.err
    assert run("tare", HOST, "--force").code == 0
    assert finger.tares == [False, True]
    assert run("set", HOST, "rate_hz", "50") == Done(
        0, "finger 6: rate_hz = 50 Hz (until the finger restarts: it has no folder to store settings in)\n"
    )
    assert run("set", HOST, "divider", "0").refusal == "error: divider = 0: give 1 to 1000"
    refusal = run("set", HOST, "tpdo1_transmission", "245").refusal
    assert "tpdo1_transmission = 245: refused by finger 6: transmission type 245" in refusal


def test_calibration_is_set_from_a_file(finger: Application, tmp_path: Path) -> None:
    file = tmp_path / "tip.json"
    file.write_text('{"a": 1}')
    assert run("set", HOST, "calibration", file).code == 0
    assert finger.calibration == b'{"a": 1}'
    file.write_text("a letter")
    assert "tip.json: not a calibration file; give one that" in run("set", HOST, "calibration", file).refusal
    finger.no_calibration = "upload: models[0]: unknown output 'taste'"
    file.write_text('{"a": 2}')
    refusal = run("set", HOST, "calibration", file).refusal
    assert refusal == f"error: {file}: refused by finger 6: {finger.no_calibration}"
    assert finger.calibration == b'{"a": 1}'


@pytest.mark.parametrize("suffix", [".log", ".blf"])
def test_record_then_decode(finger: Application, tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"press{suffix}"
    recorded = record(HOST, file)
    decoded = run("decode", file, "--summary")
    rows = [json.loads(text) for text in decoded.printed.splitlines()]
    assert recorded.endswith(f" {len(rows)} samples\n")
    numbers = [r["sample"] for r in rows]
    assert numbers == list(range(numbers[0], numbers[0] + len(rows)))
    assert all(r["displacement_mm"] == pytest.approx(r["sample"] / 100, abs=0.0011) for r in rows)
    assert all(r["force_n"] is None and r["status"] == [] for r in rows)
    assert f"received={len(rows)}" in decoded.err
    assert run("decode", file, "--text", "--finger", "6").out.count("finger=6 ") == len(rows)
    if suffix == ".log":
        with file.open("a") as log:
            log.write("(1.0) can0 186##1" + "AB" * 64 + "\n")
        assert run("decode", file) == Done(0, decoded.out, f"{file}: 1 damaged frame not decoded\n")


def test_recording_silence_fails(tmp_path: Path) -> None:
    need_multicast()
    file = tmp_path / "press.log"
    silent = ("record", f"udp:239.0.0.9?port={PORT + 1}", file, "--seconds", "0.05")
    done = run(*silent)
    assert done.code == 1
    assert done.err.endswith("nothing came in\n")
    assert list(tmp_path.iterdir()) == []
    file.write_text("irreplaceable")
    assert run(*silent, "--overwrite").code == 1
    assert file.read_text() == "irreplaceable"


def recorder(file: Path, *options: str, **process: Any) -> subprocess.Popen[str]:
    """`record` as a process of its own."""
    command = [sys.executable, "-m", "hostlink", "record", HOST, str(file), *options]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **process)


@pytest.mark.parametrize("suffix", [".log", ".blf"])
def test_record_on_a_full_disk_is_one_line_and_keeps_what_it_has(
    finger: Application, tmp_path: Path, suffix: str
) -> None:
    file = tmp_path / f"press{suffix}"
    limit = 40_000 if suffix == ".log" else 6000
    child = recorder(file, "--seconds", "30", env=uncounted(), **small_disk(limit))
    _, err = child.communicate(timeout=2 * SOON_S)
    assert err == f"error: {file}: cannot be written: File too large; the recording ends there\n"
    assert child.returncode == 1
    assert list(tmp_path.iterdir()) == [file]
    assert file.stat().st_size > limit / 2
    if suffix == ".log":
        assert next(read_log(file))


@pytest.mark.parametrize("number", ENDING)
def test_record_ended_by_a_signal_is_whole(finger: Application, tmp_path: Path, number: int) -> None:
    file = tmp_path / "press.log"
    child = recorder(file)
    # More than the block by which the program has tried whether the folder is writable.
    until(lambda: any(size_of(path) > 5000 for path in find_unfinished(file)), "some samples are in the file")
    child.send_signal(number)
    out, err = child.communicate(timeout=SOON_S)
    assert child.returncode == 0, (out, err, {path.name: size_of(path) for path in tmp_path.iterdir()})
    assert list(tmp_path.iterdir()) == [file]
    assert any(isinstance(event, Sample) for event in decode_recording(file))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("noise.log", b"(1.0) can0 181##1" + b"AB" * 64 + b"\n(1.1) can0 7FF#00\n"),
        ("noise.serial", b"voronoi-touch serial 1\n" + struct.pack("<QI", 0, 20) + b"\0noise" * 3 + b"\0\0"),
    ],
)
def test_a_recording_without_samples_is_reported_as_failure(
    name: str, content: bytes, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(content)
    refusal = run("decode", tmp_path / name).refusal
    assert f"{name}: no sample of a fingertip; " in refusal
    assert "0 damaged" not in refusal


@pytest.mark.parametrize("command", ["decode", "decode --csv a.csv", "plot -o a.png"])
def test_a_channel_is_asked_for_where_two_fingers_have_one_number(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_buses(Path("bus.log"), {0: 1, 1: 1})
    refusal = run(*command.split(), "bus.log").refusal
    assert refusal.startswith("error: bus.log: finger 1 is on several channels: can0, can1; choose one by ")
    assert list(Path().iterdir()) == [Path("bus.log")]
    done = run(*command.split(), "bus.log", "--channel", "can1")
    assert done.code == 0
    assert max(done.out.count("\n"), f"{done.out} {done.err}".count(" 40 samples")) in (1, 40)


@pytest.mark.parametrize("command", ["decode", "decode --text", "plot -o a.png"])
def test_a_log_without_times_is_decoded(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    data = [pack_state(State(sample=k, displacement_mm=1.0), k).hex() for k in range(10)]
    lines = [f"can0 18{finger} {text}" for text in data for finger in (1, 2)]
    Path("bus.log").write_text(as_candump([0.0] * len(lines), lines, ""))
    done = run(*command.split(), "bus.log")
    assert done.code == 0
    if command == "decode":
        assert [json.loads(text)["arrival_s"] for text in done.out.splitlines()] == [None] * 20


def test_times_grow_in_a_recording_during_which_the_clock_is_set_back(tmp_path: Path) -> None:
    stamps_s = (5000.0, 5000.1, 1400.2, 1400.3)  # of the wall clock, an hour back after the second frame

    def on_raw(callback: Callable[[can.Message, float], None]) -> Callable[[], None]:
        for n, stamp_s in enumerate(stamps_s):
            callback(can.Message(arbitration_id=0x186, timestamp=stamp_s), 10.0 + n / 10)
        return lambda: None

    hand: Any = SimpleNamespace(address=parse_address("can:can0"), on_raw=on_raw)
    assert live._record(hand, tmp_path / "a.log", 0.0) == (4, 0)
    times_s = [float(line[1 : line.index(")")]) for line in (tmp_path / "a.log").read_text().splitlines()]
    assert [at - times_s[0] for at in times_s] == pytest.approx([0, 0.1, 0.2, 0.3], abs=1e-5)
    assert times_s[0] - 10.0 == pytest.approx(time.time() - time.monotonic(), abs=60)


@pytest.mark.parametrize(("query", "number"), [("", 1), ("?node=3", 3)])
def test_record_a_serial_line(tmp_path: Path, query: str, number: int) -> None:
    pty, file = Ptys(tmp_path), tmp_path / "press.serial"
    with Fingers(f"serial:{pty.paths[0]}"):
        recorded = record(f"serial:{pty.paths[1]}{query}", file)
    rows = [json.loads(text) for text in run("decode", file, "--finger", str(number)).out.splitlines()]
    assert recorded.endswith(f" {len(rows)} samples\n")
    assert {r["finger"] for r in rows} == {number}
    assert not any(isnan(r["displacement_mm"]) for r in rows)


def test_version_is_printed() -> None:
    shown = run("--version").out
    assert shown.startswith(f"voronoi-touch {version('voronoi-touch')}, wire version {VERSION}, schema 0x")


def test_tare_and_calibration_end_with_their_outcome(finger: Application, tmp_path: Path) -> None:
    file = tmp_path / "tip.json"
    file.write_text("{}")
    assert run("tare", HOST) == Done(0, "finger 6: new rest frame in use\n")
    finger.outcome = RestFrameOutcome(RestFrameState.REFUSED, RestFrameReason.TOUCHED, "12 pins are pressed")
    pressed = "refused: 12 pins are pressed"
    assert run("tare", HOST) == Done(1, err=f"error: tare {pressed}; --force takes it anyway\n")
    assert run("set", HOST, "calibration", file) == Done(1, err=f"error: calibration {pressed}\n")
    finger.outcome = RestFrameOutcome(RestFrameState.FORCED, RestFrameReason.TOUCHED)
    forced = run("tare", HOST, "--force")
    assert forced == Done(0, "finger 6: rest frame forced: something touches the tip\n")
