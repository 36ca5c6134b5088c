"""The motion that neighbours predict: exact where it is affine; wrong sizes and neighbours are refused."""

from __future__ import annotations

import numpy as np
import pytest

from edge.geometry.lattice import Lattice
from edge.tracking.outliers import LocalAffine
from edge.types import Array
from tests.support.fields import hexagon
from tests.support.refusals import refused

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


def test_values_of_unknown_pins_are_ignored() -> None:
    rng = np.random.default_rng(2)
    xy, _, affine = tip()
    motion, known = rng.normal(size=xy.shape), rng.random(len(xy)) < 0.6
    with_nan = np.where(known[:, None], motion, np.nan)
    for one, other in zip(affine.predict(motion, known), affine.predict(with_nan, known), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.compiled
def test_the_matrix_of_full_neighbourhoods_is_the_same_prediction() -> None:
    xy, _, affine = tip(5)
    motion = np.random.default_rng(3).normal(size=xy.shape)
    value, _, _ = affine.predict(motion, np.ones(len(xy), bool))
    np.testing.assert_allclose(affine.matrix() @ motion, value, atol=1e-12)


@pytest.mark.parametrize("motion_n", [36, 38, 0])
def test_motion_of_another_number_of_pins_is_refused(motion_n: int) -> None:
    _, _, affine = tip()
    refused(r"motion \(37, 2\)", affine.predict, np.zeros((motion_n, 2)), np.ones(37, bool))
    refused(r"known \(37,\)", affine.predict, np.zeros((37, 2)), np.ones(motion_n, bool))
    refused(r"motion \(37, 2\)", affine.predict, np.zeros((37, 3)), np.ones(37, bool))


@pytest.mark.parametrize("pin", [-1, 37, 2**31 - 1])
def test_a_neighbour_that_does_not_exist_is_refused(pin: int) -> None:
    _, lattice, _ = tip()
    lattice.near[5, 3] = pin
    refused("neighbours of 0 to 36", LocalAffine, lattice, 0.05)


def test_weights_of_another_size_are_refused() -> None:
    for name, cut in (("weight", np.s_[:, 1:]), ("offset", np.s_[1:])):
        _, lattice, _ = tip()
        setattr(lattice, name, getattr(lattice, name)[cut])
        refused(r"weight \(37, 18\)", LocalAffine, lattice, 0.05)
