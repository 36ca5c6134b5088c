"""Fingers on a link: samples as they come, and what can be asked of a finger.

    link thread -> decoder -> clock -> [latest, callbacks, every iterator's queue]

Rules
- One `Connection` is one bus or line with all the fingers on it. A finger is there once it was heard.
- Nobody waits for a slow reader: each iterator has a queue of its own, the oldest sample goes when it is
  full, and `unread_n` counts.
- `latest` gives nothing rather than something old.
- A sensor of another version raises VersionMismatch wherever samples are asked for: there are none.
- The link comes back by itself; meanwhile there are simply no samples, and `up` is False.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from typing import Any

from hostlink.decoder import (
    CanDecoder,
    DetailFrame,
    Emergency,
    Event,
    Heartbeat,
    ObjectAnswer,
    SdoFrame,
    SerialDecoder,
    Statistics,
)
from hostlink.decoder import (
    Sample as DecodedSample,
)
from hostlink.errors import ConnectError, LinkDown, LinkTimeout, UsageError, VersionMismatch
from hostlink.finger import STALE_S, Finger, Info, Sample
from hostlink.links import CanLink, Link, open_link
from hostlink.objects import ObjectClient, SdoObjects, SerialObjects
from hostlink.subscription import End, Subscription
from hostlink.wire import (
    CanIds,
    Kind,
)
from hostlink.wire.address import Address, AddressError, parse_address

__all__ = ["Connection", "Finger", "Info", "Sample", "connect"]

log = logging.getLogger(__name__)

FINGER_S = 3.0  # default time to wait for a finger to be heard
SERIAL_NODE = 1  # a line has no node numbers


class Connection:
    """A bus or line with the fingers on it; a context manager and an iterator of samples.

    address  parsed; see `hostlink.wire.address`
    ids      bases of the CAN identifiers, where they were moved
    """

    def __init__(self, address: Address, ids: CanIds | None = None) -> None:
        self.address = address
        self._ids = ids or CanIds()
        self._changed = threading.Condition()
        self._fingers: dict[int, Finger] = {}
        self._subscriptions: list[Subscription] = []
        self._callbacks: list[Callable[[Sample], None]] = []
        self._raw: list[Callable[[Any, float], None]] = []
        self._on_detail: list[Callable[[DetailFrame], None]] = []
        self._can = CanDecoder(self._ids)
        self._serial = SerialDecoder(address.node or SERIAL_NODE)
        self._is_can = address.is_can
        self._link: Link = open_link(address, self._receive)

    # ---- samples ----------------------------------------------------------------------------------

    @property
    def fingers(self) -> Mapping[int, Finger]:
        """The fingers heard so far, by node number."""
        return dict(self._fingers)

    def finger(self, node: int | None = None, timeout_s: float = FINGER_S) -> Finger:
        """A finger by node number, or the only one there is; waits until it is heard.

        A finger that is stopped and sends no heartbeat is not heard, but can be asked by its number.
        Raises LinkTimeout: no finger was heard; UsageError: several were, and none was named
        """
        if node is not None and self._is_can:
            return self._known(node)
        with self._changed:
            self._changed.wait_for(lambda: self._fingers, timeout_s)
        if len(self._fingers) == 1:
            return next(iter(self._fingers.values()))
        if not self._fingers and not self._is_can:
            return self._known(self.address.node or SERIAL_NODE)
        if not self._fingers:
            raise LinkTimeout(f"{self.address}: no finger was heard for {timeout_s:g} s")
        raise UsageError(f"{self.address}: fingers {', '.join(map(str, self._fingers))} are there; name one")

    def latest(self, node: int | None = None, max_age_s: float | None = STALE_S) -> Sample | None:
        """The newest sample of a finger (or of any), None if it is older than `max_age_s`."""
        if node is not None:
            return self._known(node).latest(max_age_s)
        samples = [s for f in list(self._fingers.values()) if (s := f.latest(max_age_s)) is not None]
        return max(samples, key=lambda s: s.arrival_s, default=None)

    def samples(self, timeout_s: float | None = None) -> Iterator[Sample]:
        """All fingers' samples from now on, until the connection is closed.

        timeout_s  longest silence; None: wait for ever
        Raises     LinkTimeout, VersionMismatch
        """
        subscription = self._subscribe()
        try:
            while True:
                with subscription.changed:
                    sample = subscription.take()
                    if sample is None:
                        if not subscription.changed.wait(timeout_s):
                            raise LinkTimeout(f"{self.address}: no sample for {timeout_s:g} s")
                        continue
                yield sample
        except End:
            return
        finally:
            self._subscriptions.remove(subscription)

    def __iter__(self) -> Iterator[Sample]:
        return self.samples()

    async def __aiter__(self) -> AsyncIterator[Sample]:
        loop, news = asyncio.get_running_loop(), asyncio.Event()
        subscription = self._subscribe(lambda: _wake(loop, news))
        try:
            while True:
                sample = subscription.take()
                if sample is None:
                    await news.wait()
                    news.clear()
                else:
                    yield sample
        except End:
            return
        finally:
            self._subscriptions.remove(subscription)

    def on_sample(self, callback: Callable[[Sample], None]) -> Callable[[], None]:
        """Call this with every sample, from the link's thread; returns what ends it."""
        return _add(self._callbacks, callback)

    def on_detail(self, callback: Callable[[DetailFrame], None]) -> Callable[[], None]:
        """Call this with every frame of the detail stream, from the link's thread; no more once it fails."""
        return _add(self._on_detail, callback)

    def on_raw(self, callback: Callable[[Any, float], None]) -> Callable[[], None]:
        """Call this with all that comes in (can.Message or bytes) and its arrival: for recorders.

        From the link's thread; no more once it fails.
        """
        return _add(self._raw, callback)

    # ---- the link ---------------------------------------------------------------------------------

    @property
    def up(self) -> bool:
        """Whether the bus or line is open."""
        return self._link.up

    @property
    def reconnects(self) -> int:
        """Times that the bus or line was lost and came back."""
        return self._link.reconnects

    @property
    def statistics(self) -> Mapping[int, Statistics]:
        """By node number: received, lost, late, corrupt, out of order, duplicate."""
        return dict((self._can if self._is_can else self._serial).statistics)

    @property
    def unread_n(self) -> int:
        """Samples that came and went before a slow iterator, of those running now, had read them."""
        return sum(s.unread_n for s in list(self._subscriptions))

    def sync(self) -> None:
        """Send a SYNC: fingers set to it answer with their newest sample. Raises LinkDown."""
        if isinstance(self._link, CanLink):
            self._link.send(self._ids.sync, b"")
        else:
            self._link.write(_serial_frame("SYNC", b""))

    def nmt(self, command: int, node: int = 0) -> None:
        """Send an NMT command (1 start, 2 stop, 128 pre-operational, 129 reset) to a finger, or to all."""
        if isinstance(self._link, CanLink):
            self._link.send(self._ids.nmt, bytes((command, node)))
        else:
            self._link.write(_serial_frame("NMT", bytes((command,))))

    def close(self) -> None:
        """Let go of the link; iterators end."""
        self._link.close()
        for subscription in list(self._subscriptions):
            subscription.put(end=True)

    def __enter__(self) -> Connection:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    # ---- the link's thread ------------------------------------------------------------------------

    def _receive(self, data: Any, arrival_s: float) -> None:
        _tell(self._raw, data, arrival_s)
        try:
            if self._is_can:
                if data.is_extended_id:
                    return
                events = self._can.receive(data.arbitration_id, data.data, arrival_s)
            else:
                events = self._serial.receive(data, arrival_s)
        except VersionMismatch as error:
            self._mismatch(error)
            return
        for event in events:
            self._handle(event)

    def _handle(self, event: Event) -> None:
        finger = self._known(event.node)
        if isinstance(event, DecodedSample):
            self._deliver(finger, event)
        elif isinstance(event, SdoFrame) and isinstance(finger.objects, SdoObjects):
            finger.objects.answer(event.data)
        elif isinstance(event, ObjectAnswer) and isinstance(finger.objects, SerialObjects):
            finger.objects.answer(event.counter, event.reply)
        elif isinstance(event, Heartbeat):
            finger.state_nmt = event.state
            if event.state == 0:  # boot-up: what was wrong before is forgotten
                finger.faults.clear()
        elif isinstance(event, Emergency):
            finger.take_emergency(event)
        elif isinstance(event, DetailFrame):
            _tell(self._on_detail, event)

    def _deliver(self, finger: Finger, event: DecodedSample) -> None:
        state = event.state
        latency_us = state.latency_us if state.latency_us == state.latency_us else 0.0
        finger.clock.observe(round(state.capture_time_us + latency_us), event.arrival_s)
        taken = finger.clock.to_host(state.capture_time_us)
        assert taken is not None  # it was just observed
        sample = Sample(event.node, state, taken.time_s, taken.error_s, event.arrival_s, event.lost_n)
        finger.newest, finger.mismatch = sample, None
        for subscription in list(self._subscriptions):
            subscription.put(sample)
        for callback in list(self._callbacks):
            try:
                callback(sample)
            except Exception:
                log.exception("callback for finger %d", event.node)

    def _mismatch(self, error: VersionMismatch) -> None:
        for finger in self._fingers.values():
            if finger.statistics.foreign_n:
                finger.mismatch = error
        for node, statistics in self.statistics.items():
            if statistics.foreign_n:
                self._known(node).mismatch = error
        for subscription in list(self._subscriptions):
            subscription.put(error=error)
        log.error("%s: %s", self.address, error)

    def _known(self, node: int) -> Finger:
        finger = self._fingers.get(node)
        if finger is not None:
            return finger
        with self._changed:
            if node not in self._fingers:
                self._fingers[node] = Finger(node, self._objects(node), lambda: self._statistics_of(node))
                self._changed.notify_all()
            return self._fingers[node]

    def _statistics_of(self, node: int) -> Statistics:
        return self.statistics.get(node, Statistics())

    def _objects(self, node: int) -> ObjectClient:
        if not self._is_can:
            return SerialObjects(lambda frame: self._link.write(frame))
        try:
            request, response = self._ids.of(Kind.SDO_REQUEST, node), self._ids.of(Kind.SDO_RESPONSE, node)
        except ValueError as error:
            raise UsageError(str(error)) from None
        return SdoObjects(node, request, response, self._send_can)

    def _send_can(self, can_id: int, data: bytes) -> None:
        if not isinstance(self._link, CanLink):
            raise LinkDown(f"{self.address}: not a CAN bus")
        self._link.send(can_id, data)

    def _subscribe(self, wake: Callable[[], None] | None = None) -> Subscription:
        subscription = Subscription(wake)
        self._subscriptions.append(subscription)
        for finger in self._fingers.values():
            if finger.mismatch is not None:
                subscription.put(error=finger.mismatch)
        return subscription


def connect(address: str, *, ids: CanIds | None = None) -> Connection:
    """Open a bus or line: `can:can0`, `serial:/dev/ttyACM0?baud=921600`, ... (`hostlink.wire.address`).

    Raises ConnectError, one line: no such interface or port, or an address that makes no sense
    """
    try:
        return Connection(parse_address(address), ids)
    except AddressError as error:
        raise ConnectError(str(error)) from None


def _tell(callbacks: list[Any], *what: Any) -> None:
    """Call them all; one that fails is told no more, and the link's thread goes on."""
    for callback in list(callbacks):
        try:
            callback(*what)
        except Exception:
            log.exception("a callback failed and is not called any more")
            if callback in callbacks:  # it may have been removed meanwhile
                callbacks.remove(callback)


def _wake(loop: asyncio.AbstractEventLoop, news: asyncio.Event) -> None:
    if not loop.is_closed():
        loop.call_soon_threadsafe(news.set)


def _add(callbacks: list[Any], callback: Any) -> Callable[[], None]:
    callbacks.append(callback)

    def remove() -> None:
        if callback in callbacks:
            callbacks.remove(callback)

    return remove


def _serial_frame(kind: str, body: bytes) -> bytes:
    from hostlink.wire import Message, encode_frame, pack_message

    message = Message[kind]
    return encode_frame(message, pack_message(message, body, 0))
