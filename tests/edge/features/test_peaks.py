"""Regional maxima against scikit-image, and searches that stay within the grid."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from skimage.morphology import local_maxima

from edge.features.regions import PeakFinder
from edge.types import Mask

pytestmark = pytest.mark.kernels


def maxima(grid: np.ndarray) -> Mask:
    """Regional maxima, plateaus included; none where all is of one height."""
    peaks = PeakFinder(np.ones(grid.shape, dtype=np.bool_))
    peaks.set_field(grid.ravel(), np.arange(grid.size, dtype=np.int32), grid.size)
    n = peaks.find(np.zeros(grid.size, np.float32), 0.0, -1.0)
    top: Mask = np.isin(np.arange(grid.size), peaks.point[:n]).reshape(grid.shape)
    return np.zeros_like(top) if top.all() else top


@settings(max_examples=300)
@given(
    arrays(
        np.float32,
        array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=12),
        elements=st.sampled_from([-np.inf, 1.0, 2.0, 3.0, 4.0]),
    )
)
def test_maxima_equal_scikit_image(grid: np.ndarray) -> None:
    np.testing.assert_array_equal(maxima(grid), local_maxima(grid))


def test_no_level_lets_a_search_leave_the_grid() -> None:
    """The border is -inf: at a level of -inf the search ran over it, beyond the memory of the grid."""
    inside = np.ones((3, 4), bool)
    finder = PeakFinder(inside)
    finder.set_field(
        np.array([3, 0, 0, 2, 0, 0, 0, 0, 1, 0, 0, 1.5], np.float32), np.arange(12, dtype=np.int32), 12
    )
    n = finder.find(np.zeros(12, np.float32), 0.0, 0.5)
    assert n == 4
    assert [finder.first_connected(j, -np.inf, False) for j in range(n)] == [0, 0, 0, 0]
    assert [finder.first_connected(j, np.nan, True) for j in range(n)] == [0, 1, 2, 3]
    assert not np.asarray(finder.mark).reshape(5, 6)[0].any()
