"""Contacts fitted to motions with known parameters, and to others."""

from dataclasses import replace

import numpy as np
import pytest

from edge.features.several.contact_fit import FITS_MAX, ContactFit
from edge.geometry.motion_field import SHARP, MotionPrior
from edge.types import Array, Mask
from tests.support.fields import CENTRE, tip

pytestmark = pytest.mark.kernels

REST = tip(127)
PITCH = REST.pattern.pitch_px
SEEN = np.ones(127, np.bool_)


def motion_px(
    place: Array, width: float, height: float, shear: complex = 0.0, dipole: complex = 0.0
) -> Array:
    """(127, 2) px: by a contact at a place, px; width, height, shear, dipole as `ContactFit` has them."""
    d = (REST.xy_img - place) / PITCH
    f = 1.0 / (1.0 + 0.5 * (d**2).sum(axis=1) / width**2)
    push = height / width**2 + (d @ (dipole.real, dipole.imag)) / width**2
    motion = (push * f * f)[:, None] * d + f[:, None] * (shear.real, shear.imag)
    return np.asarray(PITCH * motion, np.float64)


def line_px(place: Array, width: float, height: float, half: Array, evenly: bool = False) -> Array:
    """(127, 2) px: the mean over a line, half of which is `half` pitches, by its pressure."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    parts = [
        (0.5 if evenly else 2.0 / np.pi * np.sqrt(1.0 - t * t))
        * w
        * motion_px(place + t * half * PITCH, width, height)
        for t, w in zip(nodes, weights, strict=True)
    ]
    return np.asarray(np.sum(parts, axis=0), np.float64)


def affine_px(rng: np.random.Generator) -> Array:
    turn = rng.normal(0.0, 0.01, (2, 2))
    return np.asarray((REST.xy_img - CENTRE) @ turn + rng.normal(0.0, 2.0, 2), np.float64)


def made(motion: Array, near: Array, seen: Mask = SEEN, prior: MotionPrior = SHARP) -> ContactFit:
    fit = ContactFit(REST.xy_img, PITCH, prior=prior)
    fit.choose(REST.xy_img + motion, seen, near)
    return fit


def test_two_contacts_are_found_with_their_shears_and_an_affine_motion() -> None:
    rng = np.random.default_rng(1)
    places = CENTRE + np.array([[-1.3, 0.2], [1.4, -0.5]]) * PITCH
    motion = motion_px(places[0], 0.7, 0.3, 0.1 - 0.05j, 0.02j) + motion_px(places[1], 1.1, 0.15)
    starts = places + rng.normal(0.0, 0.3 * PITCH, (2, 2))
    fit = made(motion + affine_px(rng), starts, prior=replace(SHARP, curl=1.0))
    assert fit.fit_points(starts, 2) < 5e-3
    np.testing.assert_allclose(np.asarray(fit.place)[:2], places, atol=0.02 * PITCH)
    np.testing.assert_allclose(np.asarray(fit.width)[:2], [0.7, 1.1], rtol=0.05)
    np.testing.assert_allclose(np.asarray(fit.height)[:2], [0.3, 0.15], rtol=0.1)
    np.testing.assert_allclose(np.asarray(fit.shear)[0], [0.1, -0.05], atol=0.02)
    apart = ((places[1] - places[0]) ** 2).sum() / PITCH**2
    wanted = fit.height[0] + fit.height[1] / (1.0 + 0.5 * apart / fit.width[1] ** 2)
    assert fit.total[0] == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("evenly", [False, True])
def test_a_line_is_found_with_its_direction_and_length(evenly: bool) -> None:
    half = 1.8 * np.array([np.cos(0.6), np.sin(0.6)])
    place = CENTRE + np.array([4.0, -9.0])
    fit = made(line_px(place, 0.6, 0.4, half, evenly), CENTRE[None])
    start = 1.2 * PITCH * np.array([np.cos(0.3), np.sin(0.3)])
    other = fit.fit_line(CENTRE[0], CENTRE[1], start[0], start[1], np.inf, not evenly)
    line = fit.fit_line(CENTRE[0], CENTRE[1], start[0], start[1], np.inf, evenly)
    found = np.asarray(fit.dipole)[0]
    assert np.arctan2(found[1], found[0]) == pytest.approx(0.6, abs=0.01)
    assert np.hypot(*found) == pytest.approx(1.8, rel=0.05)
    np.testing.assert_allclose(np.asarray(fit.place)[0], place, atol=0.05 * PITCH)
    assert line < other
    assert line < 0.1 * fit.fit_points(CENTRE[None], 1)


def test_a_line_without_length_moves_pins_as_a_point_does() -> None:
    place = CENTRE + np.array([5.0, 3.0])
    fit = made(motion_px(place, 0.8, 0.3), CENTRE[None])
    line = fit.fit_line(CENTRE[0], CENTRE[1], 0.0, 0.0)
    np.testing.assert_allclose(np.asarray(fit.place)[0], place, atol=0.02 * PITCH)
    point = fit.fit_points(CENTRE[None], 1)
    assert line == pytest.approx(point, abs=1e-3)


def test_lost_pins_do_not_count() -> None:
    places = CENTRE + np.array([[-1.5, 0.0], [1.5, 0.0]]) * PITCH
    motion = motion_px(places[0], 0.8, 0.3) + motion_px(places[1], 0.8, 0.2)
    lost = np.random.default_rng(2).random(127) < 0.2
    motion[lost] = 1e3
    fit = made(motion, places, ~lost)
    fit.fit_points(places, 2)
    np.testing.assert_allclose(np.asarray(fit.place)[:2], places, atol=0.05 * PITCH)


def test_a_contact_stays_near_where_it_was_looked_for() -> None:
    away = CENTRE + np.array([4.0 * PITCH, 0.0])
    fit = made(motion_px(away, 0.8, 0.3), CENTRE[None])
    fit.fit_points(CENTRE[None], 1)
    assert np.hypot(*(np.asarray(fit.place)[0] - CENTRE)) <= 2.0 * PITCH + 1e-9
    assert np.exp(-1.5) - 1e-9 <= fit.width[0] <= np.exp(1.5) + 1e-9


def test_motion_without_any_sense_gives_finite_numbers() -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        fit = made(rng.normal(0.0, 50.0, (127, 2)), CENTRE[None])
        starts = CENTRE + rng.normal(0.0, 40.0, (FITS_MAX, 2))
        for n in range(1, FITS_MAX + 1):
            assert np.isfinite(fit.fit_points(starts, n))
            assert np.isfinite(np.asarray(fit.place)[:n]).all()
            assert np.isfinite(np.asarray(fit.total)[:n]).all()
        half = rng.normal(0.0, 40.0, 2)
        assert np.isfinite(fit.fit_line(CENTRE[0], CENTRE[1], half[0], half[1]))
