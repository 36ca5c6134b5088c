"""The bounded queue between the loop, which never waits, and the thread that writes."""

import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

from edge.recording.topics import Topic


class Item(NamedTuple):
    """A message that is not encoded yet."""

    cost_bytes: int  # memory that it occupies
    topic: Topic
    log_ns: int
    publish_ns: int
    sequence: int
    encode: Callable[[], bytes]  # called by the thread that writes


class MessageQueue:
    """Items and calls in order.

    size_bytes  capacity; what does not fit is dropped
    dropped_n   messages that did not fit, came after the end, or were discarded
    """

    def __init__(self, size_bytes: int) -> None:
        self.dropped_n = 0
        self._size_bytes = size_bytes
        self._items: deque[Item | Callable[[], None]] = deque()
        self._waiting_bytes = 0
        self._reported_n = 0
        self._closed = False
        self._changed = threading.Condition()

    def put(self, items: Sequence[Item]) -> bool:
        """Queue all of them, or none: False."""
        cost = sum(item.cost_bytes for item in items)
        with self._changed:
            if self._closed or self._waiting_bytes + cost > self._size_bytes:
                self.dropped_n += len(items)
                return False
            self._items.extend(items)
            self._waiting_bytes += cost
            self._changed.notify()
        return True

    def put_call(self, call: Callable[[], None]) -> None:
        """Queue a call for the writing thread; never dropped."""
        with self._changed:
            self._items.append(call)
            self._changed.notify()

    def count_lost(self, messages_n: int) -> None:
        """Count messages that were lost before the queue."""
        with self._changed:
            self.dropped_n += messages_n

    def close(self) -> None:
        """Accept nothing more; queued items can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify()

    def give_up(self) -> None:
        """Accept and give nothing more; queued items are dropped."""
        with self._changed:
            self._closed = True
            self.dropped_n += len(self._items)
            self._items.clear()
            self._waiting_bytes = 0
            self._changed.notify()

    def get(self, timeout_s: float | None) -> Item | Callable[[], None] | None:
        """The next item; None: none came in time, or `ended`."""
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._closed, timeout_s)
            return self._items.popleft() if self._items else None

    @property
    def ended(self) -> bool:
        return self._closed and not self._items

    def done(self, item: Item) -> None:
        """Release the memory of an item that was taken."""
        with self._changed:
            self._waiting_bytes = max(0, self._waiting_bytes - item.cost_bytes)

    def newly_dropped(self) -> int:
        """How many were dropped since the last call."""
        with self._changed:
            lost_n, self._reported_n = self.dropped_n - self._reported_n, self.dropped_n
        return lost_n
