"""What looks unlike its pin must go with its neighbours; what looks right may be off them."""

from __future__ import annotations

import numpy as np
import pytest

from edge.track import Tracker
from edge.types import Array, Pins, Tracks
from tests.edge.fields import tip

PIN = 60
ASIDE = np.array([1.5, -1.0])  # px


def followed(aside: Array, light: float = 1.0, blur: float = 1.0, gain: float = 1.0) -> Tracks:
    """A quiet tip, and in the last frame one pin aside, of other brightness or sigma."""
    rest = tip(127)
    rng = np.random.default_rng(3)
    tracker = Tracker(rest)
    tracker.identify(rest.pins)

    def frame(aside: Array, light: float, blur: float, gain: float) -> Pins:
        xy = rest.xy_img + rng.normal(0.0, 0.02, rest.xy_img.shape)
        brightness = gain * rest.pins.brightness * rng.normal(1.0, 0.005, len(rest))
        sigma = np.full(len(rest), 0.02)
        xy[PIN] += aside
        brightness[PIN] *= light
        sigma[PIN] *= blur
        return Pins(xy, sigma, rest.pins.radius_px, brightness)

    for _ in range(3):
        tracks = tracker.follow(frame(np.zeros(2), 1.0, 1.0, 1.0))
        assert tracks.seen.all()
    return tracker.follow(frame(aside, light, blur, gain))


@pytest.mark.parametrize(("light", "blur"), [(1.3, 1.0), (0.6, 1.0), (1.0, 4.0)])
def test_a_pin_that_looks_otherwise_and_stands_aside_is_lost(light: float, blur: float) -> None:
    assert np.flatnonzero(~followed(ASIDE, light, blur).seen).tolist() == [PIN]


def test_a_pin_that_looks_right_may_stand_aside() -> None:
    assert followed(ASIDE).seen.all()


@pytest.mark.parametrize(("light", "blur"), [(1.3, 1.0), (0.6, 1.0), (1.0, 4.0)])
def test_a_pin_that_looks_otherwise_is_seen_where_its_neighbours_say(light: float, blur: float) -> None:
    assert followed(np.zeros(2), light, blur).seen.all()


def test_light_that_changes_for_all_is_no_reason() -> None:
    assert followed(ASIDE, gain=2.0).seen.all()
    assert np.flatnonzero(~followed(ASIDE, light=1.3, gain=2.0).seen).tolist() == [PIN]


def test_a_search_leaves_out_a_speck_in_a_pins_place() -> None:
    rest = tip(127)
    xy, light = rest.xy_img.copy(), rest.pins.brightness.copy()
    xy[PIN] += 3.0
    light[PIN] *= 0.6
    tracks = Tracker(rest).identify(Pins(xy, rest.pins.sigma_px, rest.pins.radius_px, light))
    assert np.flatnonzero(~tracks.seen).tolist() == [PIN]
