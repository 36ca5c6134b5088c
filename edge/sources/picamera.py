"""Raspberry Pi CSI cameras, through picamera2: Debian's package on a Pi, which OpenCV cannot replace.

- A mono sensor's own pixels are taken (R8, or R10 in 16 bits); of any other sensor the luma of YUV420.
- Exposure, gain and frame duration are fixed at the start, if asked for: automatic exposure changes the pins'
  brightness.
- SensorTimestamp is when the first line is read out, at the end of its exposure; the start of exposure, which
  `Frame.capture_ns` means, is earlier by the exposure time.
- A request's own number counts requests, not images of the sensor: lost frames show in the times alone.
- A request holds one of the camera's buffers: the image is copied and the request released at once.

Source: picamera2 0.3, its source and manual; raspberrypi/picamera2#821 for the time.
"""

import re
from collections.abc import Callable
from typing import Any

from edge.errors import SourceError
from edge.params import PARAMS as RUNTIME
from edge.sources.camera import CameraSource
from edge.sources.live import PARAMS as LIVE
from edge.sources.options import NoKeys, Options
from edge.sources.pixels import LAYOUTS, unpack

_MONO = re.compile(r"^R(8|10|12)$")


def load_picamera2(number: int) -> Any:
    """The `picamera2.Picamera2` with this number. Raises SourceError: no picamera2, no such camera."""
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
    return Picamera2(camera_num=number)


class PiCameraSource(CameraSource):
    """open_camera  gives a `picamera2.Picamera2`, again after each loss
    Raises       SourceError: no camera, a size that it does not have, no frames, too slow
    """

    def __init__(
        self, open_camera: Callable[[], Any], options: Options, name: str = "camera picamera"
    ) -> None:
        super().__init__(name, options.or_own(LIVE.size_px))
        self._open_camera = open_camera
        self._stream, self._bits = "main", 8
        self._device = self._open()
        self._check_rate()

    def _open(self) -> Any:
        """The camera, running. Raises SourceError."""
        camera = self._open_camera()
        try:
            self._configure(camera)
            camera.start()
        except SourceError:
            camera.close()
            raise
        except (RuntimeError, ValueError, KeyError) as error:
            camera.close()
            advice = "other program? ask for another size or format"
            raise SourceError(f"{self.name}: {error}; {advice}") from error
        return camera

    def _configure(self, camera: Any) -> None:
        """Raises SourceError: not the size that was asked for, no such format."""
        size = self._options.size_px
        pixels = self._format(camera)
        raw = {"format": pixels, "size": size} if pixels else None
        main, controls = {"format": "YUV420", "size": size}, _controls(self._options)
        camera.configure(
            camera.create_video_configuration(main=main, raw=raw, controls=controls, queue=False)
        )
        self._stream = "raw" if raw else "main"
        self._bits = int(pixels[1:]) if pixels else 8
        got = camera.camera_configuration()[self._stream]
        if pixels and got["format"] != pixels:
            raise SourceError(f"{self.name}: format {pixels} was asked for, the camera gives {got['format']}")
        if tuple(got["size"]) != size:
            width, height = got["size"]
            nearest = f"the nearest that it has is {width}x{height}: ask for that"
            raise SourceError(f"{self.name}: no {size[0]}x{size[1]}; {nearest}")
        self.size_px = size

    def _format(self, camera: Any) -> str:
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

    def _read_from(self, device: Any) -> bool:
        try:
            request = device.capture_request(wait=RUNTIME.patience_s)
        except (TimeoutError, RuntimeError):
            return False
        try:
            pixels, metadata = request.make_array(self._stream), request.get_metadata()
        finally:
            request.release()
        now_ns = self._clock_ns()
        try:
            layout = LAYOUTS["GREY" if self._bits == 8 else f"Y{self._bits}"]
            # Rows are padded; of YUV420 the luma comes first.
            image = unpack(layout, pixels.tobytes(), self.size_px, pixels.shape[1])
        except ValueError:
            self.faults["damaged frame"] += 1
        else:
            names = ("ExposureTime", "FrameDuration")
            exposed_ns, period_ns = (1000 * int(metadata.get(name, 0)) for name in names)
            begun_ns = int(metadata.get("SensorTimestamp", 0)) - exposed_ns
            self._hand_over_at(image, self._bits, begun_ns, now_ns, period_ns)
        return True

    def _shut(self, device: Any) -> None:
        try:
            device.stop()
        except RuntimeError:  # it is gone already
            self.faults["stopped badly"] += 1
        device.close()


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


def open_picamera(where: str, options: Options) -> PiCameraSource:
    """The scheme `picamera:`; `picamera:1` is the second camera."""
    if where and not (where.isdecimal() and len(where) < 10):
        raise SourceError(f"source picamera:{where}: no such camera; give a number: picamera:0, picamera:1")
    number = int(where or 0)
    options.own(f"picamera:{where}", NoKeys)
    return PiCameraSource(lambda: load_picamera2(number), options, f"camera picamera:{number}")
