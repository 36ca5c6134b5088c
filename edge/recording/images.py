"""Images as Foxglove messages without loss, and back: also from files of other tools, of 8 or 16 bits."""

import cv2
import msgspec
import numpy as np

from edge.recording.mcap_file import RawMessage
from edge.recording.ros import ros_message
from edge.recording.topics import proto, stamp
from edge.sources.image_header import check_size
from edge.sources.pixels import LAYOUTS, decode_colour, decode_picture, unpack
from edge.types import Image

#: Schemas of messages that are images.
IMAGE_SCHEMAS = (
    "foxglove.RawImage",
    "foxglove.CompressedImage",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CompressedImage",
)


class OtherSize(ValueError):
    """An image of another size than the recording's others."""


def image_message(image: Image, log_ns: int, *, png: bool) -> bytes:
    """The image without loss: as PNG, or as raw rows of mono8 / little-endian mono16."""
    head = {"timestamp": stamp(log_ns), "frame_id": "camera"}
    if png:
        ok, data = cv2.imencode(".png", image)
        if not ok:
            raise ValueError(f"PNG encoder refused an image of shape {image.shape}, {image.dtype}")
        message = proto("CompressedImage")(**head, format="png", data=data.tobytes())
    else:
        deep = image.dtype == np.uint16
        height, width = image.shape
        message = proto("RawImage")(
            **head,
            width=width,
            height=height,
            encoding="mono16" if deep else "mono8",
            step=width * image.itemsize,
            data=(image.astype("<u2", copy=False) if deep else image).tobytes(),
        )
    return bytes(message.SerializeToString())


class _Picture(msgspec.Struct):
    """A RawImage or CompressedImage in JSON, whose bytes are base64."""

    data: bytes
    width: int = 0
    height: int = 0
    encoding: str = ""
    step: int = 0


def decode_image(raw: RawMessage, size_px: tuple[int, int], colour: bool) -> tuple[Image, Image | None]:
    """Grey image of a message; with `colour` also the same in BGR, where it has colour.

    size_px  required (width, height); (0, 0): any within the limits of a camera
    Raises   OtherSize, before its pixels are decoded; ValueError: damaged, too large, of an unknown kind;
             SourceError: rosbags is not installed
    """

    def check(width: int, height: int) -> None:
        check_size(width, height)
        if size_px not in ((0, 0), (width, height)):
            raise OtherSize(f"{width}x{height} pixels, not {size_px}")

    if raw.encoding == "protobuf":
        message = proto(raw.schema.removeprefix("foxglove.")).FromString(raw.data)
    elif raw.encoding == "json":
        message = msgspec.json.decode(raw.data, type=_Picture)
    else:
        message = ros_message(raw)
    if raw.schema.endswith("CompressedImage"):
        return decode_picture(message.data, check), decode_colour(message.data) if colour else None
    check(message.width, message.height)
    if message.encoding not in LAYOUTS:
        known = ", ".join(name for name in LAYOUTS if name.islower())
        raise ValueError(f"image encoding {message.encoding!r} is not one of {known}")
    size, big_endian = (message.width, message.height), getattr(message, "is_bigendian", False)
    layout = LAYOUTS[message.encoding]
    stored = message.data, size, message.step, bool(big_endian)
    in_colour = layout._replace(to_grey=layout.to_bgr) if colour and layout.to_bgr else None
    return unpack(layout, *stored), unpack(in_colour, *stored) if in_colour else None
