"""The contact detector: its limits and what it learns; test_extract has more."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from edge.features.contact_detector import ContactDetector
from edge.features.params import PARAMS, RING_NOISE, largest_noise
from edge.types import Array, Rest
from tests.support.fields import CENTRE, areas, push, tip

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


class Twice:
    """A detector that gets the areas of all frames, and one that gets those that it needs: they agree."""

    def __init__(self, rest: Rest) -> None:
        self.rest, self.rest_area, self.spared_n = rest, areas(rest.xy_img, rest), 0
        self.of_all, self.of_few = ContactDetector(rest), ContactDetector(rest)

    def decide(self, motion: Array) -> bool:
        xy = self.rest.xy_img + motion
        change = areas(xy, self.rest) / self.rest_area - 1.0
        known = self.of_few.known(xy, motion.mean(axis=0), 0.05, True, False)
        self.spared_n += known >= 0
        touched = self.of_all.by_area(change, xy, 0.05)
        assert (self.of_few.by_area(change, xy, 0.05) if known < 0 else known) == touched
        return touched


@pytest.mark.parametrize("pins", [61, 127, 331])
def test_motion_alone_tells_of_an_untouched_tip_what_areas_would(pins: int) -> None:
    """Presses, firm and faint, noise that grows, a camera that shakes and is turned."""
    rest, rng = tip(pins), np.random.default_rng(1)
    twice, touched_n, way = Twice(rest), 0, rest.xy_img - CENTRE
    for k in range(480):
        wave, part = np.sin(k / 15.0), k // 96
        pressed = push(rest, (20.0, -15.0), 40.0, max(0.0, wave) * (0.0, 0.04, 0.012, 0.0, 0.0)[part])
        shaken = (part > 3) * (
            np.array([3.0 * wave, -2.0]) + 0.01 * wave * (k > 432) * way @ [[0, 1], [-1, 0]]
        )
        touched_n += twice.decide(pressed + shaken + rng.normal(0.0, 0.08 if part == 3 else 0.05, way.shape))
    assert 50 < touched_n < 200
    assert twice.spared_n > 150


@pytest.mark.parametrize("actual", [0.03, 0.12])
def test_noise_is_learnt(actual: float) -> None:
    """The pins' sigma is 0.05 px; the true noise is less or more. Afterwards no false and no missed touch."""
    rest, rng = tip(127), np.random.default_rng(2)
    twice = Twice(rest)
    for k in range(200):
        assert not twice.decide(rng.normal(0.0, min(actual, 0.06 + 0.001 * k), (127, 2)))
    learnt = twice.of_few.cell_noise(0.05)
    assert learnt == pytest.approx(0.83 * actual / rest.pattern.pitch_px, rel=0.25)
    assert twice.decide(push(rest, (10.0, 10.0), 60.0, 0.04) + rng.normal(0.0, actual, (127, 2)))


def test_a_slow_touch_is_not_learnt_as_noise() -> None:
    rest, rng, heights = tip(331), np.random.default_rng(3), np.linspace(0.0, 0.05, 100)
    twice = Twice(rest)
    touched = [
        twice.decide(push(rest, (0.0, 0.0), 60.0, height) + rng.normal(0.0, 0.05, (331, 2)))
        for height in heights
    ]
    assert not touched[0]
    assert heights[int(np.argmax(touched))] < 0.005
    assert all(touched[int(np.argmax(touched)) + 5 :])


def test_skin_that_creeps_is_learnt_as_noise_of_rings_and_a_touch_still_begins() -> None:
    """Neighbours move alike: cells' noise is hardly more, and a ring's mean keeps all of it."""
    rest, rng = tip(127), np.random.default_rng(0)
    twice = Twice(rest)

    def decide(height: float) -> bool:
        """One frame of pins' noise and of waves across the skin, pressed so much."""
        waves = rng.normal(0.0, 0.05, 2) * np.sin(rest.xy_img / 40.0 + rng.uniform(0.0, 6.0, 2))
        return twice.decide(push(rest, (20.0, -15.0), 50.0, height) + waves + rng.normal(0.0, 0.05, (127, 2)))

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
