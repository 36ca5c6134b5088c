"""What is judged of a picture is what was done to it."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.sim import Camera, Simulator, Tip
from edge.cli import picture
from edge.pins import take_rest
from edge.sources import open_source
from edge.types import Frame, Image
from tests.support.layouts import only


@lru_cache
def frame() -> Frame:
    return Simulator(Camera(tip=Tip(n_pins=127, kind="hex"), size_px=(320, 320))).frame()


def levels(image: Image) -> dict[str, str]:
    shown = replace(frame(), image=image)
    rest = take_rest([image])
    lines = [*picture.pins(shown, rest), picture.brightness([shown], rest)]
    return {line.topic: line.level for line in lines if line.level != "ok"}


@pytest.mark.parametrize("dark", [False, True])
def test_clipped_pins_are_counted_on_the_bright_side_of_their_edge(dark: bool) -> None:
    image = frame().image if not dark else 255 - frame().image
    half = image.copy()
    half[:, :160] = np.minimum(half[:, :160].astype(int) + 120, 255)
    rest = take_rest([image])
    clipped = picture.clipped(replace(frame(), image=half), rest)
    left = rest.xy_img[:, 0] < 160 - rest.pattern.pitch_px
    right = rest.xy_img[:, 0] > 160 + rest.pattern.pitch_px
    assert clipped[left].all()
    assert not clipped[right].any()


@pytest.mark.parametrize("degrees", [0, 60, -45])
def test_the_length_and_direction_of_a_motion_are_found(degrees: float) -> None:
    along = np.exp(1j * np.radians(degrees)) * np.linspace(-4.5, 4.5, 37)
    image = frame().image.astype(np.float32)
    shifted = [cv2.warpAffine(image, np.array([[1, 0, d.real], [0, 1, d.imag]]), (320, 320)) for d in along]
    moved = np.rint(np.mean(shifted, axis=0)).astype(np.uint8)
    smear, direction = picture.smear_px(replace(frame(), image=moved), take_rest([moved]))
    assert smear == pytest.approx(9, abs=1)
    assert direction == pytest.approx(degrees, abs=3)
    assert "motion" in levels(moved)


def test_pins_may_be_out_of_focus_or_faint_though_rounding_hides_the_noise() -> None:
    image = frame().image.astype(np.float64)
    assert not {"contrast", "focus"} & set(levels(frame().image))
    assert "focus" in levels(np.asarray(cv2.GaussianBlur(frame().image, (0, 0), 3.5), np.uint8))
    assert "contrast" in levels(np.rint(100 + 5 * image / np.ptp(image)).astype(np.uint8))


def test_holes_are_counted_where_there_is_a_lattice() -> None:
    rest = take_rest([frame().image])
    assert len(picture.holes(rest)) == 0
    gone = [40, 63, 77]
    found = picture.holes(only(rest, np.delete(np.arange(127), gone)))
    assert len(found) == len(gone)
    away = np.hypot(*(rest.xy_img[gone][:, None] - found).transpose(2, 0, 1)).min(axis=1)
    assert (away < 0.3 * rest.pattern.pitch_px).all()
    strewn = np.random.default_rng(3).permutation(127)[:80]
    assert len(picture.holes(only(rest, strewn))) == 0


def test_separate_groups_of_pins_are_each_offered_as_a_region(tmp_path: Path) -> None:
    image = frame().image
    skin = np.full((320, 320), np.median(image), np.uint8)
    two = replace(frame(), image=np.hstack([image, skin, image]).astype(np.uint8))
    rest = take_rest([two.image])
    assert [len(group) for group in picture.groups(rest)] == [127, 127]
    cv2.imwrite(str(tmp_path / "two.png"), two.image)
    tried = picture.settings_tried(open_source(str(tmp_path / "two.png")), two, rest)
    ((key, n),) = tried.items()
    source = open_source(f"{tmp_path / 'two.png'}?{key}")
    found = take_rest([next(iter(source)).image], region=source.region)
    assert len(found) == n == 2 * 127
    assert found.part is not None
    assert [np.count_nonzero(found.part == kind) for kind in np.unique(found.part)] == [127, 127]
