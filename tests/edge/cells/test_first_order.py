"""Areas near rest: as exact as is said, within the range that is said, and no further."""

from __future__ import annotations

import numpy as np
import pytest

from edge.cells import Tessellator
from edge.cells.first_order import FirstOrderAreas
from edge.cells.params import PARAMS
from tests.support.cell_checks import fresh_areas, worst_relative
from tests.support.layouts import PITCH_PX, TIPS, pressed, rest_of, tracks_of

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("tip", TIPS)
def test_noise_of_pins_is_not_triangulated_and_the_error_is_small(tip: str) -> None:
    rest = TIPS[tip]()
    tessellator = Tessellator(rest_of(rest))
    random = np.random.default_rng(1)
    kept = tessellator._mesh.counts()
    for _ in range(20):
        cells = tessellator.cells(tracks_of(rest + 0.001 * PITCH_PX * random.standard_normal(rest.shape)))
        assert worst_relative(cells.area_px2, cells.rest_area_px2) > 1e-3
        assert worst_relative(cells.area_px2, fresh_areas(tessellator)) < 0.5 * PARAMS.first_order_error
    assert tessellator._mesh.counts() == kept


@pytest.mark.parametrize("tip", TIPS)
def test_the_error_stays_small_up_to_where_exact_areas_begin(tip: str) -> None:
    rest = TIPS[tip]()
    tessellator = Tessellator(rest_of(rest))
    shift = pressed(rest) - rest
    random = np.random.default_rng(2)
    errors = []
    for size in np.linspace(0.0, 0.2, 40):
        now = rest + size * (shift + random.standard_normal(rest.shape))
        errors.append(worst_relative(tessellator.cells(tracks_of(now)).area_px2, fresh_areas(tessellator)))
    assert 1e-5 < max(errors) < 2.0 * PARAMS.first_order_error
    assert errors[-1] < 1e-12


def test_after_a_touch_the_triangles_are_those_at_rest_again() -> None:
    rest = TIPS["hexagonal"]()
    tessellator = Tessellator(rest_of(rest))
    before = tessellator.cells(tracks_of(rest))
    touched = tessellator.cells(tracks_of(pressed(rest)))
    after = tessellator.cells(tracks_of(rest))
    assert not np.array_equal(touched.area_px2, after.area_px2)
    assert after.triangles is before.triangles


def test_sizes_that_do_not_fit_are_refused() -> None:
    rest = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    triangles = np.array([[0, 1, 2], [1, 3, 2]], np.int32)
    areas = FirstOrderAreas(rest, np.ones(2), triangles)
    with pytest.raises(ValueError, match="are wanted"):
        areas.update(rest[:3].copy(), np.empty(2))
    with pytest.raises(ValueError, match="are wanted"):
        areas.update(rest, np.empty(3))
    with pytest.raises(ValueError, match="are wanted"):
        FirstOrderAreas(rest, np.ones(5), triangles)
    with pytest.raises(ValueError, match="are wanted"):
        FirstOrderAreas(rest, np.array([1.0, np.nan]), triangles)
    with pytest.raises(ValueError, match="an edge between two"):
        FirstOrderAreas(rest, np.ones(2), triangles[:0])
    for wrong in (-1, 4):
        with pytest.raises(ValueError, match="points of 0 to 3"):
            FirstOrderAreas(rest, np.ones(2), np.array([[0, 1, wrong]], np.int32))
