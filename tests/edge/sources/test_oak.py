"""OAK source without a module: a host node of depthai's own, and fakes for the hardware lines."""

import sys
import threading
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from datetime import timedelta
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from edge.errors import SourceError
from edge.params import PARAMS as RUNTIME
from edge.sources import oak, open_source
from edge.sources.options import Options
from edge.types import Clock, Frame
from tests.support.refusals import one_line
from tests.support.waiting import SOON_S, until

SIZE = (64, 48)
HOST = Options(width=SIZE[0], height=SIZE[1])


@pytest.fixture(scope="module")
def dai() -> Any:
    try:
        return oak.load_depthai()
    except SourceError as error:
        pytest.skip(str(error))


def noise(n: int) -> np.ndarray[Any, Any]:
    return np.random.default_rng(n).integers(0, 256, (SIZE[1], SIZE[0]), dtype=np.uint8)


def frames_output(
    dai: Any, steps: list[int], gate: Callable[[int], object] = lambda n: None
) -> oak.MakeOutput:
    """A host node that emits frames with these sequence numbers, then closes its pipeline's queues."""

    class Node(dai.node.ThreadedHostNode):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.out = self.createOutput("out")

        def run(self) -> None:
            for n in steps:
                gate(n)
                if not self.isRunning():
                    return
                message = dai.ImgFrame()
                message.setType(dai.ImgFrame.Type.GRAY8)
                message.setWidth(SIZE[0])
                message.setHeight(SIZE[1])
                message.setData(noise(n).ravel())
                message.setSequenceNum(n)
                message.setTimestamp(timedelta(microseconds=1_000_000 + 4_000 * n))
                message.setTimestampDevice(timedelta(microseconds=77 + 4_000 * n))
                self.out.send(message)

    def make(pipeline: Any) -> Any:
        return pipeline.create(Node).out

    return make


def lock_step(dai: Any, steps: list[int], **options: Any) -> tuple[list[Frame], oak.OakSource]:
    """Every frame is taken before the next one is made."""
    go = threading.Semaphore(1)
    output = frames_output(dai, steps, lambda n: go.acquire(timeout=SOON_S))
    got: list[Frame] = []
    with closing(oak.OakSource(output, HOST, **options)) as source:
        for _ in steps:
            frame = source.read(SOON_S)
            assert frame is not None
            got.append(frame)
            go.release()
    assert not source._thread.is_alive()
    return got, source


def test_pixels_times_and_gaps_come_through(dai: Any) -> None:
    steps = [0, 1, 2, 5, 6, 9]
    frames, source = lock_step(dai, steps)
    assert [f.sequence for f in frames] == steps
    assert source.faults["missed frame"] == 4
    for frame in frames:
        assert np.array_equal(frame.image, noise(frame.sequence))
        assert frame.capture_ns == 1_000_000_000 + 4_000_000 * frame.sequence
        assert frame.clock is Clock.DRIVER
    (first, second), _ = lock_step(dai, [0, 1], own_clock=True)
    assert (first.capture_ns, second.capture_ns) == (77_000, 4_077_000)
    assert first.clock is Clock.DEVICE


@pytest.mark.parametrize(
    ("spec", "stated"),
    [
        ("oak:?socket=CAM_Q", "no socket 'CAM_Q'"),
        ("oak:?clock=x", "clock: unknown value 'x'; known: device, host"),
        ("oak:?fps=3", "unknown key 'fps'"),
        ("oak:?sync=x", "sync: unknown value 'x'; known: "),
        ("oak:?crop=1,2,3", "crop=1,2,3: give x,y,width,height within the image of 640x400"),
        ("oak:?crop=600,0,100,100", "crop=600,0,100,100: give x,y,width,height within the image of 640x400"),
        ("oak:?width=320&height=200&crop=0,0,400,100", "within the image of 320x200"),
        ("oak:19443010F1A5F02E00", "no such OAK module; free modules here: "),
    ],
)
def test_a_bad_address_is_one_line(dai: Any, spec: str, stated: str) -> None:
    assert stated in one_line(SourceError, open_source, spec)


def test_without_depthai_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "depthai", None)
    with pytest.raises(SourceError, match=r"install voronoi-touch\[oak\]"):
        open_source("oak:")


def test_modules_are_chosen_by_id_or_name(monkeypatch: pytest.MonkeyPatch) -> None:
    modules = [SimpleNamespace(deviceId="AA", name="1.1"), SimpleNamespace(deviceId="BB", name="192.168.1.7")]
    attached = SimpleNamespace(Device=SimpleNamespace(getAllAvailableDevices=lambda: modules))
    monkeypatch.setattr(oak, "load_depthai", lambda: attached)
    for asked, found in (("", "AA"), ("BB", "BB"), ("192.168.1.7", "BB")):
        assert oak.find_module(asked).deviceId == found
    with pytest.raises(SourceError, match=r"AA \(1\.1\), BB"):
        oak.find_module("CC")


def camera_on(socket: str, sensor: str) -> Any:
    """A module with one camera."""
    feature = SimpleNamespace(socket=SimpleNamespace(name=socket), sensorName=sensor)
    return SimpleNamespace(getConnectedCameraFeatures=lambda: [feature], readCalibration=lambda: None)


def test_sockets_without_a_camera_are_refused() -> None:
    device = camera_on("CAM_A", "IMX378")
    oak.check_socket(device, "CAM_A")
    with pytest.raises(SourceError, match=r"no camera on CAM_B; cameras of this module: CAM_A \(IMX378\)"):
        oak.check_socket(device, "CAM_B")


def calls_of(make: Any) -> dict[str, Any]:
    """What an output asks of its pipeline: (by place, by name) of each function's last call."""
    pipeline = MagicMock()
    make(pipeline)
    return {name.rpartition(".")[2]: (by_place, named) for name, by_place, named in pipeline.mock_calls}


def test_the_camera_is_asked_for_what_was_set(dai: Any) -> None:
    options = Options(width=640, height=400, rate_hz=240.0, exposure_us=1500, gain=300, focus=120)
    calls = calls_of(oak.camera_output(options, "CAM_C"))
    assert not {"setFrameSyncMode", "addCrop"} & calls.keys()
    assert calls["build"] == ((dai.CameraBoardSocket.CAM_C,), {"sensorFps": 240.0})
    assert calls["setManualExposure"][0] == (1500, 300)
    assert calls["setManualFocus"][0] == (120,)
    assert calls["setAntiBandingMode"][0] == (dai.CameraControl.AntiBandingMode.OFF,)
    assert calls["setXLinkChunkSize"][0] == (0,)
    assert calls["requestOutput"] == (((640, 400),), {"type": dai.ImgFrame.Type.GRAY8, "fps": 240.0})
    unasked = calls_of(oak.camera_output(Options()))  # its own size and rate
    assert unasked["requestOutput"] == (((640, 400),), {"type": dai.ImgFrame.Type.GRAY8, "fps": 60.0})
    # Crop and synchronisation are left to the module.
    size = Options(width=640, height=400)
    calls = calls_of(oak.camera_output(size, "CAM_B", oak.Crop(100, 50, 320, 240), "input"))
    assert calls["setFrameSyncMode"][0] == (dai.CameraControl.FrameSyncMode.INPUT,)
    assert calls["requestOutput"][0] == ((640, 400),)
    assert calls["addCrop"][0] == (100, 50, 320, 240)
    assert calls["setMaxOutputFrameSize"][0] == (320 * 240,)
    assert all(hasattr(dai.CameraControl.FrameSyncMode, name) for name in oak.SYNC_MODES.values())


EXPOSURE_US = 1500


class FakeModule:
    """The part of depthai that OakSource uses, with a module that can be unplugged."""

    class MessageQueue:
        class QueueException(Exception):
            pass

    def __init__(self, rate_hz: float = 240.0) -> None:
        self.step_us = round(1e6 / rate_hz)
        self.plugged = True
        self.opened_n = 0
        self.running = False
        self.node = SimpleNamespace()

    def Device(self, info: Any) -> Any:  # noqa: N802
        if not self.plugged:
            raise RuntimeError("X_LINK_DEVICE_NOT_FOUND")
        self.opened_n += 1
        return camera_on("CAM_B", "OV9282")

    def Pipeline(self, device: Any) -> Any:  # noqa: N802
        return self

    def createOutputQueue(self) -> Any:  # noqa: N802
        self.n = 0
        return self

    def start(self) -> None:
        self.running = True

    def isRunning(self) -> bool:  # noqa: N802
        return self.running

    def stop(self) -> None:
        self.running = False

    def wait(self) -> None:
        assert not self.running

    def get(self, timeout: timedelta) -> Any:
        time.sleep(0.001)  # a camera's frames take their time
        if not self.plugged:
            raise self.MessageQueue.QueueException("closed")
        n, self.n = self.n, self.n + 1
        end = timedelta(microseconds=n * self.step_us)
        return SimpleNamespace(
            getFrame=lambda: noise(n),
            getSequenceNum=lambda: n,
            getTimestamp=lambda: end,
            getExposureTime=lambda: timedelta(microseconds=EXPOSURE_US),
        )


def opened(module: FakeModule, monkeypatch: pytest.MonkeyPatch, **settings: Any) -> oak.OakSource:
    monkeypatch.setattr(oak, "load_depthai", lambda: module)
    monkeypatch.setattr(oak, "lens_of", lambda handler, socket, size, crop: None)
    monkeypatch.setattr(oak, "RUNTIME", replace(RUNTIME, announced_s=0.01))
    return oak.OakSource(lambda pipeline: pipeline, Options(**settings), module=lambda: SimpleNamespace())  # type: ignore[arg-type,return-value]


def test_a_lost_module_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    module = FakeModule()
    with closing(opened(module, monkeypatch)) as source:
        before = source.read(SOON_S)
        assert before is not None
        # Times are of the start of the exposure.
        assert before.capture_ns == 1000 * (before.sequence * module.step_us - EXPOSURE_US)
        module.plugged = False
        until(lambda: (source.read(0.01), source.condition)[1] == "lost", "it is noticed")
        module.plugged = True
        after = source.read(SOON_S)
        assert after is not None
        assert after.sequence > before.sequence  # though the module counts from 0 again
        assert source.faults["lost"] == 1
        assert module.opened_n == 2
    assert not module.running


def test_rate_is_measured_and_a_slow_module_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with closing(opened(FakeModule(240.0), monkeypatch, rate_hz=240.0)) as source:
        assert source.rate_hz < 240 * 1.01  # frames may be skipped over
    module = FakeModule(60.0)
    with pytest.raises(SourceError, match=r"at least 192 wanted"):
        opened(module, monkeypatch, rate_hz=240.0)
    assert not module.running


def test_lens_of_a_module_from_its_calibration_file(dai: Any) -> None:
    eeprom = dai.CalibrationHandler().eepromToJson()
    handler = dai.CalibrationHandler.fromJson(eeprom, validateExtrinsics=False)
    assert oak.lens_of(handler, "CAM_B", (640, 400)) is None  # nothing in it
    matrix = [[800.0, 0.0, 640.0], [0.0, 800.0, 400.0], [0.0, 0.0, 1.0]]
    distortion = [0.1, -0.2, 0.001, 0.002] + [0.0] * 10
    handler.setCameraIntrinsics(dai.CameraBoardSocket.CAM_B, matrix, 1280, 800)
    handler.setDistortionCoefficients(dai.CameraBoardSocket.CAM_B, distortion)
    again = dai.CalibrationHandler.fromJson(handler.eepromToJson(), validateExtrinsics=False)
    lens = oak.lens_of(again, "CAM_B", (640, 400))
    assert lens is not None
    assert lens.focal_px[0] == pytest.approx(400.0)  # half the size, half the focal length
    assert lens.distortion[:2] == pytest.approx([0.1, -0.2])
    assert lens.size_px == (640, 400)
    part = oak.lens_of(again, "CAM_B", (640, 400), oak.Crop(100, 50, 320, 240))
    assert part is not None
    assert part.centre_px == pytest.approx((lens.centre_px[0] - 100, lens.centre_px[1] - 50))
    assert part.size_px == (320, 240)
