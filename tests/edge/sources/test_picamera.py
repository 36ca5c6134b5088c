"""CSI cameras, over a stand-in with picamera2's own signatures: no Pi is needed, and none was used."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from queue import Empty, Queue
from typing import Any

import numpy as np
import pytest

from edge.errors import SourceError
from edge.sources import open_source
from edge.sources.options import Options
from edge.sources.picamera import PiCameraSource
from edge.types import Clock, Frame
from tests.support.waiting import SOON_S, present

SIZE = (64, 40)
PERIOD_US, EXPOSURE_US = 4000, 1500
STRIDE = 96  # bytes: rows are padded
R8, R10 = {"format": "R8", "size": SIZE}, {"format": "R10_CSI2P", "unpacked": "R10", "size": SIZE}
COLOUR = {"format": "SRGGB10_CSI2P", "unpacked": "SRGGB10", "size": SIZE}


class Request:
    """A `CompletedRequest`."""

    def __init__(self, camera: "Camera", pixels: np.ndarray, number: int) -> None:
        self._camera, self._pixels, self._number = camera, pixels, number

    def make_array(self, name: str) -> np.ndarray:
        assert name == self._camera.stream
        return self._pixels

    def get_metadata(self) -> dict[str, Any]:
        start_ns = self._camera.epoch_ns + 1000 * PERIOD_US * self._number
        self._camera.now_ns = start_ns + 1000 * PERIOD_US
        taken_ns = start_ns + 1000 * EXPOSURE_US
        return {"SensorTimestamp": taken_ns, "ExposureTime": EXPOSURE_US, "FrameDuration": PERIOD_US}

    def release(self) -> None:
        self._camera.released_n += 1


class Camera:
    """A `Picamera2`. It runs freely until the test gives frames, by number; None: the camera goes."""

    def __init__(self, modes: list[dict[str, Any]], size: tuple[int, int] = SIZE) -> None:
        self.sensor_modes, self.size = modes, size
        self.numbers: Queue[int | None] = Queue()
        self.stream, self.format = "main", ""
        self.epoch_ns = self.now_ns = time.monotonic_ns()
        self.released_n = 0
        self.free, self.count = True, 0
        self.calls: list[str] = []
        self.config: dict[str, Any] = {}

    def create_video_configuration(
        self, main: Mapping[str, Any] = {}, lores: Mapping[str, Any] | None = None,
        raw: Mapping[str, Any] | None = {}, *, buffer_count: int = 6, controls: Mapping[str, Any] = {},
        queue: bool = True,
    ) -> dict[str, Any]:  # fmt: skip
        return {"main": dict(main), "raw": raw and dict(raw), "controls": dict(controls), "queue": queue}

    def configure(self, camera_config: dict[str, Any]) -> None:
        self.config = camera_config
        self.stream = "raw" if camera_config["raw"] else "main"
        self.config[self.stream]["size"] = self.size

    def camera_configuration(self) -> dict[str, Any]:
        return self.config

    def start(self) -> None:
        self.calls.append("start")

    def capture_request(self, wait: float | None = None) -> Request:
        number: int | None
        if self.free:
            time.sleep(PERIOD_US * 1e-6)  # the camera's own pace
            number, self.count = self.count, self.count + 1
        else:
            try:
                number = self.numbers.get(timeout=wait)
            except Empty:
                raise TimeoutError from None
        if number is None:
            raise RuntimeError("camera frontend has timed out")
        rows, bits = SIZE[1], self.config[self.stream]["format"]
        if bits == "R10":
            image = np.zeros((rows, STRIDE), np.uint16)
            image[:, : SIZE[0]] = (500 + number) % 1024
            return Request(self, image.view(np.uint8), number)
        image = np.zeros((rows * 3 // 2 if bits == "YUV420" else rows, STRIDE), np.uint8)
        image[:rows, : SIZE[0]] = (50 + number) % 256
        return Request(self, image, number)

    def stop(self) -> None:
        self.calls.append("stop")

    def close(self) -> None:
        self.calls.append("close")


@contextmanager
def opened(camera: Camera, **options: Any) -> Iterator[PiCameraSource]:
    """A source of it; closed, its thread, which waits for a frame, has ended."""
    asked = Options(**({"width": SIZE[0], "height": SIZE[1]} | options))
    times = {"retry_s": 0.01, "_clock_ns": staticmethod(lambda: camera.now_ns)}
    source: PiCameraSource = type("QuickSource", (PiCameraSource,), times)(lambda: camera, asked)
    camera.free = False
    yield source
    source._closing.set()
    camera.numbers.put(None)
    source.close()
    source._thread.join()


def read(source: PiCameraSource, camera: Camera, skip: int = 0) -> tuple[Frame, int]:
    """The next frame but some, and its number; those from before are passed over."""
    number = camera.count + 1 + skip  # one may be on its way
    camera.count = number + 1
    camera.numbers.put(number)
    while True:
        frame = present(source.read(SOON_S))
        if (frame.capture_ns - camera.epoch_ns) // (1000 * PERIOD_US) == number:
            return frame, number


@pytest.mark.parametrize(
    ("modes", "asked", "dtype", "bits", "level"),
    [
        ([R8, R10], "", np.uint8, 8, 50),
        ([R8, R10], "R10", np.uint16, 10, 500),
        ([COLOUR], "", np.uint8, 8, 50),
    ],
)
def test_pixels_without_padding_and_the_start_of_exposure(
    modes: list[dict[str, Any]], asked: str, dtype: type, bits: int, level: int
) -> None:
    camera = Camera(modes)
    with opened(camera, format=asked) as source:
        frame, number = read(source, camera)
    assert frame.image.shape == (SIZE[1], SIZE[0])
    assert frame.image.dtype == dtype
    assert (frame.image == (level + number) % (1 << bits)).all()
    assert frame.bits == bits
    assert frame.clock is Clock.DRIVER
    assert frame.capture_ns == camera.epoch_ns + number * 1000 * PERIOD_US
    assert camera.calls == ["start", "stop", "close"]
    assert camera.released_n >= 1


def test_settings_are_given_in_picamera2_s_units() -> None:
    camera = Camera([R8])
    with opened(camera, rate_hz=250.0, exposure_us=1500, gain=4) as source:
        assert source.rate_hz == pytest.approx(250.0)
    assert camera.config["controls"] == {
        "FrameDurationLimits": (4000, 4000),
        "AeEnable": False,
        "ExposureTime": 1500,
        "AnalogueGain": 4.0,
    }


def test_lost_frames_are_gaps_in_the_numbers_and_a_lost_camera_is_opened_again() -> None:
    camera = Camera([R8])
    with opened(camera) as source:
        (first, one), (second, other) = read(source, camera), read(source, camera, skip=2)
        assert second.sequence - first.sequence == other - one
        assert source.faults["missed frame"] >= 3
        camera.numbers.put(None)
        frame, number = read(source, camera)
        assert frame.image[0, 0] == (50 + number) % 256
        assert source.faults["lost"] == 1
    assert camera.calls == ["start", "stop", "close", "start", "stop", "close"]


@pytest.mark.parametrize(
    ("size", "options", "message"),
    [
        ((128, 80), {}, "no 64x40; the nearest that it has is 128x80"),
        (SIZE, {"format": "Y10"}, "no format 'Y10'; it has R8, YUV420"),
        (SIZE, {"rate_hz": 1000.0}, "250.0 frames/s, at least"),
    ],
)
def test_settings_the_camera_lacks_are_refused_in_one_line(
    size: tuple[int, int], options: dict[str, Any], message: str
) -> None:
    camera = Camera([R8], size)
    with pytest.raises(SourceError, match=message), opened(camera, **options):
        pass
    assert camera.calls[-1] == "close"


def test_without_picamera2_the_message_says_what_to_install() -> None:
    with pytest.raises(SourceError, match="apt install python3-picamera2"):
        open_source("picamera:0")
    with pytest.raises(SourceError, match="give a number"):
        open_source("picamera:front")
