"""The detail stream: every pin's displacement and relative area change, for learning from raw data.

    SEGMENT, 64 bytes, little-endian; as many as the pins need, 12 pins in each

     0        2      3       4        6         7           8       10                        64
    +--------+------+-------+--------+---------+-----------+-------+--------------------------+
    | CRC-16 | cntr | versn | sample | segment | segments  | pins  | 12 x (dx 14, dy 14, da 8) |  profile 5
    +--------+------+-------+--------+---------+-----------+-------+--------------------------+

Rules
- Segment k holds pins 12 k .. 12 k + 11, row i is pin i; rows behind the last pin are NaN.
- 36 bits a pin, low bits first: dx, dy in steps of 0.02 px (range +-163 px), relative area change in
  steps of 0.01 (+-1.27). Finite values saturate; NaN (pin lost) is the most negative value.
- The counter counts segments sent on this link. A frame with a missing segment is dropped and counted.
  - Off by default, at a divided rate, and sent only when the bus has capacity: samples have priority.

Why px and not mm: it is raw touch, before any calibration. Why 0.02 px: a third of the centroids' noise,
and 12 pins fill the segment to the last bit (331 pins: 28 segments, 4.7 ms of a 1/5 Mbit/s bus).
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from math import nan
from typing import Final

from hostlink.wire.e2e import P5_HEADER, check_p5, protected_p5
from hostlink.wire.errors import CorruptFrame
from hostlink.wire.fields import HEADER_SIZE, OLDER, STATE_SIZE, VERSION
from hostlink.wire.serial import Message, data_id_of

__all__ = [
    "PINS_MAX",
    "PINS_PER_SEGMENT",
    "Detail",
    "DetailAssembler",
    "Segment",
    "pack_detail",
    "unpack_segment",
]

PINS_PER_SEGMENT: Final = 12
PINS_MAX: Final = 255 * PINS_PER_SEGMENT
DISPLACEMENT_STEP_PX: Final = 0.02
AREA_STEP: Final = 0.01
DISPLACEMENT_BITS: Final = 14
AREA_BITS: Final = 8

_HEAD: Final = struct.Struct("<HBBHBBH")
_ROWS_SIZE: Final = STATE_SIZE - _HEAD.size
# (step, bits) of dx, dy, da
_COLUMNS: Final = (
    (DISPLACEMENT_STEP_PX, DISPLACEMENT_BITS),
    (DISPLACEMENT_STEP_PX, DISPLACEMENT_BITS),
    (AREA_STEP, AREA_BITS),
)
_LOST: Final = (nan, nan, nan)

Row = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Detail:
    """Every pin of one sample: rows of (dx px, dy px, relative area change), NaN where lost."""

    sample: int
    rows: tuple[Row, ...]


@dataclass(frozen=True, slots=True)
class Segment:
    """One message of the stream."""

    counter: int
    sample: int
    index: int
    segment_n: int
    pin_n: int
    rows: tuple[Row, ...]


def _pack_rows(rows: Iterable[Row]) -> bytes:
    bits = shift = 0
    for row in rows:
        for value, (step, width) in zip(row, _COLUMNS, strict=True):
            top = (1 << width - 1) - 1
            raw = -top - 1 if value != value else round(max(-top, min(top, value / step)))
            bits |= (raw & 2 * top + 1) << shift
            shift += width
    return bits.to_bytes(_ROWS_SIZE, "little")


def _unpack_rows(data: bytes) -> Iterable[Row]:
    bits = int.from_bytes(data, "little")
    for _ in range(PINS_PER_SEGMENT):
        row = []
        for step, width in _COLUMNS:
            raw = bits & (1 << width) - 1
            raw -= (raw & 1 << width - 1) << 1
            row.append(nan if raw == -(1 << width - 1) else raw * step)
            bits >>= width
        yield (row[0], row[1], row[2])


def pack_detail(sample: int, rows: Iterable[Row], counter: int) -> tuple[bytes, ...]:
    """The segments of one sample's pins.

    sample   number of the state it belongs to; its low 16 bits are sent
    rows     pin i: (dx px, dy px, relative area change)
    counter  of segments sent so far on this link; the caller adds the number of segments returned
    Raises   ValueError: more pins than 255 segments hold
    """
    table = list(rows)
    if len(table) > PINS_MAX:
        raise ValueError(f"{len(table)} pins: the detail stream holds {PINS_MAX}")
    segment_n = max(1, -(-len(table) // PINS_PER_SEGMENT))
    padded = table + [_LOST] * (segment_n * PINS_PER_SEGMENT - len(table))
    segments = []
    for k in range(segment_n):
        head = _HEAD.pack(0, 0, VERSION, sample & 0xFFFF, k, segment_n, len(table))
        packed = _pack_rows(padded[k * PINS_PER_SEGMENT : (k + 1) * PINS_PER_SEGMENT])
        segments.append(protected_p5(head[P5_HEADER:] + packed, counter + k, data_id_of(Message.DETAIL)))
    return tuple(segments)


def unpack_segment(frame: bytes) -> Segment:
    """Raises CorruptFrame: length, CRC, or numbers that contradict each other."""
    if len(frame) != STATE_SIZE or not check_p5(frame, data_id_of(Message.DETAIL, frame[HEADER_SIZE - 1])):
        raise CorruptFrame("detail segment with a wrong length or CRC")
    _, counter, version, sample, index, segment_n, pin_n = _HEAD.unpack_from(frame)
    expected_n = max(1, -(-pin_n // PINS_PER_SEGMENT))
    if version not in (VERSION, *OLDER) or segment_n != expected_n or index >= segment_n:
        raise CorruptFrame("detail segment whose numbers contradict each other")
    return Segment(counter, sample, index, segment_n, pin_n, tuple(_unpack_rows(frame[_HEAD.size :])))


class DetailAssembler:
    """Puts segments together; a frame is delivered whole or not at all.

    dropped_n  frames begun but not completed
    """

    def __init__(self) -> None:
        self.dropped_n = 0
        self._rows: list[Row] = []
        self._last: Segment | None = None  # the last one of an incomplete frame

    def add(self, segment: Segment) -> Detail | None:
        """The frame that this segment completes, or None."""
        last = self._last
        if segment.index == 0:
            self.drop()
            self._rows = []
        elif last is None or (last.sample, last.pin_n, last.index + 1, last.counter + 1 & 0xFF) != (
            segment.sample,
            segment.pin_n,
            segment.index,
            segment.counter,
        ):
            self.drop()
            return None
        self._rows += segment.rows
        if segment.index + 1 < segment.segment_n:
            self._last = segment
            return None
        self._last = None
        return Detail(segment.sample, tuple(self._rows[: segment.pin_n]))

    def drop(self) -> None:
        """Forgets an incomplete frame, and counts it."""
        if self._last is not None:
            self._last = None
            self.dropped_n += 1
