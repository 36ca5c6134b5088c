"""Modes against NumPy's least squares, and their behaviour under rotation."""

import numpy as np
import pytest

from edge.features.modes import INDEPENDENT_REL, MODE_NAMES, MODE_POWERS, Modes, mode_basis
from edge.features.pin_motion import ModeProduct
from tests.support.fields import CENTRE, make_rest, push, tip

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("pins", [127, 331])
@pytest.mark.parametrize("lost", [0, 1, 60])
def test_least_squares_over_the_seen_pins(pins: int, lost: int) -> None:
    rest = tip(pins)
    rng = np.random.default_rng(lost)
    motion = push(rest, (20.0, -11.0), 45.0, 0.2) + rng.normal(0.0, 0.05, (pins, 2))
    seen = np.ones(pins, np.bool_)
    seen[rng.choice(pins, lost, replace=False)] = False
    motion[~seen] = np.nan
    basis = mode_basis(rest)
    b, d = basis[seen], motion[seen] @ [1.0, 1j]
    ridge = INDEPENDENT_REL * pins * np.eye(b.shape[1])
    expected = np.linalg.solve(b.conj().T @ b + ridge, b.conj().T @ d)
    modes = Modes(rest)
    np.testing.assert_allclose(modes.fit(motion, seen), expected, rtol=0, atol=1e-11)
    if not lost:
        of_all = ModeProduct(modes.of_all).fit(motion)
        np.testing.assert_allclose(of_all, expected, rtol=0, atol=1e-6 * np.abs(d).max())


def test_modes_turn_by_their_spin() -> None:
    rest = tip(331)
    angle = 0.3
    turn = np.exp(1j * angle)
    motion = push(rest, (30.0, 12.0), 50.0, 0.2)
    z = (rest.xy_img - CENTRE) @ [1.0, 1j] * turn
    turned_rest = make_rest(np.column_stack([z.real, z.imag]) + CENTRE, rest.pattern.pitch_px)
    d = motion @ [1.0, 1j] * turn
    seen = np.ones(331, np.bool_)
    before = Modes(rest).fit(motion, seen)
    after = Modes(turned_rest).fit(np.column_stack([d.real, d.imag]), seen)
    spins = np.array([1 - a + b for a, b in MODE_POWERS])
    np.testing.assert_allclose(after, before * np.exp(1j * spins * angle), atol=1e-6 * np.abs(d).max())


def test_terms_that_the_layout_cannot_resolve_are_zero() -> None:
    rest = make_rest(CENTRE + 20.0 * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]), 20.0)
    fitted = Modes(rest).fit(np.ones((4, 2)), np.ones(4, np.bool_))
    empty = ~np.any(mode_basis(rest), axis=0)
    assert empty.any()
    assert not empty[MODE_NAMES.index("c00")]
    assert (fitted[empty] == 0.0).all()
