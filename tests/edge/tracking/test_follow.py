"""The kernel of `follow`: pins that are lost, and what is left of the residuals."""

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
