"""A table of frames with known truth: one row a frame, one column a quantity.

    sensor_image,pose_z,pose_Rx,pose_Ry,shear_x,shear_y,shear_Rz
    image_3.png,2.556,-3.708,-1.833,-0.517,-2.919,0.566

`sensor_image` names the frame; every other column is optional, and what has no column is not fitted.
"""

from __future__ import annotations

import csv
import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.errors import TableError
from edge.types import Array

__all__ = ["COLUMNS", "Targets", "read_targets"]

#: Column of the table -> calibrated value, and the column's unit.
COLUMNS: dict[str, tuple[str, str]] = {
    "pose_z": ("displacement_mm", "mm"),
    "pose_Rx": ("tilt_x_deg", "deg"),
    "pose_Ry": ("tilt_y_deg", "deg"),
    "shear_x": ("shear_x_mm", "mm"),
    "shear_y": ("shear_y_mm", "mm"),
    "shear_Rz": ("torsion_deg", "deg"),
    "force_z": ("force_n", "N"),
    "contact_x": ("contact_x_mm", "mm"),
    "contact_y": ("contact_y_mm", "mm"),
    "contact_depth": ("contact_depth_mm", "mm"),
}
_IMAGE = "sensor_image"


@dataclass(frozen=True, slots=True)
class Targets:
    """Frames and their truth.

    where   the file, for messages
    frames  (n,) path of each frame
    values  calibrated value's name -> (n,) float64 in its unit
    sha256  of the table's bytes
    """

    where: str
    frames: tuple[Path, ...]
    values: dict[str, Array]
    sha256: str

    def __len__(self) -> int:
        return len(self.frames)

    def rows(self, chosen: Array) -> Targets:
        """Some of the rows, by index."""
        frames = tuple(self.frames[i] for i in chosen)
        return Targets(self.where, frames, {k: v[chosen] for k, v in self.values.items()}, self.sha256)


def read_targets(table: str | Path, folder: str | Path) -> Targets:
    """Read a table; every frame must be in `folder`.

    Raises  TableError: one line with file, row and column
    """
    table, folder = Path(table), Path(folder)
    try:
        raw = table.read_bytes()
        lines = raw.decode("utf-8-sig").splitlines()
    except OSError as error:
        raise TableError(f"{table}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise TableError(f"{table}: not a text file; a CSV table with a column {_IMAGE} is needed") from None
    if not folder.is_dir():
        raise TableError(f"{folder}: no such folder of frames")
    reader = csv.DictReader(lines)
    names = reader.fieldnames or []
    if _IMAGE not in names:
        raise TableError(f"{table}: no column {_IMAGE}; it names each row's frame")
    known = [name for name in names if name in COLUMNS]
    if not known:
        raise TableError(f"{table}: none of the columns {', '.join(COLUMNS)}; nothing could be fitted")
    frames: list[Path] = []
    columns: dict[str, list[float]] = {name: [] for name in known}
    seen: dict[str, int] = {}
    for row in reader:
        at = f"{table}: row {reader.line_num}"
        image = row[_IMAGE] or ""
        if image in seen:
            raise TableError(f"{at}: {image} stands in row {seen[image]} already")
        seen[image] = reader.line_num
        path = folder / image
        if not path.is_file():
            raise TableError(f"{at}: no frame {image or '(empty)'} in {folder}")
        frames.append(path)
        for name in known:
            columns[name].append(_number(row[name], f"{at}, column {name}"))
    if not frames:
        raise TableError(f"{table}: no rows")
    values = {COLUMNS[name][0]: np.array(column) for name, column in columns.items()}
    return Targets(str(table), tuple(frames), values, hashlib.sha256(raw).hexdigest())


def _number(text: str | None, where: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        raise TableError(f"{where}: '{text or ''}' is not a number") from None
    if not np.isfinite(value):
        raise TableError(f"{where}: {text} is not a finite number")
    return value
