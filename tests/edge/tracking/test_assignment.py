"""Assignment: as cheap as SciPy's."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from edge.tracking.match import assign

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("shape", [(1, 1), (4, 4), (12, 30), (25, 25), (0, 3)])
@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.kernels
def test_no_other_assignment_costs_less(shape: tuple[int, int], whole: bool) -> None:
    cost = RNG.integers(-3, 3, shape).astype(float) if whole else RNG.normal(size=shape)
    column = assign(cost)
    assert len(set(column.tolist())) == shape[0]
    least = cost[linear_sum_assignment(cost)].sum()
    assert cost[np.arange(shape[0]), column].sum() == pytest.approx(least, abs=1e-12)
