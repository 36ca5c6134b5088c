"""Pins strewn without a lattice are found and followed under a press; none is left out in silence."""

from functools import lru_cache

import numpy as np
import pytest

from edge.frame import Pipeline
from edge.geometry.neighbours import nearest_of
from edge.pins import left_out, take_rest
from edge.types import Array, Frame, Image
from tests.support.pins_rendered import draw, expose

SIZE = (640, 480)
BALL = np.array([330.0, 250.0])


@lru_cache
def strewn(n: int, apart_px: float) -> Array:
    """(n, 2) px, places anywhere in the image, none nearer to another than `apart_px`."""
    rng = np.random.default_rng(n)
    places = [rng.uniform(25, np.array(SIZE) - 25)]
    while len(places) < n:
        place = rng.uniform(25, np.array(SIZE) - 25)
        if np.hypot(*(places - place).T).min() > apart_px:
            places.append(place)
    return np.array(places)


def photo(xy: Array, dark: bool) -> Image:
    bright = expose(draw(SIZE, xy, 4.5, 1.0, 120, 50), 1.5, np.random.default_rng(1))
    return 255 - bright if dark else bright


@pytest.mark.parametrize("dark", [True, False])
@pytest.mark.parametrize("n", [80, 200])
def test_a_press_on_strewn_pins_is_followed_and_found(n: int, dark: bool) -> None:
    xy = strewn(n, 0.7 * np.sqrt(SIZE[0] * SIZE[1] / n))
    rest = take_rest([photo(xy, dark)])
    off, own = nearest_of(xy, rest.xy_img)
    assert len(rest) == n
    assert off.max() < 0.5
    assert len(left_out(photo(xy, dark), rest)) == 0
    pipeline = Pipeline(rest)
    away = xy - BALL
    far = np.hypot(*away.T)[:, None] / 60.0
    for k in range(20):
        pressed = xy + min(k / 15, 1.0) * 14 / 60 * away * np.exp(0.5 - 0.5 * far**2)
        result = pipeline.process(Frame(photo(pressed, dark), k * 33_000_000, k))
        assert result.tracks.n_seen == n
        assert np.hypot(*(result.tracks.xy_img - pressed[own[:, 0]]).T).max() < 1.0
    assert result.features is not None
    (contact,) = result.features.contacts or ()
    assert np.hypot(*(contact.xy_img - BALL)) < rest.pattern.pitch_px


def test_dots_that_are_too_uneven_to_be_pins_are_named() -> None:
    xy = strewn(200, 14.0)
    image = photo(xy, dark=True)
    rest = take_rest([image])
    missed = nearest_of(rest.xy_img, xy)[0][:, 0] > 2.0
    named = left_out(image, rest)
    assert 0 < len(named) <= missed.sum() < len(xy) / 12
    assert len(named) > 0.7 * missed.sum()
    assert nearest_of(xy[missed], named)[0].max() < 2.0
