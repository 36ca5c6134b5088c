"""V4L2 cameras on a fake capture: formats, times, loss and return, settings that have no effect."""

import threading
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from edge.errors import SourceError
from edge.sources.options import Options
from edge.sources.v4l2 import V4l2Source, find_device, lasting_name, list_cameras
from edge.types import Clock, Frame
from tests.edge.sources.test_sources import noise
from tests.support.refusals import one_line
from tests.support.waiting import SOON_S, present, until

W, H = 64, 48


def encode(fourcc: str, n: int) -> np.ndarray[Any, Any]:
    """Bytes of frame n as OpenCV gives them without conversion."""
    if fourcc == "MJPG":
        return np.asarray(cv2.imencode(".jpg", noise(n))[1]).reshape(1, -1)
    return cv2.merge([noise(n)] * 2) if fourcc == "YUYV" else noise(n)


class FakeCapture:
    """cv2.VideoCapture over a camera that exists in the test alone.

    Time is the camera's: each grab moves the clock on by a period. `script` lists what happens at each grab:
    "ok", "skip" (a frame never came), "freeze", "black", "damage", "lost".
    """

    def __init__(self, camera: "FakeCamera") -> None:
        self.camera = camera
        self.values: dict[int, float] = {
            cv2.CAP_PROP_FRAME_WIDTH: W,
            cv2.CAP_PROP_FRAME_HEIGHT: H,
            cv2.CAP_PROP_FPS: 120.0,
            cv2.CAP_PROP_FOURCC: int.from_bytes(b"YUYV", "little"),
        }
        self.what = "ok"
        self.released = False
        camera.captures.append(self)

    def isOpened(self) -> bool:  # noqa: N802  (OpenCV's name)
        return self.camera.present

    def set(self, prop: int, value: float) -> bool:
        if prop in self.camera.no_such:
            return False
        fourcc = int(value).to_bytes(4, "little").decode() if prop == cv2.CAP_PROP_FOURCC else ""
        if fourcc and fourcc not in self.camera.formats:
            return False
        if prop in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT) and self.camera.fixed_size:
            return True  # the driver reports success and keeps its size
        self.values[prop] = self.camera.clamp.get(prop, value)
        return True

    def get(self, prop: int) -> float:
        if prop == cv2.CAP_PROP_POS_MSEC:
            return (self.camera.stuck_ns or self.camera.stamp_ns) / 1e6 if self.camera.stamps else 0.0
        return self.values.get(prop, 0.0)

    def grab(self) -> bool:
        camera = self.camera
        if not camera.free.is_set():
            camera.halted.set()
            camera.gate.acquire()
        self.what = camera.script.pop(0) if camera.script else "ok"
        period_ns = camera.period_ns(self)
        steps = 3 if self.what == "skip" else 1
        camera.n += steps
        camera.stamp_ns += steps * period_ns
        camera.clock_ns = camera.stamp_ns + 2_000_000
        if self.what == "lost":
            camera.present = False
        return self.what != "lost" and not camera.mute

    def retrieve(self) -> tuple[bool, Any]:
        fourcc = int(self.values[cv2.CAP_PROP_FOURCC]).to_bytes(4, "little").decode()
        if self.what == "black":
            return True, np.zeros((H, W), np.uint8)
        if self.camera.shown is not None:
            return True, self.camera.shown
        if self.what == "damage":
            return True, np.zeros((1, 7), np.uint8)
        return True, encode(fourcc, 5 if self.what == "freeze" else self.camera.n)

    def release(self) -> None:
        self.released = True


class FakeCamera:
    def __init__(self, formats: tuple[str, ...] = ("GREY", "YUYV"), rate_hz: float = 120.0) -> None:
        self.formats = formats
        self.rate_hz = rate_hz
        self.halves_with_one_buffer = False
        self.stamps = True
        self.stuck_ns = 0  # what the driver states for ever
        self.fixed_size = self.mute = False
        self.no_such: set[int] = set()
        self.clamp: dict[int, float] = {}
        self.present = True
        self.script: list[str] = []
        self.shown: Any = None  # what each image is; None: it is made anew
        self.captures: list[FakeCapture] = []
        self.n = 0
        self.stamp_ns = 5_000_000_000_000
        self.clock_ns = self.stamp_ns
        self.gate = threading.Semaphore(0)
        self.free = threading.Event()
        self.halted = threading.Event()  # the thread waits at the gate

    def period_ns(self, capture: FakeCapture) -> int:
        half = self.halves_with_one_buffer and capture.values.get(cv2.CAP_PROP_BUFFERSIZE) == 1
        return round(1e9 / self.rate_hz * (2 if half else 1))

    def find(self, where: str) -> str:
        if not self.present:
            raise SourceError(f"source v4l2:{where}: no such camera")
        return "/dev/video7"


class Opened:
    """A source whose every frame is taken in lock-step with the test."""

    def __init__(self, camera: FakeCamera, patience_s: float = SOON_S, **options: Any) -> None:
        self.camera = camera
        camera.free.set()  # while the rate is measured, frames come as they like
        clock_ns = staticmethod(lambda: camera.clock_ns)
        times = {"retry_s": 0.001, "patience_s": patience_s, "_clock_ns": clock_ns}
        made = type("QuickSource", (V4l2Source,), times)
        self.source: V4l2Source = made(
            "0", Options(**options), make_capture=lambda path: FakeCapture(camera), find=camera.find
        )
        camera.free.clear()
        camera.halted.clear()
        assert camera.halted.wait(SOON_S)
        self.source.read(0)
        self.source.faults.clear()

    def next(self) -> Frame:
        self.camera.gate.release()
        return present(self.source.read(SOON_S))

    def lose(self) -> None:
        """The camera goes with the next frame."""
        self.camera.script = ["lost"]
        self.camera.gate.release()
        until(lambda: self.source.condition == "lost", "the loss is noticed")

    def __enter__(self) -> "Opened":
        return self

    def __exit__(self, *_: object) -> None:
        self.source._closing.set()
        self.camera.free.set()
        self.camera.gate.release(4)
        self.source.close()
        assert not self.source._thread.is_alive()
        assert all(capture.released for capture in self.camera.captures)


@pytest.mark.parametrize(
    ("formats", "taken"),
    [(("GREY", "MJPG", "YUYV"), "GREY"), (("MJPG", "YUYV"), "MJPG"), (("YUYV",), "YUYV")],
)
def test_the_best_format_is_taken_unasked(formats: tuple[str, ...], taken: str) -> None:
    camera = FakeCamera(formats=formats)
    with Opened(camera):
        assert camera.captures[-1].values[cv2.CAP_PROP_FOURCC] == int.from_bytes(taken.encode(), "little")


@pytest.mark.parametrize("stamps", [True, False])
def test_times_are_the_drivers_or_else_ours(stamps: bool) -> None:
    camera = FakeCamera()
    camera.stamps = stamps
    with Opened(camera) as opened:
        frame = opened.next()
        assert frame.clock is (Clock.DRIVER if stamps else Clock.HOST)
        assert frame.capture_ns == pytest.approx(camera.stamp_ns if stamps else camera.clock_ns, abs=1000)
        assert opened.source.rate_hz == pytest.approx(120, rel=1e-3)


def test_frames_that_never_came_are_gaps_in_the_sequence() -> None:
    camera = FakeCamera()
    with Opened(camera) as opened:
        first = opened.next()
        camera.script = ["ok", "skip", "ok"]
        steps = np.diff([first.sequence] + [opened.next().sequence for _ in range(3)])
        assert steps.tolist() == [1, 3, 1]
        assert opened.source.faults["missed frame"] == 2


def test_a_camera_that_dims_is_one_condition_and_loses_no_frame(caplog: pytest.LogCaptureFixture) -> None:
    camera = FakeCamera(rate_hz=60)
    with Opened(camera) as opened:
        opened.next()
        camera.rate_hz = 30
        dim = [opened.next() for _ in range(20)]
        assert np.diff([frame.sequence for frame in dim[2:]]).tolist() == [1] * 17
        assert opened.source.condition == "slow"
        assert opened.source.faults == {"slow": 1, "missed frame": 2}  # the first two may have been lost
        advice = "light the tip better, or set exposure_us and gain"
        assert caplog.messages == [f"camera v4l2:0: 30 images/s instead of 60; {advice}"]
        camera.script = ["skip"]
        opened.next()
        assert opened.source.faults["missed frame"] == 4
        camera.rate_hz = 60
        opened.next()
        opened.next()
        assert opened.source.condition == ""


def test_a_drivers_time_that_stands_still_is_noticed(caplog: pytest.LogCaptureFixture) -> None:
    camera = FakeCamera()
    with Opened(camera) as opened:
        before = opened.next()
        camera.stuck_ns = camera.stamp_ns
        frames = [opened.next() for _ in range(9)]
        assert {frame.clock for frame in frames} == {Clock.HOST}
        assert np.all(np.diff([frame.capture_ns for frame in (before, *frames)]) > 0)
        assert opened.source.faults == {"repeated time": 9}
        assert caplog.messages == ["camera v4l2:0: its driver's time stands still; the host's is taken"]


def test_the_terms_name_request_and_outcome() -> None:
    with Opened(FakeCamera(), width=W, height=H, rate_hz=100) as opened:
        assert opened.source.terms == f"asked for {W}x{H} at 100/s, gives {W}x{H} at 120.0/s"
    with Opened(FakeCamera()) as opened:
        assert opened.source.terms == f"asked for its own size at its own rate, gives {W}x{H} at 120.0/s"


def test_a_lost_camera_comes_back_unless_it_has_another_size() -> None:
    camera = FakeCamera()
    with Opened(camera) as opened:
        before = opened.next()
        opened.lose()
        assert opened.source.read(0) is None
        camera.present = True
        after = opened.next()
        assert opened.source.condition == ""
        assert after.sequence > before.sequence
        assert opened.source.faults["lost"] == 1
        assert len(camera.captures) == 2
        opened.source.size_px = (W + 2, H)  # as if it had been another camera
        opened.lose()
        camera.present = True
        until(lambda: len(camera.captures) > 4, "it is tried again")
        assert opened.source.read(0) is None
        assert opened.source.condition == "lost"
        opened.source.size_px = (W, H)
        opened.next()


def test_frozen_black_and_damaged_frames_are_noticed() -> None:
    camera = FakeCamera()
    with Opened(camera) as opened:
        opened.next()
        camera.script = ["freeze"] * 11
        for _ in range(11):
            opened.next()
        assert opened.source.condition == "frozen"
        camera.script = ["black"]
        opened.next()
        assert opened.source.condition == "black"
        camera.script = ["damage", "ok"]
        camera.gate.release()
        opened.next()
        assert opened.source.condition == ""
        assert opened.source.faults == {"frozen": 1, "black": 1, "damaged frame": 1, "missed frame": 1}


SETTINGS = {
    cv2.CAP_PROP_AUTO_EXPOSURE: 1,
    cv2.CAP_PROP_EXPOSURE: 20,  # units of 100 us
    cv2.CAP_PROP_GAIN: 12,
    cv2.CAP_PROP_AUTOFOCUS: 0,
    cv2.CAP_PROP_FOCUS: 30,
    cv2.CAP_PROP_FPS: 120,
    cv2.CAP_PROP_BUFFERSIZE: 1,
}


def test_settings_reach_the_camera_and_no_others() -> None:
    camera = FakeCamera()
    asked = {"width": W, "height": H, "rate_hz": 120, "exposure_us": 2050, "gain": 12, "focus": 30}
    with Opened(camera, **asked) as opened:
        values = camera.captures[-1].values
        assert {prop: values[prop] for prop in SETTINGS} == SETTINGS
        assert opened.source.refused == []
    with Opened(FakeCamera()) as opened:
        unasked = SETTINGS.keys() - {cv2.CAP_PROP_FPS, cv2.CAP_PROP_BUFFERSIZE}
        assert not unasked & opened.camera.captures[-1].values.keys()


def test_refused_controls_are_named() -> None:
    camera = FakeCamera()
    camera.no_such = {cv2.CAP_PROP_GAIN}
    camera.clamp = {cv2.CAP_PROP_EXPOSURE: 156}
    with Opened(camera, exposure_us=2000, gain=12) as opened:
        refused = ["exposure_us: set to 20, camera says 156", "gain: camera has no such control"]
        assert opened.source.refused == refused


def test_two_buffers_where_one_halves_the_rate() -> None:
    camera = FakeCamera()
    camera.halves_with_one_buffer = True
    with Opened(camera, rate_hz=120) as opened:
        assert camera.captures[-1].values[cv2.CAP_PROP_BUFFERSIZE] == 2
        assert opened.source.rate_hz == pytest.approx(120, rel=1e-3)


def test_a_camera_without_the_size_the_format_frames_or_their_rate_is_refused() -> None:
    small, mute = FakeCamera(), FakeCamera()
    small.fixed_size = mute.mute = True
    for camera, asked, stated in (
        (small, {"width": 128, "height": 96}, f"asked for 128x96, camera gives {W}x{H} as GREY"),
        (FakeCamera(), {"format": "MJPG"}, "does not give MJPG"),
        (FakeCamera(), {"format": "RGB"}, "no pixel format 'RGB'"),
        (mute, {"patience_s": 0.05}, r"no frame within 0\.05 s"),
        (FakeCamera(rate_hz=60), {"rate_hz": 120}, r"60\.0 frames/s, at least 96 wanted"),
    ):
        with pytest.raises(SourceError, match=stated):
            Opened(camera, **asked)
        assert all(capture.released for capture in camera.captures)
    with Opened(FakeCamera(rate_hz=60), rate_hz=120, check_rate=False) as opened:
        assert opened.source.rate_hz == pytest.approx(60, rel=1e-3)


def plug_in(sys_root: Path, dev_root: Path, number: int, usb: str, label: str, serial: str) -> Path:
    """A camera at a socket; returns its folder."""
    node = sys_root / f"class/video4linux/video{number}"
    interface = sys_root / f"devices/usb1/{usb}/{usb}:1.0"
    interface.mkdir(parents=True, exist_ok=True)
    node.mkdir(parents=True)
    (node / "device").symlink_to(interface)
    (node / "name").write_text(f"Global Shutter {label}\n")
    if serial:
        (interface.parent / "serial").write_text(f"{serial}\n")
    (dev_root / f"video{number}").write_text("")
    return node


@pytest.fixture
def machine(tmp_path: Path) -> tuple[Path, Path]:
    """/sys and /dev of a machine with two cameras; the first has a metadata node too."""
    sys_root, dev_root = tmp_path / "sys", tmp_path / "dev"
    (dev_root / "v4l/by-id").mkdir(parents=True)
    for number, index, usb, serial in ((0, 0, "1-1", "AB12"), (1, 1, "1-1", "AB12"), (10, 0, "1-2", "")):
        node = plug_in(sys_root, dev_root, number, usb, usb, serial)
        (node / "index").write_text(f"{index}\n")
    (dev_root / "v4l/by-id/usb-Maker_Cam_XY99-video-index0").symlink_to(dev_root / "video10")
    return sys_root, dev_root


def test_cameras_of_a_machine(machine: tuple[Path, Path]) -> None:
    found = [(Path(d.path).name, d.serial, d.label) for d in list_cameras(*machine)]
    assert found == [("video0", "AB12", "Global Shutter 1-1"), ("video10", "", "Global Shutter 1-2")]
    assert lasting_name("0", *machine) == "v4l2:AB12"


@pytest.mark.parametrize(
    ("where", "node"),
    [
        ("0", "video0"),
        ("10", "video10"),
        ("AB12", "video0"),
        ("XY99", "video10"),
        ("{dev}/v4l/by-id/usb-Maker_Cam_XY99-video-index0", "video10"),
    ],
)
def test_a_camera_by_number_serial_or_path(machine: tuple[Path, Path], where: str, node: str) -> None:
    assert Path(find_device(where.format(dev=machine[1]), *machine)).name == node


@pytest.fixture
def twins(machine: tuple[Path, Path]) -> tuple[Path, Path]:
    """The same with a third camera, of the first one's serial number and label; each has its socket."""
    sys_root, dev_root = machine
    plug_in(sys_root, dev_root, 12, "1-3", "1-1", "AB12")
    (dev_root / "v4l/by-id/usb-Maker_Shutter_AB12-video-index0").symlink_to(dev_root / "video12")
    (dev_root / "v4l/by-path").mkdir()
    for number in (0, 10, 12):
        (dev_root / f"v4l/by-path/usb-0:{number}-video-index0").symlink_to(dev_root / f"video{number}")
    return sys_root, dev_root


@pytest.mark.parametrize(
    ("where", "n"),
    [
        ("AB12", 2),
        ("usb-Maker", 2),
        ("Shutter", 3),
        ("{dev}/v4l/by-id/usb-Maker_Shutter_AB12-video-index0", 2),
    ],
)
def test_a_name_of_several_cameras_is_refused_and_all_are_listed(
    twins: tuple[Path, Path], where: str, n: int
) -> None:
    message = one_line(SourceError, find_device, where.format(dev=twins[1]), *twins)
    assert f"fits {n} cameras, give the path of one: " in message
    assert message.count("/v4l/by-path/usb-0:") == n


@pytest.mark.parametrize(
    ("where", "lasting"),
    [
        ("0", "{dev}/v4l/by-path/usb-0:0-video-index0"),  # its serial number is not its own
        ("{dev}/video10", "{dev}/v4l/by-path/usb-0:10-video-index0"),  # it has none
        ("{dev}/v4l/by-path/usb-0:0-video-index0", ""),
        ("5", ""),
    ],
)
def test_a_number_has_a_name_that_stays(twins: tuple[Path, Path], where: str, lasting: str) -> None:
    assert lasting_name(where.format(dev=twins[1]), *twins) == lasting.format(dev=twins[1])
    assert Path(find_device(lasting.format(dev=twins[1]) or "0", *twins)).parent == twins[1]


@pytest.mark.parametrize("where", ["5", "NONE", "", "/dev/no/such/camera"])
def test_an_unknown_camera_is_answered_with_the_known_ones(machine: tuple[Path, Path], where: str) -> None:
    with pytest.raises(
        SourceError, match=r"no such camera; give .*; cameras here: .*video0 Global Shutter 1-1 serial AB12"
    ):
        find_device(where, *machine)


def test_no_permission(machine: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("edge.sources.v4l2.os.access", lambda path, mode: False)
    with pytest.raises(SourceError, match="join the group video"):
        find_device("0", *machine)
