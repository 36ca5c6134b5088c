# cython: annotation_typing=False
"""The decoder: bytes or CAN frames in, events out. It does no I/O and reads no clock.

    CanDecoder.receive(can_id, data, arrival_s)  -> [Sample | DetailFrame | Heartbeat | SdoFrame | ...]
    SerialDecoder.receive(data, arrival_s)       -> [Sample | ... | ObjectAnswer]

Rules
- Noise on the wire is counted, never raised: `statistics[node]`. Misuse (wrong types, CAN data of 70
  bytes) raises TypeError or ValueError at once.
- A sample is delivered complete, once, and in order, or not at all. One that arrives after a newer one is
  old: it is counted and dropped, because a controller must not act on it.
- Losses are derived from the sender's counters: the E2E counter distinguishes lost samples from those that
  the divider skipped, the 16-bit sample number shows how often that counter wrapped. A silence longer
  than 32768 samples (2.3 minutes at 240 Hz) looks like a restart: RESTART_RUN samples are dropped, and the
  loss is not counted.
- The version before is decoded too. Another one raises VersionMismatch, once a node. Frames of another layout
  look like noise, but noise implies another data id in each frame (see `wire.e2e`) and another layout the
  same one again and again.
  Events decoded in the same call are given with the next call.
- A boot-up message restarts the sequence and the clock mapping, an announced clock step only the latter.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from math import inf, nan
from typing import Any, Final

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
from hostlink.order_and_time import (
    EVIDENCE_P5,
    EVIDENCE_P11,
    ClockMap,
    Evidence,
    LinkStatistics,
    SenderWatch,
    Sequence,
)
from hostlink.wire.body import body_in, received
from hostlink.wire.canid import CanIds, Kind
from hostlink.wire.detail import DetailAssembler, unpack_segment
from hostlink.wire.e2e import P11_COUNTERS, implied_id_p5, implied_id_p11
from hostlink.wire.errors import CorruptFrame, VersionMismatch
from hostlink.wire.fields import DATA_ID, DATA_ID_CLASSIC, HEADER_SIZE, OLDER, STATE_SIZE, VERSION
from hostlink.wire.parts import PART_SIZE, Assembler, tpdo_of, unpack_part
from hostlink.wire.serial import (
    FRAME_MAX,
    Message,
    ObjectReply,
    data_id_of,
    decode_frame,
    unpack_emergency,
    unpack_message,
)
from hostlink.wire.state import State, restore
from hostlink.wire.status import FaultCode, Status

__all__ = [
    "SERIAL_NODE",
    "CanDecoder",
    "DetailFrame",
    "Emergency",
    "Event",
    "Heartbeat",
    "LinkStatistics",
    "ObjectAnswer",
    "Sample",
    "SdoFrame",
    "SecondSender",
    "SerialDecoder",
]

SERIAL_NODE: Final = 1  # a line has no node numbers: number of the finger at its end
LATE_S: Final = 0.020  # default; five samples at 240 Hz
_CLOCK_STEP: Final = int(Status.CLOCK_STEP)
_SAMPLE, _STATUS, _TIME, _LATENCY = (
    vars(State)[name] for name in ("sample", "status", "capture_time_us", "latency_us")
)
_NO_TIME: Final = (nan, inf)  # of a sample whose arrival is not known
_State, _Sample, _Corrupt = State, Sample, CorruptFrame  # a name of another module is looked up each time
_OURS, _SIZE, _PART_SIZE, _AT = VERSION, STATE_SIZE, PART_SIZE, HEADER_SIZE - 1
_new: Final = tuple.__new__  # a named tuple's own constructor takes three times as long


class _Node:
    """State of the decoder for one node."""

    def __init__(self, node: int, late_s: float, bare: bool) -> None:
        self.node = node
        self._bare = bare
        self.statistics = LinkStatistics()
        self.sequence = Sequence(self.statistics)
        self.senders = SenderWatch()
        self.clock = ClockMap()
        self.parts = Assembler()
        self.segments = DetailAssembler()
        self.evidence_p5 = Evidence(EVIDENCE_P5)
        self.evidence_p11 = Evidence(EVIDENCE_P11)
        self.mismatch_raised = False
        self.second_sender_given = False
        self._late_s = late_s

    def can_frame(self, kind: Kind, tpdo: int, data: Any, arrival_s: float) -> list[Event]:
        """The events that this frame completes. Raises CorruptFrame.

        tpdo  number of the TPDO; 0: none
        data  bytes; of a state frame also a bytearray
        """
        is_part = len(data) == _PART_SIZE
        if tpdo and is_part:
            return self.part_frame(tpdo, data, arrival_s)
        if tpdo == 1:
            return self.state_frame(data, arrival_s)
        if tpdo == 4:
            return self.detail_segment(data, arrival_s)
        if kind is Kind.HEARTBEAT:
            return self.heartbeat(data, arrival_s)
        if kind is Kind.EMERGENCY:
            return self.emergency(data, arrival_s)
        if kind is Kind.SDO_RESPONSE and is_part:
            return [SdoFrame(self.node, data, arrival_s)]
        if kind is Kind.SDO_REQUEST:
            return [SdoFrame(self.node, data, arrival_s, request=True)] if is_part else []
        raise CorruptFrame(f"{kind.name} of {len(data)} bytes")

    def corrupt_can(self, kind: Kind, tpdo: int, data: bytes) -> VersionMismatch | None:
        """Counts a frame for which `can_frame` raised; the error to raise, where it shows another version."""
        if tpdo and len(data) == PART_SIZE:
            return self.corrupt_p11(tpdo, data)
        if tpdo:
            return self.corrupt_p5(data, data_id_of(Message.STATE if tpdo == 1 else Message.DETAIL))
        self.statistics.corrupt_n += 1
        return None

    # --- one method for each kind of payload, the same for CAN and serial; all raise CorruptFrame ---

    def state_frame(self, frame: bytes, arrival_s: float) -> list[Event]:
        body = body_in(frame)
        self.evidence_p5.clear()
        at = frame
        if at[_AT] != _OURS:
            return self._deliver(restore(body), None, at[2], 256, arrival_s)
        state = None if self._bare else received(_State, body)
        return self._deliver(state, body, at[2], 256, arrival_s)

    def part_frame(self, tpdo: int, frame: bytes, arrival_s: float) -> list[Event]:
        part = unpack_part(tpdo, frame)
        self.evidence_p11.clear()
        interleaved = self.parts.is_interleaved
        state = self.parts.add(part)
        self.statistics.stray_n = self.parts.stray_n
        if state is None:
            new = self.parts.is_interleaved and not interleaved
            return self._second_sender(arrival_s) if new else []
        return self._deliver(state, state.body, part.counter, P11_COUNTERS, arrival_s)

    def detail_segment(self, frame: bytes, arrival_s: float) -> list[Event]:
        segment = unpack_segment(frame)
        self.evidence_p5.clear()
        detail = self.segments.add(segment)
        self.statistics.detail_lost_n = self.segments.dropped_n
        if detail is None:
            return []
        self.statistics.detail_n += 1
        return [DetailFrame(self.node, detail, arrival_s)]

    def heartbeat(self, body: bytes, arrival_s: float) -> list[Event]:
        if len(body) != 1:
            raise CorruptFrame(f"heartbeat of {len(body)} bytes")
        state = body[0] & 0x7F  # CiA 301: bit 7 is the toggle of node guarding
        if state == 0:
            self.sequence.restart()
            self.senders.restart()
            self.clock.restart()
        return [Heartbeat(self.node, state, arrival_s)]

    def emergency(self, body: bytes, arrival_s: float) -> list[Event]:
        event = Emergency(self.node, *unpack_emergency(body), arrival_s)
        if event.emcy and event.fault == FaultCode.CLOCK_STEP:
            self.clock.restart()
        return [event]

    def corrupt_p5(self, frame: bytes, expected_id: int) -> VersionMismatch | None:
        """Counts a frame that failed; the error to raise, where it shows another version."""
        if len(frame) > HEADER_SIZE:
            version = frame[HEADER_SIZE - 1]
            data_id = implied_id_p5(frame) - (expected_id - DATA_ID) & 0xFFFF
            known = {(VERSION, DATA_ID), *((older.version, older.data_id) for older in OLDER.values())}
            if (version, data_id) not in known and self.evidence_p5.weigh(version, data_id, frame):
                return self._foreign(version, DATA_ID, data_id)
        self.statistics.corrupt_n += 1
        return None

    def corrupt_p11(self, tpdo: int, frame: bytes) -> VersionMismatch | None:
        """The same as `corrupt_p5`, only for TPDO1, whose data id does not depend on a page."""
        if tpdo == tpdo_of(0) and len(frame) == PART_SIZE:
            implied = implied_id_p11(frame)
            known = {DATA_ID_CLASSIC, *(older.data_id_classic for older in OLDER.values())}
            if implied not in known and self.evidence_p11.weigh(implied >> 8, implied, frame):
                return self._foreign(implied >> 8, DATA_ID_CLASSIC & 0xFF, implied & 0xFF)
        self.statistics.corrupt_n += 1
        return None

    def _foreign(self, version: int, our_id: int, their_id: int) -> VersionMismatch | None:
        self.statistics.foreign_n += 1
        if self.mismatch_raised:
            return None
        self.mismatch_raised = True
        return VersionMismatch(VERSION, version, our_id, their_id, self.node)

    def _deliver(
        self, state: State | None, body: bytes | None, counter: int, modulus: int, arrival_s: float
    ) -> list[Event]:
        """state  None: it is not made, see `CanDecoder`"""
        events: list[Any] = []
        if state is not None and body is None:  # an older version's, decoded at once
            sample, status, time_us = state.sample, int(state.status), state.capture_time_us
            latency_us = state.latency_us
        else:
            sample, status, time_us = _SAMPLE.raw(body), _STATUS.raw(body), _TIME.raw(body)
            latency_us = _LATENCY.value(body)
        if self.senders.see(sample, time_us):
            events = self._second_sender(arrival_s)
        lost_n = self.sequence.accept(sample, counter, modulus)
        if lost_n < 0:
            return events
        self.statistics.received_n += 1
        taken = self._host_time(status, time_us, latency_us, arrival_s)
        if state is None:
            events.append((self.node, body, taken[0], taken[1], arrival_s, lost_n))
        else:
            events.append(_new(_Sample, (self.node, state, taken[0], taken[1], arrival_s, lost_n)))
        return events

    def _host_time(
        self, status: int, time_us: int, latency_us: float, arrival_s: float
    ) -> tuple[float, float]:
        """Capture time and its error; counts a late sample."""
        if arrival_s != arrival_s:
            return _NO_TIME
        if status & _CLOCK_STEP:
            self.clock.restart()
        taken = self.clock.take(time_us, latency_us if latency_us == latency_us else 0.0, arrival_s)
        if self.clock.lateness_s > self._late_s:
            self.statistics.late_n += 1
        return taken

    def _second_sender(self, arrival_s: float) -> list[Event]:
        self.statistics.second_sender_n += 1
        if self.second_sender_given:
            return []
        self.second_sender_given = True
        return [SecondSender(self.node, arrival_s)]


class _Decoder:
    """Common to both decoders: nodes, statistics, and events held back by an error."""

    def __init__(self, late_s: float, bare: bool) -> None:
        self._bare = bare
        self._nodes: dict[tuple[Hashable, int], _Node] = {}
        self._late_s = late_s
        self._held: list[Event] = []

    @property
    def statistics(self) -> dict[int, LinkStatistics]:
        """Counts by node number, the sum of all channels; live objects where there is one."""
        total: dict[int, LinkStatistics] = {}
        for (_, number), node in list(self._nodes.items()):
            total[number] = total[number] + node.statistics if number in total else node.statistics
        return total

    def clock(self, node: int) -> ClockMap:
        """The mapping of this node's clock; for round trips. With several channels: of the first."""
        found = next((n for (_, number), n in list(self._nodes.items()) if number == node), None)
        return (found or self._node(node)).clock

    def _node(self, node: int, channel: Hashable = None) -> _Node:
        if (channel, node) not in self._nodes:
            self._nodes[channel, node] = _Node(node, self._late_s, self._bare)
        return self._nodes[channel, node]

    def _finish(self, events: list[Event], error: VersionMismatch | None) -> list[Event]:
        if error is not None:
            self._held += events
            raise error
        if self._held:
            events, self._held = self._held + events, []
        return events


class CanDecoder(_Decoder):
    """CAN frames of any number of nodes, FD and classic, in any mixture.

    ids        identifiers; must be those that the sensors use
    late_s     limit above which a sample counts as late
    bare       a sample of a state frame of this version comes as a plain tuple in the order of `Sample`, with
               the frame's body for its state: for tables
    unknown_n  frames with other identifiers
    """

    def __init__(self, ids: CanIds | None = None, *, late_s: float = LATE_S, bare: bool = False) -> None:
        super().__init__(late_s, bare)
        self.ids = ids or CanIds()
        self._table = self.ids.table
        self._ways: dict[Hashable, dict[int, tuple[_Node, Kind, int]]] = {}  # those that frames came on
        self._alone: dict[int, tuple[_Node, Kind, int]] = {}  # those without a channel
        self.unknown_n = 0

    def receive(
        self, can_id: int, data: bytes | bytearray, arrival_s: float = nan, channel: Hashable = None
    ) -> list[Event]:
        """The events that this frame completes; mostly one or none.

        channel  the bus that it came on, if there are several: the same number on another is another finger
        Raises VersionMismatch: once a node; TypeError, ValueError: not a CAN frame
        """
        ways = self._alone if channel is None else self._ways.setdefault(channel, {})
        way = ways.get(can_id)
        size = len(data)
        if way is None or size > _SIZE:
            if not 0 <= can_id < 1 << 29 or len(data) > STATE_SIZE:
                raise ValueError(f"no CAN frame: id 0x{can_id:X} with {len(data)} bytes")
            found = self._table.get(can_id)
            if found is None:
                self.unknown_n += 1
                return self._finish([], None)
            kind, number = found
            way = ways[can_id] = (self._node(number, channel), kind, _TPDO.get(kind, 0))
        node, kind, tpdo = way
        if type(data) is not bytes and not (tpdo == 1 and size == _SIZE and type(data) is bytearray):
            data = bytes(data)
        error: VersionMismatch | None = None
        events: list[Event] = []
        try:
            events = node.can_frame(kind, tpdo, data, arrival_s)
        except _Corrupt:
            error = node.corrupt_can(kind, tpdo, bytes(data))
        if error is None and not self._held:
            return events
        return self._finish(events, error)

    def receive_run(
        self,
        times_s: list[float],
        ids: list[int],
        channels: list[str | int],
        data: bytes,
        wanted: list[bool] | None = None,
    ) -> list[Event]:
        """The events of many frames of 64 bytes, in order; of those that are wanted, None: of all."""
        events: list[Event] = []
        for i in range(len(ids)):
            if wanted is None or wanted[i]:
                at = i * STATE_SIZE
                events += self.receive(ids[i], data[at : at + STATE_SIZE], times_s[i], channels[i])
        return events

    @property
    def is_on_several(self) -> bool:
        """Whether a finger's samples came on several channels."""
        found = [number for (_, number), node in self._nodes.items() if node.statistics.received_n]
        return len(found) > len(set(found))


_TPDO: Final = {Kind.TPDO1: 1, Kind.TPDO2: 2, Kind.TPDO3: 3, Kind.TPDO4: 4}


class SerialDecoder(_Decoder):
    """The bytes of one serial line, in chunks of any size.

    node  node number of the events: a line has no node numbers
    """

    def __init__(self, node: int = SERIAL_NODE, *, late_s: float = LATE_S) -> None:
        super().__init__(late_s, False)
        self._number = node
        self._block = bytearray()
        self._skipping = False  # a block became longer than any frame: wait for its end
        self._in_step = False  # a separator was seen: data before the first one are half a frame

    def receive(self, data: bytes | bytearray, arrival_s: float = nan) -> list[Event]:
        """The events that these bytes complete.

        Raises VersionMismatch: once; TypeError: not bytes
        """
        events: list[Event] = []
        error: VersionMismatch | None = None
        head, *rest = bytes(memoryview(data)).split(b"\0")
        self._grow(head)
        for piece in rest:
            block, self._block = bytes(self._block), bytearray()
            skipped, self._skipping = self._skipping, False
            if block and not skipped:
                found, mismatch = self._frame(block, arrival_s)
                events += found
                error = error or mismatch
            self._in_step = True
            self._grow(piece)
        return self._finish(events, error)

    def _grow(self, piece: bytes) -> None:
        if self._skipping:
            return
        self._block += piece
        if len(self._block) > FRAME_MAX:
            self._block.clear()
            self._skipping = True
            self._node(self._number).statistics.corrupt_n += 1

    def _frame(self, block: bytes, arrival_s: float) -> tuple[list[Event], VersionMismatch | None]:
        node = self._node(self._number)
        try:
            kind, payload = decode_frame(block)
        except CorruptFrame:
            node.statistics.corrupt_n += self._in_step
            return [], None
        try:
            handler = _HANDLERS.get(kind)
            if handler is None:
                raise CorruptFrame(f"serial frame of unknown type {kind}")
            return handler(node, payload, arrival_s), None
        except CorruptFrame:
            return [], node.corrupt_p5(payload, DATA_ID + kind)


def _answer(node: _Node, payload: bytes, arrival_s: float) -> list[Event]:
    counter, body = unpack_message(Message.REPLY, payload)
    return [ObjectAnswer(node.node, counter, ObjectReply.unpack(body), arrival_s)]


def _state(node: _Node, payload: bytes, arrival_s: float) -> list[Event]:
    return node.state_frame(payload, arrival_s)  # the method itself is a C function of another type


def _heartbeat(node: _Node, payload: bytes, arrival_s: float) -> list[Event]:
    return node.heartbeat(unpack_message(Message.HEARTBEAT, payload)[1], arrival_s)


def _emergency(node: _Node, payload: bytes, arrival_s: float) -> list[Event]:
    return node.emergency(unpack_message(Message.EMERGENCY, payload)[1], arrival_s)


_HANDLERS: Final[dict[int, Callable[[_Node, bytes, float], list[Event]]]] = {
    Message.STATE: _state,
    Message.DETAIL: _Node.detail_segment,
    Message.REPLY: _answer,
    Message.HEARTBEAT: _heartbeat,
    Message.EMERGENCY: _emergency,
}
