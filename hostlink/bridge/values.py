"""A sample in the form of other programs: stamps on the host's wall clock, diagnoses, JSON."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import IntEnum
from math import isfinite
from typing import Any

from hostlink.commands.monitor import FingerRow
from hostlink.errors import LinkError
from hostlink.events import Sample
from hostlink.finger import Finger
from hostlink.wire import NO_CONTROL, State, Status

__all__ = ["Diagnosis", "Level", "diagnose", "finger_name", "stamp_ns", "tare", "values_of"]

_DIGITS = 6  # finer than the smallest step of any field


class Level(IntEnum):
    """Levels of `diagnostic_msgs/DiagnosticStatus`."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """State of one finger; `values` are for a person, too."""

    name: str
    level: Level
    message: str
    serial_number: str
    values: Mapping[str, str]


def finger_name(node: int) -> str:
    """Name of a finger in topics, frames of reference, services and parameters."""
    return f"finger_{node}"


def stamp_ns(sample: Sample) -> int:
    """Capture time, ns since 1970 on the host's clock; the present if it is not known."""
    age_s = sample.age_s
    return time.time_ns() - (round(age_s * 1e9) if isfinite(age_s) else 0)


def values_of(state: State) -> dict[str, Any]:
    """The fields by name, as JSON types: an invalid value is None, status bits are names."""
    values: dict[str, Any] = {name: _plain(value) for name, value in asdict(state).items()}
    values["status"] = [bit.name for bit in Status if bit in state.status]
    return values


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, _DIGITS) if isfinite(value) else None
    if isinstance(value, dict):
        return {name: _plain(v) for name, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value


def diagnose(row: FingerRow, finger: Finger, serial_number: str) -> Diagnosis:
    """State of a finger from the status bits, the faults and the link."""
    if row.state is None:
        level, message = Level.STALE, row.problem or "no samples"
    elif row.state.status & NO_CONTROL:
        level, message = Level.ERROR, row.problem
    else:
        level, message = (Level.WARN, row.problem) if row.problem else (Level.OK, "measures")
    values = {
        "rate_hz": f"{row.rate_hz:.0f}",
        "age_ms": f"{row.age_s * 1e3:.1f}",
        "received": str(row.received_n),
        "lost": str(row.lost_n),
        "late": str(row.late_n),
        "damaged": str(row.corrupt_n),
        "faults": ", ".join(code.name for code in sorted(finger.faults)) or "none",
    }
    return Diagnosis(finger_name(row.finger), level, message, serial_number, values)


def tare(finger: Finger, force: bool = False) -> tuple[bool, str]:
    """Take a rest frame; returns whether it is in use now, and a message."""
    try:
        outcome = finger.tare(force)
    except LinkError as error:
        return False, str(error)
    return True, f"rest frame in use{f': {outcome.words}' if outcome.words else ''}"
