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
        self.rest, self.rest_area = rest, areas(rest.xy_img, rest)
        self.of_all, self.of_few = ContactDetector(rest), ContactDetector(rest)
        self.spared_n = 0

    def decide(self, xy: Array) -> bool:
        change = areas(xy, self.rest) / self.rest_area - 1.0
        known = self.of_few.known(xy, (xy - self.rest.xy_img).mean(axis=0), 0.05, True, False)
        self.spared_n += known >= 0
        touched = self.of_all.by_area(change, xy, 0.05)
        assert (self.of_few.by_area(change, xy, 0.05) if known < 0 else known) == touched
        return touched


@pytest.mark.parametrize("pins", [61, 127, 331])
def test_the_pins_motion_alone_tells_of_an_untouched_tip_what_areas_would(pins: int) -> None:
    """Presses, firm and faint, noise that grows, a camera that shakes and is turned."""
    rest, rng = tip(pins), np.random.default_rng(1)
    twice, touched_n = Twice(rest), 0
    for k in range(480):
        wave, way = np.sin(k / 15.0), rest.xy_img - CENTRE
        height = max(0.0, wave) * (0.0, 0.04, 0.012, 0.0, 0.0)[k // 96]
        turn = 0.01 * wave * (k > 432) * np.column_stack([-way[:, 1], way[:, 0]])
        noise = rng.normal(0.0, 0.08 if 288 < k < 384 else 0.05, way.shape)
        shaken = turn + noise + (k > 384) * np.array([3.0 * wave, -2.0])
        touched_n += twice.decide(rest.xy_img + push(rest, (20.0, -15.0), 40.0, height) + shaken)
    assert 50 < touched_n < 200
    assert twice.spared_n > 150


def test_skin_that_creeps_is_learnt_as_noise_of_rings_and_a_touch_still_begins() -> None:
    """Neighbours move alike: cells' noise is hardly more, and a ring's mean keeps all of it."""
    rest = tip(127)
    rng = np.random.default_rng(0)
    twice = Twice(rest)

    def decide(height: float) -> bool:
        """One frame of pins' noise and of waves across the skin, pressed so much."""
        waves = rng.normal(0.0, 0.05, 2) * np.sin(rest.xy_img / 40.0 + rng.uniform(0.0, 6.0, 2))
        noise = rng.normal(0.0, 0.05, (127, 2))
        return twice.decide(rest.xy_img + push(rest, (20.0, -15.0), 50.0, height) + waves + noise)

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
