"""Noise of a pin, measured from its neighbours."""

from __future__ import annotations

import numpy as np
import pytest

from edge.features.pin_motion import PinNoise
from tests.support.fields import CENTRE, push, tip

pytestmark = pytest.mark.kernels


def test_pin_noise_is_measured_under_load_and_with_bad_pins() -> None:
    rest = tip(331)
    noise, rng = PinNoise(rest.xy_img, rest.pattern.pitch_px), np.random.default_rng(4)
    seen = np.ones(331, dtype=np.bool_)
    load = push(rest, (5.0, -9.0), 40.0, 0.2) + (rest.xy_img - CENTRE) @ [[0.1, 0.2], [-0.1, 0.0]] + 7.0
    for sigma in (0.05, 0.4):
        xy = rest.xy_img + load + rng.normal(0.0, sigma, (331, 2))
        assert noise.sigma_px(xy, seen) == pytest.approx(sigma, rel=0.2)
        xy[rng.choice(331, 4, replace=False)] += 6.0
        assert noise.sigma_px(xy, seen) < 2.0 * sigma
    assert noise.sigma_px(rest.xy_img, np.zeros(331, dtype=np.bool_)) == 0.0
