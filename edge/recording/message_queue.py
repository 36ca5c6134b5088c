"""The bounded queue between the loop, which never waits, and the thread that writes."""

import threading
from collections import deque
from collections.abc import Callable, Sequence

Calls = Sequence[Callable[[], None]]  # each of them writes a message


class MessageQueue:
    """Calls for the writing thread, in order; what exceeds `size_bytes` is dropped and counted."""

    def __init__(self, size_bytes: int) -> None:
        self.dropped_n, self._size_bytes = 0, size_bytes
        self._groups: deque[tuple[Calls, int]] = deque()
        self._waiting_bytes = 0
        self._closed = False
        self._changed = threading.Condition()

    def put(self, calls: Calls, cost_bytes: int) -> bool:
        """Queue all of them, or none: False. cost_bytes: memory that they occupy; 0: they always fit."""
        with self._changed:
            if self._closed or self._waiting_bytes + cost_bytes > self._size_bytes:
                self.dropped_n += len(calls)
                return False
            self._groups.append((calls, cost_bytes))
            self._waiting_bytes += cost_bytes
            self._changed.notify()
        return True

    def count_lost(self, messages_n: int) -> None:
        with self._changed:
            self.dropped_n += messages_n

    def close(self, give_up: bool = False) -> None:
        """Accept nothing more; what is queued can still be taken, or is dropped."""
        with self._changed:
            self._closed = True
            if give_up:
                self.dropped_n += sum(len(calls) for calls, _ in self._groups)
                self._groups.clear()
            self._changed.notify()

    def get(self, timeout_s: float | None) -> tuple[Calls, int]:
        """The next calls and their memory, for `done`; none came in time, or `ended`: no calls."""
        with self._changed:
            self._changed.wait_for(lambda: self._groups or self._closed, timeout_s)
            return self._groups.popleft() if self._groups else ((), 0)

    @property
    def ended(self) -> bool:
        return self._closed and not self._groups

    def done(self, cost_bytes: int) -> None:
        """Release the memory of what was taken."""
        with self._changed:
            self._waiting_bytes -= cost_bytes
