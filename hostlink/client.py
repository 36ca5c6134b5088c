"""Fingers on a link: live samples, and access to each finger.

    link thread -> decoder -> clock -> [latest, callbacks, every iterator's queue]

Rules
- One `Connection` is one bus or line with all the fingers on it. A finger exists once a message of it was
  received; `finger()` does not create one.
- The link never waits for a slow reader: each iterator has its own queue; when it is full the oldest sample
  is dropped, and `unread_n` counts.
- `latest` gives None rather than an old sample.
- A sensor of another version raises VersionMismatch where its samples are requested, and where all samples
  are requested while no other finger sends any. It is logged in any case.
- Neither a message nor a callback ends the link's thread: unexpected errors are counted, logged once, and
  skipped.
- Callbacks run in the link's thread. One that asks a finger, or waits for one, gets a UsageError at once.
- The link reconnects by itself; meanwhile there are no samples, and `up` is False.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from hostlink.decoder import SERIAL_NODE, CanDecoder, SerialDecoder
from hostlink.errors import ConnectError, LinkDown, LinkTimeout, UsageError, VersionMismatch, WireError
from hostlink.events import (
    DetailFrame,
    Emergency,
    Event,
    Heartbeat,
    ObjectAnswer,
    Sample,
    SdoFrame,
    SecondSender,
)
from hostlink.finger import STALE_S, Finger, Info
from hostlink.hand_file import HandFile, read_hand
from hostlink.link_guard import LinkGuard
from hostlink.links import CanLink, Link, open_link
from hostlink.objects import ObjectClient, SdoObjects, SerialObjects
from hostlink.order_and_time import ClockMap, LinkStatistics
from hostlink.subscription import End, Subscription
from hostlink.window import MEASURED, Window, WindowCollector
from hostlink.wire import CanIds, Kind
from hostlink.wire.address import Address, AddressError, parse_address
from hostlink.wire.nmt import NmtState

__all__ = ["Connection", "Finger", "Info", "Sample", "connect"]

log = logging.getLogger(__name__)

FINGER_S = 3.0  # default time to wait for a finger's first message


class Connection:
    """A bus or line with the fingers on it; a context manager and an iterator of samples.

    address  parsed; see `hostlink.wire.address`
    ids      bases of the CAN identifiers, if they were changed
    hand     what its fingers are called, and where they are mounted
    """

    def __init__(self, address: Address, ids: CanIds | None = None, hand: HandFile | None = None) -> None:
        self.address, self.hand = address, hand or HandFile()
        self._ids = ids or CanIds()
        self._changed = threading.Condition()
        self._fingers: dict[int, Finger] = {}  # those that sent what only a fingertip sends
        self._others: dict[int, Finger] = {}  # those heard or asked that have not: any CANopen device
        self._subscriptions: list[Subscription] = []
        self._callbacks: list[Callable[[Sample], None]] = []
        self._raw: list[Callable[[Any, float], None]] = []
        self._on_detail: list[Callable[[DetailFrame], None]] = []
        self._line_node = address.node or SERIAL_NODE
        self._can = CanDecoder(self._ids)
        self._serial = SerialDecoder(self._line_node)
        self._is_can = address.is_can
        self._clients: dict[int, SdoObjects | SerialObjects] = {}
        self._window: WindowCollector | None = None
        self._guard = LinkGuard(f"a callback of {address}")
        self._link: Link = open_link(address, self._receive)

    # ---- samples ----------------------------------------------------------------------------------

    @property
    def fingers(self) -> Mapping[int, Finger]:
        """The fingers heard so far, by node number."""
        return dict(self._fingers)

    @property
    def silent_nodes(self) -> Mapping[int, Finger]:
        """Nodes with a heartbeat and no sample, by number: fingers that are stopped, or other devices."""
        return {node: other for node, other in self._others.copy().items() if other.state_nmt is not None}

    def finger(self, node: int | str | None = None, timeout_s: float = FINGER_S) -> Finger:
        """A finger by node number, by its name in the hand's file, or the only one there is.

        Waits for its first message. If a given finger sends nothing (stopped, without a heartbeat), it is
        queried; with `timeout_s` 0 it neither waits nor queries.
        Raises LinkTimeout: it was not heard; UsageError: no such number or name, or several are there, none
               named
        """
        if node is None:
            return self._only_finger(timeout_s)
        node = self._node(node)
        if not self._is_can and node != self._line_node:
            raise UsageError(
                f"{self.address}: the finger on this line has number {self._line_node}; "
                f"?node={node} behind the address gives it another"
            )
        end_s = time.monotonic() + timeout_s
        if node not in self._fingers and timeout_s > 0:
            self._link.may_wait()
            self._ask(node)
        with self._changed:
            self._changed.wait_for(lambda: node in self._fingers, max(0.0, end_s - time.monotonic()))
            if node in self._fingers:
                return self._fingers[node]
        raise LinkTimeout(f"{self.address}: finger {node} was not heard; {self._who_is_there()}")

    def _node(self, which: int | str) -> int:
        return self.hand.node(which) if isinstance(which, str) else which

    def _ask(self, node: int) -> None:
        """Query a node without samples: an answer makes it a finger. Raises UsageError: no such number."""
        with suppress(
            LinkTimeout, LinkDown, WireError
        ):  # none may come, and other devices have no such object
            self._other(node).get("wire_version")
            self._sender(node)

    def _only_finger(self, timeout_s: float) -> Finger:
        end_s, asked = time.monotonic() + timeout_s, set[int]()

        def new() -> set[int]:
            return self.silent_nodes.keys() - asked

        while not self._fingers and (left_s := end_s - time.monotonic()) > 0:
            with self._changed:
                self._changed.wait_for(lambda: self._fingers or new(), left_s)
            for node in () if self._fingers else new():
                asked.add(node)
                self._ask(node)
        if len(self._fingers) == 1:
            return next(iter(self._fingers.values()))
        if self._fingers:
            raise UsageError(f"{self.address}: {self._who_is_there()}; name one")
        if not self._is_can:
            return self.finger(self._line_node, timeout_s)
        raise LinkTimeout(f"{self.address}: no finger was heard for {timeout_s:g} s")

    def _who_is_there(self) -> str:
        numbers = sorted(self._fingers)
        if not numbers:
            return "none is there"
        return f"finger{'s' * (len(numbers) > 1)} {', '.join(map(str, numbers))} heard"

    def latest(self, node: int | str | None = None, max_age_s: float | None = STALE_S) -> Sample | None:
        """The newest sample of a finger (or of any); None: there is none, or its `age_s` is over `max_age_s`.

        Raises VersionMismatch: that finger is of another version
        """
        if node is not None:
            finger = self._fingers.get(self._node(node))
            return None if finger is None else finger.latest(max_age_s)
        fingers = [f for f in list(self._fingers.values()) if f.mismatch is None]
        samples = [s for f in fingers if (s := f.latest(max_age_s)) is not None]
        if not samples and (error := self._mismatched()) is not None:
            raise error
        return max(samples, key=lambda s: s.host_time_s, default=None)

    def _mismatched(self) -> VersionMismatch | None:
        """The error of a finger of another version, if no other finger sends samples."""
        fingers = list(self._fingers.values())
        if any(f.mismatch is None and f.latest() is not None for f in fingers):
            return None
        return next((f.mismatch for f in fingers if f.mismatch is not None), None)

    def samples(self, timeout_s: float | None = None) -> Iterator[Sample]:
        """All fingers' samples from now on, until the connection is closed.

        timeout_s  longest wait for a sample; None: for ever
        Raises     LinkTimeout, VersionMismatch
        """
        self._link.may_wait()
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
        loop, arrived = asyncio.get_running_loop(), asyncio.Event()
        subscription = self._subscribe(lambda: _wake(loop, arrived))
        try:
            while True:
                sample = subscription.take()
                if sample is None:
                    await arrived.wait()
                    arrived.clear()
                else:
                    yield sample
        except End:
            return
        finally:
            self._subscriptions.remove(subscription)

    def window(self, names: Sequence[str] = MEASURED) -> Mapping[int, Window]:
        """All samples since the last call, and pins where they are sent, by finger: every one heard or named
        by the hand's file. The first call begins it. See `hostlink.window`.

        names   of the values
        Raises  UsageError: no such value, or NumPy is not installed; VersionMismatch: of another version
        """
        if self._window is None:
            self._window = WindowCollector(self)
        if (error := self._mismatched()) is not None:
            raise error
        nodes = {*self._fingers, *(mount.node for mount in self.hand.mounts)}
        return self._window.take(sorted(nodes), names)

    def on_sample(self, callback: Callable[[Sample], None]) -> Callable[[], None]:
        """Call this with every sample, from the link's thread; returns a function that ends it.

        It must not ask a finger: that raises UsageError. What it raises is logged, and the link goes on.
        While it runs nothing is received: behind one that takes long, samples come late, as `age_s` tells.
        """
        return _add(self._callbacks, callback)

    def on_detail(self, callback: Callable[[DetailFrame], None]) -> Callable[[], None]:
        """Call this with every frame of the detail stream, from the link's thread; removed if it fails."""
        return _add(self._on_detail, callback)

    def on_raw(self, callback: Callable[[Any, float], None]) -> Callable[[], None]:
        """Call this with all received data (can.Message or bytes) and the arrival time: for recorders.

        From the link's thread; removed if it fails.
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
    def unforeseen_n(self) -> int:
        """Unexpected errors of messages, drivers and callbacks; the first of each kind is logged."""
        return self._link.guard.unforeseen_n + self._guard.unforeseen_n

    @property
    def statistics(self) -> Mapping[int, LinkStatistics]:
        """Counts by node number: received, lost, late, corrupt, out of order, duplicate."""
        return dict((self._can if self._is_can else self._serial).statistics)

    @property
    def unread_n(self) -> int:
        """Samples dropped because an iterator that is still running was slow."""
        return sum(s.unread_n for s in list(self._subscriptions))

    def sync(self) -> None:
        """Send a SYNC: fingers configured for it send their newest sample. Raises LinkDown."""
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
        """Close the link; iterators end."""
        self._link.close()
        for subscription in list(self._subscriptions):
            subscription.put(end=True)

    def __enter__(self) -> Connection:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    # ---- the link's thread ------------------------------------------------------------------------

    def _receive(self, data: Any, arrival_s: float) -> None:
        self._call(self._raw, data, arrival_s)
        try:
            if self._is_can:
                # SocketCAN marks what other programs of this computer send so; our own does not come back.
                is_own = not data.is_rx and self.address.interface != "socketcan"
                if data.is_extended_id or is_own:
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
        # On a bus, any CANopen device has heartbeats, emergencies and SDO.
        anyone = self._is_can and isinstance(event, Heartbeat | Emergency | SdoFrame)
        finger = self._other(event.node) if anyone else self._sender(event.node)
        client = self._clients[event.node]
        if isinstance(event, Sample):
            self._deliver(finger, event)
        elif isinstance(event, SdoFrame) and isinstance(client, SdoObjects):
            (client.overhear if event.request else client.answer)(event.data)
        elif isinstance(event, ObjectAnswer) and isinstance(client, SerialObjects):
            client.answer(event.counter, event.reply)
        elif isinstance(event, Heartbeat):
            self._note_state(finger, event.state)
        elif isinstance(event, Emergency):
            finger.take_emergency(event)
        elif isinstance(event, DetailFrame):
            self._call(self._on_detail, event)
        elif isinstance(event, SecondSender):
            finger.second_sender = True
            log.warning(
                "%s: two senders use number %d; give each fingertip its own (?node=)",
                self.address,
                event.node,
            )

    def _note_state(self, finger: Finger, state: int) -> None:
        is_new, finger.state_nmt = finger.state_nmt is None, state
        if state == NmtState.BOOT_UP:  # earlier faults are cleared
            finger.faults.clear()
        if is_new:
            with self._changed:
                self._changed.notify_all()

    def _deliver(self, finger: Finger, sample: Sample) -> None:
        finger.newest, finger.mismatch = sample, None
        for subscription in list(self._subscriptions):
            subscription.put(sample)
        for callback in list(self._callbacks):
            self._guard.call(callback, sample)

    def _call(self, callbacks: list[Any], *what: Any) -> None:
        """Call all; one that fails is removed."""
        for callback in list(callbacks):
            if not self._guard.call(callback, *what) and callback in callbacks:  # removed meanwhile
                callbacks.remove(callback)

    def _mismatch(self, error: VersionMismatch) -> None:
        self._sender(error.node).mismatch = error
        log.error("%s: %s", self.address, error)
        if self._mismatched() is not None:
            for subscription in list(self._subscriptions):
                subscription.put(error=error)

    def _sender(self, node: int) -> Finger:
        """The finger that a message came from."""
        finger = self._fingers.get(node)
        if finger is not None:
            return finger
        with self._changed:
            finger = self._fingers.get(node) or self._others.pop(node, None) or self._make_finger(node)
            self._fingers[node] = finger
            self._changed.notify_all()
        return finger

    def _other(self, node: int) -> Finger:
        """A node that may be a finger. Raises UsageError: no such number."""
        with self._changed:
            known = self._fingers.get(node) or self._others.get(node)
            if known is None:
                known = self._others[node] = self._make_finger(node)
            return known

    def _make_finger(self, node: int) -> Finger:
        def statistics() -> LinkStatistics:
            return self.statistics.get(node, LinkStatistics())

        return Finger(self.hand.mount(node), self._objects(node), statistics, lambda: self._clock(node))

    def _clock(self, node: int) -> ClockMap:
        return (self._can if self._is_can else self._serial).clock(node)

    def _objects(self, node: int) -> ObjectClient:
        self._clients[node] = client = self._make_client(node)
        return _FromOutside(client, lambda: self._link.may_wait())

    def _make_client(self, node: int) -> SdoObjects | SerialObjects:
        if not self._is_can:
            return SerialObjects(lambda frame: self._link.write(frame))
        try:
            request, response = self._ids.of(Kind.SDO_REQUEST, node), self._ids.of(Kind.SDO_RESPONSE, node)
        except ValueError as error:
            raise UsageError(str(error)) from None
        echoes = self.address.interface == "udp_multicast"  # python-can's socket hears itself
        return SdoObjects(node, request, response, self._send_can, echoes)

    def _send_can(self, can_id: int, data: bytes) -> None:
        if not isinstance(self._link, CanLink):
            raise LinkDown(f"{self.address}: not a CAN bus")
        self._link.send(can_id, data)

    def _subscribe(self, wake: Callable[[], None] | None = None) -> Subscription:
        subscription = Subscription(wake)
        self._subscriptions.append(subscription)
        error = self._mismatched()
        if error is not None:
            subscription.put(error=error)
        return subscription


class _FromOutside:
    """Access to a node's objects that is refused in the link's own thread, where no answer would come.

    may_wait  raises UsageError in that thread
    """

    def __init__(self, client: ObjectClient, may_wait: Callable[[], None]) -> None:
        self._client, self._may_wait = client, may_wait

    def read(self, index: int, sub: int) -> bytes:
        self._may_wait()
        return self._client.read(index, sub)

    def write(self, index: int, sub: int, data: bytes) -> None:
        self._may_wait()
        self._client.write(index, sub, data)


def connect(
    address: str, *, ids: CanIds | None = None, hand: HandFile | Path | str | None = None
) -> Connection:
    """Open a bus or line: `can:can0`, `serial:/dev/ttyACM0?baud=921600`, ... (`hostlink.wire.address`).

    hand    what its fingers are called, or the file that says so (`hostlink.hand_file`)
    Raises  ConnectError, one line: no such interface or port, or an address that makes no sense;
            UsageError: the hand's file
    """
    named = read_hand(hand) if isinstance(hand, str | Path) else hand
    try:
        return Connection(parse_address(address), ids, named)
    except AddressError as error:
        raise ConnectError(str(error)) from None


def _wake(loop: asyncio.AbstractEventLoop, arrived: asyncio.Event) -> None:
    with suppress(RuntimeError):  # the loop was closed: there is no reader any more
        loop.call_soon_threadsafe(arrived.set)


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
