"""Smoothed values against what their filter is known to do."""

import math
from typing import Any

import numpy as np
import pytest

from edge.calibration.smoothing import Smoother
from edge.types import Array, Features, Frame, Reading, Result, Tracks

NAME, STEP_S, FRAME_NS = "displacement_mm", 0.1, 5_000_000
NO_PINS = np.empty((0, 2))


class Finger:
    """Frames at an even rate, with one value."""

    def __init__(self, step_s: float = STEP_S) -> None:
        self.smoother, self.now_ns = Smoother(step_s), 0

    def read(
        self, value: float, sigma: float = 0.1, *, touched: bool = True, step_ns: int = FRAME_NS
    ) -> Reading:
        """The reading of the next frame."""
        self.now_ns += step_ns
        reading = Reading({NAME: value, "friction": 0.5}, {NAME: sigma}, NO_PINS, frozenset({NAME}), True)
        tracks = Tracks.of(NO_PINS, np.empty(0), np.empty(0, np.bool_))
        features = Features(np.empty(0), NO_PINS, touched)
        frame = Frame(np.zeros((1, 1), np.uint8), self.now_ns, 1)
        self.smoother.update(Result(frame, tracks, None, features, reading, False))
        return reading

    def values(self, values: Array, sigma: float = 0.1) -> Array:
        return np.array([self.read(float(value), sigma).values[NAME] for value in values])


@pytest.mark.parametrize("sigma", [1e-3, 10.0])
@pytest.mark.parametrize("step_s", [0.05, 0.2])
def test_a_step_is_followed_in_the_time_that_is_given_whatever_sigma(sigma: float, step_s: float) -> None:
    finger = Finger(step_s)
    finger.values(np.zeros(1000), sigma)
    answer = finger.values(np.ones(1000), sigma)
    a = np.pi / 4.0 * np.arange(1, 1001) * FRAME_NS * 1e-9 / step_s
    assert int(np.argmax(answer >= 1.0)) * FRAME_NS * 1e-9 == pytest.approx(step_s, abs=1.5 * FRAME_NS * 1e-9)
    assert answer == pytest.approx(1.0 - np.exp(-a) * (np.cos(a) - np.sin(a)), abs=0.05)


def test_white_noise_falls_as_stated_and_an_even_motion_is_not_late() -> None:
    finger, rng = Finger(), np.random.default_rng(0)
    noise = finger.values(rng.normal(0.0, 0.1, 20_000))[1000:]
    share = math.sqrt(3.0 * math.pi * FRAME_NS * 1e-9 / (8.0 * STEP_S))
    assert noise.std() == pytest.approx(0.1 * share, rel=0.1)
    ramp = np.linspace(0.0, 10.0, 1000)
    np.testing.assert_allclose(finger.values(ramp)[-100:], ramp[-100:], atol=1e-6)


def test_a_frame_of_large_sigma_counts_less() -> None:
    moved = []
    for sigma in (0.1, 1.0):
        finger = Finger()
        finger.values(np.zeros(200))
        moved.append(finger.read(1.0, sigma).values[NAME])
    assert 0.0 < moved[1] < 0.05 * moved[0]


def test_only_values_with_a_sigma_are_smoothed_and_all_else_stays() -> None:
    finger = Finger()
    finger.values(np.zeros(200))
    reading = finger.read(1.0, 0.2)
    assert 0.0 < reading.values[NAME] < 0.5
    assert reading.values["friction"] == 0.5
    assert (reading.sigmas, reading.saturated, reading.calibrated) == ({NAME: 0.2}, frozenset({NAME}), True)


@pytest.mark.parametrize(
    "between", [{"touched": False}, {"value": math.nan}, {"sigma": math.nan}, {"sigma": 0.0}, {"step_ns": 0}]
)
def test_a_touch_and_a_value_that_was_not_known_begin_anew(between: dict[str, Any]) -> None:
    """Then two frames are as they are read; while nothing touches, or nothing is known, all are."""
    finger = Finger()
    finger.values(np.zeros(200))
    one = {"value": 1.0, **between}
    assert finger.read(**one).values[NAME] == pytest.approx(one["value"], nan_ok=True)
    given = np.array([2.0, 2.5]) if "step_ns" not in between else np.array([2.5])
    np.testing.assert_array_equal(finger.values(given), given)
    assert finger.values(np.array([0.0]))[0] != 0.0


def test_a_step_within_less_than_a_sample_can_state_is_no_smoothing() -> None:
    finger = Finger(step_s=1e-300)
    jumps = np.tile([0.0, 1.0], 20)
    np.testing.assert_allclose(finger.values(jumps), jumps, atol=1e-6)
