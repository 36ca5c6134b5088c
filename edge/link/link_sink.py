"""Samples onto a bus or a line: `open_sink("can:can0")`, `sink.send(state)`.

    edge loop --send--> [ newest samples, bounded ] --worker--> medium ==bus==> host
                  \\____ at once, where a write cannot block ___/   |
    node <--on_message-- reader <-----------------------------------+

Rules
- `send` never blocks and never raises: it hands over, or counts a drop and returns False.
- Newest wins. A sample that could not be sent is dropped, not queued behind a dead link: the host sees a gap
  in the sample numbers, never old data.
- Order on the bus: answers and emergencies first, then samples, then detail; detail only when nothing waits.
- A write that cannot block (SocketCAN, virtual bus, UDP) happens in the caller's thread: a hand-over to
  another thread costs up to a switch interval of the interpreter. All others happen in the worker thread.
- A full buffer (ENOBUFS, bus-off, nobody listening) drops and keeps the medium. Any other error closes it,
  and the worker reopens it, at most every RETRY_S; it counts as up with the first frame sent.
- Only the worker opens and closes, after the reader has left the medium: a file descriptor that is closed
  under a waiting reader may be reused for another file.
- At start-up a medium that cannot be opened is the user's mistake: SinkError. Later it is counted.
- A link's faults are reported from a separate thread, which sleeps until something may have changed or a
  stall has lasted for STALL_S: the loop may be in a search, and the worker in a blocked write.
"""

from __future__ import annotations

import logging
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

from edge.errors import SinkError
from edge.link.media import Medium, MediumError, MediumFull
from edge.link.sink import SinkCounters
from hostlink.wire import FaultCode, State

log = logging.getLogger(__name__)

RETRY_S = 0.1  # a tenth of the second within which the link must be back
READ_S = 0.05  # how soon a reader leaves a failed medium
READ_SHARE = 0.3  # of a processor that reading may take; an upload over SDO takes 0.2 on a desktop
READ_WINDOW_S = 0.2  # over which that share is taken
READ_PAUSE_S = 0.005  # shorter pauses cost more than they save
STALL_S = 0.06  # nothing leaves for this long: the link counts as down; announced within 0.1 s
DEPTH = 4  # samples waiting for a slow medium: 17 ms at 240 Hz; older ones are not worth sending
CONTROL_DEPTH = 256  # answers waiting; a segmented upload has one under way at a time
CLOSE_S = 0.3  # closing waits so long for the queue, and again for the threads: the program ends within 1 s


class LinkSink(ABC):
    """A sink on a medium that can fail: the rules at the head of this file. Base of CAN and serial.

    open_medium  opens the medium; raises MediumError with a line for the user
    """

    def __init__(self, name: str, open_medium: Callable[[], Medium]) -> None:
        self.name = name
        self._open_medium = open_medium
        try:
            self._medium: Medium | None = open_medium()
        except MediumError as error:
            raise SinkError(f"{name}: {error}") from None
        self.on_message: Callable[[Any], None] | None = None
        self.on_faults: Callable[[], None] | None = None  # `faults` may have changed; called from any thread
        self._changed = threading.Condition()
        self._writing = threading.Lock()  # one write at a time, none while the medium changes
        self._reading = threading.Lock()  # held by the reader while it is inside of the medium
        self._control: deque[Any] = deque(maxlen=CONTROL_DEPTH)
        self._samples: deque[Sequence[Any]] = deque()
        self._detail: deque[Any] = deque()
        self._detail_spacing_s = 0.0
        self._detail_due_s = 0.0
        self._periodic: dict[int, _Periodic] = {}
        self._failed: Medium | None = None
        self._was_down = False
        self._opened_s = time.monotonic()
        self._stalled_since_s: float | None = None
        self._write_began_s: float | None = None
        self._suspect = threading.Event()  # set when `faults` may have changed
        self._last_write_s: float | None = None  # begin of the last write that may block
        self._write_watched = False
        self._busy = False
        self._closing = False
        self._numbers = count()
        self._counters = SinkCounters()
        self._threads = [
            threading.Thread(target=loop, name=f"{name} {what}", daemon=True)
            for what, loop in (
                ("writer", self._write_loop),
                ("reader", self._read_loop),
                ("watch", self._watch_loop),
            )
        ]
        for thread in self._threads:
            thread.start()

    # ---- called by the loop -----------------------------------------------------------------------

    @abstractmethod
    def encode(self, state: State, counter: int) -> Sequence[Any]:
        """The items that carry one sample."""

    @property
    def up(self) -> bool:
        since = (self._stalled_since_s, self._write_began_s)
        stuck = any(t is not None and time.monotonic() - t > STALL_S for t in since)
        # A medium that opens may still not take frames: the first frame sent proves it.
        return self._medium is not None and not self._was_down and not stuck

    @property
    def faults(self) -> frozenset[FaultCode]:
        """The link's current faults."""
        medium = self._medium
        if medium is not None and medium.bus_off:
            return frozenset({FaultCode.BUS_OFF})
        return frozenset() if self.up else frozenset({FaultCode.LINK_DOWN})

    @property
    def counters(self) -> SinkCounters:
        return self._counters

    def send(self, state: State) -> bool:
        number = next(self._numbers)  # dropped samples have a number too: the host counts them as lost
        medium = self._medium
        if medium is None or self._closing:
            return self._count(dropped=1)
        items = self.encode(state, number)
        if medium.instant and self._writing.acquire(blocking=False):
            try:
                return self._count(sent=1) if self._write(medium, items) else self._count(dropped=1)
            finally:
                self._writing.release()
        with self._changed:
            held = (
                self._medium is medium
            )  # if lost meanwhile, queued samples would be old when the link is back
            if held:
                self._samples.append(items)
            dropped = not held or len(self._samples) > DEPTH
            if held and dropped:
                self._samples.popleft()
            self._changed.notify_all()
        return not dropped or self._count(dropped=1)

    def post(self, item: Any) -> None:
        """Send an answer, an emergency or a heartbeat: ahead of the samples, in the order given."""
        with self._changed:
            if self._medium is not None:
                self._control.append(item)
                self._changed.notify_all()

    def send_detail(self, items: Sequence[Any], spacing_s: float) -> bool:
        """Send items of the lowest priority, when nothing else waits; False: skipped and counted.

        spacing_s  least time between two of the items: a sample cannot overtake what lies in the driver's
                   queue, so there must never be more than one
        """
        with self._changed:
            free = self._medium is not None and not self._pending()
            if free:
                self._detail.extend(items)
                self._detail_spacing_s = spacing_s
                self._changed.notify_all()
        if not free:
            self._count(detail_skipped=1)
        return free

    def every(self, key: int, period_s: float, make: Callable[[], Any] | None) -> None:
        """Post `make()` each period from now on; None ends it. `key` names the series."""
        with self._changed:
            self._periodic.pop(key, None)
            if make is not None and period_s > 0:
                self._periodic[key] = _Periodic(period_s, make, time.monotonic() + period_s)
            self._changed.notify_all()

    def drain(self, timeout_s: float) -> bool:
        with self._changed:
            return self._changed.wait_for(lambda: not (self._pending() or self._busy), timeout_s)

    def close(self) -> None:
        self.drain(CLOSE_S if self.up else 0.0)
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._suspect.set()
        end_s = time.monotonic() + CLOSE_S
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(max(0.0, end_s - time.monotonic()))

    # ---- the worker -------------------------------------------------------------------------------

    def _pending(self) -> bool:
        return bool(self._samples or self._control or self._detail)

    def _count(self, *, sent: int = 0, dropped: int = 0, **others: int) -> bool:
        """Add to the counters; True if something was sent."""
        with self._changed:
            old = self._counters
            more = {name: getattr(old, name) + n for name, n in others.items()}
            self._counters = replace(old, sent=old.sent + sent, dropped=old.dropped + dropped, **more)
        if dropped and self._stalled_since_s is None:
            self._stalled_since_s = time.monotonic()
            self._suspect.set()
        return bool(sent)

    def _write(self, medium: Medium, items: Sequence[Any]) -> bool:
        """Write all items of one sample; the caller holds `_writing`."""
        if medium is not self._medium:
            return False
        bus_off = medium.bus_off
        began_s = self._write_began_s = time.monotonic()
        if not medium.instant:  # it may block
            self._last_write_s = began_s
            if not self._write_watched:
                self._write_watched = True
                self._suspect.set()
        try:
            for item in items:
                medium.write(item)
        except MediumFull:
            if self._stalled_since_s is None:
                self._stalled_since_s = began_s
            self._suspect.set()
            return False
        except MediumError as error:
            self._lose(medium, error)
            return False
        finally:
            self._write_began_s = None
        recovered = self._stalled_since_s is not None or self._was_down or bus_off
        recovered |= time.monotonic() - began_s > STALL_S
        self._stalled_since_s = None
        if self._was_down:
            self._was_down = False
            self._count(reconnects=1)
            log.info("%s: link reconnected", self.name)
        if recovered:
            self._suspect.set()
        return True

    def _lose(self, medium: Medium, error: Exception) -> None:
        with self._changed:
            if self._medium is not medium:
                return
            if not self._was_down:
                log.warning("%s: %s", self.name, error)
            self._medium, self._failed, self._was_down = None, medium, True
            waiting = len(self._samples)
            self._samples.clear()
            self._control.clear()
            self._detail.clear()
            self._changed.notify_all()
        self._suspect.set()
        if waiting:
            self._count(dropped=waiting)

    def _write_loop(self) -> None:
        while not self._closing:
            if self._medium is None:
                self._reopen()
                continue
            work = self._next_work()
            if work is None:
                continue
            kind, items = work
            medium = self._medium
            with self._writing:
                done = medium is not None and self._write(medium, items)
            self._count(**self._outcome(kind, done))
            with self._changed:
                self._busy = False
                self._changed.notify_all()
        self._close_medium(self._medium)

    def _outcome(self, kind: str, done: bool) -> dict[str, int]:
        if kind == "sample":
            return {"sent": 1} if done else {"dropped": 1}
        if kind == "detail" and not done:
            self._detail.clear()  # an incomplete group is useless
            return {"detail_skipped": 1}
        return {"detail_sent": 1} if kind == "detail" and not self._detail else {}

    def _next_work(self) -> tuple[str, Sequence[Any]] | None:
        """Wait for something to send; returns the most urgent."""
        with self._changed:
            if not (self._samples or self._control):
                self._changed.wait(self._until_due_s())
            self._post_due()
            if self._closing or self._medium is None:
                return None
            self._busy = self._pending()
            if self._control:
                return "control", (self._control.popleft(),)
            if self._samples:
                return "sample", self._samples.popleft()
            if self._detail and time.monotonic() >= self._detail_due_s:
                self._detail_due_s = time.monotonic() + self._detail_spacing_s
                return "detail", (self._detail.popleft(),)
            self._busy = False
        return None

    def _until_due_s(self) -> float | None:
        due = [p.due_s for p in self._periodic.values()]
        if self._detail:
            due.append(self._detail_due_s)
        return max(0.0, min(due) - time.monotonic()) if due else None

    def _post_due(self) -> None:
        now = time.monotonic()
        for series in self._periodic.values():
            if now >= series.due_s:
                series.due_s = max(series.due_s + series.period_s, now)
                self._control.append(series.make())

    def _reopen(self) -> None:
        failed, self._failed = self._failed, None
        self._close_medium(failed)
        # SocketCAN opens on an interface that is down, and fails at once: do not retry without a pause.
        with self._changed:
            pause_s = self._opened_s + RETRY_S - time.monotonic()
            if self._changed.wait_for(lambda: self._closing, max(0.0, pause_s)):
                return
        self._opened_s = time.monotonic()
        try:
            medium = self._open_medium()
        except MediumError:
            return
        self._stalled_since_s = None  # drops meanwhile were those of the old medium
        with self._changed:
            self._medium = medium
            self._changed.notify_all()

    def _close_medium(self, medium: Medium | None) -> None:
        if medium is not None:
            with self._writing, self._reading:
                medium.close()

    # ---- fault watch --------------------------------------------------------------------------------

    def _watch_loop(self) -> None:
        checked_s = time.monotonic()
        while True:
            self._suspect.wait(self._until_stalled_s(checked_s))
            self._suspect.clear()
            if self._closing:
                return
            checked_s = time.monotonic()
            if self.on_faults is not None:
                try:
                    self.on_faults()
                except Exception:
                    log.exception("%s: its faults cannot be reported", self.name)

    def _until_stalled_s(self, checked_s: float) -> float | None:
        """Time until a stall becomes a fault; None: nothing stalls, or it is a fault already."""
        self._write_watched = False  # first: a write that begins from here on wakes this thread
        since = (self._stalled_since_s, self._last_write_s)
        due = [s + STALL_S for s in since if s is not None and s + STALL_S >= checked_s]
        self._write_watched = bool(due)  # this thread then checks once in STALL_S, not at each write
        return max(0.001, min(due) - time.monotonic()) if due else None

    # ---- the reader -------------------------------------------------------------------------------

    def _read_loop(self) -> None:
        budget = ReadBudget(time.thread_time(), time.monotonic())
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closing or self._medium is not None)
                medium = self._medium
            if self._closing or medium is None:
                return
            with self._reading:
                message, bus_off = None, medium.bus_off
                try:
                    if medium is self._medium:
                        message = medium.read(READ_S)
                except MediumError as error:
                    self._lose(medium, error)
            if medium.bus_off != bus_off:
                self._suspect.set()
            if message is not None and self.on_message is not None:
                try:
                    self.on_message(message)
                except Exception:
                    log.exception("%s: message %r", self.name, message)
            pause_s = budget.pause_s(time.thread_time(), time.monotonic())
            if pause_s:  # messages meanwhile wait in the driver, or are lost there
                with self._changed:
                    self._changed.wait_for(lambda: self._closing, pause_s)


class ReadBudget:
    """Limits the reader's processor time: a flooded bus must not slow the loop.

    cpu_s, now_s  processor time of the reader's thread, and the time
    """

    def __init__(self, cpu_s: float, now_s: float) -> None:
        self._cpu_s, self._since_s = cpu_s, now_s

    def pause_s(self, cpu_s: float, now_s: float) -> float:
        """How long to pause reading; 0.0: go on."""
        used_s, passed_s = cpu_s - self._cpu_s, now_s - self._since_s
        pause_s = used_s / READ_SHARE - passed_s
        if passed_s > READ_WINDOW_S:
            self._cpu_s, self._since_s = cpu_s, now_s
        return pause_s if pause_s > READ_PAUSE_S else 0.0


@dataclass(slots=True)
class _Periodic:
    period_s: float
    make: Callable[[], Any]
    due_s: float
