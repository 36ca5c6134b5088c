"""Random samples: for property tests (hypothesis) and for long runs (seeded)."""

from collections.abc import Iterable
from math import inf, isnan, nan
from random import Random
from typing import Any

from hypothesis import strategies as st

from hostlink.decoder import CanDecoder, Sample, SerialDecoder
from hostlink.errors import VersionMismatch
from hostlink.wire import Contact, State, Status, pack_state, unpack_state
from hostlink.wire.fields import CONTACTS_MAX, FIELDS, LAYOUT, field_named

MEASURED = tuple(f for f in FIELDS if not f.plain)


def same(a: State, b: State) -> bool:
    """Equal, with NaN equal to NaN (unlike dataclass equality)."""
    return repr(a) == repr(b)


def as_seen(state: State) -> State:
    """The state as decoded at the other end."""
    return unpack_state(pack_state(state, 0))


def random_state(rng: Random, sample: int) -> State:
    """Every field somewhere in its range, one in eight invalid."""
    values = {f.name: nan if rng.random() < 0.125 else rng.uniform(f.low, f.high) for f in MEASURED}
    contacts = tuple(
        Contact(rng.uniform(-20, 20), rng.uniform(-20, 20), nan if rng.random() < 0.1 else rng.uniform(0, 6))
        for _ in range(rng.randint(0, CONTACTS_MAX))
    )
    return State(
        sample=sample & 0xFFFF,
        status=Status(rng.getrandbits(16)),
        capture_time_us=sample * 4167 & 0xFFFF_FFFF,
        contact_n=rng.randint(len(contacts), 14),
        contacts=contacts,
        **values,
    )


def mismatches(
    decoder: CanDecoder | SerialDecoder, calls: Iterable[tuple[Any, ...]]
) -> list[VersionMismatch]:
    """What the decoder raises, given this; no sample may come out."""
    raised = []
    for call in calls:
        try:
            assert not any(isinstance(event, Sample) for event in decoder.receive(*call))
        except VersionMismatch as error:
            raised.append(error)
    return raised


_ANY = st.floats(allow_nan=True, allow_infinity=True)
_CONTACT = st.builds(Contact, _ANY, _ANY, _ANY)

any_state = st.builds(
    State,
    sample=st.integers(0, 1 << 40),
    status=st.integers(0, 0xFFFF).map(Status),
    capture_time_us=st.integers(0, 1 << 70),
    contact_n=st.integers(0, 300),
    contacts=st.lists(_CONTACT, max_size=CONTACTS_MAX).map(tuple),
    **{f.name: _ANY for f in MEASURED},
)


def expected(name: str, value: float) -> tuple[float, float]:
    """(value on the other end, tolerance) by the rules at the head of `wire.fields`."""
    f = field_named(name)
    if isnan(value):
        return nan, 0.0
    if value in (inf, -inf) or not f.low <= value <= f.high:
        return (f.high if value > 0 else f.low), 1e-9
    value = max(value, f.scale) if "_sigma_" in name and value > 0 else value
    return value, f.scale * 0.5 + 1e-9


CONTACT_ROWS = tuple(f for f in LAYOUT if f.name.startswith("contact0_"))
