"""The surface and the contact field against known functions, everywhere and at the active points."""

import numpy as np
import pytest
from scipy.interpolate import CloughTocher2DInterpolator, RBFInterpolator

from edge.features.contact_field import QuantizedOperator
from edge.features.surface import Surface
from edge.types import Array
from tests.support.fields import CENTRE, push, tip

pytestmark = pytest.mark.kernels


def bump(xy: Array, at: Array, width: float) -> Array:
    return np.asarray(np.exp(-0.5 * ((xy - at) ** 2).sum(axis=-1) / width**2))


def divergence(surface: Surface, xy: Array) -> Array:
    """At all points: without area changes all are active."""
    surface.field.set_area_change(np.zeros(len(xy)))
    surface.field.find(xy)
    return np.array(surface.field.divergence)


def heights_at(surface: Surface, area_change: Array) -> Array:
    """At all points."""
    surface.field.set_area_change(area_change)
    return np.asarray(surface.picture()[surface.inside])


@pytest.mark.parametrize("pins", [127, 331])
def test_a_smooth_bump_is_interpolated_as_well_as_by_clough_tocher(pins: int) -> None:
    """A bump two pitches wide: both interpolants meet the truth."""
    rest = tip(pins)
    surface = Surface(rest, 48)
    at, width = CENTRE + np.array([13.0, -7.0]), 2.0 * rest.pattern.pitch_px
    values = bump(rest.xy_img, at, width)
    truth = bump(surface.points_img, at, width)
    inner = np.hypot(*(surface.points_img - CENTRE).T) < 0.8 * rest.pattern.tip_radius_px
    ours = np.abs(heights_at(surface, values) - truth)[inner]
    cubic = np.abs(CloughTocher2DInterpolator(rest.xy_img, values)(surface.points_img) - truth)[inner]
    # 0.1 % of the bump's height, which is less than one sigma of noise in any single cell.
    assert np.sqrt((ours**2).mean()) < 1e-3
    assert np.sqrt((cubic**2).mean()) < 1e-3


def test_it_is_scipy_s_thin_plate_spline_to_sixteen_bits() -> None:
    rest = tip(331)
    surface = Surface(rest)
    motion = push(rest, (20.0, -30.0), 40.0, 0.2) + np.array([12.0, -7.0])
    oracle = RBFInterpolator(rest.xy_img, motion, kernel="thin_plate_spline")
    right, down, step = np.array([1e-3, 0.0]), np.array([0.0, 1e-3]), 2e-3
    at = surface.points_img
    along_x, along_y = (oracle(at + way) - oracle(at - way) for way in (right, down))
    expected = (along_x[:, 0] + along_y[:, 1]) / step
    np.testing.assert_allclose(
        divergence(surface, rest.xy_img + motion), expected, atol=1e-3 * np.abs(expected).max()
    )
    change = 0.3 * bump(rest.xy_img, CENTRE, 40.0)
    heights = RBFInterpolator(rest.xy_img, change, kernel="thin_plate_spline")(at)
    np.testing.assert_allclose(heights_at(surface, change), heights, atol=2e-4 * heights.max())


def test_the_largest_sums_of_products_fit_32_bits() -> None:
    operator = QuantizedOperator(np.ones((2, 1000)) * [[1.0], [-1.0]])
    np.asarray(operator.values)[:] = 1.0
    operator.apply_rows(np.arange(2, dtype=np.int32), 2)
    np.testing.assert_allclose(operator.result, [1000.0, -1000.0], rtol=1e-2)


def test_a_picture_is_laid_out_row_by_row() -> None:
    rest = tip(331)
    surface = Surface(rest, 40)
    surface.field.set_area_change(rest.xy_img[:, 0] - CENTRE[0])  # a plane, which the spline continues
    grid = surface.picture()
    row, col = np.nonzero(surface.inside)
    np.testing.assert_allclose(grid[row, col], surface.x_img[col] - CENTRE[0], atol=0.2)
    assert np.isnan(grid[~surface.inside]).all()
