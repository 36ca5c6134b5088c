"""A small valid calibration file as plain data, to use and to damage."""

import copy
import math
from typing import Any

import msgspec
import numpy as np

from edge.calibration import Calibration
from edge.types import ContactRegion, Features, PinPattern
from tests.support import layouts

PATTERN = PinPattern(4.0, 20.0, np.array([320.0, 240.0]), 46.0, 10.0, 180.0, 2.0, (640, 480))
#: Nineteen pins in a hexagon.
PINS: list[list[float]] = layouts.hexagonal(2, 20.0).round(3).tolist()
_CONTENT: dict[str, Any] = {
    "format": "voronoi-touch-calibration",
    "version": 1,
    "sensor": {
        "serial": "A1", "size_px": [640, 480], "pin_radius_px": 4.0, "pitch_px": 20.0,
        "centre_px": [320.0, 240.0], "tip_radius_px": 46.0, "background": 10.0, "brightness": 180.0,
        "noise": 2.0, "rest_xy_px": PINS,
    },
    "mm_per_px": 0.1,
    "models": [
        {
            "type": "curve", "output": "displacement_mm", "input": "volume",
            "knots": [[0.0, 0.0], [0.1, 2.0], [0.4, 5.0]], "sigma": 0.02,
        },
        {
            "type": "moments", "outputs": ["shear_x_mm", "shear_y_mm"],
            "terms": [[], ["shear"], ["shear*", "volume"]],
            "weights": [[0.1, 0.0], [50.0, 0.0], [0.0, 3.0]],
            "valid": [[-2.0, 2.0], [-2.0, 2.0]], "sigma": [0.03, 0.04],
            "spread": [[[0.0, 0.0], [30.0, 0.0], [0.0, 0.0]]],
        },
    ],
    "data": {"source": "test", "sha256": "", "n_frames": 0, "created": "2026-01-01"},
}  # fmt: skip


def calibration_content() -> dict[str, Any]:
    """The file as JSON data; a new copy."""
    return copy.deepcopy(_CONTENT)


def damaged(*path: str | int, value: Any) -> dict[str, Any]:
    """The file with one value replaced, or one added."""
    table = calibration_content()
    place: Any = table
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return table


def parsed(table: dict[str, Any]) -> Calibration:
    """The file decoded by the program. Raises CalibrationError."""
    return Calibration.parse(msgspec.json.encode(table), "cal.json")


def touched_features(
    volume: float, shear_px: tuple[float, float], contacts: tuple[ContactRegion, ...] = ()
) -> Features:
    """A frame that is touched. volume: share of the area of the tip's circle."""
    return Features(
        area_change=np.zeros(len(PINS)),
        displacement_px=np.zeros((len(PINS), 2)),
        in_contact=True,
        shear_px=np.array(shear_px),
        volume_px2=volume * math.pi * PATTERN.tip_radius_px**2,
        contacts=contacts,
    )
