"""The part that all links to a host share: what waits, which medium is open, who writes, reads and reports.

    edge loop --send--> [ newest samples, bounded ] --worker--> medium ==bus==> host
                  \\____ at once, where a write cannot block ___/   |
    node <--on_message-- reader <-----------------------------------+

- `send` never blocks and never raises: it hands over, or counts a drop and returns False. A sample that could
  not be sent is not kept for later: the host sees a gap in the sample numbers, never old data.
- A write that cannot block (SocketCAN, virtual bus, UDP) happens in the caller's thread: a hand-over to
  another thread costs up to a switch interval of the interpreter. The worker thread does all others.
- A full buffer (ENOBUFS, bus-off, nobody listening) drops and keeps the medium. Any other error closes it,
  foreseen or not, and no thread ends by it. Only the worker closes and opens, after the reader has left: a
  file descriptor that is closed under a waiting reader may be reused for another file.
- At the start a medium that cannot be opened is the user's mistake: SinkError. Later it is counted.
- Faults are reported from a thread of their own: the loop may be in a search, and the worker in a write.
  It is woken by what is lost or back, and looks every `check_s` while something may stall.
"""

import logging
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from typing import Any

from edge.errors import SinkError
from edge.link.medium import Medium, MediumError, MediumFull
from edge.link.params import PARAMS
from edge.link.send_queue import SendQueue, Spaced
from hostlink.link_guard import LinkGuard
from hostlink.wire import FaultCode, State
from hostlink.wire.open_errors import message_of

log = logging.getLogger(__name__)


@dataclass(slots=True)
class SinkCounters:
    """Counts of samples since the opening.

    detail_sent, detail_skipped   groups of detail segments sent, and skipped in favour of samples
    """

    sent: int = 0  # samples given to the medium
    dropped: int = 0  # samples that could not be sent
    reconnects: int = 0  # times the medium was lost and came back
    detail_sent: int = 0
    detail_skipped: int = 0


class ReadBudget:
    """Limits the reader's processor time: a flooded bus must not slow the loop.

    cpu_s, now_s  processor time of the reader's thread, and the time
    """

    def __init__(self, cpu_s: float, now_s: float) -> None:
        self._cpu_s, self._now_s, self._paid_s = cpu_s, now_s, now_s

    def pause_s(self, cpu_s: float, now_s: float) -> float:
        """How long to pause reading; 0.0: go on. Time that was not used is no credit for later."""
        used_s = cpu_s - self._cpu_s
        self._paid_s = max(self._paid_s, self._now_s) + used_s / PARAMS.read_rel
        self._cpu_s, self._now_s = cpu_s, now_s
        pause_s = self._paid_s - now_s
        return pause_s if pause_s > PARAMS.read_pause_s else 0.0


class LinkSink(ABC):
    """A sink on a medium that can fail: the rules at the head of this file. Base of CAN and serial.

    open_medium  opens the medium; raises MediumError with a line for the user
    on_message   called with each message that comes in, from the reader's thread
    on_faults    called when `faults` may have changed, from a thread of its own
    guard        counts the exceptions that nobody foresaw
    """

    def __init__(self, name: str, open_medium: Callable[[], Medium]) -> None:
        self.name = name
        self.on_message: Callable[[Any], None] | None = None
        self.on_faults: Callable[[], None] | None = None
        self.guard = LinkGuard(name)
        self._open_medium = open_medium
        self._tried_s = time.monotonic()
        try:
            self._medium: Medium | None = open_medium()  # None: lost
        except MediumError as error:
            raise SinkError(f"{name}: {error}") from None
        self._lost = False  # and nothing was sent since: a medium that opens may still not take frames
        self._failed: Medium | None = None  # to be closed before another one is opened
        self._queue = SendQueue(PARAMS.samples_n, PARAMS.control_n)
        self._refused_s: float | None = None  # since when nothing was accepted
        self._writing_since_s: float | None = None  # begin of the present write
        self._fault_event = threading.Event()  # faults may have changed
        self._changed = threading.Condition()  # guards medium, queue and counters
        self._writing = threading.Lock()  # one write at a time, none while the medium changes
        self._reading = threading.Lock()  # held by the reader while it is inside of the medium
        self._closing = False
        self._numbers = count()
        self._counts = dict.fromkeys(SinkCounters.__slots__, 0)
        self._sent_at_once_n = 0  # samples, besides those; `_writing` is held
        self._counting = threading.Lock()
        self._budget = ReadBudget(0.0, time.monotonic())  # the thread that it counts is to begin
        self._threads = [
            threading.Thread(
                target=self.guard.run,
                args=(step, lambda: self._closing, self._recover, finish),
                name=f"{name} {what}",
                daemon=True,
            )
            for what, step, finish in (
                ("writer", self._write_or_reopen, lambda: self._close_medium(self._medium)),
                ("reader", self._read, None),
                ("watch", self._watch, None),
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
        if self._medium is None or self._lost:
            return False
        idle_s = [s for s in (self._refused_s, self._writing_since_s) if s is not None]
        return not idle_s or time.monotonic() - min(idle_s) <= PARAMS.stall_s

    @property
    def faults(self) -> frozenset[FaultCode]:
        medium = self._medium
        if medium is not None and medium.bus_off:
            return frozenset({FaultCode.BUS_OFF})
        return frozenset() if self.up else frozenset({FaultCode.LINK_DOWN})

    @property
    def counters(self) -> SinkCounters:
        with self._counting:
            return SinkCounters(**self._counts | {"sent": self._counts["sent"] + self._sent_at_once_n})

    @property
    def dropped_n(self) -> int:
        return self._counts["dropped"]

    def send(self, state: State) -> bool:
        number = next(self._numbers)  # dropped samples have a number too: the host counts them as lost
        medium = self._medium
        if medium is None or self._closing:
            self._count("dropped")
            return False
        items = self.encode(state, number)
        if medium.instant and not self._queue.sample_ahead and self._writing.acquire(False):
            try:
                if self._write(medium, items):
                    self._sent_at_once_n += 1
                    return True
            finally:
                self._writing.release()
            self._count("dropped")
            return False
        with self._changed:
            # If the medium was lost meanwhile, queued samples would be old when the link is back.
            kept = self._medium is medium and self._queue.put_sample(items)
            self._changed.notify_all()
        if not kept:
            self._count("dropped")
        return kept

    def post(self, item: Any) -> None:
        """Send an answer, an emergency or a heartbeat: ahead of the samples, in the order given."""
        with self._changed:
            if self._medium is not None:
                self._queue.put_control(item)
                self._changed.notify_all()

    def post_spaced(self, kind: Spaced, items: Sequence[Any], spacing_s: float) -> bool:
        """Send items when no sample waits, in place of those of the last call that still wait.

        kind       "block": of an answer; "detail": if nothing else waits
        spacing_s  least time between two of the items: a sample cannot overtake what lies in the driver's
                   queue, so there must never be more than one
        Returns    False: detail was skipped, and counted
        """
        with self._changed:
            free = self._medium is not None and (kind == "block" or not self._queue.waiting)
            if free:
                self._queue.put_spaced(kind, items, spacing_s)
                self._changed.notify_all()
        if not free and kind == "detail":
            self._count("detail_skipped")
        return free

    def every(self, period_s: float, make: Callable[[], Any] | None, phase: float = 0.0) -> None:
        """Post `make()` each period from now on, and nothing else periodically; None: nothing.

        phase  0..1, when in each period of the monotonic clock, which all processes of a board share
        """
        with self._changed:
            self._queue.every(period_s, make, time.monotonic(), phase)
            self._changed.notify_all()

    def drain(self, timeout_s: float) -> bool:
        with self._changed:
            return self._changed.wait_for(lambda: self._queue.empty, timeout_s)

    def close(self) -> None:
        self.drain(PARAMS.close_s if self.up else 0.0)
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._fault_event.set()
        end_s = time.monotonic() + PARAMS.close_s
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(max(0.0, end_s - time.monotonic()))

    # ---- the worker -------------------------------------------------------------------------------

    def _count(self, what: str, n: int = 1) -> None:
        with self._counting:
            self._counts[what] += n
        if what == "dropped" and n:
            self._refuse(time.monotonic())

    def _refuse(self, since_s: float) -> None:
        """Note that the medium has accepted nothing since then."""
        if self._refused_s is None:
            self._refused_s = since_s
            self._fault_event.set()

    def _write(self, medium: Medium, items: Sequence[Any]) -> bool:
        """Write all items of one sample; the caller holds `_writing`."""
        if medium is not self._medium:
            return False
        bus_off = medium.bus_off
        began_s = self._writing_since_s = time.monotonic()
        try:
            for item in items:
                medium.write(item)
        except MediumFull:
            self._refuse(began_s)
            return False
        except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever a driver raises, the medium has failed
            self._lose(medium, error)
            return False
        finally:
            self._writing_since_s = None
        if self._lost or bus_off or self._refused_s is not None:
            if self._lost:
                self._count("reconnects")
                log.info("%s: link reconnected", self.name)
            self._lost, self._refused_s = False, None
            self._fault_event.set()
        return True

    def _lose(self, medium: Medium, error: BaseException) -> None:
        if not isinstance(error, (MediumError, *medium.broken)):
            self.guard.note(error)
        with self._changed:
            if self._medium is not medium:
                return
            if not self._lost:
                log.warning("%s: %s", self.name, message_of(error))
            self._medium, self._failed, self._lost = None, medium, True
            dropped_n = self._queue.clear()
            self._changed.notify_all()
        self._fault_event.set()
        self._count("dropped", dropped_n)

    def _recover(self) -> None:
        """A thread's step has failed as nobody foresaw: begin anew with another medium, after a pause."""
        medium = self._medium
        if medium is not None:
            self._lose(medium, MediumError("unforeseen error"))
        self._pause(PARAMS.retry_s)

    def _pause(self, seconds: float) -> None:
        """Wait, unless the link is closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._closing, seconds)

    def _write_or_reopen(self) -> None:
        if self._medium is None:
            self._reopen()
            return
        items = self._next_items()
        if items is None:
            return
        medium, written = self._medium, False
        try:
            with self._writing:
                written = medium is not None and self._write(medium, items)
        finally:
            with self._changed:
                if counted := self._queue.done(written):
                    self._count(counted)
                self._changed.notify_all()

    def _next_items(self) -> Sequence[Any] | None:
        """Wait for something to send; returns the most urgent."""
        with self._changed:
            if self._medium is None or self._closing:
                return None
            wait_s = self._queue.wait_s(time.monotonic())
            if wait_s != 0.0:
                self._changed.wait(wait_s)
            if self._medium is None or self._closing:
                return None
            return self._queue.take(time.monotonic())

    def _reopen(self) -> None:
        with self._changed:
            failed, self._failed = self._failed, None
        self._close_medium(failed)
        # SocketCAN opens on an interface that is down, and fails at once: do not retry without a pause.
        self._pause(self._tried_s + PARAMS.retry_s - time.monotonic())
        if self._closing:
            return
        self._tried_s = time.monotonic()
        try:
            medium = self._open_medium()
        except MediumError:
            return
        with self._changed:
            self._medium, self._refused_s = medium, None
            self._changed.notify_all()
        self._fault_event.set()

    def _close_medium(self, medium: Medium | None) -> None:
        if medium is not None:
            with self._writing, self._reading, suppress(*medium.broken):  # a dead bus fails to close
                medium.close()

    # ---- fault watch ------------------------------------------------------------------------------

    def _watch(self) -> None:
        medium = self._medium
        may_stall = self._refused_s is not None or (medium is not None and not medium.instant)
        self._fault_event.wait(PARAMS.check_s if may_stall else None)
        self._fault_event.clear()
        if not self._closing and self.on_faults is not None and not self.guard.call(self.on_faults):
            self._pause(PARAMS.retry_s)
            self._fault_event.set()  # they must be reported some time

    # ---- the reader -------------------------------------------------------------------------------

    def _read(self) -> None:
        """Wait for a medium and read once."""
        with self._changed:
            self._changed.wait_for(lambda: self._closing or self._medium is not None)
            medium = self._medium
        if self._closing or medium is None:
            return
        with self._reading:
            message, bus_off = None, medium.bus_off
            try:
                if medium is self._medium:
                    message = medium.read(PARAMS.read_s)
            except (Exception, SystemExit) as error:  # noqa: BLE001 - the same
                self._lose(medium, error)
        if medium.bus_off != bus_off:
            self._fault_event.set()
        if message is not None and self.on_message is not None:
            self.guard.call(self.on_message, message)
        pause_s = self._budget.pause_s(time.thread_time(), time.monotonic())
        if pause_s:  # messages meanwhile wait in the driver, or are lost there
            self._pause(pause_s)
