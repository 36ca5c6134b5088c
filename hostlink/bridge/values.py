"""The parts that all outlets share: stamps on the host's wall clock, diagnoses, tare requests, parameters."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from math import isfinite
from typing import Any, Final

from hostlink.commands.monitor import FingerRow
from hostlink.errors import LinkError
from hostlink.events import Sample
from hostlink.finger import Finger
from hostlink.topics import Diagnosis, Level, level_of

__all__ = ["PARAMETERS", "ParameterDesk", "TareDesk", "diagnose", "stamp_ns"]

#: Objects of WIRE.md, by name, that may be set while it runs.
PARAMETERS: Final = ("rate_hz", "divider", "features", "detail_divider")

REQUESTS_MAX = 4  # tare requests of one finger that are not answered yet
_BUSY = f"{REQUESTS_MAX} requests are not answered yet; ask again when they are"


def stamp_ns(sample: Sample) -> int:
    """Capture time, ns since 1970 on the host's clock; the present if it is not known."""
    age_s = sample.age_s
    return time.time_ns() - (round(age_s * 1e9) if isfinite(age_s) else 0)


def diagnose(row: FingerRow, finger: Finger, serial_number: str, calibration: str = "") -> Diagnosis:
    """State of a finger from the status bits, the faults and the link; and whether it uses the calibration
    that the hand's file wants. What it has not said is empty.
    """
    wanted = finger.mount.calibration
    other = (
        f"calibration {calibration}, not {wanted}" if calibration and wanted not in ("", calibration) else ""
    )
    problem = "; ".join(filter(None, (row.problem, other)))
    if row.state is None:
        level, message = Level.STALE, problem or "no samples"
    else:
        level, message = level_of(row.state.status, problem), problem or "measures"
    values = {
        "rate_hz": f"{row.rate_hz:.0f}",
        "age_ms": f"{row.age_s * 1e3:.1f}",
        "received": str(row.received_n),
        "lost": str(row.lost_n),
        "late": str(row.late_n),
        "damaged": str(row.corrupt_n),
        "faults": ", ".join(code.name for code in sorted(finger.faults)) or "none",
    }
    return Diagnosis(finger.name, level, message, serial_number, values)


class TareDesk:
    """Takes rest frames of a finger for whoever asks, one after the other, in a thread of its own. The others
    wait; requests beyond `REQUESTS_MAX` are refused at once.
    """

    def __init__(self, finger: Finger) -> None:
        self._finger = finger
        self._places = threading.BoundedSemaphore(REQUESTS_MAX)
        self._pool = ThreadPoolExecutor(1, f"tare {finger.node}")

    def ask(self) -> Future[tuple[bool, str]]:
        """A new rest frame; the answer says whether it is in use now, and a message."""
        if not self._places.acquire(blocking=False):
            refused: Future[tuple[bool, str]] = Future()
            refused.set_result((False, _BUSY))
            return refused
        answer = self._pool.submit(self._tare)
        answer.add_done_callback(lambda _: self._places.release())
        return answer

    def _tare(self) -> tuple[bool, str]:
        try:
            outcome = self._finger.tare()
        except LinkError as error:
            return False, str(error)
        return True, f"rest frame in use{f': {outcome.message}' if outcome.message else ''}"

    def close(self) -> None:
        """Requests that are not being served are left without an answer."""
        self._pool.shutdown(wait=False, cancel_futures=True)


class ParameterDesk:
    """Values that viewers and nodes read or set, by name as `finger_1.rate_hz`. Each access asks the finger.

    fingers  by name; may grow
    """

    def __init__(self, fingers: dict[str, Finger]) -> None:
        self._fingers = fingers
        self._asking = threading.Lock()

    def names(self) -> list[str]:
        """All there are now."""
        return [f"{finger}.{key}" for finger in list(self._fingers) for key in PARAMETERS]

    def read(self, names: Iterable[str]) -> dict[str, Any]:
        """Values by name, each asked for once; what is no parameter, or cannot be read, is left out."""
        values = {}
        with self._asking:
            for name in dict.fromkeys(names):
                finger, key = self._find(name)
                with suppress(LinkError):
                    if finger is not None:
                        values[name] = finger.get(key)
        return values

    def write(self, name: str, value: Any) -> str:
        """Why it was refused, in one line; empty: it holds now."""
        finger, key = self._find(name)
        if finger is None:
            return f"no parameter {name!a:.80}"
        try:
            with self._asking:
                finger.set(key, value)
        except LinkError as error:
            return f"{name} = {value!a:.80}: {error}"
        return ""

    def _find(self, name: str) -> tuple[Finger | None, str]:
        finger, _, key = name.partition(".")
        return (self._fingers.get(finger) if key in PARAMETERS else None), key
