"""Regional maxima against scikit-image, searches that stay within the grid, and contacts from peaks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from skimage.morphology import local_maxima

from edge.features.contact_field import PeakFinder
from edge.features.contacts import Regions
from edge.types import Array, Mask

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


SIZE, STEP, X0, Y0 = 41, 2.0, 100.0, 50.0
NOISE = np.full(SIZE * SIZE, 0.01, np.float32)
Y, X = np.mgrid[:SIZE, :SIZE].astype(np.float64)


def hill(x: float, y: float, height: float, wide: float) -> Array:
    """A round Gaussian hill at a column and row, its width in steps."""
    return np.asarray(height * np.exp(-0.5 * ((X - x) ** 2 + (Y - y) ** 2) / wide**2))


def regions_of(field: Array, noise_px: float = 0.0) -> Regions:
    peaks = PeakFinder(np.ones((SIZE, SIZE), np.bool_))
    peaks.set_field(field.astype(np.float32).ravel(), np.arange(SIZE * SIZE, dtype=np.int32), SIZE * SIZE)
    peaks.find(NOISE, 0.0, 0.05)
    regions = Regions(peaks, X0, Y0, STEP)
    regions.merge(NOISE, noise_px)
    return regions


def test_a_shallow_valley_joins_and_a_deep_one_separates() -> None:
    two = hill(14.0, 20.0, 1.0, 3.0) + hill(26.0, 20.0, 0.8, 3.0)
    regions = regions_of(two)
    assert regions.n_contacts == 2
    np.testing.assert_allclose(
        np.asarray(regions.middle)[:2, 0], X0 + STEP * np.array([14.0, 26.0]), atol=0.5
    )
    assert [len(regions.ridge(i)) for i in range(2)] == [1, 1]
    noisy = regions_of(two, noise_px=6.0)  # 10 sigma of 6 px times 0.01 is deeper than that valley
    assert noisy.n_contacts == 1
    np.testing.assert_allclose(noisy.ridge(0), [[X0 + 28.0, Y0 + 40.0], [X0 + 52.0, Y0 + 40.0]])
    regions = regions_of(np.maximum(two, 0.7))
    assert regions.n_contacts == 1


def test_a_second_peak_below_the_noise_is_none() -> None:
    far = hill(10.0, 20.0, 1.0, 2.0) + hill(32.0, 20.0, 0.2, 2.0)  # nothing but zero between them
    regions = regions_of(far, noise_px=1.9)
    assert regions.n_contacts == 2
    noisy = regions_of(far, noise_px=2.1)
    assert noisy.n_contacts == 1
    np.testing.assert_allclose(noisy.ridge(0), [[X0 + 20.0, Y0 + 40.0]])
