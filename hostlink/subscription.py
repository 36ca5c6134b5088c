"""One reader's queue of samples, filled by the link's thread."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

from hostlink.errors import VersionMismatch
from hostlink.events import Sample

__all__ = ["End", "Subscription"]

QUEUE = 4096  # samples that a reader may lag behind: 3 s of five fingers at 250 Hz


class Subscription:
    """One reader's queue."""

    def __init__(self, wake: Callable[[], None] | None = None) -> None:
        self.changed = threading.Condition()
        self.samples: deque[Sample] = deque(maxlen=QUEUE)
        self.error: VersionMismatch | None = None
        self.closed = False
        self.unread_n = 0
        self._wake = wake

    def put(
        self, sample: Sample | None = None, error: VersionMismatch | None = None, end: bool = False
    ) -> None:
        with self.changed:
            if sample is not None:
                self.unread_n += len(self.samples) == QUEUE
                self.samples.append(sample)
            self.error = error or self.error
            self.closed |= end
            self.changed.notify()
        if self._wake is not None:
            self._wake()

    def take(self) -> Sample | None:
        """The oldest sample. Raises VersionMismatch, and End at the end."""
        if self.samples:
            return self.samples.popleft()
        if self.error is not None:
            error, self.error = self.error, None
            raise error
        if self.closed:
            raise End
        return None


class End(Exception):
    """The connection was closed and everything was read."""
