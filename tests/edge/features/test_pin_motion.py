"""Noise, contact pins and torsion of motion fields with known truth; the volume."""

import numpy as np
import pytest

from edge.features.pin_motion import AreaChange, PinMotion, PinNoise
from edge.types import Array, Index, Rest
from tests.support.fields import CENTRE, frame, push, tip


def turned(xy: Array, angle: float, about: Array) -> Array:
    """Motion of a rigid rotation from x towards y."""
    c, s = np.cos(angle), np.sin(angle)
    motion: Array = (xy - about) @ np.array([[c, s], [-s, c]]) + about - xy
    return motion


def moved(rest: Rest, motion: Array, pins: Index | None = None) -> PinMotion:
    """With this motion since rest, of which these pins are in the contact; None: all."""
    made = PinMotion(rest)
    made.since_rest(rest.xy_img + motion, np.full(len(rest), 0.1))
    if pins is not None:
        made.n_pins = len(pins)
        np.asarray(made.pins)[: len(pins)] = pins
    return made


def contact_of(rest: Rest, change: Array) -> Index:
    made = PinMotion(rest)
    found = made.find_contact(change, 0.0)
    return np.asarray(made.pins)[:found]


def test_the_longest_motion_and_step_and_the_largest_sigma_are_those_of_seen_pins() -> None:
    rest, rng = tip(127), np.random.default_rng(1)
    made, (before, now), sigma = PinMotion(rest), rng.normal(size=(2, 127, 2)), rng.uniform(0.1, 1.0, 127)
    now[3] = before[5] = np.nan
    made.since_rest(rest.xy_img + before, sigma)
    assert made.since_rest(rest.xy_img + now, sigma) == 126
    found = made.longest_px, made.step_px, made.sigma_max_px
    step_px = np.nanmax(np.hypot(*(now - before).T))
    assert found == pytest.approx((np.nanmax(np.hypot(*now.T)), step_px, np.delete(sigma, 3).max()))


@pytest.mark.parametrize("angle", [-1.2, -0.05, 0.0, 0.003, 0.4])
def test_torsion_is_the_angle_of_a_rigid_turn_wherever_it_is(angle: float) -> None:
    rest = tip(331)
    xy = rest.xy_img
    motion = turned(xy, angle, CENTRE + np.array([80.0, -20.0])) + np.array([7.0, -11.0])
    pins = np.flatnonzero(np.hypot(*(xy - CENTRE - [30.0, 10.0]).T) < 60.0).astype(np.int32)
    motion[pins[3]] = np.nan  # a lost pin does not count
    assert moved(rest, motion, pins).torsion() == pytest.approx(angle, abs=1e-12)


def test_torsion_does_not_depend_on_shear_or_expansion() -> None:
    rest = tip(331)
    motion = 0.2 * (rest.xy_img - CENTRE) + [5.0, 2.0]
    assert moved(rest, motion).torsion() == pytest.approx(0.0, abs=1e-12)


def test_contact_pins_are_those_of_the_plain_ellipse() -> None:
    rest = tip(331)
    rng = np.random.default_rng(0)
    for _ in range(20):
        c = np.maximum(rng.normal(0.0, 1.0, 331) * (rng.random(331) < 0.1), 0.0)
        r = rest.xy_img - c @ rest.xy_img / c.sum()
        inverse = np.linalg.inv((r * c[:, None]).T @ r / c.sum())
        inside = np.einsum("ia,ab,ib->i", r, inverse, r) <= 4.0
        np.testing.assert_array_equal(contact_of(rest, c), np.flatnonzero(inside))
    one = np.zeros(331)
    one[7] = 0.3
    np.testing.assert_array_equal(contact_of(rest, one), [7])
    np.testing.assert_array_equal(contact_of(rest, np.zeros(331)), np.arange(331))


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


@pytest.mark.kernels
def test_volume_of_noise_is_zero_and_noise_adds_none_to_a_bump() -> None:
    rest = tip(331)
    areas = frame(rest, rest.xy_img)[1].rest_area_px2
    changes = AreaChange(rest.xy_img, rest.pattern.pitch_px, areas)
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
