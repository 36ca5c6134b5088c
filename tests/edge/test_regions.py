"""One skin in several views: each has a lattice, cells and contacts of its own, and none lies on the seam."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from calib.fit import tip_of
from calib.sim import Camera, Simulator, Tip, Tool, ToolPose
from edge.calibration import Calibration
from edge.errors import NoPins
from edge.faults.pin_visibility import PinVisibility
from edge.fingertip import Fingertip
from edge.frame import Pipeline
from edge.geometry.parts import parts_of
from edge.pins import take_rest
from edge.rest.choice import rest_of_source
from edge.rest.tip_match import match_tip
from edge.sources import open_source
from edge.types import Frame, FrameSource, Image, Rest, Tracks
from tests.support.captures import write_table
from tests.support.commands import run_calib
from tests.support.layouts import only

SIDE_PX = 240
SEAM = f"roi=0,0,{SIDE_PX - 1},{SIDE_PX}", f"roi={SIDE_PX + 1},0,{SIDE_PX - 1},{SIDE_PX}"
POSES = (0.0, 0.0, 0.0, 0.4, 0.8, 1.2, 1.6, 2.0)


def _both(view: Image, shift_px: int = 0) -> Image:
    """A view, shifted to the right, and its mirror image as it is, side by side."""
    return np.asarray(np.hstack([np.roll(view, shift_px, axis=1), view[:, ::-1]]), np.uint8)


@pytest.fixture(scope="module")
def tip() -> Simulator:
    return Simulator(Camera(tip=Tip(n_pins=91, kind="hex"), size_px=(SIDE_PX, SIDE_PX)))


@pytest.fixture(scope="module")
def folder(tip: Simulator, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball pressed in beside the middle, as two views show it; at last the left one alone is shifted."""
    path = tmp_path_factory.mktemp("views")
    ball = ToolPose(Tool("sphere", 5.0), x_mm=4.0, y_mm=3.0)
    for k, depth_mm in enumerate(POSES):
        view = tip.frame((replace(ball, depth_mm=depth_mm),) if depth_mm else ()).image
        cv2.imwrite(str(path / f"{k}.png"), _both(view))
    cv2.imwrite(str(path / "8.png"), _both(tip.frame().image, 10))
    return path


def _source(folder: Path, *keys: str) -> FrameSource:
    return open_source(f"{folder}?{'&'.join(keys)}")


def _taken(folder: Path, *keys: str) -> tuple[Rest, list[Frame]]:
    """The rest frame and all frames; the pins of the left view are those with x below SIDE_PX."""
    source = _source(folder, *keys)
    frames = list(source)
    images = [f.image for f in frames[:3]]
    return take_rest(images, source.polarity, source.lens, source.region), frames


def _results(folder: Path, *keys: str) -> tuple[Rest, list[Any]]:
    """The press followed from rest."""
    rest, frames = _taken(folder, *keys)
    pipeline = Pipeline(rest)
    return rest, [pipeline.process(frame) for frame in frames[:-1]]


def test_each_view_is_read_as_it_is_alone(folder: Path) -> None:
    rest, both = _results(folder, *SEAM)
    assert rest.part is not None
    left = rest.xy_img[:, 0] < SIDE_PX
    assert np.array_equal(rest.part == rest.part[left][0], left)
    for key, rows in zip(SEAM, (left, ~left), strict=True):
        own, alone = _results(folder, key)
        assert own.part is None
        assert np.abs(own.xy_img - rest.xy_img[rows]).max() < 0.02
        for together, one in zip(both, alone, strict=True):
            moved = together.features.displacement_px[rows] - one.features.displacement_px
            assert np.nanmax(np.abs(moved)) < 0.02
            change = together.features.area_change[rows] - one.features.area_change
            assert np.nanmax(np.abs(change)) < 0.01
            in_left = np.append(left, together.cells.boundary_img[:, 0] < SIDE_PX)
            assert (np.ptp(in_left[together.cells.triangles].astype(int), axis=1) == 0).all()


def test_a_touch_is_a_contact_in_each_view_and_none_on_the_seam(folder: Path) -> None:
    _, results = _results(folder, *SEAM)
    assert all(result.features.contacts == () for result in results[:3])
    deep = results[len(POSES) - 1].features
    places = sorted((contact.xy_img for contact in deep.contacts), key=lambda xy: float(xy[0]))
    assert len(places) == 2
    mirrored = np.array([2 * SIDE_PX - 1, 0]) + np.array([-1, 1]) * places[0]
    assert np.hypot(*(mirrored - places[1])) < 2.0
    assert abs(deep.shear_px[0]) < 0.05  # of one view and its mirror image
    x, y = deep.grid_img
    for place in places:  # each view has its hill
        row, column = np.abs(y - place[1]).argmin(), np.abs(x - place[0]).argmin()
        assert deep.surface[row, column] > 0.3 * np.nanmax(deep.surface)


def test_a_shift_of_one_view_is_identified_and_the_other_is_followed_meanwhile(folder: Path) -> None:
    rest, frames = _taken(folder, *SEAM)
    left = rest.xy_img[:, 0] < SIDE_PX
    pipeline = Pipeline(rest)
    for frame, shift_px in ((frames[0], 0.0), (frames[-1], 10.0), (frames[0], 0.0)):
        result = pipeline.process(frame)
        moved = result.tracks.xy_img - rest.xy_img
        assert result.searched
        assert result.tracks.confidence >= Tracks.LOW_CONFIDENCE
        assert result.tracks.n_seen > 0.9 * len(rest)
        assert np.nanmax(np.abs(moved[left] - [shift_px, 0.0])) < 0.3
        assert np.nanmax(np.abs(moved[~left])) < 0.3
        assert not pipeline.process(frame).searched


def test_lost_pins_and_a_lost_view_change_nothing_of_the_other_whose_values_go_on(folder: Path) -> None:
    rest, frames = _taken(folder, *SEAM)
    left = rest.xy_img[:, 0] < SIDE_PX
    few = np.flatnonzero(~left)[[20, 21, 45]]
    for x, y in np.rint(rest.xy_img[few]).astype(int).tolist():
        cv2.circle(frames[2].image, (x, y), 7, 20, -1)
    frames[5].image[:100, SIDE_PX:] = 20  # a third of its pins: too few are left
    frames[6].image[:, SIDE_PX:] = 20
    pipeline, visibility = Pipeline(rest), PinVisibility(rest)
    assert (left[visibility._near] == left[:, None]).all()
    for k, whole in enumerate(_results(folder, *SEAM)[1]):
        result: Any = pipeline.process(frames[k])
        features, is_lost = result.features, k in (5, 6)
        seen = left if is_lost else ~np.isin(np.arange(len(rest)), few if k == 2 else [])
        assert (result.tracks.seen == seen).all()
        assert (np.isfinite(result.cells.area_px2) == seen).all()
        visibility.problem(result.tracks, features)
        assert visibility.explained == ("1 of 2 views lost" if is_lost else "")
        assert (features.displacement_px[left] == whole.features.displacement_px[left]).all()
        assert (features.area_change[left] == whole.features.area_change[left]).all()
        here, there = (sorted(c.xy_img.tolist() for c in f.contacts) for f in (features, whole.features))
        assert here[:1] == there[:1]
        assert len(here) == (1 if is_lost else len(there))
        assert result.searched == (k in (0, 7))
        if k == 2:
            assert 0.0 < result.cells.gap < 0.1
            away = result.cells.gap_img - rest.xy_img[few].mean(axis=0)
            assert np.hypot(*away) < rest.pattern.pitch_px


def test_parts_follow_the_pins_into_a_calibration_s_order_and_a_chosen_rest(folder: Path) -> None:
    rest, frames = _taken(folder, *SEAM)
    assert rest.part is not None
    order = np.random.default_rng(1).permutation(len(rest))
    order = order[np.argsort(-rest.part[order], kind="stable")]  # the other view is the calibration's first
    tip = replace(only(rest, order), part=1 - rest.part[order], views=rest.views[::-1])
    matched = match_tip(tip_of(tip), rest)[0]
    assert matched.part is not None
    assert (matched.part == 1 - rest.part[order]).all()
    results: list[Any] = [Pipeline(one).process(frames[7]) for one in (matched, rest)]
    areas = [result.cells.rest_area_px2 for result in results]
    assert areas[0] == pytest.approx(areas[1][order], rel=1e-9)
    moved = [result.features.displacement_px for result in results]
    assert moved[0] == pytest.approx(moved[1][order], abs=0.01)
    assert match_tip(tip_of(replace(rest, part=None)), rest)[0].part is None  # it was fitted to one view
    assert rest_of_source(_source(folder, *SEAM), "auto").rest.part is not None
    assert rest_of_source(_source(folder, SEAM[0]), "0").rest.part is None


def test_a_view_may_have_dark_pins_where_the_other_has_bright_ones(folder: Path) -> None:
    images = [frame.image for frame in _source(folder)]
    for image in images:
        image[:, SIDE_PX:] = 255 - image[:, SIDE_PX:]
    finger = Fingertip(images[:3], region="&".join(SEAM))
    assert [pattern.dark for pattern in finger.rest.views] == [False, True]
    result: Any = finger.read(images[7], 0.0)
    assert result.tracks.n_seen > 0.95 * len(finger.rest)
    assert len(result.features.contacts) == 2


def test_parts_without_a_pattern_have_no_pins(folder: Path) -> None:
    rest, _ = _taken(folder, SEAM[0], f"roi={SIDE_PX + 60},60,45,45")
    assert rest.part is None
    assert len(rest) == rest.pattern.count == 91
    with pytest.raises(NoPins, match=r"none of 2 parts of the region shows pins; the last one: no pattern"):
        _taken(folder, "roi=60,60,45,45", f"roi={SIDE_PX + 60},60,45,45")


def test_two_mirrors_of_a_published_sensor_show_one_touch_each(real_dir: Path) -> None:
    case = real_dir.parent / "cases" / "sensors" / "mirror_two_views"
    if not case.is_dir():
        pytest.skip(f"no pictures at {case}")
    source = open_source(f"{case}?roi=54,79,215,220&roi=308,91,219,216")
    frames = list(source)
    pipeline = Pipeline(take_rest([frames[0].image], source.polarity, source.lens, source.region))
    results: list[Any] = [pipeline.process(frame) for frame in frames]
    assert all(result.features.contacts == () for result in results[:-1])
    assert np.mean([result.tracks.seen.mean() for result in results[:-1]]) > 0.97
    searched = [Pipeline(pipeline.rest).process(frame).tracks.seen.mean() for frame in frames[:-1]]
    assert np.mean(searched) > 0.97  # each view by its own pattern; by one for both it was 0.92
    touched = results[-1]
    assert touched.tracks.confidence >= Tracks.LOW_CONFIDENCE
    x = sorted(float(contact.xy_img[0]) for contact in touched.features.contacts)
    assert len(x) == 2
    assert x[0] < 285 - 60 < 285 + 60 < x[1]


def test_each_view_has_a_calibration_and_the_lost_one_is_not_missed(tip: Simulator, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    places = np.column_stack([rng.uniform(-4.0, 4.0, (20, 2)), np.linspace(0.5, 3.0, 20)])
    balls = [ToolPose(Tool("sphere", 5.0), x_mm=x, y_mm=y, depth_mm=z) for x, y, z in places.tolist()]
    images = [_both(tip.frame((ball,)).image) for ball in balls]
    names = "contact_x", "contact_y", "pose_z"
    table = write_table(tmp_path, images, dict(zip(names, places.T, strict=True)))
    cv2.imwrite(str(tmp_path / "rest.png"), _both(tip.frame().image))
    words = table, "--frames", tmp_path, "--rest", tmp_path / "rest.png", "-q", "--json"
    region, path = ("--workers", "1", "--region", "&".join(SEAM)), tmp_path / "two.json"
    assert run_calib("fit", *words, *region, "-o", path).code == 0
    for report in json.loads(run_calib("evaluate", path, *words, *region).printed)["views"]:
        assert report["displacement_mae_mm"] < 0.1
        assert report["contact_place_mean_mm"] < 0.5
    finger = Fingertip([_both(tip.frame().image)] * 3, path, region=region[-1])
    assert len(parts_of(finger.rest)) == len(Calibration.load(path).views) == 2
    for hidden in (slice(0), slice(SIDE_PX), slice(SIDE_PX, None)):
        image = images[12].copy()
        image[:, hidden] = 20
        reading = finger.read(image, 0.0).reading
        assert reading.values["displacement_mm"] == pytest.approx(places[12, 2], abs=0.2)
        assert len(reading.contacts) == (2 if hidden == slice(0) else 1)
        assert np.hypot(*(reading.contacts[:, :2] - places[12, :2]).T).max() < 0.5
    refusal = run_calib("fit", *words, "--region", "rio=1", "-o", tmp_path / "a.json").refusal
    assert "region rio=1: give roi=x,y,w,h, circle=x,y,r or mask=FILE" in refusal
