"""The thin-plate operators against scipy, and at the knots."""

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator

from edge.errors import DegenerateLayout
from edge.geometry.thin_plate import thin_plate_operators
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
