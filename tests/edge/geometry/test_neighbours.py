"""Neighbours: as SciPy's search tree finds them."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from edge.geometry.neighbours import nearest_of, pairs_within

pytestmark = pytest.mark.kernels

RNG = np.random.default_rng(5)


@pytest.mark.parametrize(("n", "m", "k"), [(60, 25, 7), (1, 4, 1), (200, 1, 200), (2, 3, 6)])
def test_the_nearest_are_those_of_a_search_tree(n: int, m: int, k: int) -> None:
    points, xy = RNG.normal(size=(n, 2)), RNG.normal(size=(m, 2))
    distance, row = nearest_of(points, xy, k)
    want_distance, want_row = cKDTree(points).query(xy, k=np.arange(1, min(k, n) + 1))
    np.testing.assert_allclose(distance, want_distance, rtol=1e-12)
    np.testing.assert_array_equal(row, want_row)


def test_of_two_at_one_distance_the_lower_row_is_first() -> None:
    square = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [5.0, 0.0]])
    _, row = nearest_of(square, np.zeros((1, 2)), 3)
    assert row.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("reach", [0.0, 0.3, 10.0])
def test_pairs_are_those_of_a_search_tree(reach: float) -> None:
    xy = RNG.normal(size=(50, 2))
    want = np.sort(cKDTree(xy).query_pairs(reach, output_type="ndarray"), axis=1).reshape(-1, 2)
    found = pairs_within(xy, reach)
    np.testing.assert_array_equal(found, want[np.lexsort(want.T[::-1])])
