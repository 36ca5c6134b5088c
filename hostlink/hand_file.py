"""A hand as one file: which fingers it has, what they are called, and where they are mounted.

    name = "left_hand"                  # before all names in ROS; without it there is nothing before them
    left = true                         # the thumb is on the right, where the page shows it as a hand

    [[finger]]                          # from the thumb on
    name = "thumb"
    node = 1
    place_mm = [-40.0, 20.0, 0.0]       # of the tip's origin
    turn_deg = [0.0, 0.0, 30.0]         # roll, pitch, yaw about the parent's axes, in this order, as in URDF
    parent = "thumb_distal"             # frame that it is mounted on; without it the hand's, `hand`
    calibration = "3f9a0c..."           # what the finger should use; bridges warn where it uses another

Rules
- Only `name` and `node` of a finger are needed; tips without a place stand side by side.
- A finger that is not in the file is `finger_N`, so that nothing needs a file.
- Names serve ROS, DBC and C alike: letters, digits and single underscores.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import cos, isfinite, radians, sin
from pathlib import Path
from typing import Any, Final, NamedTuple

from hostlink.errors import UsageError
from hostlink.input_file import UPLOAD_BYTES, read_bounded
from hostlink.topics import SPACING_M, TipPlace, finger_name
from hostlink.wire.canid import NODES_MAX

__all__ = ["NAME_MAX", "HandFile", "Mount", "frame_in", "read_hand"]

NAME_MAX: Final = 20  # characters: with the name of a message behind it, fewer than DBC's 32
_MM: Final = 1e-3

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Mount:
    """One finger of the file.

    place_m      origin of the tip's frame in the parent's
    turn_rad     roll, pitch, yaw of the tip's frame, about the parent's x, y and z in this order
    parent       frame it is mounted on; "": the hand's
    calibration  the id that the finger should report; "": any
    """

    name: str
    node: int
    place_m: Triple
    turn_rad: Triple = (0.0, 0.0, 0.0)
    parent: str = ""
    calibration: str = ""

    def frame(self, namespace: str = "") -> str:
        """Name of its frame, with the namespace: tf2 wants no slash in front."""
        return frame_in(namespace, self.name)

    def parent_frame(self, namespace: str = "") -> str:
        """The frame it is mounted on. One that the file names is the robot's own, and taken as it stands."""
        return self.parent or frame_in(namespace, "hand")

    def tip_place(self, namespace: str = "") -> TipPlace:
        """The same as transforms have it."""
        (cr, sr), (cp, sp), (cy, sy) = ((cos(angle / 2), sin(angle / 2)) for angle in self.turn_rad)
        rotation = (
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        )
        return TipPlace(self.frame(namespace), self.parent_frame(namespace), self.place_m, rotation)


def frame_in(namespace: str, name: str) -> str:
    """A frame of the hand's own."""
    return f"{namespace}/{name}".strip("/")


@dataclass(frozen=True)
class HandFile:
    """The fingers in the order of the file; without a file none, and each is called by its number.

    name  of the hand; "": none
    left  a left hand
    """

    name: str = ""
    left: bool = False
    mounts: tuple[Mount, ...] = ()

    @property
    def namespace(self) -> str:
        """Before all names in ROS: "/left_hand"; "": nothing."""
        return f"/{self.name}" if self.name else ""

    @cached_property
    def _by_node(self) -> dict[int, Mount]:
        return {mount.node: mount for mount in self.mounts}

    def mount(self, node: int) -> Mount:
        """The finger with this number, in the file or not."""
        return self._by_node.get(node) or Mount(finger_name(node), node, ((node - 1) * SPACING_M, 0.0, 0.0))

    def node(self, name: str) -> int:
        """Its number. Raises UsageError: the file has no such finger."""
        for mount in self.mounts:
            if mount.name == name:
                return mount.node
        known = ", ".join(mount.name for mount in self.mounts) or "none: give a hand file, or numbers"
        raise UsageError(f"no finger {name!r}; known by name: {known}")


class _KeyRule(NamedTuple):
    """The values that a key takes: as a sentence, and as a test."""

    what: str
    fits: Callable[[Any], bool]


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", value) is not None


def _is_triple(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(_is_number(v) for v in value)


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and isfinite(value)


_NAME: Final = _KeyRule(
    f"a name of at most {NAME_MAX} letters, digits and single underscores that begins with a letter",
    lambda v: _is_name(v) and len(v) <= NAME_MAX,
)
_TRIPLE: Final = _KeyRule("three numbers", _is_triple)
_TABLES: Final = _KeyRule(
    "[[finger]] tables, at least one",
    lambda v: isinstance(v, list) and len(v) > 0 and all(isinstance(row, dict) for row in v),
)
_HAND: Final = {
    "name": _NAME,
    "left": _KeyRule("true or false", lambda v: isinstance(v, bool)),
    "finger": _TABLES,
}
_FINGER: Final = {
    "name": _NAME,
    "node": _KeyRule(f"a number from 1 to {NODES_MAX}", lambda v: type(v) is int and 1 <= v <= NODES_MAX),
    "place_mm": _TRIPLE,
    "turn_deg": _TRIPLE,
    "parent": _KeyRule("the name of a frame", lambda v: isinstance(v, str) and v.strip() == v != ""),
    "calibration": _KeyRule("a text, as `info` shows it", lambda v: isinstance(v, str)),
}


def _check(where: str, table: Mapping[str, Any], rules: Mapping[str, _KeyRule], *needed: str) -> None:
    for key, value in table.items():
        if key not in rules:
            raise UsageError(f"{where}: no key {key!r:.40}; known: {', '.join(rules)}")
        if not rules[key].fits(value):
            raise UsageError(f"{where}: {key} = {value!r:.40}: give {rules[key].what}")
    for key in needed:
        if key not in table:
            raise UsageError(f"{where}: {key} is missing: give {rules[key].what}")


def read_hand(path: str | Path) -> HandFile:
    """Raises UsageError, one line: it cannot be read, or a key is wrong."""
    try:
        table = tomllib.loads(read_bounded(path, UPLOAD_BYTES).decode())
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise UsageError(f"{path}: not TOML: byte {error.start} is not UTF-8 text") from None
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{path}: not TOML: {' '.join(str(error).split())}") from None
    _check(str(path), table, _HAND, "finger")
    mounts = []
    for i, row in enumerate(table["finger"]):
        _check(f"{path}: finger {i + 1}", row, _FINGER, "name", "node")
        mounts.append(_mount(i, row))
    for what in ("name", "node"):
        values = [getattr(mount, what) for mount in mounts]
        twice = [value for value in values if values.count(value) > 1]
        if twice:
            raise UsageError(f"{path}: {what} {twice[0]} is given twice; give each finger its own")
    return HandFile(table.get("name", ""), table.get("left", False), tuple(mounts))


def _mount(i: int, row: Mapping[str, Any]) -> Mount:
    x, y, z = row.get("place_mm", (i * SPACING_M / _MM, 0.0, 0.0))
    roll, pitch, yaw = map(radians, row.get("turn_deg", (0.0, 0.0, 0.0)))
    return Mount(
        name=row["name"],
        node=row["node"],
        place_m=(x * _MM, y * _MM, z * _MM),
        turn_rad=(roll, pitch, yaw),
        parent=row.get("parent", ""),
        calibration=row.get("calibration", ""),
    )
