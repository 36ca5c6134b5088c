"""The thin-plate operators against scipy, and at the knots."""

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator

from edge.errors import DegenerateLayout
from edge.geometry.thin_plate import thin_plate_at, thin_plate_operators
from edge.types import Array


def test_operator_is_scipys_thin_plate_spline() -> None:
    rng = np.random.default_rng(0)
    knots, points, values = rng.normal(size=(40, 2)), rng.normal(size=(25, 2)), rng.normal(size=40)
    oracle = RBFInterpolator(knots, values, kernel="thin_plate_spline")
    value, along_x, along_y = thin_plate_operators(knots, points)
    np.testing.assert_allclose(value @ values, oracle(points), atol=1e-9)
    step = 1e-5
    for slope, way in ((along_x, np.array([step, 0.0])), (along_y, np.array([0.0, step]))):
        numeric = (oracle(points + way) - oracle(points - way)) / (2.0 * step)
        np.testing.assert_allclose(slope @ values, numeric, atol=1e-4)


@pytest.mark.parametrize("knots", [np.zeros((2, 2)), np.column_stack([np.arange(9.0), np.arange(9.0)])])
def test_pins_on_a_line_are_refused(knots: Array) -> None:
    with pytest.raises(DegenerateLayout):
        thin_plate_operators(knots, np.zeros((1, 2)))


@pytest.mark.parametrize("ridge", [0.0, 0.05, 3.0])
def test_spline_near_values_is_the_penalised_least_squares(ridge: float) -> None:
    """Against the textbook's system in the knots' own unit: centre and scale must not matter."""
    rng = np.random.default_rng(4)
    knots, points, values = (
        rng.uniform(3.0, 9.0, (40, 2)),
        rng.uniform(3.0, 9.0, (7, 2)),
        rng.normal(size=(40, 2)),
    )

    def kernel(a: Array, b: Array) -> Array:
        r2 = ((a[:, None] - b[None]) ** 2).sum(axis=2)
        return np.asarray(0.5 * r2 * np.log(np.maximum(r2, 1e-300)), np.float64)

    flat = np.column_stack([np.ones(40), knots])
    system = np.block([[kernel(knots, knots) + ridge * np.eye(40), flat], [flat.T, np.zeros((3, 3))]])
    terms = np.linalg.solve(system, np.vstack([values, np.zeros((3, 2))]))
    wanted = np.hstack([kernel(points, knots), np.ones((7, 1)), points]) @ terms
    np.testing.assert_allclose(thin_plate_at(knots, values, points, ridge), wanted, atol=1e-9)
