"""UVC and other V4L2 cameras, through OpenCV.

- A serial number is looked up again after each loss: a camera that returns may have another number.
- Pixels are taken as the camera sends them and become grey here, as of all sources: decoding MJPG to grey
  takes 0.93 ms for 640x480, by way of colour 1.35 ms.
- Capture time is the driver's (V4L2 buffer timestamp, CLOCK_MONOTONIC, start of exposure with UVC's hardware
  clock). OpenCV passes it on, but not the driver's frame counter.
- One kernel buffer, so that images are as new as possible. With one buffer some drivers lose every second
  frame; if the measured rate shows that, two are used.
- Settings are read back. A size that the camera does not have, or a rate that it does not reach, is
  an error at the start; a control that it refuses is listed in `refused`.

Source: OpenCV modules/videoio/src/cap_v4l.cpp (for what each property does); V4L2 API reference.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from msgspec.structs import replace

from edge.errors import SourceError
from edge.sources.camera import CameraSource
from edge.sources.live import PARAMS as LIVE
from edge.sources.options import NoKeys, Options
from edge.sources.pixels import LAYOUTS, decode_picture, unpack

_EXPOSURE_UNIT_US = 100  # V4L2_CID_EXPOSURE_ABSOLUTE
_MANUAL, _NO_FOCUS = 1, 0  # V4L2_EXPOSURE_MANUAL; autofocus off

# A camera that stalls without disconnecting blocks OpenCV for this long (10 s without it).
os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")


@dataclass(frozen=True, slots=True)
class VideoDevice:
    path: str  # e.g. /dev/video0
    serial: str  # of the USB device; "" if it has none
    label: str  # the driver's name for it
    by_id: str = ""  # link by maker, model and serial number; "": none
    by_path: str = ""  # link by the socket that it is plugged into, which stays; "": none

    def __str__(self) -> str:
        return f"{self.by_path or self.path} {self.label} serial {self.serial or 'none'}"


def _text(path: Path) -> str:
    try:
        return path.read_text(errors="replace").strip()
    except OSError:
        return ""


def list_cameras(sys_root: Path = Path("/sys"), dev_root: Path = Path("/dev")) -> list[VideoDevice]:
    """Video nodes that give images; a UVC camera's second node gives metadata and is skipped."""
    found = []
    by_id, by_path = (
        {os.path.realpath(link): str(link) for link in (dev_root / "v4l" / kind).glob("*-video-index0")}
        for kind in ("by-id", "by-path")
    )
    nodes = (sys_root / "class/video4linux").glob("video*")
    for node in sorted(nodes, key=lambda n: int("0" + "".join(filter(str.isdecimal, n.name)))):
        if _text(node / "index") not in ("", "0"):
            continue
        # .../video0/device is the USB interface; the device above it has the serial number.
        serial = _text((node / "device").resolve().parent / "serial")
        path = os.path.realpath(dev_root / node.name)
        links = by_id.get(path, ""), by_path.get(path, "")
        found.append(VideoDevice(str(dev_root / node.name), serial, _text(node / "name"), *links))
    return found


def _alike(camera: VideoDevice, cameras: list[VideoDevice]) -> list[VideoDevice]:
    """The cameras of its serial number and label: a name made of these means any of them."""
    return [c for c in cameras if (c.serial, c.label) == (camera.serial, camera.label)]


def find_device(where: str, sys_root: Path = Path("/sys"), dev_root: Path = Path("/dev")) -> str:
    """Path of the video node. Raises SourceError: does not exist, fits several, or may not be opened."""
    cameras = list_cameras(sys_root, dev_root)
    meant: list[VideoDevice] = []
    path = str(dev_root / f"video{where}") if where.isdecimal() else where
    if (where and not os.path.exists(path)) or "/by-id/" in where:
        meant = [c for c in cameras if where in (c.serial, c.by_id)]
        if not meant and not where.isdecimal():
            meant = [c for c in cameras if where in c.by_id or where in c.label]
        meant = meant if len(meant) != 1 else _alike(meant[0], cameras)
        path = meant[0].path if meant else path
    if len(meant) > 1:
        fits = "; ".join(map(str, meant))
        raise SourceError(f"source v4l2:{where}: fits {len(meant)} cameras, give the path of one: {fits}")
    if not path or not os.path.exists(path):
        here = "; ".join(map(str, cameras)) or "none"
        wanted = "v4l2:NUMBER, v4l2:SERIAL, v4l2:NAME or /dev/v4l/by-id/..."
        raise SourceError(f"source v4l2:{where}: no such camera; give {wanted}; cameras here: {here}")
    if not os.access(path, os.R_OK | os.W_OK):
        raise SourceError(
            f"source v4l2:{where}: no permission for {path}; join the group video, log in again"
        )
    return os.path.realpath(path)


def lasting_name(where: str, sys_root: Path = Path("/sys"), dev_root: Path = Path("/dev")) -> str:
    """The name to give instead of a number, which another camera may have after a restart; "": none."""
    path = str(dev_root / f"video{where}") if where.isdecimal() else where
    cameras = list_cameras(sys_root, dev_root)
    for camera in cameras:
        if camera.path == path:
            alone = camera.serial and len(_alike(camera, cameras)) == 1
            return f"v4l2:{camera.serial}" if alone else camera.by_path
    return ""


#: These are taken unasked, in the order in which they are tried: no colour, no loss first.
_AUTO = ("GREY", "MJPG", "YUYV", "UYVY", "NV12")
_FORMATS = ("MJPG", *(name for name in LAYOUTS if name.isupper() and "UC" not in name))


class V4l2Source(CameraSource):
    """make_capture  gives an object with the interface of cv2.VideoCapture, for the path that `find` gives
    Raises        SourceError: does not exist, no permission, other size, too slow
    """

    def __init__(
        self,
        where: str,
        options: Options,
        *,
        make_capture: Callable[[str], Any] | None = None,
        find: Callable[[str], str] = find_device,
    ) -> None:
        super().__init__(f"camera v4l2:{where}", options)
        self._where, self._find = where, find
        self._make_capture = make_capture or (lambda path: cv2.VideoCapture(path, cv2.CAP_V4L2))
        self.refused: list[str] = []
        self._period_ns = 0.0
        self._stated_hz = 0.0
        if options.format and options.format.upper() not in _FORMATS:
            raise SourceError(
                f"{self.name}: no pixel format {options.format!r}; known: {', '.join(_FORMATS)}"
            )
        self._device = self._open()
        self._check_rate()
        self._period_ns = 1e9 / self.rate_hz if self.rate_hz else 0.0

    def measure_rate(self, least_hz: float, patience_s: float) -> float:
        """The same, with two buffers if one is too few."""
        stated_hz = self._options.rate_hz or self._stated_hz
        if self._options.buffers == 1:
            measured_hz = super().measure_rate(0.0, patience_s)
            if measured_hz >= max(least_hz, LIVE.slow_rel * stated_hz):
                return measured_hz
            self._options = replace(self._options, buffers=2)
            self._reopen.set()
        return super().measure_rate(least_hz, patience_s)

    def _open(self) -> Any:
        path = self._find(self._where)
        capture = self._make_capture(path)
        if not capture.isOpened():
            raise SourceError(
                f"{self.name}: {path} does not open; another program uses it, or it gives no images"
            )
        try:
            self._set_up(capture)
        except SourceError:
            capture.release()
            raise
        return capture

    def _set_up(self, capture: Any) -> None:
        """Pixel format, size, rate, buffers, exposure, gain, focus; each read back."""
        o = self._options
        # Buffers first: each of these restarts the stream.
        capture.set(cv2.CAP_PROP_BUFFERSIZE, o.buffers)
        wanted = (o.format.upper(),) if o.format else _AUTO
        for name in wanted:
            self._layout = LAYOUTS.get(name)
            code = cv2.VideoWriter.fourcc(*name.ljust(4))
            if capture.set(cv2.CAP_PROP_FOURCC, code) and int(capture.get(cv2.CAP_PROP_FOURCC)) == code:
                break
        else:
            raise SourceError(
                f"{self.name}: camera does not give {' or '.join(wanted)}; see v4l2-ctl --list-formats-ext"
            )
        capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
        if o.width and o.height:
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, o.width)
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, o.height)
        size = (int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)))
        if o.width and o.height and size != (o.width, o.height):
            raise SourceError(
                f"{self.name}: asked for {o.width}x{o.height}, camera gives {size[0]}x{size[1]} as "
                f"{name}; ask for that, or see v4l2-ctl --list-formats-ext"
            )
        if self.size_px not in ((0, 0), size):
            raise SourceError(
                f"{self.name}: camera came back with {size[0]}x{size[1]}; give width and height"
            )
        self.size_px = size
        if o.rate_hz:
            capture.set(cv2.CAP_PROP_FPS, o.rate_hz)
        self._stated_hz = float(capture.get(cv2.CAP_PROP_FPS))
        self.refused = []
        if o.exposure_us:
            self._control(capture, "manual exposure", cv2.CAP_PROP_AUTO_EXPOSURE, _MANUAL)
            units = max(1, round(o.exposure_us / _EXPOSURE_UNIT_US))
            self._control(capture, "exposure_us", cv2.CAP_PROP_EXPOSURE, units)
        if o.gain:
            self._control(capture, "gain", cv2.CAP_PROP_GAIN, o.gain)
        if o.focus is not None:
            self._control(capture, "manual focus", cv2.CAP_PROP_AUTOFOCUS, _NO_FOCUS)
            self._control(capture, "focus", cv2.CAP_PROP_FOCUS, o.focus)

    def _control(self, capture: Any, name: str, prop: int, value: float) -> None:
        if not capture.set(prop, value):
            self.refused.append(f"{name}: camera has no such control")
        elif (got := float(capture.get(prop))) != value:
            self.refused.append(f"{name}: set to {value:g}, camera says {got:g}")

    def _read_from(self, device: Any) -> bool:
        if not device.grab():
            return False
        ok, raw = device.retrieve()
        now_ns = self._clock_ns()
        try:
            if not ok or raw is None:
                raise ValueError("no image")
            data = np.ascontiguousarray(raw).reshape(-1).view(np.uint8)
            image = unpack(self._layout, data, self.size_px) if self._layout else decode_picture(data)
            if image.shape[::-1] != self.size_px:
                raise ValueError("an image of another size")
        except ValueError:
            self.faults["damaged frame"] += 1
        else:
            driver_ns = round(float(device.get(cv2.CAP_PROP_POS_MSEC)) * 1e6)
            bits = self._layout.bits if self._layout else 8
            self._hand_over_at(image, bits, driver_ns, now_ns, self._period_ns)
        return True

    def _shut(self, device: Any) -> None:
        device.release()


def open_v4l2(where: str, options: Options) -> V4l2Source:
    options.own(f"v4l2:{where}", NoKeys)
    return V4l2Source(where, options)
