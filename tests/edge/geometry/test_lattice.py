"""Pitch and slopes on lattices whose answers are known."""

import numpy as np
import pytest

from edge.geometry.lattice import pitch_of, slope_stencil
from edge.types import Array
from tests.support.fields import hexagon

PITCH = 19.0


def scattered() -> Array:
    """A lattice without ties: hexagonal, each pin moved a little."""
    xy = hexagon(6, PITCH)
    return xy + np.random.default_rng(1).normal(0.0, 0.1 * PITCH, xy.shape)


def test_the_pitch_of_a_hexagonal_lattice_is_its_spacing() -> None:
    assert pitch_of(hexagon(6, PITCH)) == pytest.approx(PITCH)


def test_the_pitch_of_two_points_is_their_distance() -> None:
    assert pitch_of(np.array([[0.0, 0.0], [3.0, 4.0]])) == pytest.approx(5.0)


def test_the_slope_of_an_affine_motion_is_exact() -> None:
    xy, gradient = scattered(), np.array([[0.03, -0.01], [0.02, 0.05]])
    ring, weight = slope_stencil(xy, PITCH)
    slope = np.einsum("nak,nkc->nac", weight, (xy @ gradient + 3.0)[ring])
    np.testing.assert_allclose(slope, np.broadcast_to(gradient, slope.shape), atol=1e-12)
