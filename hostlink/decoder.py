"""The decoder: bytes or CAN frames in, events out. It does no I/O and asks no clock.

    CanDecoder.receive(can_id, data, arrival_s)  -> [Sample | Detail.. | Heartbeat | Emergency | SdoFrame]
    SerialDecoder.receive(data, arrival_s)       -> [Sample | ... | ObjectAnswer]

Rules
- Noise on the wire is counted, never raised: `statistics[node]`. Misuse (wrong types, CAN data of 70
  bytes) raises TypeError or ValueError at once.
- A sample is delivered whole, once, and in order, or not at all. One that comes after a newer one is
  stale: it is counted and dropped, for a controller must not act on it.
- Loss is counted from the senders' counters: the E2E counter tells samples lost from samples that the
  divider left out, the 16-bit sample number tells how often that counter went round. A silence longer
  than 32768 samples (2.3 minutes at 240 Hz) looks like a restart: one sample is dropped, and the loss is
  not counted.
- Another version raises VersionMismatch, once a node. Frames of another layout look like noise, but noise
  implies another data id in each frame (see `wire.e2e`) and another layout the same one again and again.
  What was decoded beside it in the same call comes with the next call.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from hostlink.wire.canid import CanIds, Kind
from hostlink.wire.detail import Detail, DetailAssembler, unpack_segment
from hostlink.wire.e2e import P11_COUNTERS, implied_id_p5, implied_id_p11
from hostlink.wire.errors import CorruptFrame, VersionMismatch
from hostlink.wire.fields import DATA_ID, DATA_ID_CLASSIC, HEADER_SIZE, STATE_SIZE, VERSION
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
from hostlink.wire.state import State, unpack_state

__all__ = [
    "CanDecoder",
    "DetailFrame",
    "Emergency",
    "Event",
    "Heartbeat",
    "ObjectAnswer",
    "Sample",
    "SdoFrame",
    "SerialDecoder",
    "Statistics",
]

WINDOW: Final = 64  # samples; older ones are never asked for by a bus that reorders, so they are a restart
EVIDENCE_P5: Final = 3  # frames that imply one foreign data id: chance of noise doing that is 2**-48
EVIDENCE_P11: Final = 6  # of 12 bits each: 2**-60
DRIFT: Final = 200e-6  # of two crystals against each other, at worst
LATE_S: Final = 0.020  # default; five samples at 240 Hz


@dataclass(frozen=True, slots=True)
class Sample:
    """A sample of one fingertip.

    arrival_s  host's clock, as given to `receive`
    lost_n     samples lost between the one before and this
    """

    node: int
    state: State
    arrival_s: float
    lost_n: int = 0


@dataclass(frozen=True, slots=True)
class DetailFrame:
    """Every pin's motion of one sample."""

    node: int
    detail: Detail
    arrival_s: float


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """CiA 301 NMT state: 0 boot-up, 4 stopped, 5 operational, 127 pre-operational."""

    node: int
    state: int
    arrival_s: float


@dataclass(frozen=True, slots=True)
class Emergency:
    """A fault appeared (fault: its code in `wire.FAULTS`), or all are gone (emcy == fault == 0)."""

    node: int
    emcy: int
    register: int
    fault: int
    status: int
    arrival_s: float


@dataclass(frozen=True, slots=True)
class SdoFrame:
    """A response of the node's SDO server, for an SDO client such as `canopen`'s."""

    node: int
    data: bytes
    arrival_s: float


@dataclass(frozen=True, slots=True)
class ObjectAnswer:
    """Serial: the reply to the request with the same counter."""

    node: int
    counter: int
    reply: ObjectReply
    arrival_s: float


Event = Sample | DetailFrame | Heartbeat | Emergency | SdoFrame | ObjectAnswer


@dataclass(slots=True)
class Statistics:
    """What one node sent and what became of it.

    received_n      samples delivered
    lost_n          samples sent that never came, or came damaged
    corrupt_n       frames with a wrong CRC, length or content; serial: also blocks that are no frame
    duplicate_n     samples that came again; dropped
    out_of_order_n  samples that came after a newer one; dropped, and no longer counted as lost
    late_n          samples delivered, but later than the fastest by more than the limit
    restart_n       times the sample number began anew
    foreign_n       frames of another version
    stray_n         classic parts that belonged to no sample begun
    detail_n, detail_lost_n  detail frames delivered; begun and not completed
    """

    received_n: int = 0
    lost_n: int = 0
    corrupt_n: int = 0
    duplicate_n: int = 0
    out_of_order_n: int = 0
    late_n: int = 0
    restart_n: int = 0
    foreign_n: int = 0
    stray_n: int = 0
    detail_n: int = 0
    detail_lost_n: int = 0


class _Sequence:
    """Order of one node's samples: what is new, lost, old or a repetition."""

    def __init__(self, statistics: Statistics) -> None:
        self._statistics = statistics
        self._sample: int | None = None  # newest delivered
        self._counter = 0
        self._stride = 1  # sample numbers from one sent sample to the next: the sensor's divider
        self._seen = 0  # bit i: sample number newest - i was delivered
        self._restarted: int | None = None  # sample number that may begin a new sequence

    def accept(self, sample: int, counter: int, modulus: int) -> int | None:
        """Number of samples lost before this one, or None if it must not be delivered."""
        if self._sample is None:
            return self._begin(sample, counter)
        ahead = (sample - self._sample) & 0xFFFF
        if ahead == 0 or ahead > 0x8000:
            return self._old(sample, counter, (-ahead) & 0xFFFF)
        steps = (counter - self._counter) % modulus
        if steps == 0:
            steps = modulus
        steps += modulus * max(0, round((ahead / self._stride - steps) / modulus))
        steps = max(1, min(steps, ahead))
        if steps == 1:
            self._stride = ahead
        self._sample, self._counter, self._restarted = sample, counter, None
        self._seen = (self._seen << ahead | 1) & (1 << WINDOW) - 1
        self._statistics.lost_n += steps - 1
        return steps - 1

    def restart(self) -> None:
        """The node says that it begins anew."""
        self._sample = None

    def _begin(self, sample: int, counter: int) -> int:
        self._sample, self._counter, self._stride = sample, counter, 1
        self._seen, self._restarted = 1, None
        return 0

    def _old(self, sample: int, counter: int, age: int) -> int | None:
        """A repetition, a straggler, or the first samples after a restart that we did not see."""
        if age < WINDOW:
            if self._seen >> age & 1:
                self._statistics.duplicate_n += 1
            else:
                self._seen |= 1 << age
                self._statistics.out_of_order_n += 1
                self._statistics.lost_n = max(0, self._statistics.lost_n - 1)
            return None
        first, self._restarted = self._restarted, sample
        if first is not None and 0 < (sample - first) & 0xFFFF < WINDOW:
            self._statistics.restart_n += 1
            return self._begin(sample, counter)
        self._statistics.out_of_order_n += 1
        return None


class _Evidence:
    """Tells another version from noise: the same foreign data id implied by frame after frame."""

    def __init__(self, needed: int) -> None:
        self._needed = needed
        self._implied: tuple[int, int] | None = None  # version, data id
        self._frames: set[bytes] = set()

    def weigh(self, version: int, data_id: int, frame: bytes) -> bool:
        """Whether frames so far are proof. A repeated frame adds none."""
        if self._implied != (version, data_id):
            self._implied, self._frames = (version, data_id), set()
        if len(self._frames) < self._needed:
            self._frames.add(bytes(frame))
        return len(self._frames) >= self._needed

    def clear(self) -> None:
        """A frame of our own version came."""
        self._implied = None


class _Node:
    """State of the decoder for one node."""

    def __init__(self, node: int, late_s: float) -> None:
        self.node = node
        self.statistics = Statistics()
        self.sequence = _Sequence(self.statistics)
        self.parts = Assembler()
        self.segments = DetailAssembler()
        self.evidence_p5 = _Evidence(EVIDENCE_P5)
        self.evidence_p11 = _Evidence(EVIDENCE_P11)
        self.mismatch_raised = False
        self._late_s = late_s
        self._time_us: int | None = None
        self._time_s = 0.0  # capture time, unwrapped
        self._floor_s = 0.0  # smallest arrival minus capture so far

    # --- one method for each kind of payload, the same for CAN and serial; all raise CorruptFrame ---

    def state_frame(self, frame: bytes, arrival_s: float) -> list[Event]:
        state = unpack_state(frame)
        self.evidence_p5.clear()
        return self._deliver(state, frame[2], 256, arrival_s)

    def part_frame(self, tpdo: int, frame: bytes, arrival_s: float) -> list[Event]:
        part = unpack_part(tpdo, frame)
        self.evidence_p11.clear()
        state = self.parts.add(part)
        self.statistics.stray_n = self.parts.stray_n
        if state is None:
            return []
        return self._deliver(state, part.counter, P11_COUNTERS, arrival_s)

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
        return [Heartbeat(self.node, state, arrival_s)]

    def emergency(self, body: bytes, arrival_s: float) -> list[Event]:
        return [Emergency(self.node, *unpack_emergency(body), arrival_s)]

    def corrupt_p5(self, frame: bytes, expected_id: int) -> VersionMismatch | None:
        """Counts a frame that failed; the error to raise, where it shows another version."""
        if len(frame) > HEADER_SIZE:
            version = frame[HEADER_SIZE - 1]
            data_id = implied_id_p5(frame) - (expected_id - DATA_ID) & 0xFFFF
            if (version, data_id) != (VERSION, DATA_ID) and self.evidence_p5.weigh(version, data_id, frame):
                return self._foreign(version, DATA_ID, data_id)
        self.statistics.corrupt_n += 1
        return None

    def corrupt_p11(self, tpdo: int, frame: bytes) -> VersionMismatch | None:
        """As `corrupt_p5`; TPDO1 alone is asked, for its data id does not depend on a page."""
        if tpdo == tpdo_of(0) and len(frame) == PART_SIZE:
            implied = implied_id_p11(frame)
            if implied != DATA_ID_CLASSIC and self.evidence_p11.weigh(implied >> 8, implied, frame):
                return self._foreign(implied >> 8, DATA_ID_CLASSIC & 0xFF, implied & 0xFF)
        self.statistics.corrupt_n += 1
        return None

    def _foreign(self, version: int, our_id: int, their_id: int) -> VersionMismatch | None:
        self.statistics.foreign_n += 1
        if self.mismatch_raised:
            return None
        self.mismatch_raised = True
        return VersionMismatch(VERSION, version, our_id, their_id)

    def _deliver(self, state: State, counter: int, modulus: int, arrival_s: float) -> list[Event]:
        lost_n = self.sequence.accept(state.sample, counter, modulus)
        if lost_n is None:
            return []
        self.statistics.received_n += 1
        self._time(state.capture_time_us, arrival_s)
        return [Sample(self.node, state, arrival_s, lost_n)]

    def _time(self, time_us: int, arrival_s: float) -> None:
        """Counts a sample that took longer than the fastest one by more than the limit."""
        if self._time_us is None:
            self._time_us, self._time_s, self._floor_s = time_us, 0.0, arrival_s
            return
        passed_us = (time_us - self._time_us + 0x8000_0000 & 0xFFFF_FFFF) - 0x8000_0000
        self._time_us = time_us
        self._time_s += passed_us * 1e-6
        offset_s = arrival_s - self._time_s
        self._floor_s = min(self._floor_s + DRIFT * abs(passed_us) * 1e-6, offset_s)
        self.statistics.late_n += offset_s - self._floor_s > self._late_s


class _Decoder:
    """What both decoders share: nodes, statistics, and events held back by an error."""

    def __init__(self, late_s: float) -> None:
        self._nodes: dict[int, _Node] = {}
        self._late_s = late_s
        self._held: list[Event] = []

    @property
    def statistics(self) -> dict[int, Statistics]:
        """By node id; live objects."""
        return {node: state.statistics for node, state in self._nodes.items()}

    def _node(self, node: int) -> _Node:
        if node not in self._nodes:
            self._nodes[node] = _Node(node, self._late_s)
        return self._nodes[node]

    def _finish(self, events: list[Event], error: VersionMismatch | None) -> list[Event]:
        if error is not None:
            self._held += events
            raise error
        if self._held:
            events, self._held = self._held + events, []
        return events


class CanDecoder(_Decoder):
    """CAN frames of any number of nodes on one bus, FD and classic, in any mixture.

    ids        identifiers; must be those that the sensors use
    late_s     limit above which a sample counts as late
    unknown_n  frames with identifiers of others
    """

    def __init__(self, ids: CanIds | None = None, *, late_s: float = LATE_S) -> None:
        super().__init__(late_s)
        self._table = (ids or CanIds()).table
        self.unknown_n = 0

    def receive(self, can_id: int, data: bytes | bytearray, arrival_s: float = 0.0) -> list[Event]:
        """The events that this frame completes; mostly one or none.

        Raises VersionMismatch: once a node; TypeError, ValueError: not a CAN frame
        """
        if not 0 <= can_id < 1 << 29 or len(data) > STATE_SIZE:
            raise ValueError(f"no CAN frame: id 0x{can_id:X} with {len(data)} bytes")
        found = self._table.get(can_id)
        if found is None:
            self.unknown_n += 1
            return self._finish([], None)
        kind, number = found
        node = self._node(number)
        data = bytes(data)
        tpdo = _TPDO.get(kind)
        error: VersionMismatch | None = None
        events: list[Event] = []
        try:
            if tpdo is not None:
                if len(data) == PART_SIZE:
                    events = node.part_frame(tpdo, data, arrival_s)
                elif kind is Kind.TPDO1:
                    events = node.state_frame(data, arrival_s)
                elif kind is Kind.TPDO4:
                    events = node.detail_segment(data, arrival_s)
                else:
                    raise CorruptFrame(f"{kind.name} of {len(data)} bytes")
            elif kind is Kind.HEARTBEAT:
                events = node.heartbeat(data, arrival_s)
            elif kind is Kind.EMERGENCY:
                events = node.emergency(data, arrival_s)
            elif kind is Kind.SDO_RESPONSE:
                events = [SdoFrame(number, data, arrival_s)]
        except CorruptFrame:
            if tpdo is not None and len(data) == PART_SIZE:
                error = node.corrupt_p11(tpdo, data)
            elif tpdo is not None:
                message = Message.STATE if kind is Kind.TPDO1 else Message.DETAIL
                error = node.corrupt_p5(data, data_id_of(message))
            else:
                node.statistics.corrupt_n += 1
        return self._finish(events, error)


_TPDO: Final = {Kind.TPDO1: 1, Kind.TPDO2: 2, Kind.TPDO3: 3, Kind.TPDO4: 4}


class SerialDecoder(_Decoder):
    """The bytes of one serial line, in chunks of any size.

    node  number to put on the events: a line has no node ids
    """

    def __init__(self, node: int = 0, *, late_s: float = LATE_S) -> None:
        super().__init__(late_s)
        self._number = node
        self._block = bytearray()
        self._skipping = False  # a block grew beyond any frame: wait for its end
        self._in_step = False  # a separator was seen: what comes before the first is half a frame

    def receive(self, data: bytes | bytearray, arrival_s: float = 0.0) -> list[Event]:
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


def _heartbeat(node: _Node, payload: bytes, arrival_s: float) -> list[Event]:
    return node.heartbeat(unpack_message(Message.HEARTBEAT, payload)[1], arrival_s)


def _emergency(node: _Node, payload: bytes, arrival_s: float) -> list[Event]:
    return node.emergency(unpack_message(Message.EMERGENCY, payload)[1], arrival_s)


_HANDLERS: Final[dict[int, Callable[[_Node, bytes, float], list[Event]]]] = {
    Message.STATE: _Node.state_frame,
    Message.DETAIL: _Node.detail_segment,
    Message.REPLY: _answer,
    Message.HEARTBEAT: _heartbeat,
    Message.EMERGENCY: _emergency,
}
