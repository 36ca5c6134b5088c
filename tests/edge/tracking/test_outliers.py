"""A pin with anomalous brightness or sigma must move with its neighbours; another may be off them."""

import numpy as np
import pytest

from edge.tracking import Tracker
from edge.types import Array, Pins, Tracks
from tests.support.fields import tip

PIN = 60
OFFSET_PX = np.array([1.5, -1.0])  # px


def followed(off: Array, dimming: float = 1.0, blur: float = 1.0, gain: float = 1.0) -> Tracks:
    """A quiet tip, and in the last frame one pin off, of other brightness or sigma."""
    rest = tip(127)
    rng = np.random.default_rng(3)
    tracker = Tracker(rest)
    tracker.identify(rest.pins)

    def frame(off: Array, dimming: float, blur: float, gain: float) -> Pins:
        xy = rest.xy_img + rng.normal(0.0, 0.02, rest.xy_img.shape)
        brightness = gain * rest.pins.brightness * rng.normal(1.0, 0.005, len(rest))
        sigma = np.full(len(rest), 0.02)
        xy[PIN] += off
        brightness[PIN] *= dimming
        sigma[PIN] *= blur
        return Pins(xy, sigma, rest.pins.radius_px, brightness)

    for _ in range(3):
        tracks = tracker.follow(frame(np.zeros(2), 1.0, 1.0, 1.0))
        assert tracks.seen.all()
    return tracker.follow(frame(off, dimming, blur, gain))


@pytest.mark.parametrize(("dimming", "blur"), [(1.3, 1.0), (0.6, 1.0), (1.0, 4.0)])
def test_a_photometric_outlier_off_its_neighbours_map_is_lost(dimming: float, blur: float) -> None:
    assert np.flatnonzero(~followed(OFFSET_PX, dimming, blur).seen).tolist() == [PIN]


def test_a_pin_of_normal_brightness_may_be_off_its_neighbours_map() -> None:
    assert followed(OFFSET_PX).seen.all()


@pytest.mark.parametrize(("dimming", "blur"), [(1.3, 1.0), (0.6, 1.0), (1.0, 4.0)])
def test_a_photometric_outlier_that_moves_with_its_neighbours_is_seen(dimming: float, blur: float) -> None:
    assert followed(np.zeros(2), dimming, blur).seen.all()


def test_a_common_change_of_brightness_makes_no_outlier() -> None:
    assert followed(OFFSET_PX, gain=2.0).seen.all()
    assert np.flatnonzero(~followed(OFFSET_PX, dimming=1.3, gain=2.0).seen).tolist() == [PIN]


def test_a_search_rejects_a_speck_in_the_place_of_a_pin() -> None:
    rest = tip(127)
    xy, brightness = rest.xy_img.copy(), rest.pins.brightness.copy()
    xy[PIN] += 3.0
    brightness[PIN] *= 0.6
    tracks = Tracker(rest).identify(Pins(xy, rest.pins.sigma_px, rest.pins.radius_px, brightness))
    assert np.flatnonzero(~tracks.seen).tolist() == [PIN]
