"""Results of the stages as messages: one function a message.

Image coordinates here put pixel centres on integers; Foxglove's annotations put the origin on the corner of
the first pixel. The half pixel is added in this module only.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from edge.cells import cell_polygons
from edge.recording.topics import proto, stamp
from edge.types import Array, Cells, Features, Frame, Reading, Tracks
from edge.view.palette import cell_rgba

_PIXEL_CENTRE = 0.5  # foxglove.ImageAnnotations: origin on the corner of the top-left pixel


def _plain(value: Any) -> Any:
    """JSON form of NumPy scalars and arrays."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"cannot write {type(value).__name__} as JSON")


#: A NaN or an infinity becomes null, as JSON has neither.
to_json = msgspec.json.Encoder(enc_hook=_plain).encode
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
    cloud = proto("PointCloud")(
        timestamp=stamp(log_ns),
        frame_id="image",
        pose=pose,
        point_stride=dtype.itemsize,
        fields=fields,
        data=packed.tobytes(),
    )
    return bytes(cloud.SerializeToString())


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


def pins_overlay(tracks: Tracks, log_ns: int) -> bytes:
    dots = _style("POINTS", (1.0, 0.8, 0.0, 1.0), 3.0, log_ns)
    visible = tracks.xy_img[np.isfinite(tracks.xy_img).all(axis=1)]
    return _annotations([dots + _points(visible).tobytes()])


def cells_overlay(cells: Cells, features: Features, log_ns: int) -> bytes:
    """The cells' outlines on the image, shaded by their area change."""
    outline = _style("LINE_LOOP", (0.35, 0.35, 0.35, 0.8), 1.0, log_ns)
    polygons = cell_polygons(cells)
    chosen = [i for i, p in enumerate(polygons) if len(p) >= 3 and np.isfinite(p).all()]
    shapes = []
    if chosen:
        ends = np.cumsum([len(polygons[i]) for i in chosen]).tolist()
        corners = _points(np.concatenate([polygons[i] for i in chosen]))
        fills = _doubles(cell_rgba(features.area_change)[chosen], _FILL_COLOR)
        for begin, end, fill in zip([0, *ends], ends, fills, strict=False):
            shapes.append(outline + corners[begin:end].tobytes() + fill.tobytes())
    return _annotations(shapes)


def _style(kind: str, rgba: Sequence[float], thickness: float, log_ns: int) -> bytes:
    """A `PointsAnnotation` but for its points and what fills them."""
    annotation, colour = proto("PointsAnnotation"), proto("Color")(**dict(zip("rgba", rgba, strict=True)))
    shape = annotation(timestamp=stamp(log_ns), type=kind, outline_color=colour, thickness=thickness)
    return bytes(shape.SerializeToString())


def _annotations(shapes: Sequence[bytes]) -> bytes:
    return b"".join(_POINTS_FIELD + _varint(len(shape)) + shape for shape in shapes)


#: Field tags of the schemas on the wire: number << 3 | 2 for length-delimited fields. NumPy writes the
#: thousands of small messages of a picture; made one by one they cost 5 ms. Parts of a message may follow one
#: another in any order, and repeated ones are merged (protobuf, "Encoding").
_POINTS_FIELD = b"\x12"  # foxglove.ImageAnnotations.points
_POINT = 0x1A  # foxglove.PointsAnnotation.points
_FILL_COLOR = 0x32  # foxglove.PointsAnnotation.fill_color


def _points(xy_img: Array) -> NDArray[np.uint8]:
    """(n, 20) bytes: the points of an annotation, in Foxglove's pixels."""
    return _doubles(xy_img + _PIXEL_CENTRE, _POINT)


def _doubles(values: Array, field: int) -> NDArray[np.uint8]:
    """(n, 2 + 9 k) bytes of messages of k < 14 doubles (n, k), numbered from 1, as a field: one a row."""
    n, k = values.shape
    rows = np.empty((n, 2 + 9 * k), np.uint8)
    rows[:, 0], rows[:, 1] = field, 9 * k
    each = rows[:, 2:].reshape(n, k, 9)
    each[:, :, 0] = np.arange(1, k + 1) << 3 | 1
    each[:, :, 1:] = np.ascontiguousarray(values, "<f8").view(np.uint8).reshape(n, k, 8)
    return rows


def _varint(number: int) -> bytes:
    data = bytearray()
    while number > 0x7F:
        data.append(number & 0x7F | 0x80)
        number >>= 7
    data.append(number)
    return bytes(data)


#: Fields of `Features` that are numbers.
_SCALARS = [f.name for f in fields(Features) if f.type == "float | None"]


def features_json(frame: Frame, features: Features) -> dict[str, Any]:
    """The scalars and the contacts; null where not demanded."""
    shear = features.shear_px
    return {
        "sequence": frame.sequence,
        "touched": bool(features.in_contact),
        "shear_x_px": None if shear is None else float(shear[0]),
        "shear_y_px": None if shear is None else float(shear[1]),
        **{name: getattr(features, name) for name in _SCALARS},
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
    message = proto("Log")(timestamp=stamp(log_ns), level=number, message=text, name=name)
    return bytes(message.SerializeToString())
