"""A sample on classic CAN: 4 to 12 messages of 8 bytes, and their reassembly.

    byte 0    1            2                     3 ...                       7
    +--------+-----+------+----------+----------+---------------------------+
    | CRC-8  | cntr| vers | sample   | page 3   | fields, low bits first    |   E2E profile 11C
    |        | 4   | 4    | low 5    | (or data)|                           |
    +--------+-----+------+----------+----------+---------------------------+

    TPDO1  displacement, shear x, shear y: with the status enough to control a grasp
    TPDO2  status, rest of the sample number, pins tracked, number of contacts, number of parts
    TPDO3  page 0 time, check; 1 sigmas, latency, temperature; 2 force, pressure; 3 area, orientation;
           4 tilt; 5 torsion, slip; 6 forces along the surface; 7 torque, friction, slip margin.
           Pages 0 and 1 always, the others when one of their values is valid
    TPDO4  page i: contact i, for each listed contact

Rules
- All parts of a sample carry the same counter: it counts samples, and each part (CAN id and page) is a
  protected message of its own, with its own data id.
- Parts are sent in the order of the table. The number of parts in TPDO2 shows when a sample is complete.
- `check`, the low byte of the state frame's, must fit the reassembled sample.
- Two samples never mix: the counter (modulo 15) and the 5 low bits of the sample number must agree in
  all parts, which together repeat after 480 samples; a new TPDO1 drops an incomplete sample; and parts
  are accepted in ascending order only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from hostlink.wire.e2e import P11_HEADER, check_p11, protect_p11
from hostlink.wire.errors import CorruptFrame
from hostlink.wire.fields import (
    CLASSIC_BITS,
    DATA_ID_CLASSIC,
    LAYOUT,
    OLDER,
    PAGE_BITS,
    PARTS,
    SAMPLE_LOW_BITS,
    SCHEMA,
    VERSION,
    Field,
    Part,
    Schema,
)
from hostlink.wire.state import State, check_of, quantise, restore

__all__ = ["PART_SIZE", "Assembler", "PartFrame", "pack_parts", "tpdo_of", "unpack_part"]

PART_SIZE: Final = 8
_PAYLOAD: Final = PART_SIZE - P11_HEADER
_LOW_MASK: Final = (1 << SAMPLE_LOW_BITS) - 1
_CHECK_MASK: Final = (1 << CLASSIC_BITS["check"]) - 1


@dataclass(frozen=True, slots=True)
class _Slot:
    """Where a field's bits lie in the 48 payload bits of a part.

    nan_wide, nan_narrow  raw NaN in the 64-byte frame and here; equal numbers where there is none
    """

    name: str
    shift: int
    mask: int
    sign: int  # 0, or the weight of the sign bit
    nan_wide: int | None
    nan_narrow: int | None


def _slots(part: Part, schema: Schema) -> tuple[_Slot, ...]:
    shift = SAMPLE_LOW_BITS + (0 if part.page is None else PAGE_BITS)
    slots = []
    for name in part.fields:
        field: Field | None = None if name in CLASSIC_BITS else schema.field_named(name)
        bits = CLASSIC_BITS[name] if field is None else field.bits
        measured = field is not None and not field.plain
        slots.append(
            _Slot(
                name,
                shift,
                (1 << bits) - 1,
                1 << bits - 1 if field is not None and field.signed else 0,
                field.raw_nan(8 * field.size) if field is not None and measured else None,
                field.raw_nan(bits) if field is not None and measured else None,
            )
        )
        shift += bits
    assert shift <= 8 * _PAYLOAD, part
    return tuple(slots)


_SLOTS: Final = {
    schema.version: tuple(_slots(part, schema) for part in schema.parts)
    for schema in (SCHEMA, *OLDER.values())
}
_BY_NIBBLE: Final = {schema.version & 0xF: schema for schema in OLDER.values()}
_PAGED: Final = {(p.tpdo, p.page): p for p in PARTS}
_UNPAGED: Final = {p.tpdo for p in PARTS if p.page is None}
_NAMES: Final = tuple(f.name for f in LAYOUT)
_ALWAYS: Final = sum(1 << p.index for p in PARTS if p.always)
_INTERLEAVED: Final = 3  # a bus that swaps two parts does so rarely
_NAN_WIDE: Final = {f.name: f.raw_nan(8 * f.size) for f in LAYOUT if not f.plain}


def tpdo_of(index: int) -> int:
    """Number 1..4 of the TPDO that carries the part with this index."""
    return PARTS[index].tpdo


def _pack(part: Part, raws: dict[str, int], counter: int) -> bytes:
    bits = raws["sample"] & _LOW_MASK | (part.page or 0) << SAMPLE_LOW_BITS
    for slot in _SLOTS[VERSION][part.index]:
        raw = raws[slot.name]
        if raw == slot.nan_wide and slot.nan_narrow is not None:
            raw = slot.nan_narrow
        bits |= (raw & slot.mask) << slot.shift
    frame = bytearray(bytes(P11_HEADER) + bits.to_bytes(_PAYLOAD, "little"))
    protect_p11(frame, counter, DATA_ID_CLASSIC | part.index)
    return bytes(frame)


def pack_parts(state: State, counter: int) -> tuple[tuple[int, bytes], ...]:
    """The classic messages of a sample, in the order to send them: (TPDO number 1..4, 8 bytes).

    counter  of samples due on this link, as in `pack_state`; taken modulo 15
    """
    values = quantise(state)
    raws = dict(zip(_NAMES, values, strict=True))
    chosen = [p for p in PARTS if p.always or any(raws[name] != _NAN_WIDE[name] for name in p.fields)]
    raws["sample_high"] = raws["sample"] >> SAMPLE_LOW_BITS
    raws["part_n"] = len(chosen)
    raws["check"] = check_of(SCHEMA.body.pack(VERSION, *values)) & _CHECK_MASK
    return tuple((part.tpdo, _pack(part, raws, counter)) for part in chosen)


@dataclass(frozen=True, slots=True)
class PartFrame:
    """One classic message, taken apart.

    part        its row in the table
    counter     0..14
    sample_low  low 5 bits of the sample number
    raws        raw values by name, NaN as in the 64-byte frame
    schema      the sender's
    """

    part: Part
    counter: int
    sample_low: int
    raws: dict[str, int]
    schema: Schema

    def values(self) -> dict[str, float]:
        """Physical values of its measured fields, NaN where invalid, without reassembly."""
        field = self.schema.field_named
        rows = ((name, field(name), raw) for name, raw in self.raws.items() if name not in CLASSIC_BITS)
        return {
            name: raw if f.plain else float("nan") if raw == f.raw_nan(8 * f.size) else raw * f.scale
            for name, f, raw in rows
        }


def unpack_part(tpdo: int, frame: bytes) -> PartFrame:
    """Decode one 8-byte message of TPDO 1..4.

    Raises CorruptFrame: length, page, CRC, nibble or counter is wrong
    """
    if len(frame) != PART_SIZE:
        raise CorruptFrame(f"classic part of {len(frame)} bytes instead of {PART_SIZE}")
    bits = int.from_bytes(frame[P11_HEADER:], "little")
    page = None if tpdo in _UNPAGED else bits >> SAMPLE_LOW_BITS & (1 << PAGE_BITS) - 1
    part = _PAGED.get((tpdo, page))
    schema = _BY_NIBBLE.get(frame[1] >> 4, SCHEMA)
    if part is None:
        raise CorruptFrame(f"TPDO{tpdo} with unknown page {page}")
    if not check_p11(frame, schema.data_id_classic | part.index):
        raise CorruptFrame(f"TPDO{tpdo} with a wrong CRC")
    raws = {}
    for slot in _SLOTS[schema.version][part.index]:
        raw = bits >> slot.shift & slot.mask
        raw -= (raw & slot.sign) << 1
        raws[slot.name] = slot.nan_wide if raw == slot.nan_narrow and slot.nan_wide is not None else raw
    return PartFrame(part, frame[1] & 0xF, bits & _LOW_MASK, raws, schema)


class Assembler:
    """Puts the parts of one node's samples together; never mixes two samples.

    dropped_n  samples begun but not completed
    stray_n    parts that belong to no sample in progress
    """

    def __init__(self) -> None:
        self.dropped_n = 0
        self.stray_n = 0
        self._raws: dict[str, int] = {}
        self._key: tuple[int, int, int] | None = (
            None  # version, counter, low bits of the sample; None: no sample begun
        )
        self._taken = 0  # bit i: part i
        self._dropped_key: tuple[int, int, int] | None = None
        self._interleaved_n = 0  # parts of a sample dropped for a newer one, since one was complete

    @property
    def is_interleaved(self) -> bool:
        """Whether parts of two samples alternate repeatedly, which shows two senders."""
        return self._interleaved_n >= _INTERLEAVED

    def add(self, frame: PartFrame) -> State | None:
        """The sample that this part completes, or None.

        Raises CorruptFrame: complete, but the parts do not fit together
        """
        key = (frame.schema.version, frame.counter, frame.sample_low)
        if frame.part.index == 0:
            self._dropped_key = self._key
            self.drop()
            self._raws = {f.name: f.raw_nan(8 * f.size) for f in frame.schema.layout if not f.plain}
            self._key, self._taken = key, 0
        elif key != self._key or self._taken >> frame.part.index:  # another sample's, or out of order
            self._interleaved_n += key == self._dropped_key
            self.drop()
            self.stray_n += 1
            return None
        self._taken |= 1 << frame.part.index
        self._raws.update(frame.raws)
        if self._taken.bit_count() != self._raws.get("part_n"):
            return None
        self._key = self._dropped_key = None
        self._interleaved_n = 0
        return self._state(frame.sample_low, frame.schema)

    def drop(self) -> None:
        """Drops an incomplete sample, and counts it."""
        if self._key is not None:
            self._key = None
            self.dropped_n += 1

    def _state(self, sample_low: int, schema: Schema) -> State:
        raws = self._raws
        if self._taken & _ALWAYS != _ALWAYS:
            raise CorruptFrame("classic sample that claims to be complete without parts that each sample has")
        raws["sample"] = raws["sample_high"] << SAMPLE_LOW_BITS | sample_low
        body = schema.body.pack(schema.version, *(raws[f.name] for f in schema.layout))
        if check_of(body) & _CHECK_MASK != raws["check"]:
            raise CorruptFrame("classic sample whose content does not fit its check")
        return restore(body)
