"""CANopen's view of the classic frames: objects for what they carry, and the mapping of each TPDO.

Rules
- The mapping says what is sent, to the bit: E2E header, sample number, then the fields. TPDO3 and TPDO4 have
  pages, for which CANopen has no mapping: there it shows the page and its 40 bits. WIRE.md and the DBC take
  them apart; or the values are read by SDO, where all of them are.
- Some masters read an entry that begins within a byte by the object's own type, from that byte on. So a
  mapped object's type is wide enough for that, and no wider than the message.
- Values are whole numbers of the field's steps. One beyond its object's limits is not valid.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from hostlink.wire.e2e import P11_HEADER
from hostlink.wire.fields import CLASSIC_BITS, LAYOUT, PAGE_BITS, PARTS, SAMPLE_LOW_BITS, field_named

__all__ = ["FRAME_DATA", "MAPPING", "SAMPLE_DATA", "ProcessDatum"]

_MESSAGE_BITS: Final = 64
_HEADER: Final = (("pdo_crc", 8), ("pdo_counter", 4), ("pdo_version", 4), ("pdo_sample_low", SAMPLE_LOW_BITS))
_PAGED: Final = (("pdo_page", PAGE_BITS), ("pdo_page_data", _MESSAGE_BITS - 8 * P11_HEADER - 8))
_MEANINGS: Final = {
    "pdo_crc": "E2E profile 11C CRC-8",
    "pdo_counter": "E2E counter: counts samples",
    "pdo_version": "layout version modulo 16",
    "pdo_sample_low": "lower 5 bits of the sample number",
    "pdo_page": "which page this message is",
    "pdo_page_data": "the page's fields, low bits first",
    "pdo_sample_high": "upper 11 bits of the sample number",
    "pdo_part_n": "messages of this sample",
}


@dataclass(frozen=True, slots=True)
class ProcessDatum:
    """One object. low and high are the limits of valid values; `scale` is a step in `unit`."""

    name: str
    type: str
    low: int
    high: int
    scale: float
    unit: str
    meaning: str


def _entries(tpdo: int) -> tuple[tuple[str, int], ...]:
    """Name and bits of what the message holds, in order."""
    part = next(part for part in PARTS if part.tpdo == tpdo)
    if part.page is not None:
        return (*_HEADER, *_PAGED)
    fields = (
        (f"pdo_{name}", CLASSIC_BITS[name]) if name in CLASSIC_BITS else (name, field_named(name).bits)
        for name in part.fields
    )
    return (*_HEADER, *fields)


#: TPDO 1..4 -> its entries: name of the object, bits.
MAPPING: Final = {tpdo: _entries(tpdo) for tpdo in range(1, 5)}


def _widths() -> dict[str, int]:
    """Bits that an object's type needs, of those that are mapped."""
    widths: dict[str, int] = {}
    for entries in MAPPING.values():
        at = 0
        for name, bits in entries:
            byte, within = divmod(at, 8)
            needed = next(width for width in (8, 16, 32, 40) if width >= within + bits)
            assert 8 * byte + needed <= _MESSAGE_BITS, name
            widths[name] = max(needed, widths.get(name, 0))
            at += bits
    return widths


_WIDTHS: Final = _widths()

#: Every field of a sample, in the order of LAYOUT.
SAMPLE_DATA: Final = tuple(
    ProcessDatum(
        f.name,
        f"{'integer' if f.signed else 'unsigned'}{max(8 * f.size, _WIDTHS.get(f.name, 0))}",
        f.raw_low,
        f.raw_high,
        f.scale or 1.0,
        f.unit,
        f.meaning,
    )
    for f in LAYOUT
)
#: These stand in messages alone: they are mapped, and have no value of their own.
FRAME_DATA: Final = tuple(
    ProcessDatum(name, f"unsigned{_WIDTHS[name]}", 0, (1 << bits) - 1, 1.0, "", _MEANINGS[name])
    for name, bits in dict(entry for entries in MAPPING.values() for entry in entries).items()
    if name in _MEANINGS
)
