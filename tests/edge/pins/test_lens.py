"""Distortion is removed from the pins' places, to a hundredth of a pixel, and nowhere else."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from calib.commands.lens import text_of
from calib.fit import sensor_of
from calib.sim import Appearance, Camera, Simulator, Tip, ToolPose
from edge.calibration.file import rest_of
from edge.errors import CalibrationError, SourceError
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.pins.lens import corrected, magnification, seen
from edge.rest.tip_match import match_rest
from edge.sources import open_source
from edge.sources.lens_file import load_lens
from edge.types import Array, Frame, Lens, Rest
from tests.support.refusals import one_line

CAMERA = Camera(tip=Tip(n_pins=127, kind="hex"), size_px=(480, 400), k1=-0.25, k2=0.05, centre_px=(9.0, -5.0))
QUIET = Appearance(read_noise=0.0, shot_noise=0.0)
FISHEYE = Lens(
    model="fisheye", size_px=(480, 400), focal_px=(210.0, 212.0), centre_px=(236.0, 203.0),
    distortion=(0.05, -0.01, 0.003, 0.0),
)  # fmt: skip


def lens_of(camera: Camera) -> Lens:
    """The simulated camera's own."""
    (x, y), focal_px = camera.centre_img.tolist(), (camera.focal_px, camera.focal_px)
    distortion = (camera.k1, camera.k2, 0.0, 0.0)
    return Lens(size_px=camera.size_px, focal_px=focal_px, centre_px=(x, y), distortion=distortion)


LENS = lens_of(CAMERA)


def undistorted(xyz_mm: Array) -> Array:
    """(n, 2) px where a pinhole of the same focal length sees these points."""
    ray = xyz_mm[:, :2] / (xyz_mm[:, 2:] + CAMERA.tip.camera_distance_mm)
    return np.asarray(CAMERA.focal_px * ray + CAMERA.centre_img)


def frame(*poses: ToolPose) -> Frame:
    return Simulator(CAMERA, QUIET).frame(poses)


@pytest.mark.parametrize("lens", [LENS, FISHEYE], ids=["pinhole", "fisheye"])
def test_there_and_back(lens: Lens) -> None:
    rng = np.random.default_rng(2)
    xy = rng.uniform((20.0, 20.0), (460.0, 380.0), (500, 2))
    xy[7] = np.nan
    assert np.nanmax(np.abs(seen(lens, corrected(lens, xy)) - xy)) < 1e-6
    assert np.isnan(corrected(lens, xy)[7]).all()
    assert np.isnan(xy).sum() == 2
    assert magnification(lens, np.array([lens.centre_px])) == pytest.approx(1.0, abs=1e-3)


def test_pins_at_rest_are_where_a_pinhole_would_see_them() -> None:
    """To within a hundredth of a pixel of what the search without a lens is good to."""
    rest = take_rest([frame().image], lens=LENS)
    true = undistorted(CAMERA.tip.tips_mm)
    raw = take_rest([frame().image])
    assert cKDTree(true).query(raw.xy_img)[0].max() > 2.0
    assert len(rest) == 127
    found_px = cKDTree(CAMERA.project(CAMERA.tip.tips_mm)).query(raw.xy_img)[0]
    corrected_px = cKDTree(true).query(rest.xy_img)[0]
    assert np.median(corrected_px) < 0.01
    assert np.abs(corrected_px - found_px).max() < 0.01
    assert cKDTree(true).query(corrected(LENS, CAMERA.project(CAMERA.tip.tips_mm)))[0].max() < 1e-6
    assert rest.pattern.lens == LENS
    assert rest.pattern.pitch_px > raw.pattern.pitch_px


def test_a_pressed_tip_is_followed_and_searched_for_in_corrected_places() -> None:
    rest = take_rest([frame().image], lens=LENS)
    pipeline = Pipeline(rest)
    pose = ToolPose(depth_mm=1.5, shear_x_mm=0.5)
    plain = take_rest([frame().image])
    as_seen = Pipeline(plain)
    for number, pressed in enumerate([frame(), frame(pose), frame(pose)]):
        result = pipeline.process(replace(pressed, sequence=number))
        reference = as_seen.process(replace(pressed, sequence=number))
        seen_n = result.tracks.n_seen
        assert seen_n == reference.tracks.n_seen >= 120
        assert result.features is not None
        assert result.searched == reference.searched
        places = corrected(LENS, reference.tracks.xy_img[reference.tracks.seen])
        assert cKDTree(places).query(result.tracks.xy_img[result.tracks.seen])[0].max() < 0.001
    pipeline.forget()
    searched = pipeline.process(frame(pose))
    assert searched.searched
    assert np.nanmax(np.abs(searched.tracks.xy_img - result.tracks.xy_img)) < 0.1


def test_a_calibration_remembers_its_lens() -> None:
    with_lens, without = take_rest([frame().image], lens=LENS), take_rest([frame().image])
    stored: Rest = rest_of(sensor_of(with_lens, "T-1"))
    assert stored.pattern.lens == LENS
    assert match_rest(stored, with_lens)[1].seen.all()
    with pytest.raises(CalibrationError, match=r"made with a lens .* none is given: give its file"):
        match_rest(stored, without)
    with pytest.raises(CalibrationError, match=r"made without a lens: omit \?lens="):
        match_rest(rest_of(sensor_of(without, "T-1")), with_lens)
    other = take_rest([frame().image], lens=lens_of(replace(CAMERA, k2=0.06)))
    with pytest.raises(CalibrationError, match="another one is given"):
        match_rest(stored, other)


def write(folder: Path, text: str) -> Path:
    path = folder / "lens.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("lens", [LENS, FISHEYE], ids=["pinhole", "fisheye"])
def test_the_file_is_the_lens(tmp_path: Path, lens: Lens) -> None:
    assert load_lens(write(tmp_path, text_of(lens, "of a test"))) == lens


GOOD = text_of(LENS, "of a test")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD.replace("focal_px", "focus"), "unknown key 'focus'|lacks focal_px"),
        (GOOD.replace("pinhole", "mirror"), "unknown value 'mirror'"),
        (GOOD.replace("0.05, 0.0, 0.0]", "0.05]"), "must have at least 4 items"),
        (GOOD.replace("0.05, 0.0, 0.0]", "0.05, 0.0, 0.0, 0.0, 0.0]"), "6 numbers; a pinhole has 4 or 5"),
        (GOOD.replace("-0.25", "nan"), "a number from -1000 to 1000, is NaN"),
    ],
)
def test_a_bad_file_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    refusal = one_line(SourceError, load_lens, write(tmp_path, text))
    assert "lens.toml" in refusal
    assert re.search(message, refusal)


def test_a_source_s_address_names_the_lens(tmp_path: Path, data_dir: Path) -> None:
    own = replace(CAMERA, size_px=(320, 320))
    good = write(tmp_path, text_of(lens_of(own), "of a test"))
    source = open_source(f"mcap:{data_dir / 'press.mcap'}?lens={good}")
    assert source.lens == lens_of(own)
    source.close()
    bad = write(tmp_path, GOOD)
    with pytest.raises(SourceError, match="was measured at 480x400, the images are 320x320"):
        open_source(f"mcap:{data_dir / 'press.mcap'}?lens={bad}")
    with pytest.raises(SourceError, match="its maker's measurement of the lens is not known; give lens=FILE"):
        open_source(f"mcap:{data_dir / 'press.mcap'}?lens=factory")
    with pytest.raises(SourceError, match="cannot be read: No such file"):
        open_source(f"mcap:{data_dir / 'press.mcap'}?lens=absent.toml")
