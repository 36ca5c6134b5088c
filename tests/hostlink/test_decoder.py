"""The decoder: whole, bytewise, with garbage; bad media; other versions; statistics."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import isnan
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hostlink.wire as wire
from hostlink.decoder import (
    CanDecoder,
    DetailFrame,
    Emergency,
    Event,
    Heartbeat,
    LinkStatistics,
    ObjectAnswer,
    Sample,
    SdoFrame,
    SecondSender,
    SerialDecoder,
)
from hostlink.errors import VersionMismatch
from hostlink.order_and_time import RESTART_RUN
from hostlink.wire import CanIds, Kind, Message, State, encode_frame, pack_state
from hostlink.wire.e2e import protect_p11, protected_p5
from hostlink.wire.fields import DATA_ID, DATA_ID_CLASSIC, PARTS, STATE_SIZE, VERSION
from tests.support.bus import on_line, state_on_line
from tests.support.seeds import SEED
from tests.support.states import as_seen, mismatches, random_state, same

IDS = CanIds()
FRAMES = 10_000


@dataclass
class Ledger:
    """Samples sent, by number of sending; sample number = that modulo 65536.

    Every sample between the first and the last delivered is delivered, lost or out of order.
    """

    sent: list[State] = field(default_factory=list)
    delivered: list[int] = field(default_factory=list)

    def take(self, events: list[Event]) -> None:
        """Each sample must be one that was sent, whole, and newer than the one before."""
        for event in events:
            if not isinstance(event, Sample):
                continue
            last = self.delivered[-1] if self.delivered else -1
            number = last + 1 + (event.state.sample - last - 1 & 0xFFFF)
            assert number < len(self.sent), "a sample that was never sent"
            assert same(event.state, self.sent[number]), "a wrong sample"
            self.delivered.append(number)

    def balance(self, statistics: LinkStatistics) -> None:
        """Every loss is counted, exactly."""
        span = self.delivered[-1] - self.delivered[0] + 1
        assert statistics.received_n == len(self.delivered)
        assert statistics.restart_n == 0
        assert statistics.received_n + statistics.lost_n + statistics.out_of_order_n == span


def flip(data: bytes, positions: list[int]) -> bytes:
    whole = int.from_bytes(data, "little")
    for position in positions:
        whole ^= 1 << position
    return whole.to_bytes(len(data), "little")


def spots(rng: Random, size: int) -> list[int]:
    """1..8 different bit positions in this many bytes."""
    return rng.sample(range(8 * size), rng.randint(1, 8))


DETAIL = wire.pack_detail(3, [(1.0, -2.0, 0.5)] * 30, 0)
REPLY = wire.ObjectReply(0x2000, 3, data=b"VT-1")
SERIAL_CASES: list[tuple[bytes, type[Event]]] = [
    (state_on_line(State(sample=3, displacement_mm=1.0), 0), Sample),
    (b"".join(encode_frame(Message.DETAIL, segment) for segment in DETAIL), DetailFrame),
    (on_line(Message.HEARTBEAT, b"\x05", 0), Heartbeat),
    (on_line(Message.EMERGENCY, wire.pack_emergency(0x5001, 0x81, 1, 16), 0), Emergency),
    (on_line(Message.REPLY, REPLY.pack(), 42), ObjectAnswer),
]


@pytest.mark.parametrize(("data", "kind"), SERIAL_CASES, ids=lambda v: getattr(v, "__name__", ""))
@pytest.mark.parametrize("size", [1, 7, 10_000])
@pytest.mark.parametrize("before", [b"", b"half a frame", b"\0\x05\x01junk\0", b"\xff" * 1000])
def test_serial_whole_bytewise_and_with_garbage(
    data: bytes, kind: type[Event], size: int, before: bytes
) -> None:
    decoder = SerialDecoder(7)
    stream = before + data
    events = [e for i in range(0, len(stream), size) for e in decoder.receive(stream[i : i + size], 1.5)]
    assert [type(e) for e in events] == [kind]
    assert events[0].node == 7
    assert events[0].arrival_s == 1.5
    if isinstance(events[0], ObjectAnswer):
        assert (events[0].counter, events[0].reply) == (42, REPLY)
    trailing = decoder.receive(data[:-5], 2.0)
    assert len(trailing) == 0 if kind is not DetailFrame else True


def test_can_events() -> None:
    decoder = CanDecoder()
    state = State(sample=3, displacement_mm=1.0)
    (sample,) = decoder.receive(0x185, pack_state(state, 0), 1.5)
    assert isinstance(sample, Sample)
    assert (sample.node, sample.arrival_s, sample.lost_n) == (5, 1.5, 0)
    assert same(sample.state, as_seen(state))
    (part,) = (e for t, p in wire.pack_parts(state, 0) for e in decoder.receive(IDS.tpdo(t, 6), p))
    assert isinstance(part, Sample)
    assert isnan(part.host_time_s), "it is not known when it arrived"
    details = [e for s in DETAIL for e in decoder.receive(IDS.detail(5), s)]
    assert isinstance(details[0], DetailFrame)
    assert details[0].detail.rows == ((1.0, -2.0, 0.5),) * 30
    assert decoder.receive(0x705, b"\x7f", 2.0) == [Heartbeat(5, 127, 2.0)]
    emergency = decoder.receive(0x085, wire.pack_emergency(0x9001, 1, 7, 64), 2.0)
    assert emergency == [Emergency(5, 0x9001, 1, 7, 64, 2.0)]
    assert decoder.receive(0x585, bytes(8), 2.0) == [SdoFrame(5, bytes(8), 2.0)]
    assert decoder.receive(0x605, bytes(8), 2.0) == [SdoFrame(5, bytes(8), 2.0, request=True)]
    assert decoder.receive(0x080, b"") == []
    assert decoder.unknown_n == 1, "SYNC is not the sensor's"
    assert decoder.receive(0x705, b"") == []
    assert decoder.statistics[5].corrupt_n == 1


def test_misuse_raises() -> None:
    for can_id, data in ((0x181, bytes(65)), (-1, b"")):
        with pytest.raises(ValueError, match="no CAN frame"):
            CanDecoder().receive(can_id, data)


def deliver(decoder: CanDecoder, samples: list[tuple[int, int]]) -> list[int]:
    """Give the decoder (sample number, counter) pairs; returns the sample numbers delivered."""
    events = [e for s, c in samples for e in decoder.receive(0x181, pack_state(State(sample=s), c))]
    return [e.state.sample for e in events if isinstance(e, Sample)]


def test_loss_duplicates_and_order_are_counted() -> None:
    decoder = CanDecoder()
    got = deliver(decoder, [(10, 1), (11, 2), (14, 5), (14, 5), (13, 4), (13, 4), (15, 6)])
    assert got == [10, 11, 14, 15]
    s = decoder.statistics[1]
    assert (s.received_n, s.lost_n, s.duplicate_n, s.out_of_order_n) == (4, 1, 2, 1)


@given(st.lists(st.integers(1, 60_000), max_size=20), st.integers(0, 0xFFFF), st.sampled_from([1, 2, 5]))
def test_any_gaps_are_counted(gaps: list[int], first: int, stride: int) -> None:
    decoder, number = CanDecoder(), 1
    samples = [(first, 0), (first + stride, 1)]
    steps = [max(1, gap // stride) for gap in gaps]
    for step in steps:
        number += step
        samples.append((first + number * stride, number))
    deliver(decoder, samples)
    s = decoder.statistics[1]
    if all(step * stride <= 0x8000 for step in steps):
        assert s.received_n + s.lost_n == number + 1


def test_a_restart_that_the_node_reports_is_seen_at_once() -> None:
    decoder = CanDecoder()
    assert deliver(decoder, [(5000, 1)]) == [5000]
    decoder.receive(0x701, b"\0")
    assert deliver(decoder, [(0, 0), (1, 1)]) == [0, 1]


@pytest.mark.parametrize("divider", [1, 100])
def test_a_restart_is_seen_after_a_run_whatever_the_divider(divider: int) -> None:
    decoder = CanDecoder()
    deliver(decoder, [(30_000 + i, i) for i in range(10)])
    assert len(deliver(decoder, [(i * divider, i) for i in range(20)])) == 20 - RESTART_RUN + 1
    assert decoder.statistics[1].restart_n == 1


def test_old_frames_replayed_are_not_delivered() -> None:
    """A few old frames, right in all their checks, between new ones or after them."""
    decoder = CanDecoder()
    frames = [pack_state(State(sample=i, capture_time_us=i * 4167), i) for i in range(2000)]
    for frame in frames[:1500]:
        decoder.receive(0x181, frame)
    replayed = [decoder.receive(0x181, frame) for frame in frames[100:104]]
    assert replayed == [[]] * 4
    (after,) = decoder.receive(0x181, frames[1500])
    assert isinstance(after, Sample)
    assert after.state.sample == 1500
    for i in range(1501, 1600):  # each new one followed by two old ones, many times
        assert decoder.receive(0x181, frames[i]) != []
        for old in (frames[i - 1000], frames[i - 999]):
            assert not any(isinstance(e, Sample) for e in decoder.receive(0x181, old))
    assert decoder.statistics[1].second_sender_n > 50, "somebody else sends on this identifier"


def second_senders(decoder: CanDecoder, frames: list[tuple[int, bytes]]) -> list[SecondSender]:
    events = [e for can_id, data in frames for e in decoder.receive(can_id, data)]
    return [e for e in events if isinstance(e, SecondSender)]


@pytest.mark.parametrize("ahead", [0, 1, 10, 63, 500, 20_000, 40_000])
def test_two_senders_with_the_same_number_are_reported(ahead: int) -> None:
    """Two boards that were started together, and two that were not."""
    frames = []
    for i in range(300):
        first = State(sample=i, capture_time_us=5_000_000 + i * 4167)
        second = State(sample=i + ahead & 0xFFFF, capture_time_us=5_020_000 + i * 4170 + ahead * 4)
        frames += [(0x183, pack_state(state, i)) for state in (first, second)]
    decoder = CanDecoder()
    (reported,) = second_senders(decoder, frames)
    assert reported.node == 3
    assert isnan(reported.arrival_s)
    assert decoder.statistics[3].second_sender_n > 50


def test_two_classic_senders_whose_parts_mix_are_named() -> None:
    frames = []
    for i in range(20):
        ours = wire.pack_parts(State(sample=i, capture_time_us=i * 4167), i)
        theirs = wire.pack_parts(State(sample=i + 300, capture_time_us=i * 4167 + 900_000), i + 7)
        for pair in zip(ours, theirs, strict=True):
            frames += [(IDS.tpdo(tpdo, 4), part) for tpdo, part in pair]
    decoder = CanDecoder()
    assert len(second_senders(decoder, frames)) == 1


@pytest.mark.parametrize("boot_up", [True, False])
def test_restarts_stragglers_and_steps_of_the_clock_are_no_second_sender(boot_up: bool) -> None:
    rng, decoder = Random(9), CanDecoder()
    time_us = 0
    for _ in range(20):
        if boot_up:
            decoder.receive(0x701, b"\0")
        time_us = rng.randrange(1 << 32)
        frames = []
        for i in range(rng.randrange(80, 200)):
            time_us = time_us + 4167 & 0xFFFF_FFFF
            frames.append(pack_state(State(sample=i, capture_time_us=time_us), i))
        for i in range(0, len(frames) - 1, 10):
            frames[i], frames[i + 1] = frames[i + 1], frames[i]
        assert second_senders(decoder, [(0x181, frame) for frame in frames]) == []
    assert decoder.statistics[1].second_sender_n == 0


def test_late_samples_are_counted() -> None:
    decoder = CanDecoder(late_s=0.01)
    for i in range(100):
        delay_s = 0.05 if i == 50 else 0.001
        state = State(sample=i, capture_time_us=(1 << 32) - 100_000 + i * 4000)
        decoder.receive(0x181, pack_state(state, i), 1000 + i * 0.004 + delay_s)
    assert decoder.statistics[1].late_n == 1


def disturbed(
    rng: Random, ledger: Ledger, pack: Callable[[State, int], bytes], spoil: Callable[[bytes, bytes], bytes]
) -> Iterator[bytes]:
    """What arrives of so many samples: flipped, lost, repeated, late, cut off, or spoilt in the medium's way.

    `spoil` is given the frame and the one before it.
    """
    pool = [as_seen(random_state(rng, i)) for i in range(500)]
    waiting: list[bytes] = []
    previous = pack(State(), 0)
    for i in range(FRAMES):
        state = replace(pool[i % len(pool)], sample=i & 0xFFFF, capture_time_us=i * 4167 & 0xFFFF_FFFF)
        ledger.sent.append(state)
        frame = pack(state, i)
        queue = [frame]
        match rng.randrange(12):
            case 0 | 1:
                queue = [flip(frame, spots(rng, len(frame)))]
            case 2:
                queue = []
            case 3:
                queue = [frame, frame]
            case 4:
                waiting.append(frame)
                continue
            case 5:
                queue = [spoil(frame, previous)]
            case 6:
                queue = [frame[: rng.randrange(len(frame))]]
        yield from (*queue, *waiting)
        waiting.clear()
        previous = frame


def test_bad_serial_line() -> None:
    """Frames with flips, drops, repetitions, swaps and lost separators, in odd chunks."""
    rng, ledger, decoder = Random(1), Ledger(), SerialDecoder()
    stream = bytearray()
    for frame in disturbed(rng, ledger, state_on_line, lambda frame, _: frame.strip(b"\0")):
        stream += frame
        if len(stream) > rng.randrange(2000):
            ledger.take(decoder.receive(bytes(stream)))
            stream.clear()
    ledger.take(decoder.receive(bytes(stream) + b"\0"))
    statistics = decoder.statistics[1]
    ledger.balance(statistics)
    assert statistics.received_n > 0.5 * FRAMES
    assert min(statistics.corrupt_n, statistics.duplicate_n, statistics.out_of_order_n) > 0.03 * FRAMES


def test_bad_fd_memory() -> None:
    """State frames damaged *behind* CAN's own CRC, where the CRC-16 and the check at the end stand alone."""
    rng, ledger, decoder = Random(2), Ledger(), CanDecoder()

    def mix(frame: bytes, previous: bytes) -> bytes:
        cut = rng.randrange(1, STATE_SIZE)
        return previous[cut:] + frame[:cut]

    for data in disturbed(rng, ledger, pack_state, mix):
        ledger.take(decoder.receive(0x181, data))
    ledger.balance(decoder.statistics[1])
    assert decoder.statistics[1].received_n > 0.5 * FRAMES


def test_bad_classic_bus() -> None:
    """Classic parts that are lost (CAN's own CRC discards what is damaged), repeated and swapped."""
    rng, ledger, decoder = Random(3), Ledger(), CanDecoder()
    pool = [as_seen(random_state(rng, i)) for i in range(500)]
    late: list[tuple[int, bytes]] = []
    states_n = FRAMES // 10  # of 4 to 12 parts each
    for i in range(states_n):
        state = replace(pool[i % len(pool)], sample=i & 0xFFFF)
        ledger.sent.append(state)
        for part in wire.pack_parts(state, i):
            arrived = [part] * rng.choice([0, 0, 0, 2, *[1] * 56])
            if rng.random() < 1 / 60:
                late.append(part)
                continue
            for tpdo, data in (*arrived, *late):
                ledger.take(decoder.receive(IDS.tpdo(tpdo, 1), data))
            late.clear()
    ledger.balance(decoder.statistics[1])
    assert len(ledger.delivered) > 0.3 * states_n


def classic_part(index: int, counter: int, sample_low: int, payload: int) -> tuple[int, bytes]:
    """A part with a right CRC and any content."""
    part = PARTS[index]
    bits = sample_low | (part.page or 0) << 5 if part.page is not None else sample_low
    bits |= payload << (8 if part.page is not None else 5)
    frame = bytearray(2) + bytearray((bits & (1 << 48) - 1).to_bytes(6, "little"))
    protect_p11(frame, counter, DATA_ID_CLASSIC | index)
    return part.tpdo, bytes(frame)


@pytest.mark.generative
def test_any_valid_parts_in_any_order_are_samples_or_are_counted() -> None:
    """Right CRCs, any content: nothing is raised, and what is delivered has passed its check."""
    refused_n = 0
    for seed in range(4):
        rng, decoder = Random(4 * SEED + seed), CanDecoder()
        for _ in range(300):
            counter, low = rng.randrange(2), rng.randrange(2)
            for index in sorted(rng.sample(range(12), rng.randrange(1, 6))):
                tpdo, data = classic_part(index, counter, low, rng.getrandbits(48))
                if index == 1 and rng.random() < 0.8:  # a part_n that is soon reached
                    bits = int.from_bytes(data[2:], "little") & ~(0xF << 44) | rng.randrange(1, 6) << 44
                    frame = bytearray(data[:2] + bits.to_bytes(6, "little"))
                    protect_p11(frame, counter, DATA_ID_CLASSIC | 1)
                    data = bytes(frame)
                for event in decoder.receive(IDS.tpdo(tpdo, 1), data):
                    assert isinstance(event, Sample | SecondSender)
        refused_n += decoder.statistics[1].corrupt_n
    assert refused_n > 20, "samples were completed, and refused by their check"


def sent_at(decoder: CanDecoder, i: int, host_s: float, device_s: float, status: int = 0) -> Sample:
    time_us = round(device_s * 1e6) & 0xFFFF_FFFF
    state = State(sample=i, capture_time_us=time_us, latency_us=3000.0, status=wire.Status(status))
    (event,) = decoder.receive(0x181, pack_state(state, i), host_s + 0.0035)
    assert isinstance(event, Sample)
    return event


@pytest.mark.parametrize("how", ["boot-up", "status bit", "emergency"])
def test_announced_step_begins_the_clock_anew(how: str) -> None:
    """A step too small to be detected: 1 ms."""
    decoder = CanDecoder()
    for i in range(300):
        sample = sent_at(decoder, i, 1000 + i / 240, 77 + i / 240)
        assert abs(sample.host_time_s - (1000 + i / 240)) <= sample.host_error_s
    assert sample.host_error_s < 0.0011
    if how == "boot-up":
        decoder.receive(0x701, b"\0")
    elif how == "emergency":
        decoder.receive(0x081, wire.pack_emergency(0x6002, 1, wire.FaultCode.CLOCK_STEP, 0))
    status = wire.Status.CLOCK_STEP if how == "status bit" else 0
    sample = sent_at(decoder, 300, 1000 + 300 / 240, 77 + 300 / 240 - 0.001, int(status))
    assert decoder.clock(1).restarts == 1
    assert abs(sample.host_time_s - (1000 + 300 / 240)) <= sample.host_error_s


def foreign_state(counter: int, version: int, data_id: int, size: int = STATE_SIZE) -> bytes:
    return protected_p5(bytes((version,)) + Random(counter).randbytes(size)[4:], counter, data_id)


@pytest.mark.parametrize(("version", "size"), [(VERSION + 1, 64), (VERSION, 64), (VERSION + 3, 48), (1, 64)])
def test_another_version_raises_once_and_names_both(version: int, size: int) -> None:
    data_id = 0xBEEF
    frames = [foreign_state(i, version, data_id, size) for i in range(20)]
    on_can = mismatches(CanDecoder(), [(0x183, frame) for frame in frames])
    on_serial = mismatches(SerialDecoder(), [(encode_frame(Message.STATE, frame),) for frame in frames])
    for raised in (on_can, on_serial):
        assert len(raised) == 1
        assert (raised[0].ours, raised[0].theirs) == (VERSION, version)
        assert (raised[0].our_id, raised[0].their_id) == (DATA_ID, data_id)
        assert f" speaks wire version {version} " in str(raised[0])
        assert f"version {VERSION}" in str(raised[0])
    assert on_can[0].node == 3
    assert str(on_can[0]).startswith("finger 3 ")


def test_another_version_on_classic_can() -> None:
    frames = []
    for i in range(30):
        frame = bytearray(Random(i).randbytes(8))
        protect_p11(frame, i, (VERSION + 1) << 8 | 0xC0)
        frames.append((0x181, bytes(frame)))
    decoder = CanDecoder()
    (error,) = mismatches(decoder, frames)
    assert (error.ours, error.theirs) == (VERSION, VERSION + 1)
    assert (error.our_id, error.their_id) == (DATA_ID_CLASSIC & 0xFF, 0xC0)
    assert decoder.statistics[1].foreign_n > 20


def test_one_frame_with_a_foreign_version_byte_is_noise_however_often_it_is_repeated() -> None:
    """Right CRC-16, foreign version byte: two bytes of noise do that once in 65536 times."""
    frame = protected_p5(bytes((VERSION + 1,)) + pack_state(State(sample=5), 1)[4:], 1, DATA_ID)
    decoder = CanDecoder()
    assert mismatches(decoder, [(0x187, frame)] * 100) == []
    assert decoder.statistics[7].corrupt_n == 100
    with pytest.raises(wire.CorruptFrame):
        wire.unpack_state(frame)


def test_noise_is_not_another_version() -> None:
    rng, decoder = Random(5), CanDecoder()
    frame = pack_state(State(), 0)
    calls: list[tuple[object, ...]] = [(0x181, flip(frame, spots(rng, 64))) for _ in range(5000)]
    calls += [(0x181, flip(frame, [30]))] * 50  # the same damage again and again is no proof
    calls += [(0x182, Random(i).randbytes(8)) for i in range(5000)]
    assert mismatches(decoder, calls) == []


def test_events_beside_an_error_are_not_lost() -> None:
    decoder = SerialDecoder()
    good = [state_on_line(State(sample=i), i) for i in range(3)]
    bad = [foreign_state(i, VERSION + 1, 0x1111 + Message.REPLY, 30) for i in range(3)]
    with pytest.raises(VersionMismatch):
        decoder.receive(good[0] + b"".join(encode_frame(Message.REPLY, frame) for frame in bad) + good[1])
    assert [e.state.sample for e in decoder.receive(good[2]) if isinstance(e, Sample)] == [0, 1, 2]


#: A node sent parts of noise: a CRC of 8 bits is right by chance, which no decoder can notice (WIRE.md).
NOISY = 3
spots_and_masks = st.lists(st.tuples(st.integers(0, STATE_SIZE - 1), st.integers(0, 255)), max_size=2)
arrivals = st.one_of(
    st.tuples(st.sampled_from(["fd", "parts", "serial"]), st.integers(0, 3), spots_and_masks),
    st.tuples(st.just("can"), st.sampled_from(Kind), st.binary(max_size=64)),
    st.tuples(st.just("line"), st.just(0), st.binary(max_size=80)),
    st.tuples(st.just("message"), st.sampled_from(Message), st.binary(max_size=80)),
)


@pytest.mark.generative
@given(st.lists(arrivals, max_size=40))
@settings(max_examples=500)
def test_of_anything_that_arrives_only_samples_that_were_sent_are_delivered(script: list[Any]) -> None:
    """Samples, some damaged, between any bytes; what is damaged and holds its check counts as sent."""
    can, serial = CanDecoder(), SerialDecoder(1)
    sent, events, number = set[str](), list[Event](), 0
    for kind, what, data in script:
        with suppress(VersionMismatch):
            if kind == "can":
                events += can.receive(IDS.of(what, NOISY if len(data) == 8 else 1), data)
            elif kind == "line":
                events += serial.receive(data)
            elif kind == "message":
                events += serial.receive(encode_frame(what, data))
            else:
                number += what
                state = State(sample=number, displacement_mm=number / 100)
                frame = bytearray(pack_state(state, number))
                sent.add(repr(as_seen(state)))
                for at, mask in data:
                    frame[at] ^= mask
                with suppress(wire.CorruptFrame):
                    sent.add(repr(wire.unpack_state(bytes(frame))))
                if kind == "fd":
                    events += can.receive(0x181, bytes(frame))
                elif kind == "serial":
                    events += serial.receive(encode_frame(Message.STATE, bytes(frame)))
                else:
                    lost = dict(data)
                    for n, (tpdo, part) in enumerate(wire.pack_parts(state, number)):
                        events += can.receive(IDS.tpdo(tpdo, 2), part) if n not in lost else []
    samples = [event for event in events if isinstance(event, Sample) and event.node != NOISY]
    assert {repr(sample.state) for sample in samples} <= sent
