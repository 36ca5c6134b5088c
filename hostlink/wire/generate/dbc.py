"""DBC databases: signals named as the fields are, "invalid" as a value of its own, classic pages multiplexed.

Identifiers are those of one node with CiA 301's bases; for another node add the difference, or generate
with `--node`. `fd` and `classic` give cantools' databases; `text` is the file, by cantools' own writer.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from cantools.database.can import Database, Message, Node, Signal
from cantools.database.can.formats.dbc import DbcSpecifics
from cantools.database.can.formats.dbc.dbc_attribute import DbcAttribute
from cantools.database.can.formats.dbc.dbc_attribute_definition import DbcAttributeDefinition
from cantools.database.conversion import BaseConversion

from hostlink.wire import detail
from hostlink.wire.canid import CanIds, Kind
from hostlink.wire.fields import (
    CLASSIC_BITS,
    LAYOUT,
    PAGE_BITS,
    PARTS,
    SAMPLE_LOW_BITS,
    STATE_SIZE,
    VERSION,
    field_named,
)
from hostlink.wire.parts import PART_SIZE
from hostlink.wire.status import FAULTS

__all__ = ["classic", "classic_signals", "fd", "state_signals", "text"]

_PAGE: Final = "page"  # the multiplexer's name
_CLASSIC_MEANING: Final = {
    "sample_high": "upper 11 bits of the sample number; the lower 5 are sample_low",
    "check": "low byte of the state frame's check: CRC-32 over version and fields as they lie there",
    "part_n": "number of messages of this sample; complete when so many came",
}
_FAULTS: Final = ((0, "none"), *((f.code.value, f.code.name.lower()) for f in FAULTS))
_NMT: Final = ((0, "boot_up"), (4, "stopped"), (5, "operational"), (127, "pre_operational"))

Choices = tuple[tuple[int, str], ...]  # raw value, name


def _conversion(scale: float = 1, choices: Choices = ()) -> BaseConversion:
    return BaseConversion.factory(scale, 0, OrderedDict(choices) or None)


def _whole(
    name: str,
    start: int,
    bits: int,
    meaning: str,
    high: int = 0,
    low: int = 0,
    page: int | None = None,
    choices: Choices = (),
) -> Signal:
    """An unsigned number without a scale; `high` 0: all that the bits hold."""
    return Signal(
        name,
        start,
        bits,
        conversion=_conversion(choices=choices),
        minimum=low,
        maximum=high or (1 << bits) - 1,
        comment=meaning,
        receivers=["Host"],
        is_multiplexer=name == _PAGE,
        multiplexer_ids=None if page is None else [page],
        multiplexer_signal=None if page is None else _PAGE,
    )


def _field(name: str, start: int, bits: int, page: int | None = None) -> Signal:
    """A field of the table; its NaN is named "invalid"."""
    f = field_named(name)
    return Signal(
        name,
        start,
        bits,
        is_signed=f.signed,
        conversion=_conversion(f.scale or 1, () if f.plain else ((f.raw_nan(bits), "invalid"),)),
        minimum=f.low,
        maximum=f.high,
        unit=f.unit or None,
        comment=f.meaning,
        receivers=["Host"],
        multiplexer_ids=None if page is None else [page],
        multiplexer_signal=None if page is None else _PAGE,
    )


def _header_p5() -> list[Signal]:
    return [
        _whole("crc", 0, 16, "E2E profile 5 CRC-16 over the rest and the data id"),
        _whole("counter", 16, 8, "E2E counter"),
        _whole("version", 24, 8, f"layout version, {VERSION} here; check before use"),
    ]


def state_signals() -> list[Signal]:
    """Of the 64-byte state frame."""
    signals, at = _header_p5(), 32
    for f in LAYOUT:
        signals.append(_field(f.name, at, 8 * f.size))
        at += 8 * f.size
    return [*signals, _whole("check", at, 16, "low half of the CRC-32 over bytes 3..61")]


def _detail_signals() -> list[Signal]:
    signals = [
        *_header_p5(),
        _whole("sample", 32, 16, "sample number of the state it belongs to"),
        _whole("segment", 48, 8, "number of this segment; holds pins from 12 * segment on", high=254),
        _whole("segment_n", 56, 8, "segments of this sample", low=1),
        _whole("pin_n", 64, 16, "pins of this sample", high=detail.PINS_MAX),
    ]
    at = 80
    columns = (
        ("dx_px", detail.DISPLACEMENT_BITS, detail.DISPLACEMENT_STEP_PX, "px", "displacement along x"),
        ("dy_px", detail.DISPLACEMENT_BITS, detail.DISPLACEMENT_STEP_PX, "px", "displacement along y"),
        ("da", detail.AREA_BITS, detail.AREA_STEP, "", "relative change of the cell's area"),
    )
    for pin in range(detail.PINS_PER_SEGMENT):
        for name, bits, step, unit, meaning in columns:
            top = (1 << bits - 1) - 1
            signals.append(
                Signal(
                    f"pin{pin}_{name}",
                    at,
                    bits,
                    is_signed=True,
                    conversion=_conversion(step, ((-top - 1, "invalid"),)),
                    minimum=round(-top * step, 6),
                    maximum=round(top * step, 6),
                    unit=unit or None,
                    comment=meaning,
                    receivers=["Host"],
                )
            )
            at += bits
    return signals


def classic_signals(tpdo: int) -> list[Signal]:
    """Of the message on this TPDO, all pages."""
    behind = 16 + SAMPLE_LOW_BITS
    signals = [
        _whole("crc", 0, 8, "E2E profile 11C CRC-8 over the rest and the data id"),
        _whole("counter", 8, 4, "E2E counter: counts samples, the same in all their parts", high=14),
        _whole("version", 12, 4, "layout version modulo 16: nibble of the data id"),
        _whole("sample_low", 16, SAMPLE_LOW_BITS, "lower 5 bits of the sample number"),
    ]
    parts = [p for p in PARTS if p.tpdo == tpdo]
    if parts[0].page is not None:
        signals.append(_whole(_PAGE, behind, PAGE_BITS, "which page of this message"))
    for part in parts:
        at = behind + (0 if part.page is None else PAGE_BITS)
        for name in part.fields:
            if name in CLASSIC_BITS:
                bits = CLASSIC_BITS[name]
                signals.append(_whole(name, at, bits, _CLASSIC_MEANING[name], page=part.page))
            else:
                bits = field_named(name).bits
                signals.append(_field(name, at, bits, part.page))
            at += bits
    return signals


def _message(name: str, can_id: int, size: int, signals: list[Signal], is_fd: bool = False) -> Message:
    return Message(can_id, name, size, signals, senders=["Fingertip"], is_fd=is_fd)


def _database(messages: list[Message], ids: CanIds, node: int, bus_type: str) -> Database:
    emergency = [
        _whole("emcy", 0, 16, "CiA 301 emergency error code; 0: no fault any more"),
        _whole("error_register", 16, 8, "CiA 301 object 0x1001"),
        _whole("fault", 24, 8, "our fault code", choices=_FAULTS),
        _whole("fault_status", 32, 16, "status bits at this time"),
    ]
    heartbeat = _whole("nmt_state", 0, 7, "CiA 301 NMT state", choices=_NMT)
    definition = DbcAttributeDefinition("BusType", default_value="CAN", type_name="STRING")
    specifics = DbcSpecifics(
        attributes=OrderedDict(BusType=DbcAttribute(bus_type, definition)),
        attribute_definitions=OrderedDict(BusType=definition),
    )
    return Database(
        [
            *messages,
            _message("Emergency", ids.of(Kind.EMERGENCY, node), 8, emergency),
            _message("Heartbeat", ids.of(Kind.HEARTBEAT, node), 1, [heartbeat]),
        ],
        nodes=[Node("Fingertip"), Node("Host")],
        dbc_specifics=specifics,
    )


def fd(node: int) -> Database:
    """A node on a CAN FD bus."""
    ids = CanIds()
    state = _message("State", ids.state(node), STATE_SIZE, state_signals(), is_fd=True)
    pins = _message("Detail", ids.detail(node), STATE_SIZE, _detail_signals(), is_fd=True)
    return _database([state, pins], ids, node, "CAN FD")


def classic(node: int) -> Database:
    """A node on a classic CAN bus."""
    ids = CanIds()
    parts = [
        _message(f"Part{tpdo}", ids.tpdo(tpdo, node), PART_SIZE, classic_signals(tpdo))
        for tpdo in range(1, 5)
    ]
    return _database(parts, ids, node, "CAN")


def text(database: Database) -> str:
    """The DBC file."""
    return database.as_dbc_string(sort_signals=None, sort_attribute_signals=None).replace("\r\n", "\n")
