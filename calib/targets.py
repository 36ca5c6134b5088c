"""A table of frames with known truth: one row a frame, one column a quantity.

    sensor_image,pose_z,pose_Rx,pose_Ry,shear_x,shear_y,shear_Rz
    image_3.png,2.556,-3.708,-1.833,-0.517,-2.919,0.566

`sensor_image` names the frame; every other column is optional; values without a column are not fitted.

The table of a capture (`calib.capture`) can be read too. It has the rig's whole pose in every row, whether
meaningful or not, so some of its truth is dropped (NaN):
- nothing touches (depth 0): no tilt, no place of contact;
- a curved tool has a place and no tilt, a flat one a tilt and no fixed place;
- two probes at once are for detection, not for fitting depth or shear of one.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.errors import TableError
from calib.table import number, read_table, renamed, shown
from edge.types import Array

#: Column -> calibrated value, and the column's unit: a capture's table has these too.
_POSES: dict[str, tuple[str, str]] = {
    "pose_z": ("displacement_mm", "mm"),
    "pose_Rx": ("tilt_x_deg", "deg"),
    "pose_Ry": ("tilt_y_deg", "deg"),
    "shear_x": ("shear_x_mm", "mm"),
    "shear_y": ("shear_y_mm", "mm"),
    "shear_Rz": ("torsion_deg", "deg"),
}
COLUMNS = _POSES | {
    "force_z": ("force_n", "N"),
    "force_x": ("force_x_n", "N"),
    "force_y": ("force_y_n", "N"),
    "torque_z": ("torque_z_nmm", "Nmm"),
    "area": ("contact_area_mm2", "mm2"),
    "contact_x": ("contact_x_mm", "mm"),
    "contact_y": ("contact_y_mm", "mm"),
    "contact_depth": ("contact_depth_mm", "mm"),
}
_IMAGE = "sensor_image"
#: Largest plausible truth by unit, of a fingertip; a depth that never exceeds the smallest is not in mm.
MOST = {"mm": 100.0, "deg": 180.0, "N": 1000.0, "Nmm": 1e4, "mm2": 1e4}
LEAST_DEPTH_MM = 0.05
#: Columns that an arm may give as its position, and how far an arm reaches.
_DEPTHS = {"pose_z", "contact_depth"}
_MOST_REACH_MM = 1e4
#: A capture's table has these columns; `pose_z` is the contact's depth too, as it is the tool's.
_OF_CAPTURE = {column: name for column, (name, _) in _POSES.items()} | {
    "force_n": "force_n",
    "force_x_n": "force_x_n",
    "force_y_n": "force_y_n",
    "torque_z_nmm": "torque_z_nmm",
    "area_mm2": "contact_area_mm2",
    "place_x": "contact_x_mm",
    "place_y": "contact_y_mm",
}
#: What a capture's table, gauges and other people's tables call these columns, in small letters -> our name.
KNOWN_AS: dict[str, str] = {
    theirs: ours
    for ours, names in {
        _IMAGE: "image frame file filename picture",
        "pose_z": "depth depth_mm displacement_mm",
        "force_z": "fz force force_n",
        "force_x": "fx force_x_n",
        "force_y": "fy force_y_n",
        "torque_z": "tz mz torque_z_nmm",
        "area": "area_mm2",
        "contact_x": "place_x",
        "contact_y": "place_y",
    }.items()
    for theirs in names.split()
}


@dataclass(frozen=True, slots=True)
class Targets:
    """Frames and their truth.

    where   the file, for messages
    frames  (n,) path of each frame
    values  calibrated value's name -> (n,) float64 in its unit; NaN where not known
    sha256  of the table's bytes
    unread  columns of the table with unknown names
    """

    where: str
    frames: tuple[Path, ...]
    values: dict[str, Array]
    sha256: str
    unread: tuple[str, ...] = ()

    @property
    def poses(self) -> Array:
        """(n, values) float64; frames of one pose have equal rows."""
        return np.nan_to_num(np.column_stack(list(self.values.values())), nan=1e9)

    def __len__(self) -> int:
        return len(self.frames)

    def rows(self, chosen: NDArray[np.integer[Any]] | Sequence[int]) -> Targets:
        """Some of the rows, by index."""
        frames = tuple(self.frames[i] for i in chosen)
        return replace(self, frames=frames, values={k: v[np.asarray(chosen)] for k, v in self.values.items()})


def read_targets(table: Path, folder: Path) -> Targets:
    """Read a table; every frame must be in `folder`.

    Raises  TableError: one message with file, line and column
    """
    content = read_table(table, [_IMAGE], COLUMNS, KNOWN_AS)
    if not os.path.isdir(folder):
        raise TableError(f"{folder}: no such folder of frames")
    known = [name for name in content.names if name in COLUMNS]
    if not known:
        advice = renamed(content.names, KNOWN_AS)
        raise TableError(
            f"{table}: none of the columns {', '.join(COLUMNS)}; nothing could be fitted{advice}"
        )
    frames: list[Path] = []
    seen: dict[str, int] = {}
    columns: dict[str, list[float]] = {name: [] for name in known}
    for row in content.rows:
        at, image = f"{table}: line {row.line}", row.cells[_IMAGE]
        once = os.path.normpath(image)
        if once in seen:
            raise TableError(f"{at}: {shown(image)} is in line {seen[once]} already")
        seen[once] = row.line
        if not os.path.isfile(folder / image):  # `Path.is_file` raises where the name is too long
            raise TableError(f"{at}: no frame {shown(image) or '(empty)'} in {folder}")
        frames.append(folder / image)
        for name in known:
            columns[name].append(_possible(row.cells[name], f"{at}, column {name}", name))
    if not frames:
        raise TableError(f"{table}: no rows")
    values = {COLUMNS[name][0]: np.array(column) for name, column in columns.items()}
    _check_depths(table, columns)
    unknown = tuple(shown(name) or "(no heading)" for name in content.names if name not in (*COLUMNS, _IMAGE))
    digest = hashlib.sha256(content.raw).hexdigest()
    return Targets(str(table), tuple(frames), values, digest, unknown)


def _possible(text: str, where: str, name: str) -> float:
    """A number that a fingertip, or for a depth the arm that presses it, can give."""
    value, unit = number(text, where), COLUMNS[name][1]
    if abs(value) > (_MOST_REACH_MM if name in _DEPTHS else MOST[unit]):
        raise TableError(f"{where}: {value:g} {unit} is not possible; the column's unit is {unit}")
    return value


def _check_depths(table: Path, columns: Mapping[str, list[float]]) -> None:
    """Depths may be positions of the arm, from wherever it counts; their differences are a fingertip's."""
    for name in _DEPTHS & columns.keys():
        span = float(np.ptp(columns[name]))
        if span > MOST["mm"]:
            raise TableError(
                f"{table}: column {name} spans {span:g} mm; that is not possible, its unit is mm"
            )
    if "pose_z" in columns and max(map(abs, columns["pose_z"])) < LEAST_DEPTH_MM:
        raise TableError(f"{table}: column pose_z never exceeds {LEAST_DEPTH_MM} mm; its unit is mm")


def targets_of_capture(where: str, rows: Sequence[Mapping[str, str]]) -> Targets:
    """Truth of some rows of a capture's table; frames are named `recording#sequence`.

    Raises  TableError: a cell that is no number
    """
    nan = float("nan")
    columns: dict[str, list[float]] = {name: [] for name in (*_OF_CAPTURE.values(), "contact_depth_mm")}
    for row in rows:
        at = f"{where}: {row['recording']}#{row['sequence']}"
        cells = {
            name: number(row[column], f"{at}, column {column}") if row.get(column) else nan
            for column, name in _OF_CAPTURE.items()
        }
        tool, depth = row.get("tool", "flat"), cells["displacement_mm"]
        curved = tool == "sphere"
        if tool == "sphere" and not row.get("place_x"):  # on a real rig this is the commanded place
            cells["contact_x_mm"] = number(row["pose_x"], f"{at}, column pose_x")
            cells["contact_y_mm"] = number(row["pose_y"], f"{at}, column pose_y")
        if depth <= 0 or curved:
            cells["tilt_x_deg"] = cells["tilt_y_deg"] = nan
        if depth <= 0 or not curved:
            cells["contact_x_mm"] = cells["contact_y_mm"] = nan
        cells["contact_depth_mm"] = depth if depth > 0 and curved else nan
        if tool == "two":
            cells = dict.fromkeys(cells, nan)
        for name, value in cells.items():
            columns[name].append(value)
    values = {name: np.array(column) for name, column in columns.items()}
    known = {name: column for name, column in values.items() if np.isfinite(column).any()}
    frames = tuple(Path(f"{row['recording']}#{row['sequence']}") for row in rows)
    digest = hashlib.sha256(repr([sorted(row.items()) for row in rows]).encode()).hexdigest()
    return Targets(where, frames, known, digest)


def join(parts: Sequence[Targets]) -> Targets:
    """Several tables as one; values missing in one of them are NaN there."""
    if len(parts) == 1:
        return parts[0]
    names = list(dict.fromkeys(name for part in parts for name in part.values))
    values = {
        name: np.concatenate([p.values.get(name, np.full(len(p), np.nan)) for p in parts]) for name in names
    }
    digest = hashlib.sha256("".join(p.sha256 for p in parts).encode()).hexdigest()
    frames = tuple(frame for part in parts for frame in part.frames)
    return Targets(", ".join(p.where for p in parts), frames, values, digest)
