"""Regional maxima against scikit-image; valleys between peaks against connected components."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.ndimage import label
from skimage.morphology import local_maxima

from edge.features.peaks import PEAKS_MAX, PeakFinder
from edge.types import Array, Mask

pytestmark = pytest.mark.kernels

EVERYWHERE = np.ones((3, 3))


def maxima(grid: np.ndarray) -> Mask:
    """Regional maxima, plateaus included; none where all is of one height."""
    peaks = PeakFinder(np.ones(grid.shape, dtype=np.bool_))
    peaks.set_field(grid.ravel())
    top = peaks.mark_maxima().reshape(grid.shape)
    return np.zeros_like(top) if top.all() else top


@settings(max_examples=300)
@given(
    arrays(
        np.float32,
        array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=12),
        elements=st.sampled_from([-np.inf, 0.0, 1.0, 2.0, 3.0]),
    )
)
def test_maxima_equal_scikit_image(grid: np.ndarray) -> None:
    np.testing.assert_array_equal(maxima(grid), local_maxima(grid))


@pytest.mark.compiled
def test_maxima_equal_scikit_image_on_large_plateaus_and_on_noise() -> None:
    rng = np.random.default_rng(0)
    for levels in (2, 3, 8, 100):
        for _ in range(20):
            grid = rng.integers(0, levels, (48, 64)).astype(np.float32)
            np.testing.assert_array_equal(maxima(grid), local_maxima(grid))
    grid = rng.normal(size=(64, 64)).astype(np.float32)
    np.testing.assert_array_equal(maxima(grid), local_maxima(grid))


def disc(size: int) -> Mask:
    line = np.linspace(-1.0, 1.0, size)
    return np.asarray(line[:, None] ** 2 + line**2 <= 1.0)


def places(finder: PeakFinder) -> Array:
    """(m, 2) row and column of each peak, without the padding."""
    return np.column_stack(np.divmod(np.asarray(finder.at)[: finder.n_peaks], finder.width)) - 1


def test_the_highest_peaks_above_the_noise_come_in_order() -> None:
    rng = np.random.default_rng(2)
    inside = disc(40)
    field = rng.normal(size=np.count_nonzero(inside)).astype(np.float32)
    noise = rng.uniform(0.1, 0.4, len(field)).astype(np.float32)
    finder = PeakFinder(inside)
    finder.set_field(field)
    grid = np.full(inside.shape, -np.inf, np.float32)
    grid[inside] = field
    least = np.full(inside.shape, np.inf)
    least[inside] = np.maximum(noise * np.float32(3.0), 0.5)
    high = np.argwhere(local_maxima(grid) & (grid > least))
    high = high[np.argsort(-grid[tuple(high.T)], kind="stable")]
    assert len(high) > PEAKS_MAX
    assert finder.find(noise, 3.0, 0.5) == PEAKS_MAX
    np.testing.assert_array_equal(places(finder), high[:PEAKS_MAX])
    np.testing.assert_array_equal(np.asarray(finder.height), grid[tuple(high[:PEAKS_MAX].T)])
    np.testing.assert_array_equal(field[np.asarray(finder.point)], np.asarray(finder.height))


def test_peaks_are_connected_where_no_valley_goes_below_the_level() -> None:
    rng = np.random.default_rng(3)
    inside = disc(24)
    finder = PeakFinder(inside)
    for _ in range(10):
        field = rng.normal(size=np.count_nonzero(inside)).astype(np.float32)
        finder.set_field(field)
        n = finder.find(np.zeros(len(field), np.float32), 0.0, -10.0)
        grid = np.full(inside.shape, -np.inf, np.float32)
        grid[inside] = field
        at = tuple(places(finder).T)
        for j in range(n):
            level = float(grid[at][j]) - float(rng.uniform(0.0, 2.0))
            component = label(grid >= level, EVERYWHERE)[0][at]
            assert finder.first_connected(j, level) == int(np.argmax(component == component[j]))


def test_a_peak_is_connected_with_one_before_it_or_not_however_it_is_asked() -> None:
    rng = np.random.default_rng(4)
    inside = disc(24)
    finder = PeakFinder(inside)
    answers = set()
    for _ in range(20):
        field = rng.normal(size=np.count_nonzero(inside)).astype(np.float32)
        finder.set_field(field)
        levels = [float(rng.uniform(-0.5, 1.5)) for _ in range(PEAKS_MAX)]  # also higher than one before
        n = finder.find(np.zeros(len(field), np.float32), 0.0, -10.0)
        soon = [finder.is_connected(j, min(levels[j], float(finder.height[j]))) for j in range(n)]
        finder.forget_searches()
        whole = [finder.first_connected(j, min(levels[j], float(finder.height[j]))) < j for j in range(n)]
        assert soon == whole
        answers |= set(soon)
    assert answers == {False, True}


def test_no_level_lets_a_search_leave_the_grid() -> None:
    """The border is -inf: at a level of -inf the search ran over it, beyond the memory of the grid."""
    inside = np.ones((3, 4), bool)
    finder = PeakFinder(inside)
    finder.set_field(np.array([3, 0, 0, 2, 0, 0, 0, 0, 1, 0, 0, 1.5], np.float32))
    n = finder.find(np.zeros(12, np.float32), 0.0, 0.5)
    assert n == 4
    assert [finder.first_connected(j, -np.inf) for j in range(n)] == [0, 0, 0, 0]
    assert [finder.first_connected(j, np.nan) for j in range(n)] == [0, 1, 2, 3]
    assert not np.asarray(finder.mark).reshape(5, 6)[0].any()


def test_the_field_is_zero_beyond_the_active_points() -> None:
    finder = PeakFinder(np.ones((3, 4), bool))
    field = np.arange(1.0, 13.0, dtype=np.float32)
    finder.set_field(field)
    for active in ([2, 5, 11], [0, 5], []):
        which = np.array([*active, 7], np.int32)
        finder.set_field(field, which, len(active))
        expected = np.zeros(12, np.float32)
        expected[active] = field[active]
        np.testing.assert_array_equal(np.asarray(finder.grid)[np.asarray(finder.place)], expected)
        found = finder.find(np.zeros(12, np.float32), 0.0, 0.5)
        high = local_maxima(expected.reshape(3, 4)) & (expected.reshape(3, 4) > 0.0)
        assert found == np.count_nonzero(high)
        np.testing.assert_array_equal(np.sort(np.asarray(finder.point)[:found]), np.flatnonzero(high))


def test_a_finder_without_points_finds_nothing() -> None:
    finder = PeakFinder(np.zeros((3, 3), np.bool_))
    finder.set_field(np.empty(0, np.float32))
    assert finder.find(np.empty(0, np.float32), 1.0, 0.0) == 0
