"""`calib lens`: pictures of a board seen through a known lens give that lens."""

from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from edge.pins.lens import corrected
from edge.sources.lens_file import load_lens
from edge.types import Array, Image, Lens
from tests.support.commands import run_calib as command

TRUE = Lens(
    size_px=(480, 360), focal_px=(390.0, 386.0), centre_px=(233.0, 184.0),
    distortion=(-0.22, 0.06, 0.001, -0.0005, 0.0),
)  # fmt: skip
FINE = 2
TILTS = [(0, 0), (25, 0), (-25, 0), (0, 25), (0, -25), (20, 20), (-20, 20), (15, -20)]
PLACES = [(0, 0), (2, 1.3), (-2, 1.3), (2, -1.3), (-2, -1.3), (1, 0), (-1, 0.6), (0, -1)]


@cache
def rays() -> Array:
    """(n, 3) of FINE x FINE places in each pixel of the image that TRUE takes."""
    columns, rows = ((np.arange(n * FINE) + 0.5) / FINE - 0.5 for n in TRUE.size_px)
    x, y = np.meshgrid(columns, rows)
    (fx, fy), (cx, cy) = TRUE.focal_px, TRUE.centre_px
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    points = np.column_stack([x.ravel(), y.ravel()])[:, None]
    xy = cv2.undistortPoints(points, matrix, np.array(TRUE.distortion))[:, 0]
    return np.column_stack([xy, np.ones(len(xy))])


def board(tilt_deg: tuple[float, float], place: tuple[float, float]) -> Image:
    """A board of 9x6 inner corners as TRUE sees it, each pixel the mean of its rays."""
    width, height = TRUE.size_px
    ray = rays()
    turn = cv2.Rodrigues(np.deg2rad([tilt_deg[0], tilt_deg[1], 0.0]))[0]
    at = np.array([*place, 12.0])
    across, down, normal = turn.T
    hit = ray * ((normal @ at) / (ray @ normal))[:, None] - at
    u, v = hit @ across + 5.0, hit @ down + 3.5
    inside = (u > -0.5) & (u < 10.5) & (v > -0.5) & (v < 7.5)
    on_board = (u > 0) & (u < 10) & (v > 0) & (v < 7)
    dark = on_board & ((np.floor(u) + np.floor(v)) % 2 == 0)
    level = np.where(dark, 20.0, np.where(inside, 230.0, 120.0))
    shades = level.reshape(height, FINE, width, FINE).mean(axis=(1, 3))
    return np.asarray(np.rint(shades), np.uint8)


def board_pictures(folder: Path) -> list[Path]:
    """The board in all tilts and places, as board_0.png, board_1.png, ..."""
    paths = [folder / f"board_{number}.png" for number in range(len(TILTS))]
    for path, tilt, place in zip(paths, TILTS, PLACES, strict=True):
        cv2.imwrite(str(path), cv2.GaussianBlur(board(tilt, place), (0, 0), 0.7))
    return paths


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return board_pictures(tmp_path_factory.mktemp("boards"))


def test_the_lens_of_the_pictures_is_found(tmp_path: Path, pictures: list[Path]) -> None:
    path = tmp_path / "lens.toml"
    done = command("lens", *pictures, "-o", path)
    assert done.code == 0
    assert "8 pictures" in done.out
    found = load_lens(path)
    assert found.focal_px == pytest.approx(TRUE.focal_px, rel=0.01)
    # Distances of corrected points count, which neither a shift nor a zoom of all changes.
    seen = np.stack(np.meshgrid([75, 180, 300, 405], [60, 180, 300]), axis=-1).reshape(-1, 2).astype(float)
    is_at, should = (corrected(lens, seen) @ (1, 1j) for lens in (found, TRUE))
    design = np.column_stack([should, np.ones(len(seen))])
    off = is_at - design @ np.linalg.lstsq(design, is_at, rcond=None)[0]
    straight = seen @ (1, 1j)
    before = straight - design @ np.linalg.lstsq(design, straight, rcond=None)[0]
    assert np.abs(before).max() > 3.0
    assert np.abs(off).max() < 0.3


def test_mistakes_are_one_line(tmp_path: Path, pictures: list[Path]) -> None:
    path, small = tmp_path / "lens.toml", tmp_path / "small.png"
    cv2.imwrite(str(small), np.zeros((100, 100), np.uint8))
    for arguments, message in (
        (pictures[:2], "2 of 2 images show all 9x6 inner corners of a board; at least 3 are needed"),
        ([*pictures, "--board", "9"], "'9' is no board; give its inner corners across and down, e.g. 9x6"),
        ([pictures[0], small], "100x100, the ones before 480x360; keep one size"),
        ([tmp_path / "absent.png"], "absent.png"),
    ):
        done = command("lens", *arguments, "-o", path)
        assert done.code == 2
        assert message in done.err
    assert not path.exists()
    path.write_text("mine")
    assert command("lens", *pictures, "-o", path).code == 2
    assert path.read_text() == "mine"
