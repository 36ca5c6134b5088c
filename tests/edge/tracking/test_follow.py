"""The kernel of `follow`: pins that are lost, and what is left of the residuals."""

from typing import Any

import numpy as np
import pytest

from edge.tracking.follow import Follower
from edge.tracking.tip import TrackedTip
from edge.types import Rest
from tests.support.fields import CENTRE, hexagon, make_rest

pytestmark = pytest.mark.kernels


def small_tip(rings: int = 2) -> Rest:
    return make_rest(hexagon(rings, 19.0) + CENTRE, 19.0)


def follower(rest: Rest) -> Follower:
    tip = TrackedTip.of(rest)
    return Follower(tip.lattice, tip.photometric, tip.params)


def test_arrays_of_another_layout_are_looked_at_in_each_frame() -> None:
    rest = small_tip()
    found = np.asfortranarray(rest.xy_img)
    brightness: Any = rest.pins.brightness.astype(np.float32)
    kernel = follower(rest)
    kernel.settle(rest.xy_img, np.zeros((len(rest), 2)), np.ones(len(rest), bool))
    for _ in range(2):
        found += 0.3
        xy, _, seen, *_ = kernel.follow(found, rest.pins.sigma_px, brightness)
        assert seen.all()
        np.testing.assert_array_equal(xy, found)
        kernel.accept(0.7)
        np.testing.assert_allclose(kernel.last_xy(), found)


def test_no_pin_is_seen_where_nothing_was_found_or_two_are_on_one_blob() -> None:
    rest = small_tip()
    n = len(rest)
    kernel = follower(rest)
    kernel.settle(rest.xy_img, np.zeros((n, 2)), np.ones(n, bool))
    found = rest.xy_img.copy()
    found[3], found[8] = np.nan, found[9]
    _, _, seen, seen_n, leapt, *_ = kernel.follow(found, rest.pins.sigma_px, rest.pins.brightness)
    np.testing.assert_array_equal(np.flatnonzero(~seen), [3, 8])
    assert seen_n == n - 2
    assert not leapt


def test_of_two_pins_that_approach_slowly_one_is_lost_when_they_are_too_near() -> None:
    rest = small_tip(3)
    n = len(rest)
    kernel = follower(rest)
    kernel.settle(rest.xy_img, np.zeros((n, 2)), np.ones(n, bool))
    towards = 0.5 * (rest.xy_img[1] - rest.xy_img[0])
    for share in np.linspace(0.0, 0.7, 30):
        found = rest.xy_img + 0.3
        found[0] += share * towards
        found[1] -= share * towards
        _, _, seen, *_ = kernel.follow(found, rest.pins.sigma_px, rest.pins.brightness)
        kernel.accept(0.7)
        assert seen[2:].all()
        assert np.count_nonzero(seen[:2]) == (2 if share < 0.5 else 1), share


def off_by(pitches: float, step: float) -> int:
    """For how many steps a pin is seen that moves off its neighbours, `step` a frame; pitches."""
    rest = small_tip(4)
    n = len(rest)
    kernel = follower(rest)
    kernel.settle(rest.xy_img, np.zeros((n, 2)), np.ones(n, bool))
    # Towards the middle of two neighbours, where it comes near to none.
    angle = np.deg2rad(30.0)
    away = 19.0 * np.array([np.cos(angle), np.sin(angle)])
    seen_n = 0
    for off in np.arange(step, pitches + 0.5 * step, step):
        found = rest.xy_img + 0.3
        found[0] += off * away
        _, _, seen, *_ = kernel.follow(found, rest.pins.sigma_px, rest.pins.brightness)
        kernel.accept(0.7)
        assert seen[1:].all()
        seen_n += int(seen[0])
    return seen_n


def test_a_pin_may_move_more_than_half_a_pitch_off_its_neighbours_if_it_was_never_lost() -> None:
    assert off_by(0.75, 0.05) == 15
    assert off_by(0.75, 0.75) == 0  # at once it may be another one
    assert 15 < off_by(1.3, 0.05) < 20  # a pitch off it is in another one's place


@pytest.mark.parametrize("left", [0.0, 0.5, 1.0])
def test_the_autocorrelation_is_what_is_left_of_the_residuals_and_a_lost_pin_keeps_as_much(
    left: float,
) -> None:
    rest = small_tip(4)
    n, lost = len(rest), 12
    kernel = follower(rest)
    kernel.settle(rest.xy_img, np.zeros((n, 2)), np.ones(n, bool))
    bent = np.random.default_rng(3).normal(0.0, 0.5, (n, 2))
    kernel.follow(rest.xy_img + bent, rest.pins.sigma_px, rest.pins.brightness)
    kernel.accept(0.0)
    found = rest.xy_img + left * bent + 2.0
    found[lost] = np.nan
    *_, autocorrelation = kernel.follow(found, rest.pins.sigma_px, rest.pins.brightness)
    assert autocorrelation == pytest.approx(left, abs=0.02)
    kernel.accept(0.0)
    assert kernel.last_xy()[lost] == pytest.approx(rest.xy_img[lost] + left * bent[lost] + 2.0, abs=0.1)


def test_a_search_tells_what_is_left_of_the_residuals() -> None:
    rest = small_tip()
    n = len(rest)
    kernel = follower(rest)
    bent = np.random.default_rng(3).normal(0.0, 0.5, (n, 2))
    assert kernel.settle(rest.xy_img, bent, np.ones(n, bool)) == 0.0
    assert kernel.settle(rest.xy_img, 0.4 * bent, np.ones(n, bool)) == pytest.approx(0.4)
    assert kernel.settle(rest.xy_img, -bent, np.ones(n, bool)) == 0.0
