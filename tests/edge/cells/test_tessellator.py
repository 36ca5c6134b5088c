"""Cells of a tip: boundary, bounded polygon, lost pins, invariances, walks."""

from dataclasses import replace

import numpy as np
import pytest

from edge.cells import Tessellator, cell_polygons
from edge.errors import DegenerateLayout
from edge.types import Cells
from tests.bench import stability
from tests.bench.stability import cells_of, worst_error
from tests.support.cell_checks import Points, points_of, random_walks, worst_relative
from tests.support.layouts import CENTRE, PITCH_PX, TIPS, hexagonal, pressed, rest_of, square, tracks_of


def test_the_tips_of_the_stability_report_hold() -> None:
    """Areas exactly, drawings, the order of pins, a turned, shifted, scaled image, lost pins."""
    rows = [*stability.tips(), *stability.lost_pins(3)]
    assert len(rows) == len(TIPS) * 12
    assert [row for row in rows if not row.holds] == []


def test_boundary_bridges_gaps_between_spokes() -> None:
    """Rows of pins that start from the middle, at the outer end three pitches apart."""
    angle = 2 * np.pi * np.arange(12) / 12
    spokes = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rest = np.concatenate([r * PITCH_PX * spokes for r in range(2, 7)]) + CENTRE
    boundary = cells_of(rest, rest).boundary_img
    assert np.hypot(*(boundary - CENTRE).T).min() > 6 * PITCH_PX


@pytest.mark.parametrize(
    "stray", [[(0.0, 0.0)], [(0.0, 0.0), (2.0, 0.0)], [(0.0, 0.0), (2.0, 0.0), (1.0, 2.0)]]
)
def test_stray_pins_get_a_boundary_of_their_own(stray: list[tuple[float, float]]) -> None:
    """A reflection far outside that the rest frame took for a pin must not disturb the cells."""
    rest = np.concatenate([hexagonal(4), CENTRE + PITCH_PX * (np.array(stray) + np.array([20.0, 3.0]))])
    alone, together = Tessellator(rest_of(hexagonal(4))), Tessellator(rest_of(rest))
    assert np.isfinite(together.rest_area_px2).all()
    assert worst_relative(together.rest_area_px2[:61], alone.rest_area_px2) <= 1e-10


def test_parts_of_a_tip_have_a_boundary_each() -> None:
    rest = np.concatenate([hexagonal(3), hexagonal(3) + np.array([20 * PITCH_PX, 0.0])])
    tessellator = Tessellator(rest_of(rest))
    areas = tessellator.rest_area_px2
    assert worst_relative(areas[:37], areas[37:]) <= 1e-10
    assert worst_error(areas, points_of(tessellator.cells(tracks_of(rest)))) <= 1e-13


def test_boundary_enters_a_bay() -> None:
    rest = TIPS["horseshoe"]()
    boundary = cells_of(rest, rest).boundary_img
    depth = rest[:, 1].max() - boundary[np.abs(boundary[:, 0] - rest[:, 0].mean()) < PITCH_PX, 1]
    assert depth.max() > 2 * PITCH_PX  # there are points on the bay's floor
    assert np.isfinite(cells_of(rest, pressed(rest)).area_px2).all()


def test_pins_missing_at_rest_leave_no_boundary_inside() -> None:
    rest = hexagonal()
    holed = np.delete(rest, [165, 100, 101], axis=0)
    inside = np.hypot(*(cells_of(holed, holed).boundary_img - CENTRE).T) < 8 * PITCH_PX
    assert not inside.any()


def test_rim_cells_hold_when_the_rim_moves_far() -> None:
    """The rim ring 20 px out on one side and 10 px in on the other: no cell opens or collapses."""
    rest = hexagonal()
    tessellator = Tessellator(rest_of(rest))
    for share in np.linspace(0, 1, 21):
        x, y = (rest - CENTRE).T / (10 * PITCH_PX)
        motion = share * np.stack([15 * x**2 + 5 * x + 5 * y**2, 8 * y - 6 * x * y], axis=1)
        ratio = tessellator.cells(tracks_of(rest + motion)).area_px2 / tessellator.rest_area_px2
        assert np.isfinite(ratio).all()
        assert ratio.min() > 0.6
        assert ratio.max() < 1.6


def test_random_walks_agree_with_fresh_triangulations() -> None:
    """A share of the walks of `python -m tests.bench stability`."""
    walks = random_walks(50, 10, 0.5, seed=1)
    assert walks.worst_difference <= 1e-12
    assert walks.flips > 500
    jumps = random_walks(10, 10, 6.0, seed=2)
    assert jumps.worst_difference <= 1e-12
    assert jumps.builds > 10  # this tests the rebuilding branch
    large = random_walks(20, 30, 2.0, seed=1)
    assert large.worst_difference <= 1e-12


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_gap_is_on_the_side_where_pins_are_lost_and_grows_with_them(side: float) -> None:
    rest = hexagonal()
    along = side * (rest[:, 0] - CENTRE[0])
    tessellator = Tessellator(rest_of(rest))
    few, many = (
        tessellator.cells(tracks_of(np.where((along > np.quantile(along, 1 - share))[:, None], np.nan, rest)))
        for share in (0.1, 0.4)
    )
    assert 0.0 < few.gap < many.gap
    for cells in (few, many):
        assert cells.gap_img is not None
        assert side * (cells.gap_img[0] - CENTRE[0]) > 0.4 * along.max()
    none = tessellator.cells(tracks_of(rest))
    assert none.gap == 0.0
    assert none.gap_img is None


def test_lost_pins_are_where_a_press_pushes_them() -> None:
    """Along the gradient of a potential: a surface through each component is off by 0.4 px."""
    rest, rng = hexagonal(), np.random.default_rng(8)
    from_place = rest - CENTRE - np.array([1.2, 0.7]) * PITCH_PX
    far2 = (from_place**2).sum(axis=1, keepdims=True) / PITCH_PX**2
    now = rest + 0.5 * from_place * np.exp(-far2 / 4.0)
    error = []
    for _ in range(10):
        lost = rng.random(len(rest)) < 0.3
        cells = cells_of(rest, np.where(lost[:, None], np.nan, now))
        error.append(np.mean((cells.xy_img - now)[lost] ** 2))
        assert cells.whole_px2 is not None
        np.testing.assert_array_equal(cells.whole_px2[~lost], cells.area_px2[~lost])
        assert np.isnan(cells.area_px2[lost]).all()
    true = cells_of(rest, now)
    assert true.whole_px2 is None
    assert cells.whole_px2 is not None
    off = (cells.whole_px2 - true.area_px2)[lost] / true.rest_area_px2[lost]
    enlarged = (true.area_px2 / true.rest_area_px2 - 1.0)[lost]
    assert np.sqrt(np.mean(error)) < 0.1
    assert np.sqrt(np.mean(off**2)) < 0.3 * np.sqrt(np.mean(enlarged**2))


def blinked(left: float) -> tuple[Cells, Points]:
    """Cells of a pressed tip whose pins are off a smooth motion, as some of them are lost and all move on
    together; and where they are. Of the residuals `left` is said to be left.
    """
    rest = TIPS["hexagonal"]()
    now = pressed(rest, 4.0) + np.random.default_rng(5).normal(0.0, 1.0, rest.shape)
    tessellator = Tessellator(rest_of(rest))
    tessellator.cells(tracks_of(now))
    there = now + np.array([2.0, -1.0])
    found = there.copy()
    found[::9] = np.nan
    return tessellator.cells(replace(tracks_of(found), autocorrelation=left)), there


def test_a_lost_pin_keeps_its_place_among_those_that_move_on_together() -> None:
    cells, there = blinked(1.0)
    assert np.abs(cells.xy_img - there).max() < 1e-9
    from_frame, _ = blinked(0.0)
    half, _ = blinked(0.5)
    errors = [np.abs(c.xy_img - there).max() for c in (half, from_frame)]
    assert 0.2 < errors[0] == pytest.approx(errors[1] / 2, rel=1e-6)


@pytest.mark.parametrize(
    ("rest", "message"),
    [
        (np.array([[0.0, 0.0], [1.0, 0.0]]), "2 pins"),
        (np.stack([np.arange(9.0), 2 * np.arange(9.0)], axis=1), "on a line"),
        (np.full((5, 2), 3.0), "on a line"),
        (np.array([[0.0, 0.0], [1.0, 0.0], [np.nan, 1.0]]), "not finite"),
    ],
)
def test_a_rest_frame_without_a_plane_is_refused(rest: Points, message: str) -> None:
    with pytest.raises(DegenerateLayout, match=message):
        Tessellator(rest_of(rest))


@pytest.mark.parametrize("seen", [[], [3], [3, 4], [0, 1, 2, 3, 4], "one place", "on a line"])
def test_too_few_pins_in_view_and_collapsed_ones_are_refused(seen: list[int] | str) -> None:
    """The last case of few: a whole row of the grid, and nothing else."""
    rest = square(8)
    now = np.full_like(rest, 5.0) if seen == "one place" else rest @ np.array([[0.3, 0.4], [0.0, 0.0]])
    if isinstance(seen, list):
        now[:], now[seen] = np.nan, rest[seen]
    tessellator = Tessellator(rest_of(rest))
    with pytest.raises(DegenerateLayout, match=seen if isinstance(seen, str) else "seen pins"):
        tessellator.cells(tracks_of(now))
    assert np.isfinite(tessellator.cells(tracks_of(rest)).area_px2).all()  # and it works again afterwards


def test_merged_pins_share_their_cell_and_part_again() -> None:
    rest = hexagonal(5)
    tessellator = Tessellator(rest_of(rest))
    merged = rest.copy()
    merged[40] = merged[41] = (rest[40] + rest[41]) / 2
    cells = tessellator.cells(tracks_of(merged))
    assert cells.area_px2[40] == cells.area_px2[41]
    assert worst_error(cells.area_px2, points_of(cells)) <= 1e-13
    assert worst_relative(tessellator.cells(tracks_of(rest)).area_px2, tessellator.rest_area_px2) <= 1e-12


def test_a_pin_beyond_the_boundary_has_no_area() -> None:
    rest = hexagonal(5)
    now = rest.copy()
    now[60] = CENTRE + np.array([40 * PITCH_PX, 0.0])
    cells = cells_of(rest, now)
    assert np.isnan(cells.area_px2[60])
    assert np.isfinite(cells.area_px2).sum() > 80


def test_a_lost_pin_has_no_polygon() -> None:
    rest = hexagonal()
    now = pressed(rest)
    now[5] = np.nan
    polygons = cell_polygons(cells_of(rest, now))
    assert len(polygons) == len(rest)
    assert polygons[5].shape == (0, 2)


def test_a_forgotten_mesh_leaves_no_trace_in_the_areas() -> None:
    """To the last bit: frames are shared out among processes, each with frames of its own before."""
    rest = hexagonal()
    rng = np.random.default_rng(0)
    one, other = Tessellator(rest_of(rest)), Tessellator(rest_of(rest))
    for _ in range(5):
        one.cells(tracks_of(rest + rng.normal(0.0, 0.3 * PITCH_PX, rest.shape)))
    now = tracks_of(rest + rng.normal(0.0, 0.2 * PITCH_PX, rest.shape))
    one.forget()
    other.forget()
    np.testing.assert_array_equal(one.cells(now).area_px2, other.cells(now).area_px2)
