"""Gaps in the area changes, and the volume: against the skin's motion, an integral, and noise."""

import numpy as np
import pytest

from edge.features.pin_motion import AreaChange
from edge.types import Array, Rest
from tests.support.fields import CENTRE, frame, push, tip

pytestmark = pytest.mark.kernels


def rest_areas(rest: Rest) -> Array:
    return np.asarray(frame(rest, rest.xy_img)[1].rest_area_px2)


def made(rest: Rest) -> AreaChange:
    return AreaChange(rest.xy_img, rest.pattern.pitch_px, rest_areas(rest))


def test_a_lost_cell_changes_as_the_skin_between_its_neighbours() -> None:
    rest = tip(331)
    changes = made(rest)
    rng = np.random.default_rng(2)
    xy = rest.xy_img + push(rest, (5.0, -9.0), 60.0, 0.1)
    _, cells = frame(rest, xy)
    change = np.empty(331)
    changes.since_rest(cells.area_px2, change)
    np.testing.assert_allclose(change, cells.area_px2 / cells.rest_area_px2 - 1.0, rtol=0, atol=1e-15)
    changes.fill(change, xy)
    np.testing.assert_array_equal(changes.values, change)
    lost = rng.choice(331, 99, replace=False)
    inner = lost[np.hypot(*(rest.xy_img[lost] - CENTRE).T) < 0.9 * rest.pattern.tip_radius_px]
    gaps = change.copy()
    gaps[lost] = np.nan
    changes.fill(gaps, xy)
    filled = np.asarray(changes.values)
    assert np.isfinite(filled).all()
    np.testing.assert_allclose(filled[inner], change[inner], atol=0.02)


@pytest.mark.parametrize(("level", "counted"), [(-1.0, 0.0), (0.1, 0.0), (0.15, 0.1), (0.2, 0.2), (0.5, 0.5)])
def test_firm_threshold(level: float, counted: float) -> None:
    rest = tip(127)
    changes = made(rest)
    changes.fill(np.full(127, level), rest.xy_img)
    assert changes.volume(0.1) == pytest.approx(counted * rest_areas(rest).sum(), abs=1e-6)


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
