"""A sample, and its 64-byte frame: `pack_state` and `unpack_state`.

The tables in `fields` are turned into precompiled columns once, at import; a frame then costs one walk
along them and one `struct` call each way. Layout and rules: `fields`.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from operator import attrgetter
from typing import Any, Final

from hostlink.wire.e2e import check_p5, protect_p5
from hostlink.wire.errors import CorruptFrame, VersionMismatch
from hostlink.wire.fields import (
    CONTACT_FIELDS,
    CONTACTS_MAX,
    DATA_ID,
    FIELDS,
    HEADER_SIZE,
    STATE_LAYOUT,
    STATE_SIZE,
    VERSION,
    Field,
    field_named,
)
from hostlink.wire.status import Status

__all__ = ["Contact", "Raws", "State", "pack_state", "quantise", "restore", "unpack_state"]

NO_STATUS: Final = Status(0)


@dataclass(frozen=True, slots=True)
class Contact:
    """One place where something touches. Frame `tip`; NaN where not known."""

    x_mm: float
    y_mm: float
    depth_mm: float = nan


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """One sample of one fingertip. Meaning, unit, frame and range of each field: `fields.FIELDS`.

    Floats are NaN where not measured, not calibrated, not asked for or not to be trusted.
    sample and capture_time_us are counters that wrap (16 and 32 bits); `pack_state` takes larger ones
    and keeps their low bits. contacts: at most 4, strongest first; contact_n may be larger.
    """

    sample: int = 0
    status: Status = NO_STATUS
    capture_time_us: int = 0
    latency_us: float = nan
    pins_tracked: float = nan
    contact_n: int = 0
    displacement_mm: float = nan
    displacement_sigma_mm: float = nan
    force_n: float = nan
    pressure_kpa: float = nan
    contact_area_mm2: float = nan
    shear_x_mm: float = nan
    shear_y_mm: float = nan
    shear_sigma_mm: float = nan
    torsion_deg: float = nan
    tilt_x_deg: float = nan
    tilt_y_deg: float = nan
    slip_speed_mm_s: float = nan
    slip_probability: float = nan
    orientation_deg: float = nan
    temperature_degc: float = nan
    contacts: tuple[Contact, ...] = ()

    def __post_init__(self) -> None:
        if len(self.contacts) > CONTACTS_MAX:
            raise ValueError(f"{len(self.contacts)} contacts, at most {CONTACTS_MAX} fit: give the strongest")


# The frame's struct: CRC, counter, version, then STATE_LAYOUT.
_CONTACT_CODES: Final = "".join(f.code for f in CONTACT_FIELDS)
_CODES: Final = {f.name: f.code for f in FIELDS}
FRAME: Final = struct.Struct(
    "<HBB" + "".join(_CODES[k] if isinstance(k, str) else _CONTACT_CODES for k in STATE_LAYOUT)
)
assert FRAME.size == STATE_SIZE

# Raw values in the order of FIELDS; then, contact by contact, those of the listed contacts.
_NAMES: Final = tuple(f.name for f in FIELDS)
_BEFORE: Final = next(i for i, k in enumerate(STATE_LAYOUT) if isinstance(k, int))  # fields before contacts
_BEHIND: Final = _BEFORE + CONTACTS_MAX * len(CONTACT_FIELDS)
_VALUES: Final = attrgetter(*_NAMES)
_SAMPLE: Final = _NAMES.index("sample")
_STATUS: Final = _NAMES.index("status")
_TIME: Final = _NAMES.index("capture_time_us")
_COUNT: Final = _NAMES.index("contact_n")

# Columns: (scale, low, high, raw_low, raw_high, raw_nan); plain integers have scale 0.
_Column = tuple[float, float, float, int, int, int]


def _column(field: Field) -> _Column:
    nan_raw = -1 if field.plain else field.raw_nan(8 * field.size)  # plain: no raw value is NaN
    return (field.scale, field.low, field.high, field.raw_low, field.raw_high, nan_raw)


_COLUMNS: Final = tuple(_column(f) for f in FIELDS)
_CONTACT_COLUMNS: Final = tuple(_column(f) for f in CONTACT_FIELDS)
_NO_CONTACT: Final = tuple(c[5] for c in _CONTACT_COLUMNS)
_COUNT_MAX: Final = int(field_named("contact_n").high)

Raws = tuple[list[int], list[tuple[int, ...]]]


def _quantise(values: Sequence[float], columns: Sequence[_Column]) -> list[int]:
    raws = []
    for value, (scale, low, high, raw_low, raw_high, raw_nan) in zip(values, columns, strict=True):
        if low < value < high:
            raws.append(round(value / scale) if scale else int(value))
        elif value >= high:
            raws.append(raw_high)
        elif value <= low:
            raws.append(raw_low)
        else:
            raws.append(raw_nan)
    return raws


def quantise(state: State) -> Raws:
    """Raw integers of all fields in the order of FIELDS, and of the contacts that have a place.

    Finite values saturate, NaN becomes the 64-byte frame's NaN; sample number and capture time wrap.
    """
    raws = _quantise(_VALUES(state), _COLUMNS)
    contacts = [
        tuple(_quantise((c.x_mm, c.y_mm, c.depth_mm), _CONTACT_COLUMNS))
        for c in state.contacts
        if c.x_mm == c.x_mm and c.y_mm == c.y_mm
    ]
    raws[_SAMPLE] = state.sample & 0xFFFF
    raws[_STATUS] = int(state.status) & 0xFFFF
    raws[_TIME] = state.capture_time_us & 0xFFFF_FFFF
    raws[_COUNT] = min(max(state.contact_n, len(contacts)), _COUNT_MAX)
    return raws, contacts


def _restore(raws: Sequence[int], columns: Sequence[_Column]) -> list[Any]:
    return [
        nan if raw == column[5] else raw * column[0] if column[0] else raw
        for raw, column in zip(raws, columns, strict=True)
    ]


def restore(raws: Sequence[int], contacts: Sequence[Sequence[int]]) -> State:
    """The inverse of `quantise`."""
    values = dict(zip(_NAMES, _restore(raws, _COLUMNS), strict=True))
    values["status"] = Status(raws[_STATUS])
    values["contacts"] = tuple(Contact(*_restore(c, _CONTACT_COLUMNS)) for c in contacts)
    return State(**values)


def pack_state(state: State, counter: int) -> bytes:
    """The 64-byte frame of a sample.

    counter  of samples due on this link, taken modulo 256: +1 for each, also for one that the link then
             refused (that is a loss); not for one that the divider left out (that is none)
    """
    raws, contacts = quantise(state)
    listed = [raw for contact in contacts for raw in contact]
    listed += _NO_CONTACT * (CONTACTS_MAX - len(contacts))
    frame = bytearray(FRAME.pack(0, 0, VERSION, *raws[:_BEFORE], *listed, *raws[_BEFORE:]))
    protect_p5(frame, counter, DATA_ID)
    return bytes(frame)


def unpack_state(frame: bytes) -> State:
    """The sample in a 64-byte frame; its counter is `frame[2]`.

    Raises CorruptFrame: length or CRC is wrong (a frame of another version looks like that, too: only
           several frames together tell noise from another version, see `hostlink.decoder`);
           VersionMismatch: CRC right, version not ours
    """
    if len(frame) != STATE_SIZE:
        raise CorruptFrame(f"state frame of {len(frame)} bytes instead of {STATE_SIZE}")
    if not check_p5(frame, DATA_ID):
        raise CorruptFrame("state frame with a wrong CRC")
    if frame[HEADER_SIZE - 1] != VERSION:
        raise VersionMismatch(VERSION, frame[HEADER_SIZE - 1], DATA_ID, DATA_ID)
    fields = FRAME.unpack(frame)[3:]
    n = len(CONTACT_FIELDS)
    listed = [fields[i : i + n] for i in range(_BEFORE, _BEHIND, n) if fields[i] != _NO_CONTACT[0]]
    return restore(fields[:_BEFORE] + fields[_BEHIND:], listed)
