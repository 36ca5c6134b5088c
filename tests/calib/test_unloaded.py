"""The untouched tip, estimated from frames that are all pressed."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from calib.dataset import open_dataset
from calib.errors import TableError
from calib.fit import ModelKind, Search, fit
from calib.sim.camera import Camera
from calib.sim.mechanics import Tool, ToolPose
from calib.sim.simulator import Simulator
from calib.sim.tip import Tip
from calib.targets import read_targets
from calib.unloaded import load_of, unloaded
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.rest.tare import take_rest_frame
from edge.sources.files import read_image
from edge.tracking import Tracker
from edge.types import Array, Frame, Image, Rest
from tests.support.captures import write_table

N = 40
RNG = np.random.default_rng(7)
TRUTH = {
    "displacement_mm": RNG.uniform(0.6, 3.0, N),
    "tilt_x_deg": RNG.uniform(-15.0, 15.0, N),
    "tilt_y_deg": RNG.uniform(-15.0, 15.0, N),
    "shear_x_mm": RNG.uniform(-1.5, 1.5, N),
    "shear_y_mm": RNG.uniform(-1.5, 1.5, N),
}


def tip() -> Simulator:
    return Simulator(Camera(tip=Tip(n_pins=127, kind="hex"), size_px=(320, 320)))


@pytest.fixture(scope="module")
def pressed() -> list[Image]:
    one = tip()
    poses = [ToolPose(Tool(), 0.0, 0.0, *row) for row in zip(*TRUTH.values(), strict=True)]
    return [one.frame((pose,)).image for pose in poses]


def error_px(rest: Rest, true: Rest) -> float:
    """Rms distance of the pins from their true places."""
    tracks = Tracker(true).identify(rest.pins)
    assert tracks.seen.all()
    return float(np.sqrt(np.mean(np.sum((tracks.xy_img - true.xy_img) ** 2, axis=1))))


@pytest.mark.parametrize("n", [10, N])
def test_the_estimate_is_nearer_to_the_truth_than_any_frame(pressed: list[Image], n: int) -> None:
    true = take_rest([tip().frame().image])
    chosen = take_rest([pressed[int(np.argmin(TRUTH["displacement_mm"][:n]))]])
    found = unloaded(chosen, pressed[:n], {name: column[:n] for name, column in TRUTH.items()})
    assert found is not None
    frames = [take_rest([image]) for image in pressed[:n:4]]
    assert error_px(found, true) < 0.75 * min(error_px(frame, true) for frame in [chosen, *frames])


def test_without_a_load_far_from_it_or_with_few_frames_there_is_none(pressed: list[Image]) -> None:
    chosen, depth = take_rest([pressed[int(np.argmin(TRUTH["displacement_mm"]))]]), "displacement_mm"
    shear: dict[str, Array] = {"shear_x_mm": TRUTH["shear_x_mm"]}
    assert load_of(shear) is None
    # No load at all; an arm's position; one depth alone.
    for values in (shear, {depth: TRUTH[depth] + 50.0}, {depth: np.full(N, 3.0)}):
        assert unloaded(chosen, pressed, values) is None
    assert unloaded(chosen, pressed[:4], {name: column[:4] for name, column in TRUTH.items()}) is None


def test_a_fit_to_pressed_frames_is_right_on_the_real_tip(pressed: list[Image], tmp_path: Path) -> None:
    depth, untouched = TRUTH["displacement_mm"], tip().frame().image
    data = open_dataset([write_table(tmp_path, pressed, {"pose_z": depth})], tmp_path, None)
    assert "in 40 frames extrapolated to no load" in data.rest_message
    with ThreadPoolExecutor(1) as pool:
        frames, search = data.extract(pool), Search(kinds=frozenset({ModelKind.POLYNOMIAL}))
    fitted = fit(data.rest, data.targets, frames, estimated=data.estimated, mm_per_px=None, search=search)[0]
    pipeline = Pipeline(take_rest_frame([untouched] * 8, calibration=fitted).rest, fitted)
    read, name = [], "displacement_mm"
    for image in [*pressed, untouched]:
        pipeline.forget()
        read.append(pipeline.process(Frame(image, 0, 0)).reading)
    assert (
        np.mean([abs(r.values[name] - d) < r.sigmas[name] for r, d in zip(read, depth, strict=False)]) > 0.6
    )
    assert read[-1].values[name] == 0.0


def test_frames_the_table_calls_untouched_are_the_rest_frame(pressed: list[Image], tmp_path: Path) -> None:
    untouched = tip().frame().image
    depths = np.append(TRUTH["displacement_mm"][:6], [0.0, 0.0])
    path = write_table(tmp_path, [*pressed[:6], untouched, untouched], {"pose_z": depths})
    data = open_dataset([path], tmp_path, Path("auto"))
    assert "2 frames that the table says are without load" in data.rest_message
    assert error_px(data.rest, take_rest([untouched])) < 0.02


def test_a_table_without_pins_is_one_line(tmp_path: Path) -> None:
    path = write_table(tmp_path, [np.zeros((240, 320), np.uint8)] * 2, {"pose_z": np.array([1.0, 2.0])})
    with pytest.raises(TableError, match="give --rest an image of the untouched tip"):
        open_dataset([path], tmp_path, None)


@pytest.mark.real
def test_published_frames_of_one_tip(real_dir: Path) -> None:
    """All pressed by 1 mm and more; a twentieth of a pitch is what a tilt of one degree moves pins by."""
    folder = real_dir / "tactip331_binary"
    true = take_rest([read_image(folder / "rest.png")])
    targets = read_targets(folder / "targets.csv", folder / "frames").rows(range(0, 600, 5))
    data_rest = take_rest([read_image(targets.frames[int(np.argmin(targets.values["displacement_mm"]))])])
    found = unloaded(data_rest, [read_image(path) for path in targets.frames], targets.values)
    assert found is not None
    assert error_px(found, true) < 0.08 * true.pattern.pitch_px
