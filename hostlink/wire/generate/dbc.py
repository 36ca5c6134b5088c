"""DBC databases: signals named as the fields are, "invalid" as a value of its own, classic pages multiplexed.

One file holds all fingers of a bus, on CiA 301's identifiers. For people, status and fault registers are a
signal a bit; the C codec and WIRE.md have them as the one number that they are (`by_bit` false). `fd` and
`classic` give cantools' databases; `text` is the file, by cantools' own writer.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

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
from hostlink.wire.nmt import NmtState
from hostlink.wire.objects import object_named
from hostlink.wire.parts import PART_SIZE
from hostlink.wire.status import FAULTS, REGISTER_BITS, STATUS

__all__ = ["Sender", "classic", "classic_signals", "fd", "state_signals", "text"]

_PAGE: Final = "page"  # the multiplexer's name
_HOST: Final = "Host"
_ANYONE: Final = "Fingertip"
_CLASSIC_MEANING: Final = {
    "sample_high": "upper 11 bits of the sample number; the lower 5 are sample_low",
    "check": "low byte of the state frame's check: CRC-32 over version and fields as they lie there",
    "part_n": "number of messages of this sample; complete when so many came",
}
_FAULTS: Final = ((0, "none"), *((f.code.value, f.code.name.lower()) for f in FAULTS))
_EMCY: Final = ((0, "none"), *((f.emcy, f.code.name.lower()) for f in FAULTS))
_NMT: Final = tuple((state.value, state.name.lower()) for state in NmtState)
_NO_YES: Final = ((0, "no"), (1, "yes"))
_STATUS_BITS: Final = tuple((s.bit.name, f"{s.meaning}: {s.advice}") for s in STATUS)

Choices = tuple[tuple[int, str], ...]  # raw value, name


@dataclass(frozen=True, slots=True)
class Sender:
    """A finger on the bus.

    name     of its node in the file, and before the names of its messages; "": the messages' alone
    rate_hz  samples a second, for the cycle times; 0: there are none
    by_bit   status and fault registers are a signal a bit
    """

    node: int
    name: str = ""
    rate_hz: float = 0.0
    by_bit: bool = True

    @property
    def cycle_ms(self) -> int:
        return max(1, round(1000 / self.rate_hz)) if self.rate_hz else 0


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
        receivers=[_HOST],
        is_multiplexer=name == _PAGE,
        multiplexer_ids=None if page is None else [page],
        multiplexer_signal=None if page is None else _PAGE,
    )


def _field(name: str, start: int, bits: int, page: int | None = None, by_bit: bool = False) -> list[Signal]:
    """A field of the table; its NaN is named "invalid"."""
    f = field_named(name)
    if by_bit and name == "status":
        return _bits(name, start, _STATUS_BITS)
    signal = Signal(
        name,
        start,
        bits,
        is_signed=f.signed,
        conversion=_conversion(f.scale or 1, () if f.plain else ((f.raw_nan(bits), "invalid"),)),
        minimum=f.low,
        maximum=f.high,
        unit=f.unit or None,
        comment=f.meaning,
        receivers=[_HOST],
        multiplexer_ids=None if page is None else [page],
        multiplexer_signal=None if page is None else _PAGE,
    )
    return [signal]


def _bits(prefix: str, start: int, rows: Iterable[tuple[str | None, str]]) -> list[Signal]:
    """A signal for each bit that has a name, from bit 0 on."""
    return [
        _whole(f"{prefix}_{name.lower()}", start + i, 1, meaning, choices=_NO_YES)
        for i, (name, meaning) in enumerate(rows)
        if name
    ]


def _header_p5() -> list[Signal]:
    return [
        _whole("crc", 0, 16, "E2E profile 5 CRC-16 over the rest and the data id"),
        _whole("counter", 16, 8, "E2E counter"),
        _whole("version", 24, 8, f"layout version, {VERSION} here; check before use"),
    ]


def state_signals(by_bit: bool = False) -> list[Signal]:
    """Signals of the 64-byte state frame."""
    signals, at = _header_p5(), 32
    for f in LAYOUT:
        signals += _field(f.name, at, 8 * f.size, by_bit=by_bit)
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
                    receivers=[_HOST],
                )
            )
            at += bits
    return signals


def classic_signals(tpdo: int, by_bit: bool = False) -> list[Signal]:
    """Signals of the message on this TPDO, all pages."""
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
                signals += _field(name, at, bits, part.page, by_bit)
            at += bits
    return signals


def _emergency_signals(by_bit: bool) -> list[Signal]:
    register = [_whole("error_register", 16, 8, "CiA 301 object 0x1001")]
    status = [_whole("fault_status", 32, 16, "status bits at this time")]
    return [
        _whole("emcy", 0, 16, "CiA 301 emergency error code; 0: no fault any more", choices=_EMCY),
        *(_bits("error", 16, REGISTER_BITS) if by_bit else register),
        _whole("fault", 24, 8, "our fault code", choices=_FAULTS),
        *(_bits("status", 32, _STATUS_BITS) if by_bit else status),
    ]


_BUS_TYPE: Final = DbcAttributeDefinition("BusType", default_value="CAN", type_name="STRING")
_SEND_TYPE: Final = DbcAttributeDefinition(
    "GenMsgSendType", default_value="Cyclic", kind="BO_", type_name="ENUM", choices=["Cyclic", "Event"]
)
_EVENT: Final = DbcAttribute("1", _SEND_TYPE)


def _message(
    sender: Sender,
    name: str,
    can_id: int,
    signals: list[Signal],
    meaning: str,
    cycle_ms: int = 0,
    size: int = 8,
) -> Message:
    """cycle_ms  0: sent when something happens"""
    prefix = f"{sender.name}_" if sender.name else ""
    return Message(
        can_id,
        prefix + name,
        size,
        signals,
        comment=meaning,
        senders=[sender.name or _ANYONE],
        cycle_time=cycle_ms or None,
        dbc_specifics=DbcSpecifics(
            attributes=OrderedDict() if cycle_ms else OrderedDict(GenMsgSendType=_EVENT)
        ),
        is_fd=size > PART_SIZE,
    )


def _service_messages(sender: Sender) -> list[Message]:
    """The messages that a node sends on either bus."""
    ids, period = CanIds(), object_named("heartbeat_ms").default
    assert isinstance(period, int)  # the table has a number there
    heartbeat = [_whole("nmt_state", 0, 7, "CiA 301 NMT state", choices=_NMT)]
    return [
        _message(
            sender, "Emergency", ids.of(Kind.EMERGENCY, sender.node), _emergency_signals(sender.by_bit),
            "A fault has appeared or cleared.",
        ),
        _message(
            sender, "Heartbeat", ids.of(Kind.HEARTBEAT, sender.node), heartbeat,
            "The node is there; object heartbeat_ms sets the period.", period, 1,
        ),
    ]  # fmt: skip


def _database(messages: Iterable[Message], senders: Sequence[Sender], bus_type: str) -> Database:
    definitions: OrderedDict[str, Any] = OrderedDict(BusType=_BUS_TYPE, GenMsgSendType=_SEND_TYPE)
    nodes = [Node(s.name or _ANYONE, comment=f"Fingertip, CANopen node {s.node}.") for s in senders]
    return Database(
        [*messages],
        nodes=[*nodes, Node(_HOST)],
        dbc_specifics=DbcSpecifics(
            attributes=OrderedDict(BusType=DbcAttribute(bus_type, _BUS_TYPE)),
            attribute_definitions=definitions,
        ),
    )


def fd(senders: Sequence[Sender]) -> Database:
    """Fingers on a CAN FD bus."""
    ids, messages = CanIds(), []
    for s in senders:
        messages += [
            _message(
                s, "State", ids.state(s.node), state_signals(s.by_bit),
                "One sample. Check crc and version, then status; then take values that are not invalid.",
                s.cycle_ms, STATE_SIZE,
            ),
            _message(
                s, "Detail", ids.detail(s.node), _detail_signals(),
                "Every pin's motion, 12 pins a message, while object detail_divider is not 0.", 0, STATE_SIZE,
            ),
            *_service_messages(s),
        ]  # fmt: skip
    return _database(messages, senders, "CAN FD")


_PARTS: Final = (
    "Motion of the skin.",
    "Status, and how many messages this sample has.",
    "Pages: time, sigmas, force, area, tilt, torsion and slip, friction. 0 and 1 come with every sample.",
    "Pages: a contact each; sent while there is one.",
)


def classic(senders: Sequence[Sender]) -> Database:
    """Fingers on a classic CAN bus."""
    ids, messages = CanIds(), []
    for s in senders:
        for tpdo, meaning in enumerate(_PARTS, 1):
            always = any(part.always for part in PARTS if part.tpdo == tpdo)
            signals = classic_signals(tpdo, s.by_bit)
            period_ms = s.cycle_ms if always else 0
            messages.append(
                _message(s, f"Part{tpdo}", ids.tpdo(tpdo, s.node), signals, meaning, period_ms, PART_SIZE)
            )
        messages += _service_messages(s)
    return _database(messages, senders, "CAN")


def text(database: Database) -> str:
    """The DBC file."""
    return database.as_dbc_string(sort_signals=None, sort_attribute_signals=None).replace("\r\n", "\n")
