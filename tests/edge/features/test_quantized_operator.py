"""Products in 16-bit integers: their error, and that no sum overflows."""

from __future__ import annotations

import numpy as np
import pytest

from edge.features.contact_field import QuantizedOperator
from tests.support.refusals import refused

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize(("k", "m"), [(1, 1), (3, 15), (4, 16), (9, 33), (50, 331)])
def test_product_is_off_by_half_a_step_of_each(k: int, m: int) -> None:
    rng = np.random.default_rng(k)
    matrix, values = rng.normal(size=(k, m)), rng.normal(size=m).astype(np.float32)
    operator = QuantizedOperator(matrix)
    np.asarray(operator.values)[:] = values
    operator.apply()
    step = np.maximum(np.abs(matrix).max(axis=1) / 32767.0, np.abs(matrix).sum(axis=1) / 65000.0)
    bound = 0.51 * (step * np.abs(values).sum() + np.abs(matrix).sum(axis=1) * np.abs(values).max() / 32767.0)
    assert (np.abs(np.asarray(operator.result) - matrix @ values) <= bound + 1e-5).all()


def test_chosen_rows_are_those_of_the_whole_product() -> None:
    rng = np.random.default_rng(1)
    operator = QuantizedOperator(rng.normal(size=(40, 50)))
    np.asarray(operator.values)[:] = rng.normal(size=50)
    operator.apply()
    whole = np.array(operator.result)
    which = np.array([39, 0, 7, 7, 3], np.int32)
    operator.apply_rows(which, 4)
    np.testing.assert_array_equal(np.asarray(operator.result)[:4], whole[which[:4]])


@pytest.mark.parametrize("k", [1, 4, 6])
def test_small_weights_are_left_out_as_far_as_rounding_hides_it(k: int) -> None:
    """Rows that decay from their middle on, and rows of zeros."""
    rng = np.random.default_rng(k)
    decay = np.exp(-0.15 * np.abs(np.arange(331) - np.linspace(0, 330, k)[:, None]))
    matrix = rng.normal(size=(k, 331)) * decay
    matrix[-1] = 0.0
    values = rng.normal(size=331)
    step = np.maximum(np.abs(matrix).max(axis=1) / 32767.0, np.abs(matrix).sum(axis=1) / 65000.0)
    rounding = step * np.sqrt(331 / 12.0) * np.hypot.reduce(values)  # that is also what is left out, at most
    of_values = np.abs(matrix).sum(axis=1) * np.abs(values).max() / 32767.0
    operator = QuantizedOperator(matrix)
    np.asarray(operator.values)[:] = values
    operator.apply()
    assert (np.abs(np.asarray(operator.result) - matrix @ values) <= 2.0 * rounding + of_values).all()


def test_the_largest_sums_fit_32_bits() -> None:
    operator = QuantizedOperator(np.ones((2, 1000)) * [[1.0], [-1.0]])
    np.asarray(operator.values)[:] = 1.0
    operator.apply()
    np.testing.assert_allclose(operator.result, [1000.0, -1000.0], rtol=1e-2)


def test_values_round_to_the_nearest_step_ties_to_even() -> None:
    operator = QuantizedOperator(np.eye(5))
    np.asarray(operator.values)[:] = [32767.0, 0.5, 1.5, -2.5, 2.4]
    operator.apply()
    np.testing.assert_allclose(operator.result, [32767.0, 0.0, 2.0, -2.0, 2.0], rtol=1e-6)


def test_zeros_give_zeros() -> None:
    operator = QuantizedOperator(np.zeros((2, 3)))
    operator.apply()
    np.testing.assert_array_equal(operator.result, 0.0)


def test_a_row_keeps_one_block_at_least() -> None:
    operator = QuantizedOperator(np.diag([1.0, 1e-30]))
    np.asarray(operator.values)[:] = 1.0
    operator.apply()
    np.testing.assert_allclose(operator.result, [1.0, 1e-30], rtol=1e-4)


def test_arrays_that_do_not_fit_are_refused() -> None:
    for bad in (np.zeros(3), np.zeros((0, 3)), np.zeros((3, 0)), np.array([[np.nan]]), np.array([[np.inf]])):
        refused("finite", QuantizedOperator, bad)
