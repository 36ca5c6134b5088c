"""Detects that a link sends nothing, and wakes the thread that reports it. Times are `time.monotonic`."""

import threading
import time


class StallWatch:
    """stall_s          longest time without a sent item
    writing_since_s  when the present write began; None: there is none
    """

    def __init__(self, stall_s: float) -> None:
        self._stall_s = stall_s
        self._refused_s: float | None = None  # since when nothing was accepted
        self.writing_since_s: float | None = None
        self._slow_write_s: float | None = None  # begin of the last write that may block
        self._slow_write_watched = False
        self._changed = threading.Event()
        self._checked_s = time.monotonic()

    @property
    def stalled(self) -> bool:
        """Whether nothing was sent for too long."""
        refused_s, write_s = self._refused_s, self.writing_since_s
        if refused_s is None and write_s is None:
            return False
        begun_s = min(s for s in (refused_s, write_s) if s is not None)
        return time.monotonic() - begun_s > self._stall_s

    def may_block(self, began_s: float) -> None:
        """Note that the present write, which began then, may block."""
        self._slow_write_s = began_s
        if not self._slow_write_watched:
            self._slow_write_watched = True
            self._changed.set()

    def left(self, began_s: float, recovered: bool) -> None:
        """Note that a write that began then has succeeded; recovered: a fault ends with it."""
        recovered |= self._refused_s is not None or time.monotonic() - began_s > self._stall_s
        self._refused_s = None
        if recovered:
            self._changed.set()

    def refused(self, since_s: float) -> None:
        """Note that the medium has accepted nothing since then."""
        if self._refused_s is None:
            self._refused_s = since_s
        self._changed.set()

    def dropped(self) -> None:
        if self._refused_s is None:
            self.refused(time.monotonic())

    def reopened(self) -> None:
        """Forget the refusals of the old medium."""
        self._refused_s = None

    def wake(self) -> None:
        """Wake the waiting thread: a fault may have begun or ended."""
        self._changed.set()

    def wait(self) -> None:
        """Return when a fault of the link may have appeared or cleared."""
        self._changed.wait(self._until_stalled_s())
        self._changed.clear()
        self._checked_s = time.monotonic()

    def _until_stalled_s(self) -> float | None:
        """Time until a stall becomes a fault; None: nothing stalls, or it is a fault already."""
        self._slow_write_watched = False  # first: a write that begins from here on wakes this thread
        since = (self._refused_s, self._slow_write_s)
        due = [s + self._stall_s for s in since if s is not None and s + self._stall_s >= self._checked_s]
        # This thread then checks once in `stall_s`, not at each write.
        self._slow_write_watched = bool(due)
        return max(0.001, min(due) - time.monotonic()) if due else None
