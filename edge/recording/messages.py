"""What stands in a recording: one table of topics, and one function a message.

- A well-known Foxglove schema (protobuf) wherever one fits; JSON with a JSON schema for numbers that
  have none, because PlotJuggler plots those as they are.
- Numbers per pin travel as packed little-endian float64 in `foxglove.PointCloud`: exact, and cheap to
  write. Overlays (`ImageAnnotations`) repeat some of it for the eye only.
- Image coordinates here put pixel centres on integers; Foxglove's annotations put the origin on the
  corner of the first pixel. The half pixel is added here and nowhere else.
- protobuf and the schemas are imported when the first message of their kind is made.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from edge.errors import SourceError
from edge.types import Array, Cells, Features, Frame, Image, Reading, Tracks

__all__ = [
    "TOPICS",
    "Topic",
    "annotations_of",
    "cells_cloud",
    "cloud_to_array",
    "decode_image",
    "features_json",
    "image_message",
    "log_message",
    "pins_cloud",
    "proto",
    "reading_json",
    "schema_of",
    "to_json",
]

_PIXEL_CENTRE = 0.5  # foxglove.ImageAnnotations: origin on the corner of the top-left pixel


@dataclass(frozen=True, slots=True)
class Topic:
    """name      topic in the file
    schema    name of the schema; "foxglove." ones are protobuf, the rest JSON
    fields    for JSON: (name, JSON type, meaning); other fields may follow
    """

    name: str
    schema: str
    fields: tuple[tuple[str, str, str], ...] = ()

    @property
    def is_json(self) -> bool:
        return not self.schema.startswith("foxglove.")


_SEQUENCE = ("sequence", "integer", "the camera's own counter")

TOPICS: dict[str, Topic] = {
    "image": Topic("/camera/image", "foxglove.RawImage"),
    "image_png": Topic("/camera/image", "foxglove.CompressedImage"),
    "frame": Topic(
        "/camera/frame",
        "voronoi_touch.Frame",
        (
            _SEQUENCE,
            ("capture_ns", "integer", "start of exposure, ns, on `clock`"),
            ("clock", "string", "device, driver, host or recorded"),
            ("bits", "integer", "bits of a pixel that count"),
        ),
    ),
    "truth": Topic(
        "/camera/truth", "voronoi_touch.Truth", (_SEQUENCE, ("truth", "object", "what the rig knows"))
    ),
    "pins": Topic("/pins", "foxglove.PointCloud"),
    "pins_overlay": Topic("/pins/overlay", "foxglove.ImageAnnotations"),
    "cells": Topic("/cells", "foxglove.PointCloud"),
    "cells_overlay": Topic("/cells/overlay", "foxglove.ImageAnnotations"),
    "features": Topic(
        "/features",
        "voronoi_touch.Features",
        (
            _SEQUENCE,
            ("touched", "boolean", "anything above the noise"),
            ("shear_x_px", "number", "mean motion of the pins, x right, px"),
            ("shear_y_px", "number", "mean motion of the pins, y down, px"),
            ("volume_px2", "number", "compressed part of the surface's integral, px2"),
            ("torsion_rad", "number", "rotation about the contact, rad"),
            ("slip_px", "number", "motion that the load does not explain, px"),
            ("slip_probability", "number", "0..1"),
            ("contacts", "array", "x_px, y_px, peak, area_px2, orientation_rad, elongation; strongest first"),
        ),
    ),
    "reading": Topic(
        "/reading",
        "voronoi_touch.Reading",
        (
            _SEQUENCE,
            ("values", "object", "calibrated values by name of the wire's field; unit in the name"),
            ("sigmas", "object", "one-sigma error of each value, in its unit"),
            ("contacts", "array", "x_mm, y_mm, depth_mm in the tip's frame; strongest first"),
            ("saturated", "array", "names of values outside of the calibrated range"),
            ("calibrated", "boolean", "a calibration of this tip was applied"),
        ),
    ),
    "sample": Topic(
        "/bus/sample",
        "voronoi_touch.Sample",
        (
            _SEQUENCE,
            ("values", "object", "the state frame's fields as the host decodes them"),
            ("payload", "string", "the bytes as sent, hexadecimal"),
        ),
    ),
    "events": Topic("/events", "foxglove.Log"),
}


@cache
def proto(name: str) -> Any:
    """Class of a Foxglove message, e.g. `proto("RawImage")`. Raises SourceError where it is not installed."""
    try:
        module = import_module(f"foxglove_schemas_protobuf.{name}_pb2")
    except ImportError as error:
        raise SourceError(f"recording: {error}; install voronoi-touch[edge]") from error
    return getattr(module, name)


def schema_of(topic: Topic) -> tuple[str, str, bytes]:
    """(message encoding, schema encoding, schema) as MCAP's registry names them."""
    if topic.is_json:
        properties = {name: {"type": kind, "description": text} for name, kind, text in topic.fields}
        return (
            "json",
            "jsonschema",
            msgspec.json.encode({"title": topic.schema, "type": "object", "properties": properties}),
        )
    from mcap_protobuf.schema import build_file_descriptor_set

    message = proto(topic.schema.removeprefix("foxglove."))
    return "protobuf", "protobuf", build_file_descriptor_set(message).SerializeToString()


def _plain(value: Any) -> Any:
    """NumPy scalars and arrays, sets and enums inside of a truth, as JSON."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"cannot write {type(value).__name__} as JSON")


_JSON = msgspec.json.Encoder(enc_hook=_plain)


def to_json(value: Any) -> bytes:
    """JSON; a NaN or an infinity becomes null, as JSON has neither."""
    return _JSON.encode(value)


def _stamp(ns: int) -> Any:
    from google.protobuf.timestamp_pb2 import Timestamp

    seconds, nanos = divmod(ns, 1_000_000_000)
    return Timestamp(seconds=seconds, nanos=nanos)


def image_message(image: Image, log_ns: int, *, png: bool) -> bytes:
    """The image without loss: as PNG, or as raw rows of mono8 / little-endian mono16."""
    if png:
        ok, data = cv2.imencode(".png", image)
        if not ok:
            raise ValueError(f"PNG encoder refused an image of shape {image.shape}, {image.dtype}")
        message = proto("CompressedImage")(
            timestamp=_stamp(log_ns), frame_id="camera", format="png", data=data.tobytes()
        )
    else:
        deep = image.dtype == np.uint16
        height, width = image.shape
        message = proto("RawImage")(
            timestamp=_stamp(log_ns),
            frame_id="camera",
            width=width,
            height=height,
            encoding="mono16" if deep else "mono8",
            step=width * image.itemsize,
            data=(image.astype("<u2", copy=False) if deep else image).tobytes(),
        )
    return bytes(message.SerializeToString())


# foxglove.RawImage encodings that a camera or another tool may have written, and the way to grey.
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


def decode_image(schema: str, data: bytes) -> Image:
    """Grey image of a RawImage or CompressedImage message. Raises ValueError where it is damaged."""
    if schema == "foxglove.CompressedImage":
        packed = proto("CompressedImage").FromString(data)
        buffer = np.frombuffer(packed.data, np.uint8)
        flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH
        decoded = cv2.imdecode(buffer, flags) if buffer.size else None
        if decoded is None:
            raise ValueError(f"{packed.format or 'compressed'} image does not decode")
        return _grey(decoded)
    raw = proto("RawImage").FromString(data)
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


def _grey(image: NDArray[Any]) -> Image:
    """As uint8 or native uint16, whichever it is."""
    return (
        image.astype(np.uint16, copy=False)
        if image.dtype.itemsize == 2
        else image.astype(np.uint8, copy=False)
    )


_NUMERIC = {"u1": 1, "i4": 6, "f4": 7, "f8": 8}  # foxglove.PackedElementField.NumericType


def _cloud(columns: Mapping[str, NDArray[Any]], log_ns: int) -> bytes:
    """One point a row; z = 0 because viewers want three coordinates."""
    n = len(columns["x"])
    dtype = np.dtype([(name, np.asarray(column).dtype.newbyteorder("<")) for name, column in columns.items()])
    packed = np.empty(n, dtype)
    for name, column in columns.items():
        packed[name] = column
    field = proto("PackedElementField")
    fields = [
        field(name=name, offset=dtype.fields[name][1], type=_NUMERIC[dtype.fields[name][0].str[1:]])
        for name in columns
        if dtype.fields is not None
    ]
    pose = proto("Pose")()
    pose.orientation.w = 1.0
    return bytes(
        proto("PointCloud")(
            timestamp=_stamp(log_ns),
            frame_id="image",
            pose=pose,
            point_stride=dtype.itemsize,
            fields=fields,
            data=packed.tobytes(),
        ).SerializeToString()
    )


def cloud_to_array(cloud: Any) -> NDArray[Any]:
    """Structured array of a decoded foxglove.PointCloud: one row a pin, one field a column."""
    names = {number: name for name, number in _NUMERIC.items()}
    dtype = np.dtype(
        {
            "names": [field.name for field in cloud.fields],
            "formats": [
                "<" + names[field.type] if names[field.type] != "u1" else "u1" for field in cloud.fields
            ],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_stride,
        }
    )
    return np.frombuffer(cloud.data, dtype)


def pins_cloud(tracks: Tracks, features: Features | None, log_ns: int) -> bytes:
    """Row i is pin i: x, y, sigma_px, seen; with features also dx_px, dy_px, area_change."""
    columns: dict[str, NDArray[Any]] = {
        "x": tracks.xy_img[:, 0],
        "y": tracks.xy_img[:, 1],
        "z": np.zeros(len(tracks.xy_img)),
        "sigma_px": tracks.sigma_px,
        "seen": tracks.seen.astype(np.uint8),
    }
    if features is not None:
        columns["dx_px"] = features.displacement_px[:, 0]
        columns["dy_px"] = features.displacement_px[:, 1]
        columns["area_change"] = features.area_change
    return _cloud(columns, log_ns)


def cells_cloud(cells: Cells, log_ns: int) -> bytes:
    """Row i is pin i's cell: x, y, area_px2, rest_area_px2."""
    n = len(cells.area_px2)
    return _cloud(
        {
            "x": cells.xy_img[:n, 0],
            "y": cells.xy_img[:n, 1],
            "z": np.zeros(n),
            "area_px2": cells.area_px2,
            "rest_area_px2": cells.rest_area_px2,
        },
        log_ns,
    )


def annotations_of(
    log_ns: int,
    *,
    points: Array | None = None,
    polygons: Sequence[Array] = (),
    colours: Sequence[tuple[float, float, float, float]] = (),
) -> bytes:
    """Overlay on the image.

    points    (n, 2) px; dots; rows with NaN are left out
    polygons  (k, 2) px each; outlines, filled with colours[i] (r, g, b, a in 0..1)
    """
    stamp = _stamp(log_ns)
    annotation, point2, colour = proto("PointsAnnotation"), proto("Point2"), proto("Color")
    shapes = []
    for polygon, rgba in zip(polygons, colours, strict=True):
        if len(polygon) < 3 or not np.isfinite(polygon).all():
            continue
        shapes.append(
            annotation(
                timestamp=stamp,
                type=annotation.LINE_LOOP,
                points=[point2(x=x, y=y) for x, y in (polygon + _PIXEL_CENTRE).tolist()],
                outline_color=colour(r=0.35, g=0.35, b=0.35, a=0.8),
                fill_color=colour(r=rgba[0], g=rgba[1], b=rgba[2], a=rgba[3]),
                thickness=1.0,
            )
        )
    if points is not None:
        visible = points[np.isfinite(points).all(axis=1)] + _PIXEL_CENTRE
        shapes.append(
            annotation(
                timestamp=stamp,
                type=annotation.POINTS,
                points=[point2(x=x, y=y) for x, y in visible.tolist()],
                outline_color=colour(r=1.0, g=0.8, b=0.0, a=1.0),
                thickness=3.0,
            )
        )
    return bytes(proto("ImageAnnotations")(points=shapes).SerializeToString())


def features_json(frame: Frame, features: Features) -> dict[str, Any]:
    """The scalars and the contacts; what was not asked for is null."""
    shear = features.shear_px
    return {
        "sequence": frame.sequence,
        "touched": bool(features.touched),
        "shear_x_px": None if shear is None else float(shear[0]),
        "shear_y_px": None if shear is None else float(shear[1]),
        "volume_px2": features.volume_px2,
        "torsion_rad": features.torsion_rad,
        "slip_px": features.slip_px,
        "slip_probability": features.slip_probability,
        "contacts": [
            {
                "x_px": float(contact.xy_img[0]),
                "y_px": float(contact.xy_img[1]),
                "peak": contact.peak,
                "area_px2": contact.area_px2,
                "orientation_rad": contact.orientation_rad,
                "elongation": contact.elongation,
            }
            for contact in features.contacts or ()
        ],
    }


def reading_json(frame: Frame, reading: Reading) -> dict[str, Any]:
    return {
        "sequence": frame.sequence,
        "values": reading.values,
        "sigmas": reading.sigmas,
        "contacts": [
            {"x_mm": x, "y_mm": y, "depth_mm": depth}
            for x, y, depth in reading.contacts.reshape(-1, 3).tolist()
        ],
        "saturated": sorted(reading.saturated),
        "calibrated": reading.calibrated,
    }


_LEVELS = ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")  # foxglove.Log.Level, by number


def log_message(level: str, text: str, name: str, log_ns: int) -> bytes:
    """level: one of debug, info, warning, error, fatal."""
    number = _LEVELS.index(level.upper())
    return bytes(
        proto("Log")(timestamp=_stamp(log_ns), level=number, message=text, name=name).SerializeToString()
    )
