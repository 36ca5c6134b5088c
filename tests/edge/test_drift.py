"""Slow drift: learnt only while certainly untouched, bounded, reported, reversible."""

import numpy as np
import pytest
from numpy.random import default_rng

from edge.drift import Drift, DriftParams
from edge.types import Array, Rest, Tracks
from tests.support.layouts import rest_of, square, tracks_of

STEP_NS = 100_000_000


@pytest.fixture
def rest() -> Rest:
    return rest_of(square(6))


def tracks(xy: Array, lost: int = 0) -> Tracks:
    return tracks_of(np.where(np.arange(len(xy))[:, None] < lost, np.nan, xy))


def rest_for(
    drift: Drift, xy: Array, seconds: float, start_ns: int = 0, quiet: bool = True, lost: int = 0
) -> int:
    """Keep the pins there; returns the time at the end."""
    now = start_ns
    for _ in range(round(seconds * 1e9 / STEP_NS)):
        now += STEP_NS
        drift.learn(tracks(xy, lost), now, quiet)
    return now


def test_drift_is_subtracted_with_the_time_constant(rest: Rest) -> None:
    drift = Drift(rest, DriftParams(limit_px=0.5, time_s=10.0))
    moved = rest.xy_img + np.array([0.2, -0.1])
    rest_for(drift, moved, 10.0)
    left = moved - drift.offset_of() - rest.xy_img
    np.testing.assert_allclose(left, np.tile([0.2, -0.1], (len(rest), 1)) * np.exp(-1.0), rtol=0.03)
    assert drift.offset_px == pytest.approx(0.2 * (1 - np.exp(-1.0)), rel=0.03)
    assert drift.limit_share < 0.1


@pytest.mark.parametrize(
    ("quiet", "lost", "away", "seconds"),
    [
        (False, 0, 0.2, 60.0),  # touched, or a fault
        (True, 8, 0.2, 60.0),  # pins missing
        (True, 0, 2.0, 60.0),  # a light touch, or a camera that moved
        (True, 0, 0.2, STEP_NS * 1e-9),  # between two touches for one frame
    ],
)
def test_drift_is_learnt_only_while_certainly_untouched(
    rest: Rest, quiet: bool, lost: int, away: float, seconds: float
) -> None:
    drift = Drift(rest, DriftParams(limit_px=0.3, time_s=1.0))
    now, moved = 0, rest.xy_img + np.array([away, 0.0])
    for _ in range(5):
        now = rest_for(drift, moved, seconds, now, quiet, lost) + STEP_NS
        drift.learn(tracks(moved), now, False)
    assert drift.offset_px == 0.0
    assert not drift.learnt


def test_no_offset_ever_exceeds_the_limit(rest: Rest) -> None:
    drift = Drift(rest, DriftParams(limit_px=0.3, time_s=0.1))
    random = default_rng(1)
    now = 0
    for _ in range(40):
        now = rest_for(drift, rest.xy_img + random.uniform(-1.2, 1.2, 2), 6.0, now)
        assert drift.offset_px <= 0.3
    rest_for(drift, rest.xy_img + np.array([0.9, 0.0]), 10.0, now)
    assert drift.limit_share >= 0.1


def test_drift_learning_can_be_switched_off(rest: Rest) -> None:
    off = Drift(rest, DriftParams(limit_px=0.0, time_s=0.1))
    rest_for(off, rest.xy_img + 0.1, 30.0)
    assert off.offset_px == 0.0
    assert not off.learnt


def test_a_lost_pin_keeps_its_residual(rest: Rest) -> None:
    drift = Drift(rest, DriftParams(time_s=0.1))
    now = rest_for(drift, rest.xy_img + 0.1, 30.0)
    rest_for(drift, rest.xy_img - 0.1, 30.0, now, lost=1)
    shifted = -drift.offset_of()
    np.testing.assert_allclose(shifted[0], -0.1, atol=1e-6)
    np.testing.assert_allclose(shifted[1:], 0.1, atol=1e-6)
