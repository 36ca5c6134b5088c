"""The contents of a recording: one table of topics, and their schemas.

Foxglove's schemas (protobuf, imported with the first message) wherever one fits; JSON for other numbers,
because PlotJuggler plots those directly.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any

import msgspec

from edge.errors import SourceError
from hostlink.topics import DIAGNOSTICS, SAMPLE, finger_name


@dataclass(frozen=True, slots=True)
class Topic:
    name: str  # topic in the file
    schema: str  # name of the schema; "foxglove." ones are protobuf, the rest JSON
    content: Mapping[str, Any] = field(default_factory=dict)  # JSON schema, for JSON; other fields may follow


def _json(name: str, title: str, *fields: tuple[str, str, str]) -> Topic:
    """A topic of JSON messages; fields: (name, JSON type, meaning)."""
    properties = {name: {"type": kind, "description": text} for name, kind, text in fields}
    return Topic(name, title, {"title": title, "type": "object", "properties": properties})


_SEQUENCE = ("sequence", "integer", "the camera's own counter")

TOPICS: dict[str, Topic] = {
    "image": Topic("/camera/image", "foxglove.RawImage"),
    "image_png": Topic("/camera/image", "foxglove.CompressedImage"),
    "frame": _json(
        "/camera/frame",
        "voronoi_touch.Frame",
        _SEQUENCE,
        ("capture_ns", "integer", "start of exposure, ns, on `clock`"),
        ("clock", "string", "device, driver, host or recorded"),
        ("bits", "integer", "bits of a pixel that count"),
    ),
    "truth": _json(
        "/camera/truth", "voronoi_touch.Truth", _SEQUENCE, ("truth", "object", "what the rig knows")
    ),
    "pins": Topic("/pins", "foxglove.PointCloud"),
    "pins_overlay": Topic("/pins/overlay", "foxglove.ImageAnnotations"),
    "cells": Topic("/cells", "foxglove.PointCloud"),
    "cells_overlay": Topic("/cells/overlay", "foxglove.ImageAnnotations"),
    "features": _json(
        "/features",
        "voronoi_touch.Features",
        _SEQUENCE,
        ("touched", "boolean", "anything above the noise"),
        ("shear_x_px", "number", "mean motion of the pins, x right, px"),
        ("shear_y_px", "number", "mean motion of the pins, y down, px"),
        ("volume_px2", "number", "compressed part of the surface's integral, px2"),
        ("torsion_rad", "number", "rotation about the contact, rad"),
        ("slip_px", "number", "motion that the load does not explain, px"),
        ("slip_probability", "number", "0..1"),
        ("twist_slip_probability", "number", "0..1"),
        ("contacts", "array", "x_px, y_px, peak, area_px2, orientation_rad, elongation; strongest first"),
    ),
    "reading": _json(
        "/reading",
        "voronoi_touch.Reading",
        _SEQUENCE,
        ("values", "object", "calibrated values by name of the wire's field; unit in the name"),
        ("sigmas", "object", "one-sigma error of each value, in its unit"),
        ("contacts", "array", "x_mm, y_mm, depth_mm in the tip's frame; strongest first"),
        ("saturated", "array", "names of values outside of the calibrated range"),
        ("calibrated", "boolean", "a calibration of this tip was applied"),
    ),
    "diagnostics": Topic("/diagnostics", DIAGNOSTICS["title"], DIAGNOSTICS),
    "tf": Topic("/tf", "foxglove.FrameTransforms"),
    "events": Topic("/events", "foxglove.Log"),
}


def sample_topic(finger: int) -> Topic:
    """The topic of what was sent to the bus; `hostlink.topics` has it, and the next."""
    return Topic(f"/{finger_name(finger)}/sample", SAMPLE["title"], SAMPLE)


def contacts_topic(finger: int) -> Topic:
    return Topic(f"/{finger_name(finger)}/contacts", "foxglove.SceneUpdate")


class FoxgloveMessages:
    """Foxglove's messages as `hostlink.topics` makes them: classes by name, times as (s, ns)."""

    def __getattr__(self, name: str) -> Any:
        if name in ("Timestamp", "Duration"):
            return _time(name)
        return proto(name)


@cache
def _time(name: str) -> Callable[[int, int], Any]:
    module = import_module(f"google.protobuf.{name.lower()}_pb2")

    def made(sec: int, nsec: int) -> Any:
        return getattr(module, name)(seconds=sec, nanos=nsec)

    return made


@cache
def proto(name: str) -> Any:
    """Class of a Foxglove message, e.g. `proto("RawImage")`. Raises SourceError where it is not installed."""
    try:
        module = import_module(f"foxglove_schemas_protobuf.{name}_pb2")
    except ImportError as error:
        raise SourceError(f"recording: {error}; install voronoi-touch[edge] or -e .[edge]") from error
    return getattr(module, name)


def schema_of(topic: Topic) -> tuple[str, str, bytes]:
    """(message encoding, schema encoding, schema) with the names of MCAP's registry."""
    if not topic.schema.startswith("foxglove."):
        return "json", "jsonschema", msgspec.json.encode(topic.content)
    from mcap_protobuf.schema import build_file_descriptor_set

    message = proto(topic.schema.removeprefix("foxglove."))
    return "protobuf", "protobuf", build_file_descriptor_set(message).SerializeToString()


def stamp(ns: int) -> Any:
    return _time("Timestamp")(*divmod(ns, 1_000_000_000))
