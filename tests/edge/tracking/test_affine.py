"""The motion that neighbours predict: exact where it is affine."""

import numpy as np
import pytest

from edge.geometry.lattice import Lattice
from edge.tracking.affine import LocalAffine
from edge.types import Array
from tests.support.fields import hexagon

PITCH = 19.0

pytestmark = pytest.mark.kernels


def tip(rings: int = 3) -> tuple[Array, Lattice, LocalAffine]:
    xy = hexagon(rings, PITCH)
    lattice = Lattice(xy, PITCH)
    return xy, lattice, LocalAffine(lattice, 0.05)


def test_an_affine_motion_is_predicted_from_two_thirds_of_the_neighbours() -> None:
    rng = np.random.default_rng(9)
    xy, _, affine = tip(5)
    gradient = 0.05 * rng.normal(size=(2, 2))
    motion = xy @ gradient + rng.normal(size=2)
    value, support, slope = affine.predict(motion, rng.random(len(xy)) < 0.7)
    inner = np.hypot(*xy.T) < 3 * PITCH
    assert np.abs(value - motion)[inner].max() < 0.1
    assert support.min() > 0
    np.testing.assert_allclose(slope[inner] / PITCH, np.broadcast_to(gradient, slope[inner].shape), atol=0.01)


def test_a_pin_does_not_affect_its_own_prediction() -> None:
    xy, _, affine = tip()
    motion = np.zeros_like(xy)
    motion[7] = 5.0
    value, _, _ = affine.predict(motion, np.ones(len(xy), bool))
    np.testing.assert_array_equal(value[7], 0.0)
