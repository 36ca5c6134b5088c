"""DBC files: signals named as the fields are, "invalid" as a value of its own, classic pages multiplexed.

Identifiers are those of one node with CiA 301's bases; for another node add the difference, or generate
with `--node`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

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

__all__ = ["Signal", "classic", "classic_signals", "fd", "state_signals"]

_CLASSIC_MEANING: Final = {
    "sample_high": "upper 11 bits of the sample number; the lower 5 are sample_low",
    "check": "low byte of the state frame's check: CRC-32 over version and fields as they lie there",
    "part_n": "number of messages of this sample; complete when so many came",
}


@dataclass(frozen=True, slots=True)
class Signal:
    """One signal of a message.

    start, bits   position, little-endian bit numbers
    nan           raw value that means "invalid", or None
    mux           "" plain, "M" multiplexer, "m3" present on page 3
    """

    name: str
    start: int
    bits: int
    signed: bool = False
    scale: float = 1
    low: float = 0
    high: float = 0
    unit: str = ""
    nan: int | None = None
    mux: str = ""
    meaning: str = ""
    choices: tuple[tuple[int, str], ...] = ()


def _field(name: str, start: int, bits: int, mux: str = "", label: str | None = None) -> Signal:
    f = field_named(name)
    return Signal(
        label or name, start, bits, f.signed, f.scale or 1, f.low, f.high, f.unit,
        None if f.plain else f.raw_nan(bits), mux, f.meaning,
    )  # fmt: skip


def _header_p5() -> list[Signal]:
    return [
        Signal("crc", 0, 16, high=0xFFFF, meaning="E2E profile 5 CRC-16 over the rest and the data id"),
        Signal("counter", 16, 8, high=0xFF, meaning="E2E counter"),
        Signal("version", 24, 8, high=0xFF, meaning=f"layout version, {VERSION} here; check before use"),
    ]


def state_signals() -> list[Signal]:
    """Of the 64-byte state frame."""
    signals, at = _header_p5(), 32
    for f in LAYOUT:
        signals.append(_field(f.name, at, 8 * f.size))
        at += 8 * f.size
    signals.append(Signal("check", at, 16, high=0xFFFF, meaning="low half of the CRC-32 over bytes 3..61"))
    return signals


def _detail_signals() -> list[Signal]:
    signals = [
        *_header_p5(),
        Signal("sample", 32, 16, high=0xFFFF, meaning="sample number of the state it belongs to"),
        Signal("segment", 48, 8, high=254, meaning="number of this segment; holds pins from 12 * segment on"),
        Signal("segment_n", 56, 8, low=1, high=255, meaning="segments of this sample"),
        Signal("pin_n", 64, 16, high=detail.PINS_MAX, meaning="pins of this sample"),
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
            nan = -top - 1
            signals.append(
                Signal(f"pin{pin}_{name}", at, bits, True, step, round(-top * step, 6), round(top * step, 6),
                       unit, nan, meaning=meaning)
            )  # fmt: skip
            at += bits
    return signals


def classic_signals(tpdo: int) -> list[Signal]:
    """Of the message on this TPDO, all pages."""
    signals = [
        Signal("crc", 0, 8, high=0xFF, meaning="E2E profile 11C CRC-8 over the rest and the data id"),
        Signal("counter", 8, 4, high=14, meaning="E2E counter: counts samples, the same in all their parts"),
        Signal("version", 12, 4, high=15, meaning="layout version modulo 16: nibble of the data id"),
        Signal("sample_low", 16, SAMPLE_LOW_BITS, high=31, meaning="lower 5 bits of the sample number"),
    ]
    for part in (p for p in PARTS if p.tpdo == tpdo):
        at = 16 + SAMPLE_LOW_BITS
        mux = ""
        if part.page is not None:
            if part.page == 0:
                signals.append(
                    Signal("page", at, PAGE_BITS, high=7, mux="M", meaning="which page of this message")
                )
            at += PAGE_BITS
            mux = f"m{part.page}"
        for name in part.fields:
            if name in CLASSIC_BITS:
                bits = CLASSIC_BITS[name]
                signals.append(
                    Signal(name, at, bits, high=(1 << bits) - 1, mux=mux, meaning=_CLASSIC_MEANING[name])
                )
            else:
                bits = field_named(name).bits
                signals.append(_field(name, at, bits, mux))
            at += bits
    return signals


def _emergency_signals() -> list[Signal]:
    faults = ((0, "none"), *((f.code.value, f.code.name.lower()) for f in FAULTS))
    return [
        Signal("emcy", 0, 16, high=0xFFFF, meaning="CiA 301 emergency error code; 0: no fault any more"),
        Signal("error_register", 16, 8, high=0xFF, meaning="CiA 301 object 0x1001"),
        Signal("fault", 24, 8, high=0xFF, meaning="our fault code", choices=faults),
        Signal("fault_status", 32, 16, high=0xFFFF, meaning="status bits at this time"),
    ]


_NMT: Final = ((0, "boot_up"), (4, "stopped"), (5, "operational"), (127, "pre_operational"))

Message = tuple[str, int, int, bool, list[Signal]]  # name, identifier, bytes, FD, signals


def _common(ids: CanIds, node: int) -> list[Message]:
    heartbeat = Signal("nmt_state", 0, 7, high=127, meaning="CiA 301 NMT state", choices=_NMT)
    return [
        ("Emergency", ids.of(Kind.EMERGENCY, node), 8, False, _emergency_signals()),
        ("Heartbeat", ids.of(Kind.HEARTBEAT, node), 1, False, [heartbeat]),
    ]


def _number(value: float) -> str:
    return f"{value:.10g}"


def _write(messages: list[Message]) -> str:
    lines = ['VERSION ""', "", "NS_ :", "", "BS_:", "", "BU_: Fingertip Host", ""]
    comments, values = [], []
    for name, can_id, size, _, signals in messages:
        lines.append(f"BO_ {can_id} {name}: {size} Fingertip")
        for s in signals:
            sign = "-" if s.signed else "+"
            mux = f" {s.mux}" if s.mux else ""
            lines.append(
                f" SG_ {s.name}{mux} : {s.start}|{s.bits}@1{sign} ({_number(s.scale)},0) "
                f'[{_number(s.low)}|{_number(s.high)}] "{s.unit}" Host'
            )
            comments.append(f'CM_ SG_ {can_id} {s.name} "{s.meaning}";')
            choices = s.choices if s.nan is None else ((s.nan, "invalid"),)
            if choices:
                text = " ".join(f'{raw} "{label}"' for raw, label in choices)
                values.append(f"VAL_ {can_id} {s.name} {text} ;")
        lines.append("")
    formats = [f'BA_ "VFrameFormat" BO_ {i} {14 if fd else 0};' for _, i, _, fd, _ in messages]
    fd = any(message[3] for message in messages)
    kinds = ",".join(f'"{k}"' for k in ["StandardCAN", "ExtendedCAN", *["reserved"] * 12, "StandardCAN_FD"])
    attributes = [
        'BA_DEF_ "BusType" STRING ;',
        f'BA_DEF_ BO_ "VFrameFormat" ENUM {kinds};',
        'BA_DEF_DEF_ "BusType" "CAN";',
        'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";',
        f'BA_ "BusType" "{"CAN FD" if fd else "CAN"}";',
    ]
    return "\n".join([*lines, *comments, *attributes, *formats, *values]) + "\n"


def fd(node: int) -> str:
    """DBC of a node on a CAN FD bus."""
    ids = CanIds()
    return _write(
        [
            ("State", ids.state(node), STATE_SIZE, True, state_signals()),
            ("Detail", ids.detail(node), STATE_SIZE, True, _detail_signals()),
            *_common(ids, node),
        ]
    )


def classic(node: int) -> str:
    """DBC of a node on a classic CAN bus."""
    ids = CanIds()
    parts: list[Message] = [
        (f"Part{tpdo}", ids.tpdo(tpdo, node), PART_SIZE, False, classic_signals(tpdo)) for tpdo in range(1, 5)
    ]
    return _write([*parts, *_common(ids, node)])
