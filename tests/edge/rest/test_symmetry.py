"""A touch that is seen without knowing the tip, and what must not be taken for one."""

from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from calib.sim import Camera, Simulator, Tip, ToolPose
from edge.pins import take_rest
from edge.rest.symmetry import RestSymmetry, symmetry_of
from edge.sources import open_source
from edge.sources.files import read_image
from edge.types import Image


def simulated(kind: str, pins_n: int, *poses: ToolPose) -> Image:
    return Simulator(Camera(tip=Tip(n_pins=pins_n, kind=kind), size_px=(480, 480))).frame(poses).image


def symmetry(image: Image) -> RestSymmetry:
    return symmetry_of(take_rest([image]))


@pytest.mark.parametrize(("kind", "pins_n"), [("hex", 127), ("rings", 331)])
def test_a_tilted_touch_is_seen_and_one_straight_onto_the_middle_is_not(kind: str, pins_n: int) -> None:
    tilted = symmetry(simulated(kind, pins_n, ToolPose(depth_mm=3.0, tilt_x_deg=15.0)))
    assert tilted.in_contact
    assert "lopsided" in tilted.message
    assert not symmetry(simulated(kind, pins_n, ToolPose(depth_mm=2.0))).in_contact


def test_a_camera_at_a_slant_a_lens_and_uneven_pins_are_no_touch() -> None:
    """What a slant of 6 % across and a lens of 10 % outwards do to a flat grid, and noise."""
    rest = take_rest([simulated("hex", 127)])
    place = (rest.xy_img - rest.pattern.centre_img) / rest.pattern.tip_radius_px
    scale = 1.0 + 0.1 * (place**2).sum(axis=1) + 0.06 * place[:, 0]
    seen = rest.pattern.centre_img + rest.pattern.tip_radius_px * place * scale[:, None]
    assert not symmetry_of(replace(rest, pins=replace(rest.pins, xy_img=seen))).in_contact
    noise = np.random.default_rng(5).normal(0.0, 0.08 * rest.pattern.pitch_px, rest.xy_img.shape)
    found = symmetry_of(replace(rest, pins=replace(rest.pins, xy_img=rest.xy_img + noise)))
    assert found.irregularity > 0.04
    assert not found.in_contact


def test_too_few_pins_are_never_suspected() -> None:
    assert symmetry(simulated("hex", 37, ToolPose(depth_mm=3.0, tilt_x_deg=15.0))) == RestSymmetry(0.0, 0.0)


@pytest.mark.real
def test_published_recordings(real_dir: Path) -> None:
    """Untouched images pass; of touched ones of a regular tip most are seen."""
    binary = real_dir / "tactip331_binary"
    assert not symmetry(read_image(binary / "rest.png")).in_contact
    touched = [symmetry(read_image(path)).in_contact for path in sorted((binary / "frames").iterdir())[::30]]
    assert np.mean(touched) > 0.8
    for video in ("gelsight_mini/press.avi", "video/Movement4.avi", "video/north.avi"):
        source = open_source(str(real_dir / video))
        for frame in islice(source, 0, 40, 20):
            assert not symmetry(frame.image).in_contact
        source.close()
