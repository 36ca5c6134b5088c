"""Mean motion, contact pins, torsion and planes of motion fields with known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from edge.features.pin_motion import PinMotion
from edge.types import Array, Index, Rest
from tests.support.fields import CENTRE, make_rest, tip
from tests.support.refusals import refused


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


def test_mean_motion_is_that_of_the_seen_pins() -> None:
    rest = make_rest(np.array([[5.0, 5.0], [6.0, 5.0], [7.0, 5.0]]), 1.0)
    xy = rest.xy_img + np.array([[1.0, 2.0], [3.0, 4.0], [np.nan, np.nan]])
    motion, sigma = PinMotion(rest), np.array([0.1, 0.3, np.nan])
    assert motion.since_rest(xy, sigma) == 2
    assert motion.sigma_px == pytest.approx(0.2)
    np.testing.assert_allclose(motion.mean, [2.0, 3.0])
    np.testing.assert_array_equal(motion.xy, xy)
    np.testing.assert_array_equal(motion.motion, xy - rest.xy_img)
    assert motion.since_rest(np.full((3, 2), np.nan), sigma) == motion.sigma_px == 0
    assert np.isnan(motion.mean).all()


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


def test_torsion_needs_two_pins() -> None:
    assert np.isnan(moved(tip(127), np.zeros((127, 2)), np.array([0], np.int32)).torsion())


def test_contact_pins_fill_the_ring_of_a_flat_contact() -> None:
    rest = tip(331)
    xy = rest.xy_img
    at = CENTRE + np.array([25.0, -10.0])
    far = np.hypot(*(xy - at).T)
    ring = ((far > 55.0) & (far < 75.0)).astype(np.float64)
    chosen = np.zeros(331, dtype=np.bool_)
    chosen[contact_of(rest, ring)] = True
    assert chosen[far < 50.0].all()
    assert not chosen[far > 120.0].any()


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


def test_a_plane_removes_the_motion_that_a_load_explains() -> None:
    rest = tip(331)
    unit = (rest.xy_img - CENTRE) / rest.pattern.tip_radius_px
    rng = np.random.default_rng(1)
    before, now = rng.normal(0.0, 1.0, (2, 331, 2))
    now[5], before[9] = np.nan, np.nan
    pins = np.arange(0, 331, 3, dtype=np.int32)
    made = moved(rest, now, pins)
    used = made.fit_step(before)
    step = (now - before)[pins]
    known = np.isfinite(step[:, 0])
    basis = np.column_stack([np.ones(len(pins)), unit[pins]])[known]
    residual = step[known] - basis @ np.linalg.lstsq(basis, step[known], rcond=None)[0]
    assert used == known.sum()
    assert made.left_px2 == pytest.approx((residual**2).sum(), rel=1e-9)
    assert moved(rest, now, pins[:0]).fit_step(before) == 0


def test_a_contact_is_pressed_where_its_cells_grow_together() -> None:
    pins = np.arange(40, 60, dtype=np.int32)
    made = moved(tip(127), np.zeros((127, 2)), pins)
    before = np.random.default_rng(2).normal(0.0, 0.02, 127)
    sizes = np.linspace(0.01, 0.2, 127)
    mixed = sizes * np.where(np.arange(127) % 2, 1.0, -1.0)
    for sign in (1.0, -1.0):
        assert made.is_pressing(before + sign * sizes, before, 0.9)
        assert not made.is_pressing(before + sign * mixed, before, 0.9)
    change = mixed[pins]
    share = abs(change.sum()) / np.abs(change).sum()
    assert made.is_pressing(before + mixed, before, share - 1e-9)
    assert not made.is_pressing(before + mixed, before, share + 1e-9)
    lost = before + sizes
    lost[45], before[46] = np.nan, np.nan
    assert made.is_pressing(lost, before, 0.9)
    assert not made.is_pressing(np.full(127, np.nan), before, 0.9)


def test_a_rest_frame_without_two_coordinates_a_pin_is_refused() -> None:
    rest = tip(127)
    pins = replace(rest.pins, xy_img=rest.xy_img[:, :1])
    refused("wanted", PinMotion, replace(rest, pins=pins))


def test_a_tip_without_a_radius_is_refused() -> None:
    rest = tip(127)
    flat = replace(rest, pattern=replace(rest.pattern, tip_radius_px=0.0))
    refused("radius", PinMotion, flat)


def test_arrays_that_do_not_fit_are_refused() -> None:
    made, xy, sigma = PinMotion(tip(127)), np.zeros((127, 2)), np.zeros(127)
    for bad in (xy[:-1], np.zeros((127, 3)), np.zeros((128, 2))):
        refused("wanted", made.since_rest, bad, sigma)
    refused("wanted", made.since_rest, xy, sigma[:-1])
