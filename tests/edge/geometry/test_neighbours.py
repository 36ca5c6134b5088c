"""Neighbours: as SciPy's search tree finds them, and what is refused."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from edge.geometry.neighbours import nearest_of, pairs_within, short_rows, weighted_rows
from tests.support.refusals import refused

RNG = np.random.default_rng(5)


@pytest.mark.parametrize(("n", "m", "k"), [(60, 25, 7), (1, 4, 1), (200, 1, 200)])
@pytest.mark.kernels
def test_the_nearest_are_those_of_a_search_tree(n: int, m: int, k: int) -> None:
    points, xy = RNG.normal(size=(n, 2)), RNG.normal(size=(m, 2))
    distance, row = nearest_of(points, xy, k)
    want_distance, want_row = cKDTree(points).query(xy, k=np.arange(1, k + 1))
    np.testing.assert_allclose(distance, want_distance, rtol=1e-12)
    np.testing.assert_array_equal(row, want_row)


@pytest.mark.kernels
def test_of_two_at_one_distance_the_lower_row_is_first() -> None:
    square = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [5.0, 0.0]])
    _, row = nearest_of(square, np.zeros((1, 2)), 3)
    assert row.tolist() == [[0, 1, 2]]


@pytest.mark.kernels
def test_there_are_no_more_columns_than_points() -> None:
    distance, row = nearest_of(np.zeros((2, 2)), np.ones((3, 2)), 6)
    assert distance.shape == row.shape == (3, 2)


@pytest.mark.parametrize("reach", [0.0, 0.3, 10.0])
@pytest.mark.kernels
def test_pairs_are_those_of_a_search_tree(reach: float) -> None:
    xy = RNG.normal(size=(50, 2))
    want = np.sort(cKDTree(xy).query_pairs(reach, output_type="ndarray"), axis=1).reshape(-1, 2)
    found = pairs_within(xy, reach)
    np.testing.assert_array_equal(found, want[np.lexsort(want.T[::-1])])


@pytest.mark.parametrize(
    ("points", "xy", "k"),
    [
        (np.zeros((0, 2)), np.zeros((3, 2)), 1),
        (np.zeros((4, 2)), np.zeros((3, 2)), 0),
        (np.zeros((4, 3)), np.zeros((3, 2)), 1),
        (np.full((4, 2), np.nan), np.zeros((3, 2)), 1),
        (np.zeros((4, 2)), np.full((3, 2), np.inf), 1),
    ],
)
@pytest.mark.kernels
def test_points_that_cannot_be_compared_are_refused(points: np.ndarray, xy: np.ndarray, k: int) -> None:
    refused(r"(is|are) wanted", nearest_of, points, xy, k)


def test_rows_keep_their_numbers() -> None:
    rows = np.array([[0, 1], [65_535, 2]], np.int32)
    assert short_rows(rows).dtype == np.uint16
    np.testing.assert_array_equal(short_rows(rows), rows)
    assert short_rows(np.empty((0, 6), np.int32)).shape == (0, 6)


def test_weights_of_a_row_are_an_even_number_and_none_is_zero_before_the_last() -> None:
    near = np.array([[4, 1, 2], [0, 3, 0], [1, 2, 3]], np.int32)
    start, row, weight = weighted_rows(near, np.array([[0.5, 0.0, 2.0], [0.0, 1.5, 0.0], [1.0, 2.0, 3.0]]))
    np.testing.assert_array_equal(start, [0, 2, 4, 8])
    np.testing.assert_array_equal(row[weight != 0], [8, 4, 6, 2, 4, 6])
    np.testing.assert_array_equal(weight, [0.5, 2.0, 1.5, 0.0, 1.0, 2.0, 3.0, 0.0])


@pytest.mark.parametrize("row", [-1, 65_536])
def test_rows_that_16_bits_do_not_hold_are_refused(row: int) -> None:
    rows = np.array([[0, row]], np.int32)
    refused("rows", short_rows, rows)
    refused("rows", weighted_rows, rows, np.ones((1, 2)))
