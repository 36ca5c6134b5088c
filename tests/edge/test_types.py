"""What flows between the stages: unchanged once it is made, and copied with changes as any dataclass."""

from __future__ import annotations

import pickle
from dataclasses import fields, replace

import numpy as np
import pytest

from edge.types import Reading, Tracks


def made() -> Tracks:
    return Tracks(np.zeros((3, 2)), np.ones(3), np.array([True, False, True]), 0.98)


def test_an_object_of_a_frame_stays_unchanged() -> None:
    with pytest.raises(AttributeError):
        made().confidence = 0.0  # type: ignore[misc]


def test_it_is_copied_with_changes() -> None:
    before = made()
    after = replace(before, confidence=0.5)
    assert (after.confidence, before.confidence) == (0.5, 0.98)
    assert after.xy_img is before.xy_img
    with pytest.raises(TypeError):
        replace(before, certainty=0.5)  # type: ignore[call-arg]


def test_it_names_its_fields_and_keeps_its_methods() -> None:
    assert [f.name for f in fields(Tracks)] == ["xy_img", "sigma_px", "seen", "confidence", "autocorrelation"]
    assert made().n_seen == 2
    assert made().autocorrelation == 0.0
    with pytest.raises(TypeError):
        Tracks(np.zeros((3, 2)), np.ones(3))  # type: ignore[call-arg]


def test_another_process_gets_it_whole() -> None:
    reading = pickle.loads(pickle.dumps(Reading({"force_n": 1.0}, {"force_n": 0.1}, np.ones((1, 3)))))
    assert reading.values == {"force_n": 1.0}
    assert not reading.saturated
    np.testing.assert_array_equal(reading.contacts, np.ones((1, 3)))
