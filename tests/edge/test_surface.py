"""The constant operators against scipy, against known functions, and their volume against noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CloughTocher2DInterpolator, RBFInterpolator

from edge.errors import DegenerateLayout
from edge.features.local import Neighbourhood
from edge.features.surface import Surface, thin_plate_operators
from edge.types import Array
from tests.edge.fields import CENTRE, frame, push, tip


def bump(xy: Array, at: Array, width: float) -> Array:
    return np.asarray(np.exp(-0.5 * ((xy - at) ** 2).sum(axis=-1) / width**2))


def test_operator_is_scipys_thin_plate_spline() -> None:
    rng = np.random.default_rng(0)
    knots, points, values = rng.normal(size=(40, 2)), rng.normal(size=(25, 2)), rng.normal(size=40)
    oracle = RBFInterpolator(knots, values, kernel="thin_plate_spline")
    value, along_x, along_y = thin_plate_operators(knots, points)
    np.testing.assert_allclose(value @ values, oracle(points), atol=1e-9)
    step = 1e-5
    for slope, way in ((along_x, np.array([step, 0.0])), (along_y, np.array([0.0, step]))):
        numeric = (oracle(points + way) - oracle(points - way)) / (2.0 * step)
        np.testing.assert_allclose(slope @ values, numeric, atol=1e-4)


def test_operator_returns_the_values_at_the_knots() -> None:
    knots = tip(127).xy_img
    value, _, _ = thin_plate_operators(knots, knots)
    np.testing.assert_allclose(value, np.eye(len(knots)), atol=1e-9)


@pytest.mark.parametrize("knots", [np.zeros((2, 2)), np.column_stack([np.arange(9.0), np.arange(9.0)])])
def test_pins_on_a_line_are_refused(knots: Array) -> None:
    with pytest.raises(DegenerateLayout):
        thin_plate_operators(knots, np.zeros((1, 2)))


@pytest.mark.parametrize("pins", [127, 331])
def test_smooth_bump_as_well_as_clough_tocher(pins: int) -> None:
    """A bump two pitches wide: both interpolants meet the truth."""
    rest = tip(pins)
    surface = Surface(rest, 48)
    at, width = CENTRE + np.array([13.0, -7.0]), 2.0 * rest.pattern.pitch_px
    values = bump(rest.xy_img, at, width)
    truth = bump(surface.points_img, at, width)
    inner = np.hypot(*(surface.points_img - CENTRE).T) < 0.8 * rest.pattern.tip_radius_px
    ours = np.abs(surface.rise(values, rest.xy_img, 0.0)[1] - truth)[inner]
    cubic = np.abs(CloughTocher2DInterpolator(rest.xy_img, values)(surface.points_img) - truth)[inner]
    # 0.1 % of the bump's height, which is less than one sigma of noise in any single cell.
    assert np.sqrt((ours**2).mean()) < 1e-3
    assert np.sqrt((cubic**2).mean()) < 1e-3


def test_stretch_of_linear_motion_is_exact() -> None:
    rest = tip(331)
    surface = Surface(rest)
    motion = (rest.xy_img - CENTRE) @ np.array([[0.03, 0.2], [-0.1, 0.05]]) + [5.0, -3.0]
    np.testing.assert_allclose(surface.stretch(rest.xy_img + motion), 0.08, atol=1e-6)


def test_stretch_noise_is_that_of_the_operator() -> None:
    rest = tip(127)
    surface = Surface(rest)
    rng = np.random.default_rng(1)
    draws = np.stack([surface.stretch(rest.xy_img + rng.normal(0.0, 0.05, (127, 2))) for _ in range(2000)])
    np.testing.assert_allclose(draws.std(axis=0), 0.05 * surface.stretch_noise, rtol=0.12)


def test_lost_pins_grow_as_the_skin_between_their_neighbours() -> None:
    rest = tip(331)
    surface = Surface(rest)
    rng = np.random.default_rng(2)
    xy = rest.xy_img + push(rest, (5.0, -9.0), 60.0, 0.1)
    _, cells = frame(rest, xy)
    change = cells.area_px2 / cells.rest_area_px2 - 1.0
    full, _, _ = surface.rise(change, xy, 0.0)
    np.testing.assert_array_equal(full, change.astype(np.float32))
    lost = rng.choice(331, 99, replace=False)
    inner = lost[np.hypot(*(rest.xy_img[lost] - CENTRE).T) < 0.9 * rest.pattern.tip_radius_px]
    gaps = change.copy()
    gaps[lost] = np.nan
    filled, _, _ = surface.rise(gaps, xy, 0.0)
    assert np.isfinite(filled).all()
    np.testing.assert_allclose(filled[inner], change[inner], atol=0.02)


def test_roughness_is_the_noise_whatever_the_load_and_a_few_bad_pins() -> None:
    rest = tip(331)
    near, rng = Neighbourhood(rest), np.random.default_rng(4)
    seen = np.ones(331, dtype=np.bool_)
    load = push(rest, (5.0, -9.0), 40.0, 0.2) + (rest.xy_img - CENTRE) @ [[0.1, 0.2], [-0.1, 0.0]] + 7.0
    for sigma in (0.05, 0.4):
        xy = rest.xy_img + load + rng.normal(0.0, sigma, (331, 2))
        assert near.roughness_px(xy, seen) == pytest.approx(sigma, rel=0.2)
        xy[rng.choice(331, 4, replace=False)] += 6.0
        assert near.roughness_px(xy, seen) < 2.0 * sigma
    assert near.roughness_px(rest.xy_img, np.zeros(331, dtype=np.bool_)) == 0.0


@pytest.mark.parametrize(("level", "counted"), [(-1.0, 0.0), (0.1, 0.0), (0.15, 0.1), (0.2, 0.2), (0.5, 0.5)])
def test_firm_threshold(level: float, counted: float) -> None:
    surface = Surface(tip(127))
    # A plain: it has one height everywhere.
    _, heights, volume = surface.rise(np.full(127, level), surface.rest_img, 0.1)
    np.testing.assert_allclose(heights, level, rtol=1e-3)
    assert volume / (len(heights) * surface.step_px**2) == pytest.approx(counted, abs=1e-3)


def test_sixteen_bits_are_enough() -> None:
    rest = tip(331)
    surface = Surface(rest)
    value, along_x, along_y = thin_plate_operators(rest.xy_img, surface.points_img)
    motion = push(rest, (20.0, -30.0), 40.0, 0.2) + np.array([12.0, -7.0])
    stretch = along_x @ motion[:, 0] + along_y @ motion[:, 1]
    np.testing.assert_allclose(
        surface.stretch(rest.xy_img + motion), stretch, atol=1e-3 * np.abs(stretch).max()
    )
    change = 0.3 * bump(rest.xy_img, CENTRE, 40.0)
    heights = value @ change
    np.testing.assert_allclose(surface.rise(change, rest.xy_img, 0.0)[1], heights, atol=2e-4 * heights.max())


def test_volume_of_noise_is_nothing_and_noise_adds_nothing_to_a_bump() -> None:
    rest = tip(331)
    surface = Surface(rest)
    rng = np.random.default_rng(3)
    width, noise = 40.0, 0.002
    clean = 0.3 * bump(rest.xy_img, CENTRE, width)

    def volume(change: Array) -> float:
        return surface.rise(change, rest.xy_img, 3.0 * noise)[2]

    draws = rng.normal(0.0, noise, (50, 331))
    full = 0.3 * 2.0 * np.pi * width**2
    raw = np.mean([np.maximum(surface.rise(d, rest.xy_img, 0.0)[1], 0.0).sum() for d in draws])
    assert raw * surface.step_px**2 > 0.01 * full  # what plain rectification would report untouched
    assert np.mean([volume(d) for d in draws]) < 2e-4 * full
    assert abs(volume(clean) / full - 1.0) < 0.03
    assert abs(np.mean([volume(clean + d) for d in draws]) / volume(clean) - 1.0) < 0.01


def test_grid_is_laid_out_row_by_row() -> None:
    rest = tip(331)
    surface = Surface(rest, 40)
    grid = surface.spread(surface.points_img[:, 0].astype(np.float32), np.nan)
    row, col = np.nonzero(surface.inside)
    np.testing.assert_allclose(grid[row, col], surface.x_img[col], rtol=1e-6)
    assert np.isnan(grid[~surface.inside]).all()
