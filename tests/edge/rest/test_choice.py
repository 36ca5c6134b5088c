"""The least deformed image of a recording, with and without untouched images in it."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from calib.sim import Camera, Simulator, Tip, ToolPose
from calib.targets import read_targets
from edge.calibration import Calibration
from edge.errors import NoPins
from edge.pins import take_rest
from edge.rest.choice import aligned, choose_rest, rest_of_source
from edge.rest.tip_match import match_tip
from edge.sources import open_source
from edge.sources.files import read_image
from edge.types import Image, Rest

TIP = Tip(n_pins=127, kind="hex")
RNG = np.random.default_rng(19)


def simulator() -> Simulator:
    return Simulator(Camera(tip=TIP, size_px=(320, 320)))


def touches(depths_mm: np.ndarray) -> list[Image]:
    """A flat surface at these depths, tilted and sheared at random."""
    one = simulator()
    return [
        one.frame((ToolPose(depth_mm=float(d), tilt_x_deg=15 * u, tilt_y_deg=15 * v, shear_x_mm=x),)).image
        for d, (u, v, x) in zip(depths_mm, RNG.uniform(-1.0, 1.0, (len(depths_mm), 3)), strict=True)
    ]


def test_the_untouched_images_are_found_behind_a_touch() -> None:
    images = touches(np.linspace(3.0, 1.0, 8))
    resting = [simulator().frame().image for _ in range(4)]
    choice = choose_rest([*images, *resting, *images[::-1]])
    assert 8 <= choice.index < 12
    assert choice.trusted
    assert choice.agree_n == 3
    assert "3 of 19 others" in choice.message


def test_a_press_that_is_held_for_longer_than_the_tip_rests_is_not_the_rest() -> None:
    one = simulator()
    choice = choose_rest([one.frame((ToolPose(depth_mm=2.0),) * (4 <= k < 20)).image for k in range(24)])
    assert choice.index not in range(4, 20)
    assert choice.trusted


def test_without_an_untouched_image_the_shallowest_is_taken_and_marked_untrusted() -> None:
    depths = np.array([2.5, 3.0, 1.8, 2.2, 0.5, 2.8, 1.5, 2.0, 3.2, 2.6])
    choice = choose_rest(touches(depths))
    assert choice.index == 4
    assert not choice.trusted
    assert "may show a touch" in choice.message
    with pytest.raises(NoPins):
        choose_rest([np.zeros((100, 100), np.uint8)])


def rest_of(data_dir: Path, how: str, calibration: Calibration | None = None) -> Rest:
    with closing(open_source(str(data_dir / "press_shear.mcap"))) as source:
        return rest_of_source(source, how, calibration).rest


def test_a_calibration_s_rest_pins_are_moved_onto_a_touched_image(data_dir: Path) -> None:
    calibration = Calibration.load(data_dir / "hex127_flat.json")
    images = [frame.image for frame in open_source(str(data_dir / "press_shear.mcap"))]
    true = match_tip(calibration, take_rest(images[:8]))[0]
    for rest in (rest_of(data_dir, "none", calibration), rest_of(data_dir, "0", calibration)):
        assert np.hypot(*(rest.xy_img - true.xy_img).T).max() < 0.3
    shifted = np.roll(images[0], (3, -2), (0, 1))
    moved = aligned(calibration, take_rest([shifted]))
    assert moved.xy_img - true.xy_img == pytest.approx(np.tile([-2.0, 3.0], (len(true), 1)), abs=0.2)


@pytest.mark.real
def test_real_tables_least_deformed_frame_is_a_shallow_one(real_dir: Path) -> None:
    folder = real_dir / "tactip331_binary"
    targets = read_targets(folder / "targets.csv", folder / "frames")
    some = list(range(0, 600, 10))

    choice = choose_rest([read_image(targets.frames[k]) for k in some])
    depth = targets.values["displacement_mm"][some]
    assert depth[choice.index] <= np.quantile(depth, 0.15)
    assert not choice.trusted
