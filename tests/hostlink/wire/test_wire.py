"""The codec: state frame, classic parts, detail stream, objects, messages, identifiers, COBS."""

import dataclasses
from collections.abc import Callable
from contextlib import suppress
from math import inf, isnan, nan
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hostlink.wire as wire
from hostlink.wire import CanIds, Contact, CorruptFrame, Kind, Message, State, Status
from hostlink.wire.cobs import decode, encode
from hostlink.wire.detail import AREA_STEP, DISPLACEMENT_STEP_PX, PINS_MAX, PINS_PER_SEGMENT
from hostlink.wire.fields import (
    CHECK_SIZE,
    CLASSIC_BITS,
    CONTACTS_MAX,
    FIELDS,
    LAYOUT,
    PARTS,
    STATE_SIZE,
    VERSION,
)
from hostlink.wire.objects import GROUPS, TYPES
from tests.support.states import CONTACT_ROWS, MEASURED, any_state, expected, same
from tests.support.waiting import present


def test_the_tables_are_complete() -> None:
    names = [f.name for f in dataclasses.fields(State)]
    assert names == [*(f.name for f in FIELDS), "contacts"]
    assert 4 + sum(f.size for f in LAYOUT) + CHECK_SIZE == STATE_SIZE
    in_parts = [name for p in PARTS for name in p.fields if name not in CLASSIC_BITS]
    assert sorted(in_parts) == sorted(f.name for f in LAYOUT if f.name != "sample")
    assert {s.bit for s in wire.STATUS} == set(Status)
    assert [f.code for f in wire.FAULTS] == list(wire.FaultCode)
    assert len({f.emcy for f in wire.FAULTS}) == len(wire.FAULTS)
    assert all(f.register & 1 for f in wire.FAULTS)


@pytest.mark.parametrize("f", LAYOUT, ids=lambda f: f.name)
def test_ranges_fit_both_representations(f: wire.Field) -> None:
    for bits in (8 * f.size, f.bits):
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if f.signed else (0, (1 << bits) - 1)
        assert low <= f.raw_low <= f.raw_high <= high
        if not f.plain:
            assert not f.raw_low <= f.raw_nan(bits) <= f.raw_high, "NaN must lie outside of the range"


def test_objects_are_well_formed() -> None:
    for o in wire.OBJECTS:
        assert o.type in TYPES
        assert o.access in ("ro", "rw", "wo", "const")
        assert (o.index in GROUPS) or o.sub == 0
        if o.default is not None:
            assert wire.unpack_value(o, wire.pack_value(o, o.default)) == o.default
        rows = [x for x in wire.OBJECTS if x.index == o.index]
        if o.sub == 0 and o.name.endswith("_max_sub"):
            assert o.default == max(x.sub for x in rows)


def through_parts(state: State, counter: int) -> State:
    assembler = wire.Assembler()
    frames = wire.pack_parts(state, counter)
    results = [assembler.add(wire.unpack_part(tpdo, frame)) for tpdo, frame in frames]
    assert all(result is None for result in results[:-1])
    return present(results[-1])


@given(any_state, st.integers(0, 300))
@settings(max_examples=400)
def test_round_trip_within_the_resolution(state: State, counter: int) -> None:
    frame = wire.pack_state(state, counter)
    assert len(frame) == STATE_SIZE
    assert (frame[2], frame[3]) == (counter & 0xFF, VERSION)
    back = wire.unpack_state(frame)
    assert back.sample == state.sample & 0xFFFF
    assert back.capture_time_us == state.capture_time_us & 0xFFFF_FFFF
    assert back.status == state.status
    for f in MEASURED:
        value, tolerance = expected(f.name, getattr(state, f.name))
        assert getattr(back, f.name) == pytest.approx(value, abs=tolerance, nan_ok=True), f.name
    placed = [c for c in state.contacts if not isnan(c.x_mm) and not isnan(c.y_mm)]
    assert len(back.contacts) == len(placed)
    assert back.contact_n == min(14, max(state.contact_n, len(placed)))
    for sent, got in zip(placed, back.contacts, strict=True):
        for row, a, b in zip(CONTACT_ROWS, sent, got, strict=True):
            value, tolerance = expected(row.name, a)
            assert b == pytest.approx(value, abs=tolerance, nan_ok=True)


@given(any_state, st.integers(0, 300))
@settings(max_examples=400)
def test_recorded_messages_are_read_back_exactly(state: State, counter: int) -> None:
    once = wire.unpack_state(wire.pack_state(state, counter))
    assert same(wire.unpack_state(wire.pack_state(once, counter + 1)), once)
    assert same(through_parts(state, counter), once), "classic parts carry the same as the state frame"


def test_part_one_alone_is_enough_for_a_grasp() -> None:
    tpdo, frame = wire.pack_parts(State(sample=77, displacement_mm=1.5, shear_x_mm=-0.25), 3)[0]
    assert tpdo == 1
    part = wire.unpack_part(tpdo, frame)
    values = part.values()
    assert values["displacement_mm"] == 1.5
    assert values["shear_x_mm"] == -0.25
    assert isnan(values["shear_y_mm"])
    assert part.sample_low == 77 & 31
    assert frame[1] >> 4 == VERSION & 0xF


@given(any_state, any_state, st.integers(0, 300), st.data())
@settings(max_examples=150)
def test_parts_of_two_samples_never_mix(a: State, b: State, counter: int, data: st.DataObject) -> None:
    """Any interleaving and loss of two successive samples' parts gives a, b or nothing."""
    b = dataclasses.replace(b, sample=a.sample + 1)
    frames = [*wire.pack_parts(a, counter), *wire.pack_parts(b, counter + 1)]
    order = data.draw(st.permutations(range(len(frames))))
    whole = [wire.unpack_state(wire.pack_state(s, 0)) for s in (a, b)]
    assembler = wire.Assembler()
    for i in order[: data.draw(st.integers(0, len(frames)))]:
        got = assembler.add(wire.unpack_part(*frames[i]))
        assert got is None or any(same(got, w) for w in whole)


TPDO1, PART1 = wire.pack_parts(State(), 0)[0]
STATE = wire.pack_state(State(), 0)


@pytest.mark.parametrize(
    ("unpack", "arguments"),
    [
        (wire.unpack_state, (STATE[:-1],)),
        (wire.unpack_state, (STATE[:-1] + b"\x01",)),
        (wire.unpack_part, (3, bytes(7) + b"\xff")),
        (wire.unpack_part, (1, bytes(7))),
        (wire.unpack_part, (TPDO1 + 1, PART1)),
        (wire.unpack_value, (wire.object_named("divider"), b"\1")),
        (wire.unpack_value, (wire.object_named("serial_number"), b"\xff")),
        *((decode, (stuffed,)) for stuffed in (b"\x05\x11", b"\0", b"\x02\0", b"\xff\x01")),
    ],
)
def test_bytes_that_do_not_fit_are_refused(unpack: Callable[..., object], arguments: tuple[Any, ...]) -> None:
    with pytest.raises(CorruptFrame):
        unpack(*arguments)


def test_more_contacts_or_pins_than_fit_are_misuse() -> None:
    with pytest.raises(ValueError, match=f"at most {CONTACTS_MAX}"):
        State(contacts=(Contact(0, 0),) * (CONTACTS_MAX + 1))
    with pytest.raises(ValueError, match=str(PINS_MAX)):
        wire.pack_detail(0, [(0.0, 0.0, 0.0)] * (PINS_MAX + 1), 0)


_pin = st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 3)


@given(st.lists(_pin, max_size=60), st.integers(0, 1 << 20), st.integers(0, 300))
def test_detail_round_trip(rows: list[tuple[float, float, float]], sample: int, counter: int) -> None:
    segments = wire.pack_detail(sample, rows, counter)
    assert len(segments) == max(1, -(-len(rows) // PINS_PER_SEGMENT))
    assert {segment[3] for segment in segments} == {VERSION}
    assembler = wire.DetailAssembler()
    results = [assembler.add(wire.unpack_segment(segment)) for segment in segments]
    assert results[:-1] == [None] * (len(segments) - 1)
    detail = present(results[-1])
    assert detail.sample == sample & 0xFFFF
    assert len(detail.rows) == len(rows)
    steps = (DISPLACEMENT_STEP_PX, DISPLACEMENT_STEP_PX, AREA_STEP)
    tops = (8191, 8191, 127)
    for sent, got in zip(rows, detail.rows, strict=True):
        for a, b, step, top in zip(sent, got, steps, tops, strict=True):
            value = nan if isnan(a) else max(-top * step, min(top * step, a))
            assert b == pytest.approx(value, abs=step / 2 + 1e-9, nan_ok=True)


def test_detail_with_a_segment_missing_is_dropped_whole() -> None:
    assembler = wire.DetailAssembler()
    rows = [(1.0, 2.0, 0.5)] * 40
    first, second = wire.pack_detail(1, rows, 0), wire.pack_detail(2, rows, 4)
    got = [assembler.add(wire.unpack_segment(s)) for s in (*first[:1], *first[2:], *second)]
    assert [d.sample for d in got if d is not None] == [2]
    assert assembler.dropped_n == 1


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("rate_hz", 1001, ValueError),
        ("divider", 0, ValueError),
        ("divider", 1.5, TypeError),
        ("divider", True, TypeError),
        *(("divider", value, ValueError) for value in (inf, -inf, nan, 1e300, 10**400, -(10**400))),
        *(("rate_hz", value, ValueError) for value in (inf, -inf, nan, 1e300, 10**400, 1 << 127)),
        ("reboot", 10**400, ValueError),
        pytest.param("divider", 10**5000, ValueError, id="too long to print"),
        pytest.param("divider", "9" * 5000, TypeError, id="long text"),
        ("serial_number", 5, TypeError),
        ("calibration", "text", TypeError),
    ],
)
def test_wrong_object_values(name: str, value: object, error: type[Exception]) -> None:
    with pytest.raises(error, match=name) as raised:
        wire.pack_value(wire.object_named(name), value)  # type: ignore[arg-type]
    assert len(str(raised.value)) < 200
    assert "\n" not in str(raised.value)


@given(
    st.sampled_from(wire.Op), st.integers(0, 0xFFFF), st.integers(0, 255),
    st.integers(0, 0xFFFF_FFFF), st.integers(0, 0xFFFF_FFFF), st.binary(max_size=192),
)  # fmt: skip
def test_requests_and_replies_round_trip(
    op: wire.Op, index: int, sub: int, offset: int, total: int, data: bytes
) -> None:
    request = wire.ObjectRequest(op, index, sub, offset, total, data)
    assert wire.ObjectRequest.unpack(request.pack()) == request
    reply = wire.ObjectReply(index, sub, total, offset, total, data)
    payload = wire.pack_message(Message.REPLY, reply.pack(), 9)
    counter, body = wire.unpack_message(Message.REPLY, payload)
    assert (counter, wire.ObjectReply.unpack(body)) == (9, reply)
    assert payload[3] == VERSION
    with pytest.raises(CorruptFrame):
        wire.unpack_message(Message.REQUEST, payload)


@pytest.mark.generative
@given(st.binary(max_size=40))
def test_any_body_parses_or_is_refused(body: bytes) -> None:
    for unpack in (wire.ObjectRequest.unpack, wire.ObjectReply.unpack, wire.unpack_emergency):
        with suppress(CorruptFrame):
            unpack(body)


def test_identifiers() -> None:
    ids = CanIds()
    assert ids.state(5) == 0x185
    assert ids.kind_of(0x485) == (Kind.TPDO4, 5)
    assert ids.kind_of(0x080) is None
    assert ids.kind_of(0x081) == (Kind.EMERGENCY, 1)
    with pytest.raises(ValueError, match=r"1\.\.127"):
        ids.state(128)
    with pytest.raises(ValueError, match="0x201"):
        CanIds(tpdo1=0x200, tpdo2=0x200)
    moved = CanIds(tpdo1=0x200)
    assert moved.kind_of(0x205) == (Kind.TPDO1, 5)
    assert moved.kind_of(0x185) is None


# From the paper and the examples commonly given with it: long runs at and about the 254 limit.
COBS = [
    (b"", "01"),
    (b"\0", "0101"),
    (b"\0\0", "010101"),
    (b"\0\x11\0", "01021101"),
    (bytes.fromhex("11220033"), "0311220233"),
    (bytes.fromhex("11000000"), "0211010101"),
    (bytes(range(1, 255)), "ff" + bytes(range(1, 255)).hex()),
    (bytes(range(255)), "01ff" + bytes(range(1, 255)).hex()),
    (bytes(range(1, 256)), "ff" + bytes(range(1, 255)).hex() + "02ff"),
    (bytes(range(2, 256)) + b"\0", "ff" + bytes(range(2, 256)).hex() + "0101"),
    (bytes(range(3, 256)) + b"\0\1", "fe" + bytes(range(3, 256)).hex() + "0201"),
    (b"\1" * 508, "ff" + "01" * 254 + "ff" + "01" * 254),
]


@pytest.mark.parametrize(("plain", "stuffed"), COBS)
def test_cobs_as_published(plain: bytes, stuffed: str) -> None:
    assert encode(plain).hex() == stuffed
    assert decode(bytes.fromhex(stuffed)) == plain
