"""OAK source without a module: a host node of depthai's own, and fakes for the hardware lines."""

import os
import sys
import threading
import time
from contextlib import ExitStack, closing
from dataclasses import replace
from datetime import timedelta
from itertools import islice
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from edge.cli.hand import hand_on
from edge.errors import SourceError
from edge.params import PARAMS as RUNTIME
from edge.sources import oak, open_source
from edge.sources.oak_hand import FedCamera
from edge.sources.options import Options
from edge.sources.shared_memory import Outbox
from edge.types import Clock, Frame, Image
from tests.support.oak_nodes import SIZE, frames_output, noise
from tests.support.refusals import one_line
from tests.support.waiting import SOON_S, present, until

HOST = Options(width=SIZE[0], height=SIZE[1])


@pytest.fixture(scope="module")
def dai() -> Any:
    try:
        return oak.load_depthai()
    except SourceError as error:
        pytest.skip(str(error))


def lock_step(dai: Any, steps: list[int], **asked: Any) -> tuple[list[Frame], oak.OakSource]:
    """Every frame is taken before the next one is made."""
    go = threading.Semaphore(1)
    output = frames_output(dai, steps, lambda n: go.acquire(timeout=SOON_S))
    got: list[Frame] = []
    camera: Any = SimpleNamespace(options=HOST, keys=oak.OakKeys(**asked), crop=None, output=output)
    with closing(oak.OakSource(oak.OakModule([camera]), camera)) as source:
        for _ in steps:
            got.append(present(source.read(SOON_S)))
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
        assert frame.capture_ns == 1_000_000_000 + 20_000_000 * frame.sequence
        assert frame.clock is Clock.DRIVER
    (first, second), _ = lock_step(dai, [0, 1], clock="device")
    assert (first.capture_ns, second.capture_ns) == (77_000, 20_077_000)
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


def calls_of(camera: oak.OakCamera) -> dict[str, Any]:
    """What an output asks of its pipeline: (by place, by name) of each function's last call."""
    pipeline = MagicMock()
    camera.output(pipeline)
    return {name.rpartition(".")[2]: (by_place, named) for name, by_place, named in pipeline.mock_calls}


def test_the_camera_is_asked_for_what_was_set(dai: Any) -> None:
    options = Options(
        width=640, height=400, rate_hz=240.0, exposure_us=1500, gain=300, focus=120, extra={"socket": "CAM_C"}
    )
    calls = calls_of(oak.camera_at("", options))
    assert not {"setFrameSyncMode", "addCrop"} & calls.keys()
    assert calls["build"] == ((dai.CameraBoardSocket.CAM_C,), {"sensorFps": 240.0})
    assert calls["setManualExposure"][0] == (1500, 300)
    assert calls["setManualFocus"][0] == (120,)
    assert calls["setAntiBandingMode"][0] == (dai.CameraControl.AntiBandingMode.OFF,)
    assert calls["setXLinkChunkSize"][0] == (0,)
    assert calls["requestOutput"] == (((640, 400),), {"type": dai.ImgFrame.Type.GRAY8, "fps": 240.0})
    unasked = calls_of(oak.camera_at("", Options()))  # its own size and rate
    assert unasked["requestOutput"] == (((640, 400),), {"type": dai.ImgFrame.Type.GRAY8, "fps": 60.0})
    # Crop and synchronisation are left to the module.
    size = Options(width=640, height=400, extra={"crop": "100,50,320,240", "sync": "input"})
    calls = calls_of(oak.camera_at("", size))
    assert calls["setFrameSyncMode"][0] == (dai.CameraControl.FrameSyncMode.INPUT,)
    assert calls["requestOutput"][0] == ((640, 400),)
    assert calls["addCrop"][0] == (100, 50, 320, 240)
    assert calls["setMaxOutputFrameSize"][0] == (320 * 240,)
    assert all(hasattr(dai.CameraControl.FrameSyncMode, name) for name in oak.SYNC_MODES.values())


EXPOSURE_US = 1500


def picture(place: int, n: int) -> Image:
    """What the camera of this place shows in the exposure of this number."""
    return noise(n + 10**6 * place)


class FakeModule:
    """The part of depthai that OakSource uses, with a module that can be unplugged."""

    CameraBoardSocket = SimpleNamespace(__members__={"CAM_B": None})

    def __init__(self, rate_hz: float = 240.0) -> None:
        self.step_us = round(1e6 / rate_hz)
        self.plugged = True
        self.opened_n = 0
        self.running = False
        self.MessageQueue = SimpleNamespace(getAny=self.read)

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

    def isClosed(self) -> bool:  # noqa: N802 (as depthai names it)
        return not self.plugged

    def read(self, queues: Any, timeout: timedelta) -> dict[str, Any]:
        time.sleep(0.001)  # a camera's frames take their time
        if not self.plugged:
            return {}
        n, self.n = self.n, self.n + 1
        end = timedelta(microseconds=n * self.step_us)
        return {
            place: SimpleNamespace(
                getFrame=lambda place=place: picture(int(place), n),
                getSequenceNum=lambda: n,
                getTimestamp=lambda: end,
                getExposureTime=lambda: timedelta(microseconds=EXPOSURE_US),
            )
            for place in queues
        }


def cameras_of(
    fake: FakeModule, monkeypatch: pytest.MonkeyPatch, n: int = 1, **settings: Any
) -> oak.OakModule:
    monkeypatch.setattr(oak, "load_depthai", lambda: fake)
    monkeypatch.setattr(oak, "lens_of", lambda handler, socket, size, crop: None)
    monkeypatch.setattr(oak, "RUNTIME", replace(RUNTIME, announced_s=0.01))

    def found(*given: object) -> Any:
        return fake  # as the module, and as an output

    camera: Any = SimpleNamespace(options=Options(**settings), keys=oak.OakKeys(), crop=None, output=found)
    return oak.OakModule([camera] * n, found)


def opened(fake: FakeModule, monkeypatch: pytest.MonkeyPatch, **settings: Any) -> oak.OakSource:
    module = cameras_of(fake, monkeypatch, **settings)
    return oak.OakSource(module, module.cameras[0])


def lost_when_read(source: oak.OakSource) -> None:
    until(lambda: (source.read(0.01), source.condition)[1] == "lost", "it is noticed")


def test_a_lost_module_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    module = FakeModule()
    with closing(opened(module, monkeypatch)) as source:
        before = present(source.read(SOON_S))
        # Times are of the start of the exposure.
        assert before.capture_ns == 1000 * (before.sequence * module.step_us - EXPOSURE_US)
        module.plugged = False
        lost_when_read(source)
        module.plugged = True
        after = present(source.read(SOON_S))
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
    lens = present(oak.lens_of(again, "CAM_B", (640, 400)))
    assert lens.focal_px[0] == pytest.approx(400.0)  # half the size, half the focal length
    assert lens.distortion[:2] == pytest.approx([0.1, -0.2])
    assert lens.size_px == (640, 400)
    part = present(oak.lens_of(again, "CAM_B", (640, 400), oak.Crop(100, 50, 320, 240)))
    assert part.centre_px == pytest.approx((lens.centre_px[0] - 100, lens.centre_px[1] - 50))
    assert part.size_px == (320, 240)


def test_the_fingers_of_a_hand_have_a_camera_each_and_one_number_for_an_exposure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fake, over = FakeModule(), threading.Event()
    module = cameras_of(fake, monkeypatch, 2)
    outboxes = [Outbox(1 << 20) for _ in module.cameras]
    ends = [FedCamera(outbox.far_end.dup(), os.dup(outbox.fd)) for outbox in outboxes]

    def hand() -> None:
        opened = None
        while not over.is_set():
            opened = hand_on(module, opened, outboxes)

    thread = threading.Thread(target=hand)
    thread.start()
    with ExitStack() as stack:
        stack.callback(over.set)
        fingers = [oak.OakSource(end, module.cameras[0]) for end in ends]
        for source in fingers:
            stack.callback(source.close)
        before = [frame.sequence for source in fingers for frame in islice(source, 1)]
        fake.plugged = False
        for source in fingers:
            lost_when_read(source)
        fake.plugged = True
        numbers = set()
        for place, source in enumerate(fingers):
            for frame in islice(source, 20):
                n = (frame.capture_ns // 1000 + EXPOSURE_US) // fake.step_us
                assert np.array_equal(frame.image, picture(place, n))
                numbers.add(frame.sequence - n)
        (base,) = numbers
        assert base > max(before)  # where the module counts from 0 again
        over.set()
        thread.join()
        for outbox in outboxes:
            outbox.far_end.close()
            outbox.close()
        for source in fingers:  # the end of the hand is that of its fingers
            assert all(source)
            assert source.ended
