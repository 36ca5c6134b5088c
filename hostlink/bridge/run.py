"""The bridge's loop: samples and diagnoses of a hand to its outlets, until it is stopped.

Rules
- The link's thread only puts into a queue. When an outlet is slower than the hand, the oldest sample is
  dropped, and `left_out_n` counts it: a late sample is worth less than a new one.
- A finger is announced with its first message; another version is reported as a diagnosis.
- An outlet handles its own errors (a viewer or router that left).
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Protocol

from hostlink.bridge.values import diagnose
from hostlink.client import Connection
from hostlink.commands.monitor import Board
from hostlink.errors import LinkError
from hostlink.events import DetailFrame, Sample
from hostlink.finger import Finger
from hostlink.topics import DIAGNOSIS_S, Diagnosis

__all__ = ["Bridge", "Outlet"]

QUEUE = 2048  # samples: nearly two seconds of five fingers at 240 Hz


class Outlet(Protocol):
    """Receives samples. All calls come from one thread."""

    def add_finger(self, finger: Finger) -> None:
        """Add a finger, at its first message."""
        ...

    def publish(self, sample: Sample | DetailFrame) -> None:
        """Publish a sample, or the pins' motion, of a finger that was added."""
        ...

    def report(self, diagnoses: Sequence[Diagnosis]) -> None:
        """Publish the state of all fingers, once a second."""
        ...

    def close(self) -> None:
        """Close everything."""
        ...


class Bridge:
    """Passes samples of a connection to outlets; `run` in one thread, `stop` from any.

    left_out_n  samples dropped because the outlets were too slow
    """

    def __init__(self, hand: Connection, outlets: Sequence[Outlet]) -> None:
        self._hand, self._outlets = hand, outlets
        self._samples: queue.Queue[Sample | DetailFrame | None] = queue.Queue(QUEUE)
        self._known: set[int] = set()
        self._identities: dict[int, tuple[str, str]] = {}  # serial number, calibration
        self._board = Board(hand)
        self.left_out_n = 0

    def run(self, seconds: float | None = None) -> None:
        """Run until `stop`, or the time is up."""
        end_s = None if seconds is None else time.monotonic() + seconds
        report_s = time.monotonic() + DIAGNOSIS_S
        ends = self._hand.on_sample(self._put), self._hand.on_detail(self._put)
        try:
            while end_s is None or time.monotonic() < end_s:
                wait_s = min(report_s, end_s or report_s) - time.monotonic()
                if wait_s <= 0:
                    self._report()
                    report_s = time.monotonic() + DIAGNOSIS_S
                    continue
                with suppress(queue.Empty):
                    sample = self._samples.get(timeout=wait_s)
                    if sample is None:
                        return
                    self._publish(sample)
        finally:
            for end in ends:
                end()

    def stop(self) -> None:
        """End `run` after the samples that came before."""
        self._put(None)

    def _put(self, sample: Sample | DetailFrame | None) -> None:
        while True:
            try:
                self._samples.put_nowait(sample)
                return
            except queue.Full:
                with suppress(queue.Empty):
                    self._samples.get_nowait()
                    self.left_out_n += 1

    def _publish(self, sample: Sample | DetailFrame) -> None:
        self._add(sample.node)
        for outlet in self._outlets:
            outlet.publish(sample)

    def _add(self, node: int) -> None:
        if node in self._known:
            return
        self._known.add(node)
        finger = self._hand.fingers[node]
        for outlet in self._outlets:
            outlet.add_finger(finger)
        # It runs in another thread: a finger that does not answer must not delay samples.
        threading.Thread(target=self._ask_identity, args=(finger,), daemon=True).start()

    def _ask_identity(self, finger: Finger) -> None:
        with suppress(LinkError):
            both = str(finger.get("serial_number")), str(finger.get("calibration_id"))
            self._identities[finger.node] = both

    def _report(self) -> None:
        fingers = self._hand.fingers
        rows = [row for row in self._board.rows() if row.finger in fingers]
        for row in rows:
            self._add(row.finger)
        diagnoses = [
            diagnose(row, fingers[row.finger], *self._identities.get(row.finger, ("", ""))) for row in rows
        ]
        for outlet in self._outlets:
            outlet.report(diagnoses)
