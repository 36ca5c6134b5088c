"""Images as Foxglove messages without loss, and back: also from files of other tools, of 8 or 16 bits."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from edge.recording.topics import proto, stamp
from edge.sources.image_header import check_size, image_size
from edge.types import Image


class OtherSize(ValueError):
    """An image of another size than the recording's others."""


def image_message(image: Image, log_ns: int, *, png: bool) -> bytes:
    """The image without loss: as PNG, or as raw rows of mono8 / little-endian mono16."""
    if png:
        ok, data = cv2.imencode(".png", image)
        if not ok:
            raise ValueError(f"PNG encoder refused an image of shape {image.shape}, {image.dtype}")
        message = proto("CompressedImage")(
            timestamp=stamp(log_ns), frame_id="camera", format="png", data=data.tobytes()
        )
    else:
        deep = image.dtype == np.uint16
        height, width = image.shape
        message = proto("RawImage")(
            timestamp=stamp(log_ns),
            frame_id="camera",
            width=width,
            height=height,
            encoding="mono16" if deep else "mono8",
            step=width * image.itemsize,
            data=(image.astype("<u2", copy=False) if deep else image).tobytes(),
        )
    return bytes(message.SerializeToString())


# foxglove.RawImage encodings that a camera or another tool may have written, and the conversion to grey.
_RAW: dict[str, tuple[str, int, int | None]] = {  # encoding: dtype, channels, OpenCV's conversion
    "mono8": ("u1", 1, None),
    "8UC1": ("u1", 1, None),
    "mono16": ("<u2", 1, None),
    "16UC1": ("<u2", 1, None),
    "rgb8": ("u1", 3, cv2.COLOR_RGB2GRAY),
    "bgr8": ("u1", 3, cv2.COLOR_BGR2GRAY),
    "8UC3": ("u1", 3, cv2.COLOR_BGR2GRAY),
    "rgba8": ("u1", 4, cv2.COLOR_RGBA2GRAY),
    "bgra8": ("u1", 4, cv2.COLOR_BGRA2GRAY),
}


def decode_image(schema: str, data: bytes, size_px: tuple[int, int] | None = None) -> Image:
    """Grey image of a RawImage or CompressedImage message.

    size_px  required (width, height); None: any within the limits of a camera
    Raises   OtherSize, before its pixels are decoded; ValueError: damaged, or too large
    """
    if schema == "foxglove.CompressedImage":
        packed = proto("CompressedImage").FromString(data)
        _check_size(image_size(packed.data), size_px)
        decoded = cv2.imdecode(
            np.frombuffer(packed.data, np.uint8), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH
        )
        if decoded is None:
            raise ValueError(f"{packed.format or 'compressed'} image does not decode")
        return _grey(decoded)
    raw = proto("RawImage").FromString(data)
    _check_size((raw.width, raw.height), size_px)
    if raw.encoding not in _RAW:
        raise ValueError(f"image encoding {raw.encoding!r} is not one of {', '.join(_RAW)}")
    dtype, channels, conversion = _RAW[raw.encoding]
    itemsize = np.dtype(dtype).itemsize
    row = raw.width * channels * itemsize
    if raw.step < row or len(raw.data) < raw.step * raw.height or not raw.height or not raw.width:
        raise ValueError(f"image of {raw.width}x{raw.height} has {len(raw.data)} bytes, rows of {raw.step}")
    rows = np.frombuffer(raw.data, np.uint8, raw.step * raw.height).reshape(raw.height, raw.step)[:, :row]
    image = np.ascontiguousarray(rows).view(dtype)
    if conversion is not None:
        return _grey(cv2.cvtColor(image.reshape(raw.height, raw.width, channels), conversion))
    return _grey(image)


def _check_size(found_px: tuple[int, int], size_px: tuple[int, int] | None) -> None:
    check_size(*found_px)
    if size_px not in (None, found_px):
        raise OtherSize(f"{found_px[0]}x{found_px[1]} pixels, not {size_px}")


def _grey(image: NDArray[Any]) -> Image:
    """The image as uint8 or native uint16."""
    return (
        image.astype(np.uint16, copy=False)
        if image.dtype.itemsize == 2
        else image.astype(np.uint8, copy=False)
    )
