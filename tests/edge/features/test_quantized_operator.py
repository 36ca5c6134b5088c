"""Products in 16-bit integers: their error, and that no sum overflows."""

import numpy as np
import pytest

from edge.features.contact_field import QuantizedOperator

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


def test_the_largest_sums_fit_32_bits() -> None:
    operator = QuantizedOperator(np.ones((2, 1000)) * [[1.0], [-1.0]])
    np.asarray(operator.values)[:] = 1.0
    operator.apply()
    np.testing.assert_allclose(operator.result, [1000.0, -1000.0], rtol=1e-2)
