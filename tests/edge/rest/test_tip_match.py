"""A calibration belongs to one tip, with all its pins."""

from dataclasses import replace

import numpy as np
import pytest

from calib.fit import tip_of
from calib.sim import Camera, Simulator, Tip
from edge.errors import CalibrationError
from edge.pins import take_rest
from edge.rest.tip_match import as_followed, match_tip, near_rest
from edge.types import Image, Rest
from tests.support.layouts import only


def image_of(tip: Tip, size: tuple[int, int] = (240, 240)) -> Image:
    return Simulator(Camera(tip=tip, size_px=size)).frame().image


@pytest.fixture(scope="module")
def hexagonal() -> Rest:
    return take_rest([image_of(Tip(127, "hex"))])


@pytest.mark.parametrize("other", [Tip(91, "hex"), Tip(127, "rings"), Tip(121, "square")])
def test_another_tip_of_the_same_image_size_is_refused(hexagonal: Rest, other: Tip) -> None:
    with pytest.raises(CalibrationError, match=r"another tip|belongs to another one"):
        match_tip(tip_of(hexagonal), take_rest([image_of(other)]))


def test_another_image_size_or_pins_that_moved_together_are_refused(hexagonal: Rest) -> None:
    with pytest.raises(CalibrationError, match="made at 240x240, the images are 320x240"):
        match_tip(tip_of(hexagonal), take_rest([image_of(Tip(127, "hex"), (320, 240))]))
    by_px = np.array([0.55 * hexagonal.pattern.pitch_px, 0.0])
    moved = replace(hexagonal, pins=replace(hexagonal.pins, xy_img=hexagonal.xy_img + by_px))
    with pytest.raises(CalibrationError, match=r"pins are \d+\.\d px from where|another tip"):
        match_tip(tip_of(hexagonal), moved)


def test_a_rest_frame_that_misses_a_few_pins_is_accepted_and_read_as_later_images(hexagonal: Rest) -> None:
    large = replace(hexagonal, pins=replace(hexagonal.pins, radius_px=1.1 * hexagonal.pins.radius_px))
    image = image_of(Tip(127, "hex"))
    own = as_followed(match_tip(tip_of(large), only(hexagonal, np.arange(127) % 20 > 0))[0], [image])
    np.testing.assert_allclose(own.xy_img, hexagonal.xy_img, atol=0.05)
    assert np.hypot(*(near_rest(own, image).xy_img - own.xy_img).T).mean() < 0.001
