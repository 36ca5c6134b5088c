"""The surface against known functions, and its volume against noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CloughTocher2DInterpolator

from edge.features.contact_field import ContactField
from edge.features.surface import Surface
from edge.geometry.thin_plate import thin_plate_operators
from edge.types import Array
from tests.support.fields import CENTRE, frame, push, tip

pytestmark = pytest.mark.kernels


def bump(xy: Array, at: Array, width: float) -> Array:
    return np.asarray(np.exp(-0.5 * ((xy - at) ** 2).sum(axis=-1) / width**2))


@pytest.mark.parametrize("pins", [127, 331])
def test_smooth_bump_as_well_as_clough_tocher(pins: int) -> None:
    """A bump two pitches wide: both interpolants meet the truth."""
    rest = tip(pins)
    surface = Surface(rest, 48)
    at, width = CENTRE + np.array([13.0, -7.0]), 2.0 * rest.pattern.pitch_px
    values = bump(rest.xy_img, at, width)
    truth = bump(surface.points_img, at, width)
    inner = np.hypot(*(surface.points_img - CENTRE).T) < 0.8 * rest.pattern.tip_radius_px
    ours = np.abs(surface.interpolate(values, rest.xy_img, 0.0)[0] - truth)[inner]
    cubic = np.abs(CloughTocher2DInterpolator(rest.xy_img, values)(surface.points_img) - truth)[inner]
    # 0.1 % of the bump's height, which is less than one sigma of noise in any single cell.
    assert np.sqrt((ours**2).mean()) < 1e-3
    assert np.sqrt((cubic**2).mean()) < 1e-3


def test_divergence_of_linear_motion_is_exact() -> None:
    rest = tip(331)
    surface = Surface(rest)
    motion = (rest.xy_img - CENTRE) @ np.array([[0.03, 0.2], [-0.1, 0.05]]) + [5.0, -3.0]
    np.testing.assert_allclose(surface.divergence(rest.xy_img + motion), 0.08, atol=1e-6)


@pytest.mark.compiled
def test_divergence_noise_is_that_of_the_operator() -> None:
    rest = tip(127)
    surface = Surface(rest)
    rng = np.random.default_rng(1)
    draws = np.stack([surface.divergence(rest.xy_img + rng.normal(0.0, 0.05, (127, 2))) for _ in range(2000)])
    np.testing.assert_allclose(draws.std(axis=0), 0.05 * surface.divergence_noise, rtol=0.12)


def test_lost_pins_grow_as_the_skin_between_their_neighbours() -> None:
    rest = tip(331)
    surface = Surface(rest)
    rng = np.random.default_rng(2)
    xy = rest.xy_img + push(rest, (5.0, -9.0), 60.0, 0.1)
    _, cells = frame(rest, xy)
    change = cells.area_px2 / cells.rest_area_px2 - 1.0
    surface.interpolate(change, xy, 0.0)
    np.testing.assert_array_equal(surface.field.area_change, change.astype(np.float32))
    lost = rng.choice(331, 99, replace=False)
    inner = lost[np.hypot(*(rest.xy_img[lost] - CENTRE).T) < 0.9 * rest.pattern.tip_radius_px]
    gaps = change.copy()
    gaps[lost] = np.nan
    surface.interpolate(gaps, xy, 0.0)
    filled = np.asarray(surface.field.area_change)
    assert np.isfinite(filled).all()
    np.testing.assert_allclose(filled[inner], change[inner], atol=0.02)


@pytest.mark.parametrize(("level", "counted"), [(-1.0, 0.0), (0.1, 0.0), (0.15, 0.1), (0.2, 0.2), (0.5, 0.5)])
def test_firm_threshold(level: float, counted: float) -> None:
    surface = Surface(tip(127))
    # A plain: it has one height everywhere.
    heights, volume = surface.interpolate(np.full(127, level), surface.rest_img, 0.1)
    np.testing.assert_allclose(heights, level, rtol=1e-3)
    assert volume / (len(heights) * surface.step_px**2) == pytest.approx(counted, abs=1e-3)


def test_sixteen_bits_are_enough() -> None:
    rest = tip(331)
    surface = Surface(rest)
    value, along_x, along_y = thin_plate_operators(rest.xy_img, surface.points_img)
    motion = push(rest, (20.0, -30.0), 40.0, 0.2) + np.array([12.0, -7.0])
    divergence = along_x @ motion[:, 0] + along_y @ motion[:, 1]
    np.testing.assert_allclose(
        surface.divergence(rest.xy_img + motion), divergence, atol=1e-3 * np.abs(divergence).max()
    )
    change = 0.3 * bump(rest.xy_img, CENTRE, 40.0)
    heights = value @ change
    np.testing.assert_allclose(
        surface.interpolate(change, rest.xy_img, 0.0)[0], heights, atol=2e-4 * heights.max()
    )


@pytest.mark.compiled
def test_volume_of_noise_is_nothing_and_noise_adds_nothing_to_a_bump() -> None:
    rest = tip(331)
    surface = Surface(rest)
    rng = np.random.default_rng(3)
    width, noise = 40.0, 0.002
    clean = 0.3 * bump(rest.xy_img, CENTRE, width)

    def volume(change: Array) -> float:
        return surface.interpolate(change, rest.xy_img, 3.0 * noise)[1]

    draws = rng.normal(0.0, noise, (50, 331))
    full = 0.3 * 2.0 * np.pi * width**2
    raw = np.mean([np.maximum(surface.interpolate(d, rest.xy_img, 0.0)[0], 0.0).sum() for d in draws])
    assert raw * surface.step_px**2 > 0.01 * full  # what plain rectification would report untouched
    assert np.mean([volume(d) for d in draws]) < 2e-4 * full
    assert abs(volume(clean) / full - 1.0) < 0.03
    assert abs(np.mean([volume(clean + d) for d in draws]) / volume(clean) - 1.0) < 0.01


def test_grid_is_laid_out_row_by_row() -> None:
    rest = tip(331)
    surface = Surface(rest, 40)
    grid = surface.to_grid(surface.points_img[:, 0].astype(np.float32), np.nan)
    row, col = np.nonzero(surface.inside)
    np.testing.assert_allclose(grid[row, col], surface.x_img[col], rtol=1e-6)
    assert np.isnan(grid[~surface.inside]).all()


def test_the_blend_is_of_divergence_and_heights() -> None:
    rest = tip(127)
    field = Surface(rest).field
    field.interpolate(np.linspace(-0.1, 0.2, 127), rest.xy_img, 0.0)
    field.find_divergence(rest.xy_img + push(rest, (10.0, 0.0), 40.0, 0.1))
    field.find_blend()
    np.testing.assert_allclose(
        field.blend, 0.7 * np.asarray(field.divergence) + 0.3 * np.asarray(field.heights), atol=1e-7
    )


def test_sizes_that_do_not_fit_are_refused() -> None:
    rest = tip(127)
    field = Surface(rest).field
    for change, xy in ((np.zeros(126), rest.xy_img), (np.zeros(127), rest.xy_img[1:])):
        with pytest.raises(ValueError, match="wanted"):
            field.interpolate(change, xy, 0.0)
    with pytest.raises(ValueError, match="wanted"):
        field.find_divergence(np.zeros((127, 3)))
    for heights, divergences in (((9, 126), (9, 254)), ((9, 127), (9, 253)), ((9, 127), (8, 254))):
        with pytest.raises(ValueError, match="wanted"):
            ContactField(rest.xy_img, 32.0, np.ones(heights), np.ones(divergences))
