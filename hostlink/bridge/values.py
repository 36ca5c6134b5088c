"""What all outlets share: stamps on the host's wall clock, diagnoses, tare requests."""

from __future__ import annotations

import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from math import isfinite

from hostlink.commands.monitor import FingerRow
from hostlink.errors import LinkError
from hostlink.events import Sample
from hostlink.finger import Finger
from hostlink.topics import Diagnosis, Level, finger_name, level_of

__all__ = ["TareDesk", "diagnose", "stamp_ns"]

REQUESTS_MAX = 4  # tare requests of one finger that are not answered yet
_BUSY = f"{REQUESTS_MAX} requests are not answered yet; ask again when they are"


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
