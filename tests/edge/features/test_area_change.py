"""Gaps in the area changes, and the volume: against the skin's motion, an integral, and noise."""

import numpy as np
import pytest

from edge.features.pin_motion import AreaChange
from edge.types import Array, Rest
from tests.support.fields import CENTRE, frame, tip

pytestmark = pytest.mark.kernels


def rest_areas(rest: Rest) -> Array:
    return np.asarray(frame(rest, rest.xy_img)[1].rest_area_px2)


def made(rest: Rest) -> AreaChange:
    return AreaChange(rest.xy_img, rest.pattern.pitch_px, rest_areas(rest))


def test_volume_of_noise_is_zero_and_noise_adds_none_to_a_bump() -> None:
    rest = tip(331)
    changes = made(rest)
    rng = np.random.default_rng(3)
    width, noise = 40.0, 0.002
    clean = 0.3 * np.exp(-0.5 * ((rest.xy_img - CENTRE) ** 2).sum(axis=1) / width**2)

    def volume(change: Array, threshold: float = 3.0 * noise) -> float:
        changes.fill(change, rest.xy_img)
        return changes.volume(threshold)

    draws = rng.normal(0.0, noise, (50, 331))
    full = 0.3 * 2.0 * np.pi * width**2
    assert np.mean([volume(d, 0.0) for d in draws]) > 0.01 * full  # of noise without a threshold
    assert np.mean([volume(d) for d in draws]) < 4e-4 * full
    assert abs(volume(clean) / full - 1.0) < 0.03
    assert abs(np.mean([volume(clean + d) for d in draws]) / volume(clean) - 1.0) < 0.01
