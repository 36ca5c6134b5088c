"""What all outlets share: stamps on the host's wall clock, diagnoses, tare."""

from __future__ import annotations

import time
from math import isfinite

from hostlink.commands.monitor import FingerRow
from hostlink.errors import LinkError
from hostlink.events import Sample
from hostlink.finger import Finger
from hostlink.topics import Diagnosis, Level, finger_name, level_of

__all__ = ["diagnose", "stamp_ns", "tare"]


def stamp_ns(sample: Sample) -> int:
    """Capture time, ns since 1970 on the host's clock; the present if it is not known."""
    age_s = sample.age_s
    return time.time_ns() - (round(age_s * 1e9) if isfinite(age_s) else 0)


def diagnose(row: FingerRow, finger: Finger, serial_number: str) -> Diagnosis:
    """State of a finger from the status bits, the faults and the link."""
    if row.state is None:
        level, message = Level.STALE, row.problem or "no samples"
    else:
        level, message = level_of(row.state.status, row.problem), row.problem or "measures"
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
    return True, f"rest frame in use{f': {outcome.message}' if outcome.message else ''}"
