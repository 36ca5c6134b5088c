"""Results as samples: known values are kept, unknown ones are NaN."""

from math import isnan
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from edge.link.sample import SIGMAS, to_state
from edge.types import Reading, Tracks
from hostlink.wire import FIELDS, Contact, State, Status
from tests.support.states import as_seen

#: Fields that the calibration fills in.
VALUES = frozenset(f.name for f in FIELDS if not (f.plain or f.contact)) - {
    "latency_us",
    "pins_tracked",
    "temperature_degc",
    *(row[0] for row in SIGMAS),
}


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
