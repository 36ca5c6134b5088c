"""The contact detector: its limits and what it learns; test_extract has more."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from edge.features.contact_detector import ContactDetector
from edge.features.params import PARAMS, RING_NOISE, largest_noise
from tests.support.fields import areas, push, tip

pytestmark = pytest.mark.kernels

ENDS = PARAMS.contact_sigma
BEGINS = np.hypot(ENDS, largest_noise(127))


def test_a_contact_has_hysteresis() -> None:
    rest = tip(127)
    detector = ContactDetector(rest)
    change = np.zeros(127)
    xy = rest.xy_img + push(rest, (0.0, 0.0), 60.0, 0.1)  # the medians agree throughout
    between = 0.5 * (BEGINS + ENDS)
    unit = RING_NOISE * 0.05 / rest.pattern.pitch_px
    answers = []
    for sigmas in (between, BEGINS + 0.1, between, ENDS - 0.1, between):
        change[:] = sigmas * unit
        answers.append(ContactDetector.by_area(detector, change, xy, 0.05))
        detector = detector if answers[-1] else ContactDetector(rest)  # without what it learnt
    assert answers == [False, True, True, False, False]


@pytest.mark.parametrize("n", [19, 127, 331])
def test_the_highest_of_many_passes_its_level_as_rarely_as_one_passes_its_own(n: int) -> None:
    """Of normal noise; to a fifth, which is 0.04 standard deviations."""
    many, one = n * norm.sf(np.hypot(ENDS, largest_noise(n))), norm.sf(ENDS)
    assert many == pytest.approx(one, rel=0.2)


def test_skin_that_creeps_is_learnt_as_noise_of_rings_and_a_touch_still_begins() -> None:
    """Neighbours move alike: cells' noise is hardly more, and a ring's mean keeps all of it."""
    rest = tip(127)
    rest_area = areas(rest.xy_img, rest)
    rng = np.random.default_rng(0)
    detector = ContactDetector(rest)

    def decide(height: float) -> bool:
        """One frame of pins' noise and of waves across the skin, pressed so much."""
        waves = rng.normal(0.0, 0.05, 2) * np.sin(rest.xy_img / 40.0 + rng.uniform(0.0, 6.0, 2))
        xy = rest.xy_img + push(rest, (20.0, -15.0), 50.0, height) + waves + rng.normal(0.0, 0.05, (127, 2))
        return detector.by_area(areas(xy, rest) / rest_area - 1.0, xy, 0.05)

    assert not any([decide(0.0) for _ in range(300)][64:])
    assert decide(0.05)


@pytest.mark.parametrize(("height", "noise"), [(0.0, 0.05), (0.0, 0.15), (0.015, 0.05)])
def test_quiet_pins_show_a_press_in_the_first_frame(height: float, noise: float) -> None:
    rest = tip(127)
    rest = replace(rest, pins=replace(rest.pins, sigma_px=np.full(127, 0.15 / 2**0.5)))
    rest_area = areas(rest.xy_img, rest)
    for seed in range(40):
        rng = np.random.default_rng(seed)
        xy = rest.xy_img + push(rest, (20.0, -15.0), 30.0, height) + rng.normal(0.0, noise, (127, 2))
        change = areas(xy, rest) / rest_area - 1.0
        assert ContactDetector(rest).by_area(change, xy, 0.15) == (height > 0.0)
