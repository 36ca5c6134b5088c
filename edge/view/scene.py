"""One frame as the page draws it: a short header, and raw arrays, which are only cast and copied here.

Places are px of the camera's image, pixel centres on integers, at any size of the transmitted picture.
"""

from math import degrees
from typing import Any

import cv2
import numpy as np

from edge.cells import cell_polygons
from edge.types import Array, Frame, Image, Rest, Result
from edge.view.palette import COLOUR_STEPS, PALETTES, PARAMS, Palette, cell_colours, cell_rgba
from hostlink.wire import FIELDS
from hostlink.wire.shown import live_charts, live_fields, page_numbers

Arrays = dict[str, tuple[str, bytes]]
#: Fields of every sample that the page's charts show as they are sent, and all that they show, in this order.
CHARTED = live_fields(FIELDS)
CHART = ("time_s", *CHARTED, "latency_ms", "volume_px2", "shear_x_px", "shear_y_px")


def hello(source: str, serial: str) -> dict[str, Any]:
    return {
        "source": source,
        "serial": serial,
        "chart": CHART,
        "charts": live_charts(FIELDS),
        "numbers": page_numbers(FIELDS),
        "palettes": {name: _colours(palette) for name, palette in PALETTES.items()},
        "full_change": PARAMS.full_change,
        "local_gain": PARAMS.local_gain,
        "global_gain": PARAMS.global_gain,
    }


def _colours(palette: Palette) -> dict[str, Any]:
    """By name, red first; "cells" from fully expanded to fully compressed."""
    named = {name: list(getattr(palette, name)[::-1]) for name in Palette.__dataclass_fields__}
    steps = cell_colours(np.linspace(-PARAMS.full_change, PARAMS.full_change, 2 * COLOUR_STEPS + 1), palette)
    return {**named, "cells": steps[:, ::-1].tolist()}


def camera(frame: Frame) -> tuple[dict[str, Any], Arrays]:
    """The image, no larger than a panel."""
    image = frame.image
    grey: Image = image if image.dtype == np.uint8 else (image >> max(0, frame.bits - 8)).astype(np.uint8)
    height, width = image.shape
    step = -(-max(height, width) // PARAMS.side_max_px)
    if step > 1:
        small = cv2.resize(grey, (width // step, height // step), interpolation=cv2.INTER_AREA)
        grey = np.asarray(small, np.uint8)
    _, data = cv2.imencode(".jpg", grey, (cv2.IMWRITE_JPEG_QUALITY, PARAMS.jpeg_quality))
    header = {
        "capture_us": frame.capture_ns // 1000,
        "size_px": [width, height],
        "image_px": [grey.shape[1], grey.shape[0]],
    }
    return header, {"image": ("jpeg", data.tobytes())}


def touch(result: Result, rest: Rest, wants: frozenset[str]) -> tuple[dict[str, Any], Arrays]:
    """Pins, cells, contacts and vectors of a frame; if wanted also surface and cells' corners in colour."""
    tracks, cells, features = result.tracks, result.cells, result.features
    low, high = rest.xy_img.min(axis=0), rest.xy_img.max(axis=0)
    side = float((high - low).max()) + 4 * rest.pattern.pitch_px  # space for the outer cells, and for motion
    header: dict[str, Any] = {
        "sequence": result.frame.sequence,
        "pins_n": len(rest),
        "held_n": tracks.n_seen,
        "sure": features is not None,
        "square": [*((low + high) / 2 - side / 2).tolist(), side],
        "centre": rest.xy_img.mean(axis=0).tolist(),
    }
    arrays: Arrays = {"pins": _f4(tracks.xy_img)}
    if features is not None:
        header["touched"] = features.in_contact
        arrays["motion"] = _f4(features.displacement_px)
        if features.shear_px is not None:
            header["shear_px"] = features.shear_px.tolist()
        header["contacts"] = [
            {
                "xy": contact.xy_img.tolist(),
                "peak": contact.peak,
                "angle_deg": degrees(contact.orientation_rad),
                "elongation": contact.elongation,
            }
            for contact in features.contacts or ()
        ]
        if "surface" in wants and features.surface is not None and features.grid_img is not None:
            x, y = features.grid_img
            header["grid"] = [float(x[0]), float(y[0]), float(x[1] - x[0]), len(x)]
            arrays["surface"] = _f4(features.surface)
    if cells is not None and cells.triangles is not None and features is not None:
        arrays["change"] = _f4(features.area_change)
        arrays["points"] = _f4(np.concatenate([cells.xy_img, cells.boundary_img]))
        arrays["triangles"] = ("u2", cells.triangles.astype("<u2").tobytes())
        if "cells" in wants:
            polygons = cell_polygons(cells)
            arrays["corners_n"] = ("u2", np.array([len(p) for p in polygons], "<u2").tobytes())
            arrays["corners"] = _f4(np.concatenate(polygons))
            arrays["rgba"] = _f4(cell_rgba(features.area_change))
    return header, arrays


def _f4(values: Array) -> tuple[str, bytes]:
    return "f4", values.astype("<f4").tobytes()
