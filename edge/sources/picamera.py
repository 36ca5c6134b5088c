"""Raspberry Pi CSI cameras, through picamera2: Debian's package on a Pi, which OpenCV cannot replace.

- A mono sensor's own pixels are taken (R8, or R10 in 16 bits); of any other sensor the luma of YUV420.
- Exposure, gain and frame duration are fixed at the start, if asked for: automatic exposure changes the pins'
  brightness.
- SensorTimestamp is when the first line is read out, at the end of its exposure; the start of exposure, which
  `Frame.capture_ns` means, is earlier by the exposure time. If plausible, it is on the monotonic clock.
- Lost frames are inferred from the times: a request's own number counts requests, not images of the sensor.
- A request holds one of the camera's buffers: the image is copied and the request released at once.
- Only `load_picamera2` needs a Pi; all else runs with any object of the same methods.

Source: picamera2 0.3, its source and manual; raspberrypi/picamera2#821 for the time.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from edge.errors import SourceError
from edge.sources.live import PARAMS as LIVE
from edge.sources.live import ThreadedSource, Watch
from edge.sources.options import Options
from edge.types import Array, Clock, Frame, Image


@dataclass(frozen=True, slots=True)
class PiCameraParams:
    """Parameters by name; evidence in docs/tuning.md, "Cameras"."""

    retry_s: float = 0.5  # between attempts to get a lost camera back
    frame_s: float = 1.0  # without a frame for this long the camera is lost
    patience_s: float = 5.0  # for the first frames
    buffers_n: int = 4  # requests in rotation
    size_px: tuple[int, int] = (640, 400)  # width and height if none are asked for


PARAMS = PiCameraParams()
_MONO = re.compile(r"^R(8|10|12)$")


class PiRequest(Protocol):
    """What is used of `picamera2.request.CompletedRequest`."""

    def make_array(self, name: str) -> np.ndarray[Any, Any]: ...
    def get_metadata(self) -> dict[str, Any]: ...
    def release(self) -> None: ...


class PiCamera(Protocol):
    """What is used of `picamera2.Picamera2`."""

    @property
    def sensor_modes(self) -> list[dict[str, Any]]: ...
    def create_video_configuration(
        self,
        main: Mapping[str, Any] = ...,
        lores: Mapping[str, Any] | None = ...,
        raw: Mapping[str, Any] | None = ...,
        *,
        buffer_count: int = ...,
        controls: Mapping[str, Any] = ...,
        queue: bool = ...,
    ) -> dict[str, Any]: ...
    def configure(self, camera_config: dict[str, Any]) -> Any: ...
    def camera_configuration(self) -> dict[str, Any]: ...
    def start(self) -> None: ...
    def capture_request(self, wait: float | None = None) -> PiRequest: ...
    def stop(self) -> None: ...
    def close(self) -> None: ...


OpenCamera = Callable[[], PiCamera]


def load_picamera2(number: int) -> PiCamera:
    """The camera with this number. Raises SourceError: no picamera2, no such camera."""
    try:
        from picamera2 import Picamera2
    except ImportError as error:
        raise SourceError(
            f"source picamera: {error}; apt install python3-picamera2, in a virtual environment with system "
            "packages (deploy/install.sh --camera picamera makes one)"
        ) from error
    found = Picamera2.global_camera_info()
    if number >= len(found):
        here = ", ".join(f"{n} ({info.get('Model', '?')})" for n, info in enumerate(found)) or "none"
        raise SourceError(
            f"source picamera:{number}: no such camera; cameras here: {here}; check the ribbon cable"
        )
    camera: PiCamera = Picamera2(camera_num=number)
    return camera


class PiCameraSource(ThreadedSource):
    """Frames of a CSI camera.

    open_camera  gives the camera, again after each loss
    Raises       SourceError: no camera, a size that it does not have, no frames, too slow
    """

    def __init__(
        self,
        open_camera: OpenCamera,
        options: Options,
        *,
        name: str = "camera picamera",
        patience_s: float = PARAMS.patience_s,
        retry_s: float = PARAMS.retry_s,
        clock_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        super().__init__(name)
        self._open_camera, self._options = open_camera, options
        self._retry_s, self._clock_ns = retry_s, clock_ns
        self._watch = Watch()
        self._sequence, self._last_ns = -1, 0
        self._stream, self._bits = "main", 8
        self._camera: PiCamera | None = self._open()
        try:
            least_hz = LIVE.slow_rel * options.rate_hz if options.check_rate else 0.0
            self.rate_hz = self.measure_rate(least_hz, patience_s, "shorten exposure_us or ask for less")
        except SourceError:
            self.close()
            raise

    def _open(self) -> PiCamera:
        """The camera, running. Raises SourceError."""
        camera = self._open_camera()
        try:
            self._configure(camera)
            camera.start()
        except (RuntimeError, ValueError, KeyError) as error:
            camera.close()
            raise SourceError(
                f"{self.name}: {error}; other program? ask for another size or format"
            ) from error
        except SourceError:
            camera.close()
            raise
        return camera

    def _configure(self, camera: PiCamera) -> None:
        """Raises SourceError: not the size that was asked for, no such format."""
        o = self._options
        size = (o.width, o.height) if o.width and o.height else PARAMS.size_px
        pixels = self._format(camera)
        raw = {"format": pixels, "size": size} if pixels else None
        camera.configure(
            camera.create_video_configuration(
                main={"format": "YUV420", "size": size},
                raw=raw,
                buffer_count=PARAMS.buffers_n,
                controls=_controls(o),
                queue=False,
            )
        )
        self._stream = "raw" if raw else "main"
        self._bits = int(pixels[1:]) if pixels else 8
        got = camera.camera_configuration()[self._stream]
        if pixels and got["format"] != pixels:
            raise SourceError(f"{self.name}: format {pixels} was asked for, the camera gives {got['format']}")
        if tuple(got["size"]) != size:
            width, height = got["size"]
            raise SourceError(
                f"{self.name}: no {size[0]}x{size[1]}; the nearest that it has is {width}x{height}: "
                "ask for that"
            )
        self.size_px = size

    def _format(self, camera: PiCamera) -> str:
        """A mono format of the sensor, the asked one or that of fewest bits; "": it has colour."""
        wanted = self._options.format
        mono = {str(mode["format"]) for mode in camera.sensor_modes}
        mono |= {str(mode.get("unpacked", "")) for mode in camera.sensor_modes}
        known = sorted((name for name in mono if _MONO.match(name)), key=lambda name: int(name[1:]))
        if wanted in ("", *known):
            return wanted or (known[0] if known else "")
        if wanted == "YUV420":
            return ""
        raise SourceError(f"{self.name}: no format {wanted!r}; it has {', '.join([*known, 'YUV420'])}")

    # -- reading --------------------------------------------------------------------------------

    def _work(self) -> None:
        try:
            while not self._closing.is_set():
                if self._camera is None:
                    self._return()
                    continue
                try:
                    request = self._camera.capture_request(wait=PARAMS.frame_s)
                except (TimeoutError, RuntimeError):
                    if not self._closing.is_set():
                        self._set_condition("lost")
                    self._release()
                    continue
                try:
                    pixels, metadata = request.make_array(self._stream), request.get_metadata()
                finally:
                    request.release()
                self._take(pixels, metadata)
        finally:
            self._release()

    def _return(self) -> None:
        """The camera again, or a pause."""
        try:
            self._camera = self._open()
        except SourceError:  # still away: `condition` stays lost
            self._closing.wait(self._retry_s)

    def _release(self) -> None:
        camera, self._camera = self._camera, None
        if camera is not None:
            try:
                camera.stop()
            except RuntimeError:  # it is gone already
                self.faults["stopped badly"] += 1
            camera.close()

    def _take(self, pixels: np.ndarray[Any, Any], metadata: Mapping[str, Any]) -> None:
        now_ns = self._clock_ns()
        try:
            image = _grey(pixels, self._bits, self.size_px)
        except ValueError:
            self.faults["damaged frame"] += 1
            return
        begun_ns = int(metadata.get("SensorTimestamp", 0)) - 1000 * int(metadata.get("ExposureTime", 0))
        trusted = 0 <= now_ns - begun_ns < LIVE.same_clock_s * 1e9
        capture_ns = begun_ns if trusted else now_ns
        self._sequence += self._steps(capture_ns, 1000 * int(metadata.get("FrameDuration", 0)))
        self._last_ns = capture_ns
        clock = Clock.DRIVER if trusted else Clock.HOST
        frame = Frame(image, capture_ns, self._sequence, clock, self._bits)
        self._set_condition(self._watch.check(frame))
        self._offer(frame)

    def _steps(self, capture_ns: int, period_ns: int) -> int:
        """Frame periods since the last frame; more than one: frames were lost."""
        if not period_ns or self._sequence < 0:
            return 1
        steps = max(1, round((capture_ns - self._last_ns) / period_ns))
        if steps > 1:
            self.faults["missed frame"] += steps - 1
        return steps


def _controls(options: Options) -> dict[str, Any]:
    """picamera2's names and units: us, a factor, dioptres."""
    out: dict[str, Any] = {}
    if options.rate_hz:
        period_us = round(1e6 / options.rate_hz)
        out["FrameDurationLimits"] = (period_us, period_us)
    if options.exposure_us or options.gain:
        out["AeEnable"] = False
    if options.exposure_us:
        out["ExposureTime"] = options.exposure_us
    if options.gain:
        out["AnalogueGain"] = float(options.gain)
    if options.focus is not None:
        out |= {"AfMode": 0, "LensPosition": float(options.focus)}  # 0: manual
    return out


def _grey(pixels: np.ndarray[Any, Any], bits: int, size_px: tuple[int, int]) -> Image:
    """The image without the padding of its rows; of YUV420 the luma, which comes first.

    pixels  (rows, bytes a row) uint8
    Raises  ValueError: too few rows or bytes
    """
    width, height = size_px
    wide: Array | np.ndarray[Any, Any] = np.ascontiguousarray(pixels)
    if bits > 8:
        wide = wide.view(np.uint16)
    if wide.ndim != 2 or wide.shape[0] < height or wide.shape[1] < width:
        raise ValueError(f"{pixels.shape} bytes for {width}x{height} pixels")
    return np.ascontiguousarray(wide[:height, :width])


def open_picamera(where: str, options: Options) -> PiCameraSource:
    """The scheme `picamera:`; `picamera:1` is the second camera."""
    if where and not (where.isdecimal() and len(where) < 10):
        raise SourceError(f"source picamera:{where}: no such camera; give a number: picamera:0, picamera:1")
    number = int(where or 0)
    options = options.without_extra(f"picamera:{where}")
    return PiCameraSource(lambda: load_picamera2(number), options, name=f"camera picamera:{number}")
