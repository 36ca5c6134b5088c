"""OAK modules, through depthai v3.

Only `find_module` and `OakCamera.output` need hardware; the rest takes any node's output.

- depthai is loaded here and nowhere else (0.5 s, 85 MB), with its telemetry off.
- Modules are listed first (0.5 s): opening one that does not exist takes 11.5 s.
- Frames are read from the queue, never in a host node of our own: an exception in a node's thread would abort
  the process.
- Capture time is depthai's, synchronised to the host's monotonic clock (`Clock.DRIVER`), or with
  `clock=device` the module's own (`Clock.DEVICE`). Its stamps are of the end of the exposure; we ask for the
  start.
- `crop=x,y,width,height` is done by the module: only that part of the image goes over USB.
- One process alone may open a module: `OakModule` has all cameras that are used, and `edge hand` hands their
  frames on to other processes (`oak_hand`).
- `sync=output` makes a camera's frame sync pin clock others, `sync=input` follows such a pin or any signal
  at the same rate. Of cameras of one module at one rate, frames with one sequence number belong together.

Source: depthai 3.12, its type stubs and its behaviour without hardware; the maker's page on frame sync.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from datetime import timedelta
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast

import msgspec
import numpy as np

from edge.errors import SourceError
from edge.params import PARAMS as RUNTIME
from edge.sources.camera import CameraSource
from edge.sources.live import PARAMS as LIVE
from edge.sources.oak_hand import FedCamera, fed_camera
from edge.sources.options import Options
from edge.types import Clock, Frame, Lens

if TYPE_CHECKING:
    import depthai as dai

RATE_HZ = 60.0  # that every camera of the maker's gives at this size; without a rate the modules give 30
_READ = timedelta(seconds=RUNTIME.wait_s)


def load_depthai() -> Any:
    """The depthai module. Raises SourceError: not installed."""
    os.environ["DEPTHAI_TELEMETRY"] = "0"
    os.environ.setdefault("DEPTHAI_LEVEL", "error")  # its own warnings would hide our one line
    try:
        import depthai
    except ImportError as error:
        raise SourceError(f"source oak: {error}; install voronoi-touch[oak]") from error
    return depthai


def find_module(where: str) -> dai.DeviceInfo:
    """The module with this id, name or address; "" the first one. Raises SourceError within 2 s."""
    found: list[dai.DeviceInfo] = load_depthai().Device.getAllAvailableDevices()
    for info in found:
        if not where or where in (info.deviceId, info.name):
            return info
    here = ", ".join(f"{info.deviceId} ({info.name})" for info in found) or "none"
    place = f"oak:{where}".rstrip(":")
    raise SourceError(
        f"source {place}: no such OAK module; free modules here: {here}; plug it in, check its udev "
        "rule; several cameras of one are for `edge hand`"
    )


#: A camera's frame sync pin does this, by the value of `sync=`; depthai's name for it.
SYNC_MODES = {"output": "OUTPUT", "input": "INPUT", "ptp": "TIME_PTP"}


class Crop(NamedTuple):
    """A part of the image, px."""

    x: int
    y: int
    width: int
    height: int

    @classmethod
    def parse(cls, text: str, size_px: tuple[int, int]) -> Crop:
        """Read "x,y,width,height". Raises SourceError: not that, or not within an image of this size."""
        width, height = size_px
        match = re.fullmatch(r"\d{1,5}(,\d{1,5}){3}", text)
        crop = cls(*map(int, text.split(","))) if match else cls(0, 0, 0, 0)
        within = crop.x + crop.width <= width and crop.y + crop.height <= height
        if not (crop.width and crop.height and within):
            raise SourceError(
                f"source oak: crop={text}: give x,y,width,height within the image of {width}x{height}, "
                f"e.g. crop={width // 4},{height // 4},{width // 2},{height // 2}"
            )
        return crop

    def of(self, pipeline: dai.Pipeline, output: dai.Node.Output) -> dai.Node.Output:
        """The cropped output, grey."""
        import depthai as dai

        node = pipeline.create(dai.node.ImageManip)
        node.initialConfig.addCrop(self.x, self.y, self.width, self.height)
        node.initialConfig.setFrameType(dai.ImgFrame.Type.GRAY8)
        node.setMaxOutputFrameSize(self.width * self.height)
        output.link(node.inputImage)
        return node.out


def _socket(name: str) -> dai.CameraBoardSocket:
    """Raises SourceError: no such name."""
    sockets = load_depthai().CameraBoardSocket.__members__
    if name not in sockets:
        raise SourceError(f"source oak: no socket {name!r}; known: {', '.join(sockets)}")
    return cast("dai.CameraBoardSocket", sockets[name])


def check_socket(device: Any, name: str) -> None:
    """Raises SourceError: the module has no camera there."""
    cameras = {camera.socket.name: camera.sensorName for camera in device.getConnectedCameraFeatures()}
    if name not in cameras:
        here = ", ".join(f"{socket} ({sensor})" for socket, sensor in cameras.items()) or "none"
        raise SourceError(f"source oak: no camera on {name}; cameras of this module: {here}; give ?socket=")


#: Ours, of depthai's names of models; others are not OpenCV's.
_MODELS: dict[str, Literal["pinhole", "fisheye"]] = {"Perspective": "pinhole", "Fisheye": "fisheye"}


def lens_of(
    handler: dai.CalibrationHandler, socket: str, size_px: tuple[int, int], crop: Crop | None = None
) -> Lens | None:
    """Lens model for this image size, or a part of such an image; None: the module has none."""
    board = _socket(socket)
    try:
        matrix = handler.getCameraIntrinsics(board, *size_px)
        distortion = handler.getDistortionCoefficients(board)
        model = handler.getDistortionModel(board)
    except RuntimeError:  # not calibrated at the factory
        return None
    if model.name not in _MODELS:
        return None
    kind = _MODELS[model.name]
    x, y = crop[:2] if crop else (0, 0)
    return Lens(
        model=kind,
        size_px=crop[2:] if crop else size_px,
        focal_px=(matrix[0][0], matrix[1][1]),
        centre_px=(matrix[0][2] - x, matrix[1][2] - y),
        distortion=tuple(distortion[: 4 if kind == "fisheye" else 14]),
    )


class OakKeys(msgspec.Struct):
    """The scheme's own keys; `crop` is x,y,width,height."""

    socket: str = "CAM_B"
    clock: Literal["host", "device"] = "host"
    crop: str = ""
    sync: Literal["", "output", "input", "ptp"] = ""


class OakCamera(NamedTuple):
    """A camera of a module, as it is asked for."""

    options: Options
    keys: OakKeys
    crop: Crop | None

    def output(self, pipeline: dai.Pipeline) -> dai.Node.Output:
        """A mono camera: manual exposure and focus, no anti-banding, one chunk a frame."""
        import depthai as dai

        options, sync = self.options, self.keys.sync
        rate_hz = options.rate_hz
        camera = pipeline.create(dai.node.Camera).build(_socket(self.keys.socket), sensorFps=rate_hz)
        control = camera.initialControl
        control.setManualExposure(options.exposure_us or LIVE.exposure_us, options.gain or LIVE.gain_iso)
        control.setAntiBandingMode(dai.CameraControl.AntiBandingMode.OFF)
        if options.focus is not None:
            control.setManualFocus(options.focus)
        if sync:
            control.setFrameSyncMode(getattr(dai.CameraControl.FrameSyncMode, SYNC_MODES[sync]))
        pipeline.setXLinkChunkSize(0)
        output = camera.requestOutput(options.size_px, type=dai.ImgFrame.Type.GRAY8, fps=rate_hz)
        return output if self.crop is None else self.crop.of(pipeline, output)


def camera_at(where: str, options: Options) -> OakCamera:
    """The camera that an address asks for; unasked, of a size and rate of its maker's mono sensors."""
    keys = options.own(f"oak:{where}", OakKeys)
    options = options.or_own(LIVE.size_px, RATE_HZ)
    return OakCamera(options, keys, Crop.parse(keys.crop, options.size_px) if keys.crop else None)


Opened = tuple["dai.Pipeline", "dict[str, dai.MessageQueue]"]


class OakModule:
    """Cameras of one module, or host nodes, which are opened and lost together.

    find    gives the module to open; None: host only
    lenses  of each camera, by the module's own calibration
    live    whether it comes back when it is lost; else its stream has an end

    Frames of one exposure have one number in all cameras. It goes on where a lost module begins with 0 again.
    """

    def __init__(
        self, cameras: Sequence[OakCamera], find: Callable[[], dai.DeviceInfo] | None = None
    ) -> None:
        self._dai = load_depthai()
        self.cameras, self._find = cameras, find
        self.lenses: list[Lens | None] = [None] * len(cameras)
        self.live = find is not None
        self._base = self._next = 0
        for camera in cameras:
            _socket(camera.keys.socket)

    def open(self) -> Opened:
        """Pipeline, running, and the queues of the cameras. Raises SourceError; RuntimeError from depthai."""
        dai = self._dai
        if self._find is None:
            pipeline = dai.Pipeline(createImplicitDevice=False)
        else:
            device = dai.Device(self._find())
            for camera in self.cameras:
                check_socket(device, camera.keys.socket)
            handler = device.readCalibration()
            self.lenses = [lens_of(handler, c.keys.socket, c.options.size_px, c.crop) for c in self.cameras]
            pipeline = dai.Pipeline(device)
        outputs = [camera.output(pipeline) for camera in self.cameras]
        queues = {str(place): output.createOutputQueue() for place, output in enumerate(outputs)}
        pipeline.start()
        self._base = self._next
        return pipeline, queues

    def read(self, opened: Opened) -> dict[int, Frame] | None:
        """The frames of the last moment, by the camera's place; None: lost, or at the end of the stream."""
        queues = opened[1]
        try:
            messages = self._dai.MessageQueue.getAny(queues, _READ)
        except RuntimeError:
            return None
        if not messages and any(queue.isClosed() for queue in queues.values()):
            return None
        return {int(place): self._frame(int(place), message) for place, message in messages.items()}

    def shut(self, opened: Opened) -> None:
        """Close the module, which may be gone already."""
        pipeline = opened[0]
        if pipeline.isRunning():
            pipeline.stop()
            pipeline.wait()

    def _frame(self, place: int, message: dai.ImgFrame) -> Frame:
        image = np.array(message.getFrame(), dtype=np.uint8)  # a copy: the message's memory is reused
        sequence = self._base + message.getSequenceNum()
        self._next = max(self._next, sequence + 1)
        own_clock = self.cameras[place].keys.clock == "device"
        end = message.getTimestampDevice() if own_clock else message.getTimestamp()
        stamp_ns = (end - message.getExposureTime()) // timedelta(microseconds=1) * 1000
        return Frame(image, stamp_ns, sequence, Clock.DEVICE if own_clock else Clock.DRIVER)


class OakSource(CameraSource):
    """Frames of one camera, of an own module or fed by the process that has it open. Raises SourceError."""

    def __init__(self, module: OakModule | FedCamera, camera: OakCamera, name: str = "camera oak") -> None:
        super().__init__(name, camera.options)
        self._module = module
        self._next = 0
        self._device = self._open()
        if module.live:
            self._check_rate()
        else:  # a replay would lose its first frames
            self.size_px = camera.crop[2:] if camera.crop else camera.options.size_px
            self.rate_hz = camera.options.rate_hz

    @property
    def factory_lens(self) -> Lens | None:
        return self._module.lenses[0]

    def _open(self) -> Any:
        return self._module.open()

    def _read_from(self, device: Any) -> bool:
        frames = self._module.read(device)
        if frames is None and not self._module.live:
            self._closing.set()
        for frame in (frames or {}).values():
            self._take(frame)
        return frames is not None

    def _shut(self, device: Any) -> None:
        self._module.shut(device)

    def _take(self, frame: Frame) -> None:
        image, sequence = frame.image, frame.sequence
        if image.ndim != 2 or self.size_px not in ((0, 0), image.shape[::-1]):
            self.faults["damaged frame"] += 1
            return
        self.size_px = (image.shape[1], image.shape[0])
        if sequence > self._next and self.received_n:
            self.faults["missed frame"] += sequence - self._next
        self._next = sequence + 1
        self._hand_over(frame)


def open_oak(where: str, options: Options) -> OakSource:
    """The scheme `oak:`; its own keys: `OakKeys`."""
    camera = camera_at(where, options)
    module = fed_camera() or OakModule([camera], lambda: find_module(where))
    return OakSource(module, camera, f"camera oak:{where} {camera.keys.socket}")
