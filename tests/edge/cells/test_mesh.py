"""The kept triangulation by itself: exact areas, flips, degenerate sets, misuse."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edge.cells.mesh import Mesh
from edge.errors import DegenerateLayout
from tests.bench import stability
from tests.support import exact
from tests.support.layouts import HARD_SETS, Points, bounded

pytestmark = pytest.mark.kernels


def areas_of(mesh: Mesh, points: Points, n_pins: int) -> Points:
    areas = np.empty(n_pins)
    mesh.update(np.ascontiguousarray(points, dtype=np.float64), areas)
    return areas


def test_the_hard_sets_of_the_stability_report_hold() -> None:
    """Areas against rational arithmetic at every scale and offset; four pins through a common circle."""
    rows = [*stability.hard_sets(1), *stability.through_a_circle(1)]
    assert len(rows) == len(HARD_SETS) + 1
    assert [row for row in rows if not row.holds] == []


# Small whole numbers: almost every four points are cocircular, collinear or the same.
grid_point = st.tuples(st.integers(-4, 4), st.integers(-4, 4))
frames = st.lists(st.lists(grid_point, min_size=9, max_size=9), min_size=2, max_size=5)


@given(frames=frames, exponent=st.integers(-30, 30), shift=st.sampled_from([0.0, 1e6]))
@settings(max_examples=150)
def test_degenerate_motion_is_exact(frames: list[list[tuple[int, int]]], exponent: int, shift: float) -> None:
    """For any motion of the pins, each frame's areas are those of rational arithmetic."""
    mesh = Mesh(9, 24)
    for frame in frames:
        points = bounded(np.array(frame, dtype=float) / 6, 24) * 2.0**exponent + shift
        if np.ptp(points) == 0:
            continue
        wanted = exact.cell_areas(points, 9)
        assert exact.relative_errors(areas_of(mesh, points, 9), wanted).max() <= 1e-13


def test_a_pin_among_the_fence_has_no_bounded_cell() -> None:
    ring = bounded(np.empty((0, 2)), 24)
    pins = np.array([[0.0, 0.0], [0.4, 0.1], [1.6, 0.0]])
    points = np.concatenate([pins, ring, 2 * ring])
    areas = areas_of(Mesh(3, 24, 24), points, 3)
    assert np.isfinite(areas).tolist() == [True, True, False]


def test_tiny_coordinates_do_not_break_exactness() -> None:
    pins = np.array([[1e-300, -1e-310], [0.3, 5e-324], [-0.2, 0.4], [0.0, -0.5]])
    as_zero = np.where(np.abs(pins) < 1e-200, 0.0, pins)
    areas = areas_of(Mesh(4, 40), bounded(pins), 4)
    assert (areas == areas_of(Mesh(4, 40), bounded(as_zero), 4)).all()


@pytest.mark.parametrize(
    ("points", "error", "message"),
    [
        (np.full((4, 2), np.nan), DegenerateLayout, "not finite"),
        (np.array([[0, 0], [1, 0], [0, np.inf], [1, 1.0]]), DegenerateLayout, "not finite"),
        (np.ones((4, 2)), DegenerateLayout, "one place"),
        (np.array([[0, 0], [1e20, 0], [0, 1], [1, 1.0]]), DegenerateLayout, "farther apart"),
        (np.zeros((3, 2)), ValueError, "are wanted"),
        pytest.param(np.zeros((4, 2), dtype=np.int64), ValueError, "dtype", marks=pytest.mark.compiled),
    ],
)
def test_misuse_is_reported_and_the_mesh_usable(points: Points, error: type[Exception], message: str) -> None:
    mesh = Mesh(1, 3)
    good = np.array([[0.0, 0.0], [-1, -1], [1, -1], [0, 1]])
    before = areas_of(mesh, good, 1)
    with pytest.raises(error, match=message):
        mesh.update(points, np.empty(1))
    assert areas_of(mesh, good, 1) == before
