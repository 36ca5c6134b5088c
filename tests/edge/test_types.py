"""What flows between the stages: unchanged once it is made, and copied with changes as any dataclass."""

import pickle
from dataclasses import fields, replace

import numpy as np
import pytest

from edge.types import Reading, Tracks


def made() -> Tracks:
    return Tracks.of(np.zeros((3, 2)), np.ones(3), np.array([True, False, True]), 0.98)


def test_an_object_of_a_frame_is_copied_with_changes_and_stays_unchanged() -> None:
    before = made()
    with pytest.raises(AttributeError):
        before.confidence = 0.0  # type: ignore[misc]
    after = replace(before, confidence=0.5)
    assert (after.confidence, before.confidence) == (0.5, 0.98)
    assert after.xy_img is before.xy_img
    names = " ".join(f.name for f in fields(Tracks))
    assert names == "xy_img sigma_px seen n_seen confidence autocorrelation"
    assert (before.n_seen, before.autocorrelation) == (2, 0.0)
    for wrong in ({"certainty": 0.5}, {"xy": before.xy_img}):
        with pytest.raises(TypeError):
            replace(before, **wrong)
    with pytest.raises(TypeError):
        Tracks(np.zeros((3, 2)), np.ones(3))  # type: ignore[call-arg]


def test_another_process_gets_it_whole() -> None:
    reading = pickle.loads(pickle.dumps(Reading({"force_n": 1.0}, {"force_n": 0.1}, np.ones((1, 3)))))
    assert reading.values == {"force_n": 1.0}
    assert not reading.saturated
    np.testing.assert_array_equal(reading.contacts, np.ones((1, 3)))
