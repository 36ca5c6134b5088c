"""Pictures: the right colour in the right place, marks in the right place, files that open."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.figures import figure, surface_figure
from edge.errors import InputError, SinkError
from edge.types import Array, Features, Frame, Tracks
from edge.view.palette import PAPER, PARAMS, SAFE, Palette, cell_colours, cell_rgba
from edge.view.panels import View, draw_camera, draw_touch, save_pins_overlay
from edge.view.video import CODECS, write_video
from tests.edge.cli.test_render import frames_of
from tests.support.fields import contact_region
from tests.support.layouts import pins_at, tracks_of

Scene = tuple[View, Array, Tracks]
PITCH = 20.0
SIZE = 320


def square_grid(k: int = 7) -> Array:
    axis = (np.arange(k) + 2) * PITCH
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


def squares(xy: Array) -> list[Array]:
    corner = PITCH / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return [centre + corner for centre in xy]


def features_of(
    xy: Array, change: Array, motion: Array, contacts: int = 0, surface: bool = False
) -> Features:
    found = tuple(contact_region((xy[i, 0], xy[i, 1]), float(change[i]), 100.0) for i in range(contacts))
    grid = np.linspace(30, 180, 24)
    x, y = np.meshgrid(grid, grid)
    hill = 0.4 * np.exp(-((x - 100) ** 2 + (y - 100) ** 2) / 800)
    return Features(
        area_change=change,
        displacement_px=motion,
        in_contact=True,
        shear_px=motion.mean(axis=0),
        contacts=found,
        surface=np.where(np.hypot(x - 105, y - 105) < 70, hill, np.nan) if surface else None,
        grid_img=(grid, grid) if surface else None,
    )


@pytest.fixture
def scene() -> Scene:
    xy = square_grid()
    return View.of(xy, PITCH, SIZE), xy, tracks_of(xy)


def at(canvas: np.ndarray, view: View, xy_img: Array) -> tuple[int, int, int]:
    x, y = np.rint(view.canvas(np.asarray(xy_img, dtype=float))).astype(int)
    b, g, r = canvas[y, x].tolist()
    return b, g, r


@pytest.mark.parametrize("palette", [PAPER, SAFE])
def test_colours_run_from_expanded_over_paper_to_compressed(palette: Palette) -> None:
    colours = cell_colours(np.array([-0.5, 0.0, 0.5, 9.0, np.nan]), palette).tolist()
    ends = [palette.expanded, palette.paper, palette.compressed, palette.compressed, palette.edge]
    assert colours == [list(end) for end in ends]
    if palette is SAFE:
        # A deuteranope's eye hardly tells red from green: blue must do it alone.
        assert abs(colours[2][0] - colours[0][0]) > 120
    else:  # overlays are transparent where nothing changed
        nothing, enlarged = cell_rgba(np.array([0.0, 0.5]))
        assert nothing[3] == 0.0
        assert enlarged.tolist() == [*(level / 255 for level in reversed(palette.compressed)), 0.7]


def test_equal_changes_look_equal_to_both_sides() -> None:
    """In lightness, which remains in grey print."""
    shares = np.linspace(0.01, 0.5, 30)

    def lightness(change: Array) -> Array:
        bgr = cell_colours(change)[None].astype(np.float32) / 255
        return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2Lab))[0, :, 0].astype(float)

    compressed, expanded = lightness(shares), lightness(-shares)
    assert np.abs(compressed - expanded).max() < 1.5  # of 100
    assert (np.diff(compressed) < 0).all()
    assert (np.diff(expanded) < 0).all()


def test_no_mean_motion_is_no_arrow(scene: Scene, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="figures need voronoi-touch[calib]")
    view, xy, tracks = scene
    for motion, arrows in ((0.01, False), (6.0, True)):
        features = features_of(xy, np.zeros(len(xy)), np.tile([motion, 0.0], (len(xy), 1)))
        canvas = draw_touch(view, squares(xy), tracks, features)
        assert (canvas == PAPER.shear).all(axis=2).any() == arrows
        frame = Frame(np.full((SIZE, SIZE), 40, np.uint8), 0, 0)
        figure(tmp_path / "a.svg", frame, tracks, squares(xy), features)
        arrow = "stroke: #ffffff; stroke-width: 0.8"  # the rim of the mean's arrow alone
        assert (arrow in (tmp_path / "a.svg").read_text()) == arrows


def test_cells_are_red_where_compressed_and_blue_where_expanded(scene: Scene) -> None:
    view, xy, tracks = scene
    change = np.zeros(len(xy))
    change[10], change[30] = 0.5, -0.5
    canvas = draw_touch(view, squares(xy), tracks, features_of(xy, change, np.zeros_like(xy), contacts=1))
    beside = np.array([6.0, 6.0])  # off the pin's dot
    assert at(canvas, view, xy[10] + beside) == PAPER.compressed
    assert at(canvas, view, xy[30] + beside) == PAPER.expanded
    assert at(canvas, view, xy[20] + beside) == PAPER.paper
    assert at(canvas, view, xy[20]) == PAPER.pin
    assert at(canvas, view, xy[0]) == PAPER.contact
    star = np.argwhere((canvas == PAPER.contact).all(axis=2))[:, ::-1].mean(axis=0)
    assert np.allclose(star, view.canvas(xy[0]), atol=1.0)
    bare = draw_touch(view, [], tracks, None)  # without features the pins alone are drawn
    assert at(bare, view, xy[3]) == PAPER.pin
    assert at(bare, view, xy[3] + 7.0) == PAPER.paper


def test_vectors_point_along_the_pins_motion(scene: Scene) -> None:
    """Down and right is +y and +x; lengths are the gains times the motion."""
    view, xy, tracks = scene
    motion = np.tile([6.0, 0.0], (len(xy), 1))
    motion[24] = [0.0, 6.0]
    features = features_of(xy, np.zeros(len(xy)), motion)
    canvas = draw_touch(view, [np.empty((0, 2))] * len(xy), tracks, features)
    ink = (canvas.astype(int) - PAPER.local).__abs__().sum(axis=2) < 350
    x, y = view.canvas(xy[1] + [PARAMS.local_gain * 6.0 - 1, 0.0])
    assert ink[round(y) - 1 : round(y) + 2, round(x)].any()
    x, y = view.canvas(xy[1] + [PARAMS.local_gain * 6.0 + 2, 0.0])
    assert not ink[round(y) - 1 : round(y) + 2, round(x)].any()
    x, y = view.canvas(xy[24] + [0.0, PARAMS.local_gain * 6.0 - 1])
    assert ink[round(y), round(x) - 1 : round(x) + 2].any()
    head = view.canvas(np.mean(xy - motion, axis=0)) + PARAMS.global_gain * view.scale * motion.mean(axis=0)
    arrow = np.argwhere((canvas == PAPER.shear).all(axis=2))[:, ::-1]
    assert abs(arrow[:, 0].max() - head[0]) < 4


def test_lost_pins_and_open_cells_are_skipped(scene: Scene) -> None:
    view, xy, _ = scene
    lost = xy.copy()
    lost[8] = np.nan
    tracks, polygons = tracks_of(lost), squares(xy)
    polygons[8] = np.empty((0, 2))
    polygons[9] = np.array([[0.0, 0.0], [np.inf, 0.0], [0.0, 1.0]])
    polygons[10] = np.array([[0.0, 0.0], [1e12, 0.0], [0.0, 1e12]])
    canvas = draw_touch(view, polygons, tracks, features_of(xy, 0.1 + 0.0 * lost[:, 0], lost - xy))
    assert canvas.shape == (SIZE, SIZE, 3)


def test_the_camera_panel_shows_the_same_place_and_brightness(scene: Scene) -> None:
    view, xy, _ = scene
    image = np.zeros((240, 240), np.uint8)
    x, y = xy[12].astype(int)
    image[y - 2 : y + 3, x - 2 : x + 3] = 255
    canvas = draw_camera(view, image)
    spot = np.argwhere(canvas[:, :, 0] > 128)[:, ::-1].mean(axis=0)
    assert np.allclose(spot, view.canvas(xy[12]), atol=0.51)
    deep = draw_camera(view, np.full((240, 240), 2048, np.uint16), bits=12)
    assert at(deep, view, np.array([100.0, 100.0])) == (128, 128, 128)
    red = draw_camera(view, np.full((240, 240, 3), (0, 16, 2048), np.uint16), bits=12)
    assert at(red, view, np.array([100.0, 100.0])) == (0, 1, 128)


def test_overlay_of_found_pins(tmp_path: Path) -> None:
    pins = pins_at(np.array([[20.0, 20], [40, 20], [20, 40]]), 5.0)
    drawn_of = np.zeros((60, 80), np.uint8), pins, np.zeros(3, bool), np.empty((0, 2)), (), ()
    save_pins_overlay(tmp_path / "a.png", *drawn_of)
    drawn = cv2.imread(str(tmp_path / "a.png"))
    assert drawn is not None
    assert drawn.shape == (120, 160, 3)
    columns = np.flatnonzero(drawn.any(axis=(0, 2)))
    assert columns.min() == pytest.approx(2 * (20.5 - 5) - 0.5, abs=1.5)
    with pytest.raises(SinkError, match="cannot be written"):
        save_pins_overlay(tmp_path / "no such folder" / "a.png", *drawn_of)


@pytest.mark.parametrize("mm_per_px", [0.0, 0.05])
def test_figures_for_print(tmp_path: Path, scene: Scene, mm_per_px: float) -> None:
    pytest.importorskip("matplotlib", reason="figures need voronoi-touch[calib]")
    _, xy, tracks = scene
    change = np.zeros(len(xy))
    change[24] = 0.5
    features = features_of(xy, change, np.full_like(xy, 2.0), contacts=1, surface=True)
    frame = Frame(np.full((240, 240), 90, np.uint8), 0, 0)
    figure(tmp_path / "a.png", frame, tracks, squares(xy), features, mm_per_px=mm_per_px)
    surface_figure(tmp_path / "s.png", features, mm_per_px=mm_per_px)
    with pytest.raises(InputError, match=r"demand Feature\.SURFACE"):
        surface_figure(tmp_path / "s.png", replace(features, surface=None))
    for name in ("a.png", "s.png"):
        drawn = cv2.imread(str(tmp_path / name))
        assert drawn is not None
        red = (drawn[:, :, 2] > 190) & (drawn[:, :, :2].max(axis=2) < 110)
        assert red.sum() > 200  # the compressed cell, the top of the hill


@pytest.mark.parametrize("suffix", sorted(CODECS))
def test_videos_play_back(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    pictures = [np.full((121, 161, 3), 40 * i, np.uint8) for i in range(6)]  # odd sides lose a line
    assert write_video(iter(pictures), path, 25.0) == 6
    assert cv2.VideoCapture(str(path), cv2.CAP_FFMPEG).get(cv2.CAP_PROP_FPS) == pytest.approx(25.0)
    played = np.array(frames_of(path))
    assert played.shape == (6, 120, 160, 3)
    assert np.allclose(played.mean(axis=(1, 2, 3)), [40 * i for i in range(6)], atol=4)


def test_impossible_videos_are_refused(tmp_path: Path) -> None:
    one = np.zeros((20, 20, 3), np.uint8)
    for pictures, name, stated in (
        ([one], "a.gif", "no format"),
        ([], "a.avi", "no pictures"),
        ([one], "no such folder/a.avi", "cannot be written"),
        ([one, np.zeros((20, 40, 3), np.uint8)], "a.avi", "a picture is 40x20, not 20x20"),
    ):
        with pytest.raises(SinkError, match=stated):
            write_video(pictures, tmp_path / name, 25.0)
