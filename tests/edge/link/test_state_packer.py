"""Results as samples: known values are kept, others NaN; their bytes are those of the wire's own packer."""

import pickle
from dataclasses import replace
from math import inf, isnan, nextafter
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given

from edge.link.state_packer import SIGMAS, StatePacker
from edge.types import Reading, Tracks
from hostlink.wire import FIELDS, Contact, State, Status, pack_state
from hostlink.wire.fields import Field
from tests.support.states import MEASURED, any_state, as_seen, same

pytestmark = pytest.mark.kernels

to_state = StatePacker().to_state
#: Fields that the calibration fills in.
OTHERS = {"latency_us", "pins_tracked", "temperature_degc", *(row[0] for row in SIGMAS)}
VALUES = frozenset(f.name for f in FIELDS if not (f.plain or f.contact)) - OTHERS


def sent(tracks: Tracks, reading: Reading, **stated: Any) -> State:
    """The sample of a result, of which these parts are sent."""
    result: Any = SimpleNamespace(tracks=tracks, reading=reading)
    return to_state(result, **({"sample": 0, "status": Status(0), "capture_time_us": 0} | stated))


def tracks(n: int = 10, seen: int = 8, confidence: float = 1.0) -> Tracks:
    mask = np.arange(n) < seen
    return Tracks.of(np.zeros((n, 2)), np.ones(n), mask, confidence)


def reading(contacts: int = 2, **values: float) -> Reading:
    rows = np.array([[k, -k, 0.5] for k in range(contacts)], dtype=float).reshape(-1, 3)
    return Reading(values, {}, rows, frozenset(), calibrated=True)


def test_every_value_has_its_place() -> None:
    values = {name: float(k + 1) / 4 for k, name in enumerate(sorted(VALUES))}
    result = tracks(), reading(2, **values)
    back = as_seen(sent(*result, sample=70_000, status=Status.TOUCHED, capture_time_us=1 << 33))
    for f in FIELDS:
        if f.name in values:
            limited = min(max(values[f.name], f.low), f.high)
            assert getattr(back, f.name) == pytest.approx(limited, abs=0.501 * f.scale), f.name
    assert back.sample == 70_000 & 0xFFFF
    assert back.capture_time_us == 0
    assert back.status == Status.TOUCHED
    assert back.pins_tracked == pytest.approx(0.8)
    assert back.contact_n == 2
    assert back.contacts == (Contact(0.0, 0.0, 0.5), Contact(1.0, -1.0, 0.5))


def test_bits_that_follow_from_the_result() -> None:
    untrusted = Reading({}, {}, np.empty((0, 3)), frozenset({"displacement_mm"}), calibrated=False)
    state = sent(tracks(confidence=0.1), untrusted, status=Status.NOT_LIVE)
    assert state.status == Status.NOT_LIVE | Status.UNCALIBRATED | Status.SATURATED | Status.TRACKER_LOST
    assert isnan(state.displacement_mm)


def test_without_a_result_only_the_frame_counts() -> None:
    state = to_state(
        None, sample=3, status=Status.CAMERA_FAULT, capture_time_us=9, latency_us=50.0, temperature_degc=41.0
    )
    assert (state.sample, state.capture_time_us) == (3, 9)
    assert (state.latency_us, state.temperature_degc) == (50.0, 41.0)
    assert state.status == Status.CAMERA_FAULT
    assert all(isnan(getattr(state, name)) for name in VALUES)
    assert isnan(state.pins_tracked)


def test_contacts_that_do_not_fit_are_counted_and_unknown_values_refused() -> None:
    state = sent(tracks(), reading(6))
    assert state.contact_n == 6
    assert [c.x_mm for c in state.contacts] == [0.0, 1.0]
    with pytest.raises(TypeError, match="displacement_cm"):
        sent(tracks(), reading(0, displacement_cm=1.0))


def made_of(values: State) -> tuple[Any, int, Status, int]:
    """A result whose sample has these values, and the others."""
    known = {f.name: getattr(values, f.name) for f in MEASURED}
    found = np.array(values.contacts, np.float64).reshape(-1, 3)
    tracks, reading = Tracks.of(found, found[:0], found[:0] > 0), Reading(known, {}, found, calibrated=True)
    time_us = values.capture_time_us % (1 << 50)
    return SimpleNamespace(tracks=tracks, reading=reading), values.sample, values.status, time_us


@given(any_state)
def test_any_sample_also_of_the_reading_before(values: State) -> None:
    result = made_of(values)
    for _ in range(2):
        state = to_state(*result, values.latency_us, values.temperature_degc)
        assert pack_state(state, 300) == pack_state(replace(state), 300)
        whole = replace(values, capture_time_us=result[-1], contact_n=len(values.contacts))
        assert same(state, whole)
        assert same(pickle.loads(pickle.dumps(state)), whole)


@pytest.mark.parametrize("f", MEASURED, ids=lambda f: f.name)
def test_values_at_and_beside_the_middle_of_two_steps_are_rounded_alike(f: Field) -> None:
    for n in range(f.raw_low, f.raw_high, 97):
        value = (n + 0.5) * f.scale
        for near in (nextafter(value, -inf), value, nextafter(value, inf)):
            given: dict[str, Any] = {"sample": -1, f.name: near}
            state = to_state(*made_of(State(**given)), near, near)
            assert pack_state(state, 0) == pack_state(replace(state), 0), near
