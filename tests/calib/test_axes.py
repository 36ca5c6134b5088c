"""Axes of rigs: all eight orientations in the image, and frames that leave it open."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from calib.axes import Axes, recognise_axes, recognise_handedness
from calib.evaluate import evaluate
from calib.extract import Extract
from calib.fit import fit
from edge.calibration.inputs import FRAME_INPUTS
from edge.types import Array
from tests.support.synthetic import REST, make, targets

SHEAR = ("shear_x_mm", "shear_y_mm")
FORMS = list(product((1, -1), (1, -1), (False, True)))


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
    return recognise_axes([recognise_handedness(SHEAR, extract.inputs, FRAME_INPUTS, y)])


def _errors(form: tuple[int, int, bool]) -> list[float]:
    extract, values = make(60, noise=0.01)
    fresh, true = make(100, seed=1)
    calibration, _ = fit(REST, targets(_seen(values, form)), extract, mm_per_px=None)
    report = evaluate(calibration, targets(_seen(true, form)), fresh)
    return [report["displacement_mae_mm"], *sorted(report["shear_mae_mm"]), report["torsion_mae_deg"]]


@pytest.fixture(scope="module")
def straight() -> list[float]:
    return _errors(FORMS[0])


@pytest.mark.parametrize("form", [(1, -1, False), (1, -1, True), (1, 1, True)], ids=str)
def test_a_mirrored_or_turned_rig_gives_the_same_errors(
    form: tuple[int, int, bool], straight: list[float]
) -> None:
    np.testing.assert_allclose(_errors(form), straight, rtol=0.02, atol=1e-4)


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_any_rig_s_handedness_is_recognised(form: tuple[int, int, bool]) -> None:
    sx, sy, swapped = form
    axes = _found(form, *make(60, noise=0.01))
    assert axes.mirrored[SHEAR] == (sx * sy * (-1 if swapped else 1) < 0)
    assert not axes.warnings


def test_the_relation_is_given_in_the_image_s_axes() -> None:
    # The synthetic rig's shear is the image's.
    names = {
        (1, 1, False): "shear_x_mm = image x, shear_y_mm = image y",
        (1, -1, False): "shear_x_mm = image x, shear_y_mm = image -y (mirrored)",
        (-1, 1, False): "shear_x_mm = image -x, shear_y_mm = image y (mirrored)",
        (1, 1, True): "shear_x_mm = image y, shear_y_mm = image x (mirrored)",
        (-1, 1, True): "shear_x_mm = image y, shear_y_mm = image -x",
        (-1, -1, False): "shear_x_mm = image -x, shear_y_mm = image -y",
    }
    for form, expected in names.items():
        assert _found(form, *make(100)).lines == (expected,)


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
