"""Axes of rigs: all eight orientations in the image, any z, and frames that leave it open."""

import json
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.axes import Axes, recognise_axes, recognise_handedness
from calib.errors import FitError, TableError
from calib.evaluate import evaluate
from calib.extract import DEMAND, Extract, gather, measure
from calib.fit import ModelKind, Search, fit
from calib.press_axis import along_press
from calib.sim import Simulator, Tip
from calib.sim.camera import Camera
from calib.sim.mechanics import ToolPose
from calib.targets import Targets
from edge.calibration import Calibration
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.types import Array, Image, Index, Rest
from tests.support.captures import write_table
from tests.support.commands import run_calib
from tests.support.synthetic import REST, make, targets

SHEAR = ("shear_x_mm", "shear_y_mm")
FORMS = list(product((1, -1), (1, -1), (False, True)))
pytestmark = pytest.mark.usefixtures("quick_fits")


def _seen(values: dict[str, Array], form: tuple[int, int, bool]) -> dict[str, Array]:
    """The table as a rig whose axes are negated and swapped would have written it."""
    sx, sy, swapped = form
    x, y = sx * values["shear_x_mm"], sy * values["shear_y_mm"]
    turned = {"shear_x_mm": y, "shear_y_mm": x} if swapped else {"shear_x_mm": x, "shear_y_mm": y}
    side = sx * sy * (-1 if swapped else 1)
    return values | turned | {"torsion_deg": side * values["torsion_deg"]}


def _found(form: tuple[int, int, bool], extract: Extract, values: dict[str, Array]) -> Axes:
    seen = _seen(values, form)
    y = seen["shear_x_mm"] + 1j * seen["shear_y_mm"]
    return recognise_axes([recognise_handedness(SHEAR, extract.inputs, y)])


def _errors(form: tuple[int, int, bool]) -> list[float]:
    extract, values = make(60, noise=0.01)
    fresh, true = make(100, seed=1)
    calibration, _ = fit(REST, targets(_seen(values, form)), extract, mm_per_px=None)
    report = evaluate(calibration, targets(_seen(true, form)), fresh)
    return [report["displacement_mae_mm"], *sorted(report["shear_mae_mm"]), report["torsion_mae_deg"]]


@pytest.fixture(scope="module")
def straight(quick_fits: None) -> list[float]:
    return _errors(FORMS[0])


@pytest.mark.parametrize("form", [(1, -1, False), (1, -1, True), (1, 1, True)], ids=str)
def test_a_mirrored_or_turned_rig_errs_alike(form: tuple[int, int, bool], straight: list[float]) -> None:
    np.testing.assert_allclose(_errors(form), straight, rtol=0.02, atol=1e-4)


def test_the_relation_is_given_in_the_image_s_axes() -> None:
    # The synthetic rig's shear is the image's.
    lines = {
        (1, 1, False): "shear_x_mm = image x, shear_y_mm = image y",
        (1, -1, False): "shear_x_mm = image x, shear_y_mm = image -y (mirrored)",
        (-1, 1, False): "shear_x_mm = image -x, shear_y_mm = image y (mirrored)",
        (1, 1, True): "shear_x_mm = image y, shear_y_mm = image x (mirrored)",
        (-1, 1, True): "shear_x_mm = image y, shear_y_mm = image -x",
        (-1, -1, False): "shear_x_mm = image -x, shear_y_mm = image -y",
        (1, -1, True): "shear_x_mm = image -y, shear_y_mm = image x",
        (-1, -1, True): "shear_x_mm = image -y, shear_y_mm = image -x (mirrored)",
    }
    for form in FORMS:
        axes = _found(form, *make(60, noise=0.01))
        assert axes.lines == (lines[form],)
        assert axes.mirrored[SHEAR] == ("mirrored" in lines[form])
        assert not axes.warnings


def test_a_sweep_along_one_axis_leaves_handedness_open() -> None:
    extract, values = make(50)
    values["shear_y_mm"] = 0.0 * values["shear_y_mm"]
    axes: list[Axes] = []
    fit(REST, targets({name: values[name] for name in SHEAR}), extract, mm_per_px=None, on_axes=axes.append)
    assert axes == [recognise_axes([])]
    assert not axes[0].lines


def test_groups_that_disagree_are_reported() -> None:
    extract, values = make(60, noise=0.01)
    rng = np.random.default_rng(3)
    tilt = 10 * (values["shear_x_mm"] - 1j * values["shear_y_mm"]) + 0.01 * rng.normal(size=60)
    values |= {"tilt_x_deg": tilt.real, "tilt_y_deg": tilt.imag}
    axes: list[Axes] = []
    fit(REST, targets(values), extract, mm_per_px=None, on_axes=axes.append)
    assert axes[0].mirrored == {("tilt_x_deg", "tilt_y_deg"): True, SHEAR: False}
    (warning,) = axes[0].warnings
    assert "do not agree" in warning
    assert "tilt_x_deg" in warning


@dataclass(frozen=True, slots=True)
class Pressed:
    """A rendered tip, tilted and pressed, 60 frames from 1 mm above the first touch to 3 mm beyond."""

    rest_image: Image
    images: list[Image]
    rest: Rest
    extract: Extract
    depth: Array
    force: Array

    @property
    def every(self) -> Index:
        return np.arange(len(self.depth), dtype=np.int32)

    @property
    def touched(self) -> Index:
        return self.every[self.depth > 0.8]

    def table(self, rows: Index, **values: Array) -> tuple[Targets, Extract]:
        return targets(values).rows(rows), self.extract.rows(rows)


@pytest.fixture(scope="module")
def pressed() -> Pressed:
    sim = Simulator(Camera(tip=Tip(n_pins=127, kind="hex"), size_px=(320, 320)))
    rest_image = sim.frame().image
    depth = np.round(np.linspace(-1.0, 3.0, 60), 3)
    tilts = np.random.default_rng(0).uniform(-8.0, 8.0, (60, 2))
    poses = [ToolPose(depth_mm=d, tilt_x_deg=a, tilt_y_deg=b) for d, (a, b) in zip(depth, tilts, strict=True)]
    images = [sim.frame((pose,) if pose.depth_mm > 0 else ()).image for pose in poses]
    rest = take_rest([rest_image])
    pipeline = Pipeline(rest, demand=DEMAND)
    extract = gather([measure(pipeline, image) for image in images])
    return Pressed(rest_image, images, rest, extract, depth, np.maximum(depth, 0.0) ** 1.5)


#: A rig writes a depth with a sign and a reading at the first touch; beside them is the relation found.
RIGS = [
    (1, 0.0, "displacement_mm = pose_z ("),
    (-1, 0.0, "displacement_mm = -pose_z ("),
    (1, 50.0, "displacement_mm = pose_z -50."),
    (-1, 412.3, "displacement_mm = 412."),
    (-1, -80.0, "displacement_mm = -80."),
    (1, -5.0, "displacement_mm = pose_z +4."),
]


@pytest.mark.parametrize(("sign", "at_touch", "relation"), RIGS)
def test_any_rig_s_z_becomes_a_depth(pressed: Pressed, sign: int, at_touch: float, relation: str) -> None:
    table, extract = pressed.table(pressed.every, displacement_mm=sign * pressed.depth + at_touch)
    found, (line,) = along_press(table, extract, captured=False, rest_given=True)
    assert line.startswith(relation)
    depth = found.values["displacement_mm"]
    if (sign, at_touch) == (1, 0.0):
        np.testing.assert_array_equal(depth, pressed.depth)
    else:  # a fit that is not told takes no such table
        np.testing.assert_allclose(depth, np.maximum(pressed.depth, 0.0), atol=0.25 if at_touch else 0.0)
        with pytest.raises(FitError, match=r"table\.csv: column pose_z \(displacement_mm\) (falls|is )"):
            fit(pressed.rest, table, extract, mm_per_px=None)
    fit(pressed.rest, found, extract, mm_per_px=None, search=Search(kinds=frozenset({ModelKind.PLAIN})))


@pytest.mark.parametrize(("sign", "at_touch"), [(1, 50.0), (-1, 412.3), (-1, -80.0), (1, -20.0)])
def test_a_position_without_a_first_touch_is_refused(pressed: Pressed, sign: int, at_touch: float) -> None:
    table, extract = pressed.table(pressed.touched, displacement_mm=sign * pressed.depth + at_touch)
    with pytest.raises(TableError, match=r"pose_z .* first touch.*, or add frames every 0\.1 mm") as caught:
        along_press(table, extract, captured=False, rest_given=True)
    assert ("z point up?" in str(caught.value)) == (sign < 0)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("sign", [1, -1])
def test_a_depth_or_a_force_that_is_all_pressed_is_taken_either_way(pressed: Pressed, sign: int) -> None:
    values = {"displacement_mm": sign * pressed.depth, "force_n": sign * pressed.force}
    table, extract = pressed.table(pressed.touched, **values)
    found, lines = along_press(table, extract, captured=False, rest_given=True)
    np.testing.assert_array_equal(found.values["displacement_mm"], pressed.depth[pressed.touched])
    np.testing.assert_array_equal(found.values["force_n"], pressed.force[pressed.touched])
    assert lines[1] == ("force_n = force_z" if sign > 0 else "force_n = -force_z")
    if sign < 0:
        force, _ = pressed.table(pressed.touched, force_n=values["force_n"])
        with pytest.raises(FitError, match=r"column force_z \(force_n\) falls .* a press pushes"):
            fit(pressed.rest, force, extract, mm_per_px=None)
        with pytest.raises(TableError, match="give --rest an image of the untouched tip"):
            along_press(table, extract, captured=False, rest_given=False)


@pytest.mark.parametrize("at_touch", [0.4123, -0.01, 12.0])
def test_a_position_in_metres_is_refused(pressed: Pressed, at_touch: float) -> None:
    table, extract = pressed.table(pressed.every, displacement_mm=at_touch - pressed.depth / 1000.0)
    for rest_given in (True, False):
        with pytest.raises(TableError, match=r"column pose_z changes by 0\.004 mm .*; its unit is mm"):
            along_press(table, extract, captured=False, rest_given=rest_given)


@pytest.mark.parametrize(("idle", "noted"), [(0.0, False), (0.2, False), (-2.5, True), (20.0, True)])
def test_a_gauge_that_is_not_tared_is_named(pressed: Pressed, idle: float, noted: bool) -> None:
    table, extract = pressed.table(pressed.every, force_n=-pressed.force + idle)
    _, (line,) = along_press(table, extract, captured=False, rest_given=True)
    assert line == "force_n = -force_z" + (
        f" ({idle:g} N where nothing touches: is the gauge tared?)" * noted
    )


def test_a_depth_that_the_frames_do_not_follow_stays_as_it_is(pressed: Pressed) -> None:
    shuffled = np.random.default_rng(1).permutation(pressed.depth)
    table, extract = pressed.table(pressed.every, displacement_mm=shuffled)
    found, lines = along_press(table, extract, captured=False, rest_given=True)
    np.testing.assert_array_equal(found.values["displacement_mm"], shuffled)
    assert not lines
    table, extract = pressed.table(pressed.every, displacement_mm=shuffled + 400.0)
    with pytest.raises(TableError, match="column pose_z: over 100 mm is no depth"):
        along_press(table, extract, captured=False, rest_given=True)


def test_a_rig_whose_z_points_up_is_calibrated_by_one_command(pressed: Pressed, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "rest.png"), pressed.rest_image)
    write_table(tmp_path, pressed.images, {"pose_z": 412.3 - pressed.depth})
    here, out = str(tmp_path), tmp_path / "tip.json"
    given = [f"{here}/targets.csv", "--frames", here, "--rest", f"{here}/rest.png", "-q", "--workers", "1"]
    done = run_calib("fit", *given, "-o", out)
    assert done.code == 0
    assert "axes: displacement_mm = 412." in done.err
    table, extract = pressed.table(pressed.every, displacement_mm=np.maximum(pressed.depth, 0.0))
    assert evaluate(Calibration.load(out), table, extract)["displacement_mae_mm"] < 0.25
    assert json.loads(run_calib("evaluate", out, *given, "--json").out)["displacement_mae_mm"] < 0.1
