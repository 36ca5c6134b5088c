"""Contacts from peaks: grouping, shape, splitting, and what is refused; on fields drawn by hand."""

from __future__ import annotations

import numpy as np
import pytest

from edge.features.peaks import PeakFinder
from edge.features.regions import CONTACTS_MAX, Regions
from edge.types import Array
from tests.support.refusals import refused

pytestmark = pytest.mark.kernels

SIZE, STEP, X0, Y0 = 41, 2.0, 100.0, 50.0
NOISE = np.full(SIZE * SIZE, 0.01, np.float32)
Y, X = np.mgrid[:SIZE, :SIZE].astype(np.float64)


def hill(x: float, y: float, height: float, wide: float, narrow: float = 0.0, angle: float = 0.0) -> Array:
    """A Gaussian hill at a column and row, with axes in steps."""
    u = (X - x) * np.cos(angle) + (Y - y) * np.sin(angle)
    v = -(X - x) * np.sin(angle) + (Y - y) * np.cos(angle)
    return np.asarray(height * np.exp(-0.5 * ((u / wide) ** 2 + (v / (narrow or wide)) ** 2)))


def regions_of(field: Array, noise_px: float = 0.0) -> tuple[PeakFinder, Regions]:
    peaks = PeakFinder(np.ones((SIZE, SIZE), np.bool_))
    peaks.set_field(field.astype(np.float32).ravel())
    peaks.find(NOISE, 0.0, 0.05)
    regions = Regions(peaks, X0, Y0, STEP)
    regions.merge(NOISE, noise_px)
    return peaks, regions


def place(regions: Regions, x: float, y: float) -> int:
    """Where a column and row lie in the padded grid."""
    return int((y + 1) * (SIZE + 2) + x + 1)


def test_middle_axes_and_area_of_an_ellipse() -> None:
    _, regions = regions_of(hill(20.4, 17.0, 1.0, 6.0, 3.0, 0.5))
    assert regions.n_contacts == 1
    np.testing.assert_allclose(np.asarray(regions.middle)[0], [X0 + STEP * 20.4, Y0 + STEP * 17.0], atol=0.1)
    assert regions.direction[0] == pytest.approx(0.5, abs=0.01)
    assert regions.elongation[0] == pytest.approx(2.0, rel=0.05)
    cut = np.sqrt(-2.0 * np.log(0.3))  # where the hill has fallen to the region's edge, in its sigmas
    assert regions.area_px2(0) == pytest.approx(np.pi * 18.0 * cut**2 * STEP**2, rel=0.05)
    assert regions.peak_height(0) == pytest.approx(1.0, abs=2e-3)


def test_a_shallow_valley_joins_and_a_deep_one_separates() -> None:
    two = hill(14.0, 20.0, 1.0, 3.0) + hill(26.0, 20.0, 0.8, 3.0)
    _, regions = regions_of(two)
    assert regions.n_contacts == 2
    np.testing.assert_allclose(
        np.asarray(regions.middle)[:2, 0], X0 + STEP * np.array([14.0, 26.0]), atol=0.5
    )
    assert [len(regions.ridge(i)) for i in range(2)] == [1, 1]
    _, noisy = regions_of(two, noise_px=6.0)  # 10 sigma of 6 px times 0.01 is deeper than that valley
    assert noisy.n_contacts == 1
    np.testing.assert_allclose(noisy.ridge(0), [[X0 + 28.0, Y0 + 40.0], [X0 + 52.0, Y0 + 40.0]])
    _, regions = regions_of(np.maximum(two, 0.7))
    assert regions.n_contacts == 1


def test_peaks_can_be_merged_again_with_another_noise() -> None:
    hills = sum(hill(8.0 + 6.0 * k, 20.0, 1.0 - 0.1 * k, 2.0) for k in range(5))
    peaks, regions = regions_of(np.asarray(hills))
    for noise_px in (0.0, 3.0, 6.0, 3.0, 0.0):
        _, fresh = regions_of(np.asarray(hills), noise_px)
        n = regions.merge(NOISE, noise_px)
        assert n == fresh.n_contacts
        np.testing.assert_array_equal(np.asarray(regions.middle)[:n], np.asarray(fresh.middle)[:n])
    assert peaks.n_peaks == 5


def test_a_second_peak_below_the_noise_is_none() -> None:
    far = hill(10.0, 20.0, 1.0, 2.0) + hill(32.0, 20.0, 0.2, 2.0)  # nothing but zero between them
    _, regions = regions_of(far, noise_px=1.9)
    assert regions.n_contacts == 2
    _, noisy = regions_of(far, noise_px=2.1)
    assert noisy.n_contacts == 1
    np.testing.assert_allclose(noisy.ridge(0), [[X0 + 20.0, Y0 + 40.0]])


def test_no_more_contacts_than_the_table_holds() -> None:
    field = sum(hill(5.0 + 10.0 * (k % 4), 5.0 + 10.0 * (k // 4), 1.0 - 0.02 * k, 1.5) for k in range(16))
    _, regions = regions_of(np.asarray(field))
    assert regions.n_contacts == CONTACTS_MAX
    np.testing.assert_allclose(np.asarray(regions.middle)[7], [X0 + 70.0, Y0 + 30.0], atol=0.3)


def test_the_points_of_a_dropped_contact_go_to_the_others() -> None:
    _, regions = regions_of(hill(14.0, 20.0, 1.0, 3.0) + hill(26.0, 20.0, 0.8, 3.0))
    before = regions.area_px2(1)
    regions.keep(np.array([0, 1], np.uint8))
    assert regions.n_contacts == 1
    assert np.asarray(regions.middle)[0, 0] < X0 + STEP * 26.0
    assert regions.area_px2(0) > before


def test_a_split_contact_becomes_two_in_the_order_of_their_heights() -> None:
    _, regions = regions_of(hill(10.0, 20.0, 0.9, 3.0) + hill(30.0, 20.0, 1.0, 5.0, 2.0))
    regions.split(0, place(regions, 26.0, 20.0), place(regions, 33.0, 20.0))
    regions.sort()
    assert regions.n_contacts == 3
    heights = [float(regions.peak_height(i)) for i in range(3)]
    assert heights == sorted(heights, reverse=True)
    columns = (np.asarray(regions.middle)[:3, 0] - X0) / STEP
    np.testing.assert_allclose(columns, [10.0, 33.0, 26.0], atol=2.0)


def test_nothing_above_the_noise_is_no_contact() -> None:
    _, regions = regions_of(np.zeros((SIZE, SIZE)))
    assert regions.n_contacts == 0


def test_splits_of_no_contact_or_place_are_refused() -> None:
    _, regions = regions_of(hill(20.0, 20.0, 1.0, 3.0))
    for i in (-1, 1, 8):
        refused("contact", regions.split, i, 50, 60)
    for at in (-1, (SIZE + 2) ** 2):
        refused("places", regions.split, 0, 50, at)
        refused("places", regions.split, 0, at, 50)


def test_joined_regions_are_one_and_the_others_move_up() -> None:
    field = hill(8.0, 20.0, 1.0, 2.5) + hill(20.0, 20.0, 0.9, 2.5) + hill(32.0, 20.0, 0.8, 2.5)
    _, regions = regions_of(field)
    assert regions.n_contacts == 3
    regions.join(0, 1)
    assert regions.n_contacts == 2
    assert len(regions.ridge(0)) == 2
    np.testing.assert_allclose(
        np.asarray(regions.middle)[:2, 0], X0 + STEP * np.array([13.7, 32.0]), atol=0.5 * STEP
    )
    for i, k in ((0, 0), (1, 0), (0, 2), (-1, 1)):
        refused("two contacts", regions.join, i, k)


def test_the_nearest_point_of_a_place() -> None:
    _, regions = regions_of(hill(20.0, 20.0, 1.0, 3.0))
    assert regions.nearest_point(X0 + STEP * 7.3, Y0 + STEP * 11.6) == place(regions, 7.0, 12.0)
    assert regions.nearest_point(-1e6, -1e6) == place(regions, 0.0, 0.0)
