"""A sample, and its 64-byte frame: `pack_state` and `unpack_state`.

The tables in `fields` are turned into precompiled columns once, at import; a frame then costs one walk
along them and one `struct` call each way. Layout and rules: `fields`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import accumulate, islice, repeat, starmap
from math import nan
from struct import iter_unpack
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar, cast, dataclass_transform
from zlib import crc32

from hostlink.wire.body import NUMBER, Decoded, FromFrame, body_in, frame_of, received
from hostlink.wire.fields import (
    CONTACTS_MAX,
    LAYOUT,
    OLDER,
    SCHEMA,
    VERSION,
    Schema,
)
from hostlink.wire.generated_state import StateFields
from hostlink.wire.status import status_of

__all__ = [
    "Contact",
    "State",
    "all_fields",
    "check_of",
    "frame_of",
    "pack_state",
    "quantise",
    "restore",
    "unpack_state",
]


class Contact(NamedTuple):
    """One place where something touches. Frame `tip`; NaN where not known."""

    x_mm: float
    y_mm: float
    depth_mm: float = nan


T = TypeVar("T")


class _DecodedContacts:
    """The contacts, likewise; kept once they are decoded."""

    def __get__(self, state: State | None, owner: type) -> tuple[Contact, ...]:
        if state is None or state.body is None:
            return ()
        found = _exact_contacts(state.exact, state.contact_n) if state.exact else _contacts_of(state.body)
        state.__dict__["contacts"] = found
        return found


@dataclass_transform(frozen_default=True, kw_only_default=True)
def _sample(cls: type[T]) -> type[T]:
    """A frozen dataclass whose fields are decoded when they are read: a control loop reads a few of 29, and a
    dataclass's own constructor takes longer than the bus.
    """
    made = dataclass(frozen=True, init=False)(cls)
    places = dict(zip(_NAMES, accumulate((f.size for f in LAYOUT), initial=1), strict=False))
    for row in fields(cast("Any", made)):
        if row.name in places:  # else the table has changed: generate
            field, at = SCHEMA.field_named(row.name), places[row.name]
            setattr(made, row.name, Decoded(field, _NAMES.index(row.name), at, row.default))
    setattr(made, "contacts", _DecodedContacts())  # noqa: B010
    return made


def _exact_contacts(exact: bytes, n: int) -> tuple[Contact, ...]:
    first = _FIRST * NUMBER.size
    numbers = iter_unpack(f"{_CONTACT_SIZE}d", exact[first : _BEHIND * NUMBER.size])
    return tuple(islice(starmap(Contact, numbers), n))


def _contacts_of(body: bytes) -> tuple[Contact, ...]:
    raws = _raws_of(body)[_FIRST:_BEHIND]
    values = [
        raw * scale if raw != raw_nan else nan
        for raw, scale, raw_nan in zip(raws, _SCALES[_FIRST:_BEHIND], _NANS[_FIRST:_BEHIND], strict=True)
    ]
    return tuple(
        Contact(*values[i : i + _CONTACT_SIZE])
        for i in range(0, len(values), _CONTACT_SIZE)
        if raws[i] != _NANS[_FIRST]
    )


def _raws_of(body: bytes) -> Sequence[int]:
    """Raw integers of all fields, in the order of LAYOUT."""
    return _BODY.unpack(body)[1:]


_BODY: Final = SCHEMA.body

# LAYOUT turned into columns, and where the contacts lie among them.
_NAMES: Final = tuple(f.name for f in LAYOUT)
_CONTACT_SIZE: Final = 3
_FIRST: Final = _NAMES.index("contact0_x_mm")
_BEHIND: Final = _FIRST + CONTACTS_MAX * _CONTACT_SIZE
_SAMPLE, _STATUS, _TIME, _COUNT = map(_NAMES.index, ("sample", "status", "capture_time_us", "contact_n"))
_COUNT_MAX: Final = int(LAYOUT[_COUNT].high)

# A plain integer is scaled by 1, and none of its raw values is NaN.
_SCALES: Final = tuple(f.scale or 1 for f in LAYOUT)
_NANS: Final = tuple(-1 if f.plain else f.raw_nan(8 * f.size) for f in LAYOUT)
#: Names of the fields that are measured; "": a plain integer, which `quantise` treats on its own.
_MEASURED: Final = tuple("" if f.plain else f.name for f in LAYOUT)
#: Step, range, and raw values of its ends. With a float a comparison takes half the time.
_RANGES: Final = tuple(
    (f.scale, float(f.low), float(f.high), f.raw_low, f.raw_least, f.raw_high) for f in LAYOUT
)
_NO_VALUES: Final = [f.raw_nan(8 * f.size) for f in LAYOUT]


@_sample
class State(StateFields, FromFrame):
    """One sample of one fingertip; give the fields by name. Meaning, unit, frame, range: `fields.LAYOUT`.

    Floats are NaN where not measured, not calibrated, not asked for or not to be trusted.
    sample and capture_time_us are counters that wrap (16 and 32 bits); `pack_state` takes larger ones
    and keeps their low bits. contacts: at most 2, strongest first; contact_n may be larger.
    Raises TypeError: no such field; ValueError: more contacts
    """

    contacts: tuple[Contact, ...] = ()

    if not TYPE_CHECKING:  # a type checker reads the fields

        def __init__(self, **values):
            object.__setattr__(self, "__dict__", all_fields(values))

    def __reduce__(self) -> tuple[Any, ...]:
        """Serves copies and other processes."""
        return (State.of, (vars(self),)) if self.body is None else (restore, (self.body, self.exact))

    @classmethod
    def of(cls, fields: dict[str, Any]) -> State:
        """The sample with these fields, which are all (`all_fields`); it keeps the dictionary."""
        state = cls.__new__(cls)
        object.__setattr__(state, "__dict__", fields)
        return state


def all_fields(given: dict[str, Any]) -> dict[str, Any]:
    """All fields in the order of the table, then the contacts. Raises  as of `State`"""
    values = _DEFAULTS | given
    if len(values) > len(_DEFAULTS):
        raise TypeError(f"a sample has no field {', '.join(sorted(values.keys() - _DEFAULTS.keys()))}")
    if (n := len(values["contacts"])) > CONTACTS_MAX:
        raise ValueError(f"{n} contacts, at most {CONTACTS_MAX} fit: give the strongest")
    return values


_DEFAULTS: Final[dict[str, Any]] = {f.name: f.default for f in fields(cast("Any", State))}


def quantise(state: State) -> Sequence[int]:
    """Raw integers of all fields, in the order of LAYOUT.

    Finite values saturate, NaN becomes the 64-byte frame's NaN; sample number and capture time wrap.
    A contact without a place is left out.
    """
    if state.body is not None:
        return _raws_of(state.body)
    values = vars(state)
    places: list[float] = []
    for contact in state.contacts:
        if contact.x_mm == contact.x_mm and contact.y_mm == contact.y_mm:
            places += (contact.x_mm, contact.y_mm, contact.depth_mm)
    given: list[Any] = [*map(values.get, _MEASURED, repeat(nan))]
    given[_FIRST : _FIRST + len(places)] = places
    made = _NO_VALUES.copy()
    for i, value in enumerate(given):
        if value == value:
            scale, low, high, raw_low, raw_least, raw_high = _RANGES[i]
            if low < value < high:
                made[i] = max(raw_least, round(value / scale))
            else:
                made[i] = raw_high if value >= high else raw_low
    made[_SAMPLE] = state.sample & 0xFFFF
    made[_STATUS] = int(state.status) & 0xFFFF
    made[_TIME] = state.capture_time_us & 0xFFFF_FFFF
    made[_COUNT] = min(max(state.contact_n, len(places) // _CONTACT_SIZE), _COUNT_MAX)
    return made


def restore(body: bytes, exact: bytes | None = None) -> State:
    """The sample with this version and these fields. It keeps them, and decodes a field when it is read.

    An older version's values are decoded at once.

    exact  as of `FromFrame`
    """
    if body[0] != VERSION:
        schema = OLDER[body[0]]
        return _restore_older(schema.body.unpack(body)[1:], schema)
    return received(State, body, exact)


def _restore_older(raws: Sequence[int], schema: Schema) -> State:
    values: dict[str, Any] = {
        f.name: raw if f.plain else nan if raw == f.raw_nan(8 * f.size) else raw * f.scale
        for f, raw in zip(schema.layout, raws, strict=True)
    }
    places = [values.pop(f.name) for f in schema.layout if f.contact]
    rows = (places[i : i + _CONTACT_SIZE] for i in range(0, len(places), _CONTACT_SIZE))
    values["status"] = status_of(values["status"])
    return State(**values, contacts=tuple(Contact(*row) for row in rows if row[0] == row[0]))


def check_of(body: bytes) -> int:
    """The 16-bit check of version and fields."""
    return crc32(body) & 0xFFFF


def pack_state(state: State, counter: int) -> bytes:
    """The 64-byte frame of a sample.

    counter  of samples due on this link, taken modulo 256: +1 for each, also for one that the link then
             refused (a loss); not for one that the divider skipped (no loss)
    """
    return frame_of(state.body or _BODY.pack(VERSION, *quantise(state)), counter)


def unpack_state(frame: bytes) -> State:
    """The sample in a 64-byte frame; its counter is `frame[2]`.

    Raises CorruptFrame: length, CRC, version or check is wrong. A frame of another version looks like that,
           too: only several frames together distinguish the two, see `hostlink.decoder`
    """
    return restore(body_in(frame))
