"""Identity of pins: after a jump, from frame to frame, and when it cannot be known."""

from __future__ import annotations

import numpy as np
import pytest

from edge.errors import DegenerateLayout
from edge.track import Tracker
from edge.types import Array, PinPattern, Pins, Rest, Tracks

PITCH_PX = 18.0


def pins_at(xy: Array) -> Pins:
    n = len(xy)
    return Pins(xy, np.full(n, 0.05), np.full(n, 5.0), np.full(n, 150.0))


def rest_at(xy: Array) -> Rest:
    radius = float(np.hypot(*(xy - xy.mean(0)).T).max()) + 5
    pattern = PinPattern(5.0, PITCH_PX, xy.mean(0), radius, 10.0, 150.0, 1.0, (420, 420))
    return Rest(pins_at(xy), pattern)


def rings(count: int, centre: tuple[float, float] = (210.0, 210.0)) -> Array:
    """Concentric rings of 6k pins, as the dome tips have them; 11 rings make 397 pins, 10 make 331."""
    xy = [np.zeros((1, 2))]
    for k in range(1, count + 1):
        angle = 2 * np.pi * np.arange(6 * k) / (6 * k)
        xy.append(k * PITCH_PX * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    return np.concatenate(xy) + centre


def pressed(xy: Array, rng: np.random.Generator) -> Array:
    """A press anywhere, then shear and twist: the middle moves by up to 25 px, the rim by up to 15."""
    radius = np.hypot(*(xy - xy.mean(0)).T).max()
    unit = (xy - xy.mean(0)) / radius
    at = rng.uniform(-0.5, 0.5, 2)
    away = unit - at
    spread = away * np.exp(-((away**2).sum(1) / 0.25))[:, None] * rng.uniform(5, 20)
    angle = rng.uniform(0, 2 * np.pi)
    shear = rng.uniform(0, 18) * np.array([np.cos(angle), np.sin(angle)])
    hold = 1 - 0.4 * (unit**2).sum(1)[:, None]
    twist = np.deg2rad(rng.uniform(-5, 5)) * radius * np.stack([-unit[:, 1], unit[:, 0]], axis=1)
    return xy + spread + hold * shear + twist


def test_a_jump_from_rest_gives_every_pin_its_own_name() -> None:
    rng = np.random.default_rng(1)
    xy = rings(10)
    tracker = Tracker(rest_at(xy))
    for _ in range(20):
        now = pressed(xy, rng)
        order = rng.permutation(len(xy))
        tracks = tracker.identify(pins_at(now[order]))
        assert tracks.confidence > Tracks.LOW_CONFIDENCE
        np.testing.assert_array_equal(tracks.xy_img, now)


def test_too_few_pins_at_rest_are_refused() -> None:
    with pytest.raises(DegenerateLayout, match="at least 4"):
        Tracker(rest_at(rings(10)[:3]))
    with pytest.raises(DegenerateLayout, match="one line"):
        Tracker(rest_at(np.stack([np.arange(9.0) * PITCH_PX, np.zeros(9)], axis=1)))
