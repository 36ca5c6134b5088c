"""The contact detector against the same decisions in NumPy; learning and refusals are in test_extract
too.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from edge.features.contact_detector import ContactDetector
from edge.features.params import PARAMS, RING_NOISE, largest_noise
from edge.geometry.lattice import slope_stencil
from edge.types import Array, Rest
from tests.support.fields import areas, push, tip
from tests.support.refusals import refused

pytestmark = pytest.mark.kernels

ENDS = PARAMS.contact_sigma
BEGINS = np.hypot(ENDS, largest_noise(127))


def area_change_by_medians(rest: Rest, xy: Array) -> Array:
    """(n,) area change at each pin when each moves as the median of its ring."""
    ring, slope = slope_stencil(rest.xy_img, rest.pattern.pitch_px)
    middle = np.median((xy - rest.xy_img)[ring], axis=1)
    gradient = np.einsum("ndk,nkc->ncd", slope, middle[ring])
    return np.asarray(np.linalg.det(np.eye(2) + gradient) - 1.0)


def test_in_contact_where_ring_means_and_medians_are_beyond_the_limits() -> None:
    rest = tip(127)
    ring, _ = slope_stencil(rest.xy_img, rest.pattern.pitch_px)
    rest_area = areas(rest.xy_img, rest)
    rng = np.random.default_rng(0)
    answers = []
    for height in np.linspace(0.0, 0.01, 40):
        xy = rest.xy_img + push(rest, (20.0, -15.0), 50.0, height) + rng.normal(0.0, 0.05, (127, 2))
        change = areas(xy, rest) / rest_area - 1.0
        limit = BEGINS * RING_NOISE * 0.05 / rest.pattern.pitch_px
        mean = change[ring].mean(axis=1)
        by_medians = area_change_by_medians(rest, xy)
        coherent = by_medians[ring[mean.argmax()]].max() > ENDS / BEGINS * limit or by_medians.max() > limit
        expected = bool(mean.max() > limit and coherent)
        assert ContactDetector(rest).by_area(change, xy, 0.05) == expected
        answers.append(expected)
    assert len(set(answers)) == 2


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


def test_a_mean_over_few_cells_is_scaled_down_and_over_three_ignored() -> None:
    rest = tip(127)
    ring, _ = slope_stencil(rest.xy_img, rest.pattern.pitch_px)
    xy = rest.xy_img + push(rest, (0.0, 0.0), 60.0, 0.1)
    limit = BEGINS * RING_NOISE * 0.05 / rest.pattern.pitch_px
    for known, factor, expected in ((4, 1.01, True), (4, 0.99, False), (3, 100.0, False)):
        change = np.full(127, np.nan)
        change[ring[0, :known]] = factor * limit / np.sqrt(known / 7)
        assert ContactDetector(rest).by_area(change, xy, 0.05) == expected
    assert not ContactDetector(rest).by_area(np.full(127, np.nan), xy, 0.05)


def test_a_contact_holds_by_its_pins_motion_while_that_alone_would_begin_one() -> None:
    rest = tip(127)
    rest_area = areas(rest.xy_img, rest)
    detector = ContactDetector(rest)
    answers = []
    for height in (0.0, 0.1, 0.08, 0.001, 0.05):  # the last without areas in between: it is where it was
        xy = rest.xy_img + push(rest, (20.0, -15.0), 50.0, height)
        if height != 0.05:
            detector.by_area(areas(xy, rest) / rest_area - 1.0, xy, 0.05)
        answers.append(detector.holds(xy))
    assert answers == [False, True, True, False, False]
    detector.by_area(areas(xy, rest) / rest_area - 1.0, xy, 0.05)
    assert detector.holds(xy)
    assert not detector.holds(rest.xy_img)
    xy[0] = np.nan
    assert not detector.holds(xy)
    refused("wanted", detector.holds, xy[1:])


def test_without_areas_pins_that_move_against_each_other_decide() -> None:
    rest = tip(127)
    xy = rest.xy_img + np.array([9.0, -4.0])
    assert not ContactDetector(rest).by_motion(xy, 0.05)
    xy += push(rest, (0.0, 0.0), 60.0, 0.02)
    assert ContactDetector(rest).by_motion(xy, 0.05)
    xy[:124] = np.nan
    assert not ContactDetector(rest).by_motion(xy, 0.05)  # three pins are not enough


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
