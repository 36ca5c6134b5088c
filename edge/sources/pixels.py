"""Grey images from what cameras and files store: one table of pixel layouts for all of them.

The same picture gives the same pixels from every source. Colour becomes grey with the weights of BT.601; the
luma of a JPEG and of YUV is taken as it is stored. What a file says of orientation and gamma is ignored, as a
live camera does not say it.

Sources: sensor_msgs/image_encodings.hpp; Foxglove, RawImage; V4L2, Image Formats; MIPI CSI-2 (packed pixels).
"""

from collections.abc import Callable
from functools import partial
from math import ceil
from typing import Any, NamedTuple

import cv2
import numpy as np

from edge.sources.image_header import check_size, image_size, is_whole_png
from edge.types import Image

Pixels = np.ndarray[Any, Any]


def to_grey(image: Pixels) -> Image:
    """Grey of the same depth. Raises ValueError: not an image of 8 or 16 bits."""
    if image.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"pixels of type {image.dtype}; save it with 8 or 16 bits a pixel")
    if image.ndim == 2:
        return image
    conversions = {1: None, 3: cv2.COLOR_BGR2GRAY, 4: cv2.COLOR_BGRA2GRAY}
    if image.ndim != 3 or image.shape[2] not in conversions:
        raise ValueError(f"{image.shape} values; save it as grey or RGB")
    code = conversions[image.shape[2]]
    return np.asarray(image[:, :, 0] if code is None else cv2.cvtColor(image, code))


def decode_picture(data: Pixels | bytes, check: Callable[[int, int], None] = check_size) -> Image:
    """Grey image of a PNG, JPEG or other compressed picture.

    check   is given width and height before the pixels are decoded, and raises ValueError
    Raises  ValueError: not an image, damaged
    """
    data = np.frombuffer(data, np.uint8)
    check(*image_size(data.data))
    jpeg = data[0] == 0xFF
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION if jpeg else cv2.IMREAD_UNCHANGED
    try:
        image = cv2.imdecode(data, flags) if data[0] != 0x89 or is_whole_png(data.data) else None
    except cv2.error:
        image = None
    if image is None:
        raise ValueError("not an image, or damaged")
    return to_grey(image)


def decode_colour(data: Pixels | bytes) -> Image | None:
    """A picture that `decode_picture` has taken, in BGR; None: it has no colour."""
    flags = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    image = np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), flags))
    return image if image.ndim == 3 else None


class Layout(NamedTuple):
    """How rows of bytes become pixels.

    bits         of a pixel that count
    pixel_bytes  of a pixel in its row, on average
    to_grey      of (h, bytes of a row) uint8
    planes       rows of all planes to one of the first, which has the luma
    to_bgr       as `to_grey`; None: it has no colour, or keeps it in other planes
    """

    bits: int
    pixel_bytes: float
    to_grey: Callable[[Pixels], Any]
    planes: float = 1.0
    to_bgr: Callable[[Pixels], Any] | None = None


def _colour(dtype: str, values_n: int, code: int | None, rows: Pixels) -> Any:
    pixels = rows.view(dtype)
    pixels = pixels.reshape(len(rows), -1, values_n) if values_n > 1 else pixels
    return pixels if code is None else cv2.cvtColor(pixels, code)


def _deep(rows: Pixels) -> Pixels:
    return rows.view("<u2").astype(np.uint16, copy=False)


def _packed(bits: int, rows: Pixels) -> Pixels:
    """Pixels' upper eight bits, one after another, and then a byte of their lower ones."""
    n = 8 // (bits - 8)
    units = rows.reshape(len(rows), -1, n + 1).astype(np.uint16)
    lower = units[:, :, n:] >> np.arange(n, dtype=np.uint16) * (bits - 8) & (1 << bits - 8) - 1
    return (units[:, :, :n] << (bits - 8) | lower).reshape(len(rows), -1)


#: The layouts by the names of ROS and Foxglove, and of V4L2 in capitals.
LAYOUTS: dict[str, Layout] = {}
for _names, _layout in {
    "mono8 8UC1 GREY": Layout(8, 1, lambda rows: rows),
    "mono16 16UC1 Y16": Layout(16, 2, _deep),
    "Y10": Layout(10, 2, _deep),
    "Y12": Layout(12, 2, _deep),
    "Y10P": Layout(10, 1.25, partial(_packed, 10)),
    "Y12P": Layout(12, 1.5, partial(_packed, 12)),
    "nv12 nv21 NV12 NV21 YU12 YV12": Layout(8, 1, lambda rows: rows, 1.5),
    "nv24": Layout(8, 1, lambda rows: rows, 3),
}.items():
    LAYOUTS |= dict.fromkeys(_names.split(), _layout)
for _names, _n, _code in (
    ("yuyv yuv422_yuy2 YUYV", 2, "YUV2{}_YUYV"),
    ("uyvy yuv422 UYVY", 2, "YUV2{}_UYVY"),
    ("rgb8 RGB3", 3, "RGB2{}"),
    ("bgr8 8UC3 BGR3", 3, "BGR2{}"),
    ("rgba8", 4, "RGBA2{}"),
    ("bgra8 8UC4", 4, "BGRA2{}"),
    ("bayer_rggb8 RGGB", 1, "BayerRGGB2{}"),
    ("bayer_bggr8", 1, "BayerBGGR2{}"),
    ("bayer_gbrg8 GBRG", 1, "BayerGBRG2{}"),
    ("bayer_grbg8 GRBG", 1, "BayerGRBG2{}"),
):
    for _dtype, _bits in (("<u2", 16), ("u1", 8)):
        _to_grey, _to_bgr = (
            partial(_colour, _dtype, _n, getattr(cv2, "COLOR_" + _code.format(_to), None))  # None: is so
            for _to in ("GRAY", "BGR")
        )
        _layout = Layout(_bits, _n * _bits / 8, _to_grey, to_bgr=_to_bgr)
        LAYOUTS |= dict.fromkeys(_names.replace("8", str(_bits)).split(), _layout)
LAYOUTS["BA81"] = LAYOUTS["bayer_bggr8"]


def unpack(
    layout: Layout, data: Pixels | bytes, size_px: tuple[int, int], step: int = 0, big_endian: bool = False
) -> Image:
    """Grey image of raw pixels.

    step    bytes from row to row; 0: found from the length of the data
    Raises  ValueError: too few bytes
    """
    width, height = size_px
    raw = np.frombuffer(data, np.uint8)
    row_bytes = ceil(width * layout.pixel_bytes)
    if not step:
        step, left = divmod(len(raw), round(height * layout.planes))
        step = row_bytes if left else step
    if step < row_bytes or len(raw) < step * height or not height or not width:
        raise ValueError(f"image of {width}x{height} has {len(raw)} bytes, rows of {step}")
    rows = np.ascontiguousarray(raw[: step * height].reshape(height, step)[:, :row_bytes])
    if big_endian and layout.bits > 8:
        rows = rows.view(np.uint16).byteswap().view(np.uint8)
    return np.ascontiguousarray(layout.to_grey(rows)[:, :width])
