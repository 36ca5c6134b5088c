"""The kernel of `follow`: pins that are lost, and what is left of the residuals."""

from copy import deepcopy
from typing import Any

import numpy as np
import pytest

from edge.geometry.select import SIGMA_OF_MAD
from edge.tracking.follow import Follower
from edge.tracking.tip import TrackedTip
from edge.types import Array, Pins, Rest
from tests.support.fields import CENTRE, hexagon, make_rest

pytestmark = pytest.mark.kernels


REST = make_rest(hexagon(4, 19.0) + CENTRE, 19.0)


class Frames:
    """A kernel at rest, and the frames that it is given."""

    def __init__(self, rest: Rest) -> None:
        tip, n = TrackedTip(rest), len(rest)
        self.found = deepcopy(rest.pins)
        self.kernel = Follower(tip.lattice, tip.photometric, tip.params, self.found, np.empty((n, 2)))
        self.kernel.settle(rest.xy_img, np.zeros((n, 2)), np.ones(n, bool))

    def follow(self, found: Array) -> tuple[Any, ...]:
        self.found.xy_img[:] = found
        return self.kernel.follow()


def off_by(pitches: float, step: float) -> int:
    """For how many steps a pin is seen that moves off its neighbours, `step` a frame; pitches."""
    frames = Frames(REST)
    # Towards the middle of two neighbours, where it comes near to none.
    angle = np.deg2rad(30.0)
    away = 19.0 * np.array([np.cos(angle), np.sin(angle)])
    seen_n = 0
    for off in np.arange(step, pitches + 0.5 * step, step):
        found = REST.xy_img + 0.3
        found[0] += off * away
        _, _, seen, *_ = frames.follow(found)
        assert seen[1:].all()
        seen_n += int(seen[0])
    return seen_n


def test_a_pin_may_move_more_than_half_a_pitch_off_its_neighbours_if_it_was_never_lost() -> None:
    assert off_by(0.75, 0.05) == 15
    assert off_by(0.75, 0.75) == 0  # at once it may be another one
    assert 15 < off_by(1.3, 0.05) < 20  # a pitch off it is in another one's place


@pytest.mark.parametrize("steps_n", [1, 20])  # short ones do without residuals until the pin is lost
@pytest.mark.parametrize("left", [0.0, 0.5, 1.0])
def test_the_autocorrelation_is_what_is_left_of_the_residuals_and_a_lost_pin_keeps_as_much(
    left: float, steps_n: int
) -> None:
    n, lost = len(REST), 12
    frames = Frames(REST)
    bent = np.random.default_rng(3).normal(0.0, 0.5, (n, 2))
    for step in range(steps_n):
        frames.follow(REST.xy_img + (step + 1) / steps_n * bent)
    found = REST.xy_img + left * bent + 2.0
    found[lost] = np.nan
    *_, autocorrelation, _, _ = frames.follow(found)
    assert autocorrelation == pytest.approx(left, abs=0.02)
    assert frames.kernel.last_xy()[lost] == pytest.approx(
        REST.xy_img[lost] + left * bent[lost] + 2.0, abs=0.1
    )


@pytest.mark.parametrize("scatter", [0.003, 0.01, 0.03])
def test_pins_are_doubted_for_their_brightness_beside_the_gain_of_all_and_for_their_sigma(
    scatter: float,
) -> None:
    photometric, n = TrackedTip(REST).photometric, len(REST)

    def median_of(values: Array) -> float:
        return float(np.sort(values)[n // 2])

    for seed in range(50):
        rng = np.random.default_rng(seed)
        gain = 1.2 + rng.normal(0.0, scatter, n)
        gain[:3] *= rng.uniform(0.95, 1.05, 3)
        sigma = 0.05 * rng.uniform(0.7, 1.35, n)
        sigma[2:5] *= rng.uniform(1.0, 2.0, 3)
        off = np.abs(gain - median_of(gain))
        trusted = off <= max(0.03 * median_of(gain), 4.0 * SIGMA_OF_MAD * median_of(off))
        trusted &= sigma <= 2.0 * median_of(sigma)
        motion = np.where(trusted[:, None], 0.0, [5.0, 5.0])
        pins = Pins(REST.xy_img, sigma, REST.pins.radius_px, gain * REST.pins.brightness)
        found = photometric.accepted(pins, motion, np.ones((n, 2)), np.ones(n, np.bool_), searched=False)
        np.testing.assert_array_equal(found, trusted)
