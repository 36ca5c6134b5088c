"""The kernel of `follow`: pins that are lost, and what is left of the residuals."""

from copy import deepcopy
from typing import Any

import numpy as np
import pytest

from edge.tracking.follow import Follower
from edge.tracking.tip import TrackedTip
from edge.types import Array, Rest
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


@pytest.mark.parametrize("left", [0.0, 0.5, 1.0])
def test_the_autocorrelation_is_what_is_left_of_residuals_and_a_lost_pin_keeps_as_much(
    left: float,
) -> None:
    n, lost = len(REST), 12
    frames = Frames(REST)
    bent = np.random.default_rng(3).normal(0.0, 0.5, (n, 2))
    frames.follow(REST.xy_img + bent)
    found = REST.xy_img + left * bent + 2.0
    found[lost] = np.nan
    *_, autocorrelation, _, _ = frames.follow(found)
    assert autocorrelation == pytest.approx(left, abs=0.02)
    assert frames.kernel.last_xy()[lost] == pytest.approx(
        REST.xy_img[lost] + left * bent[lost] + 2.0, abs=0.1
    )
