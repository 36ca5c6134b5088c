"""Errors against known truth: counted over all frames, and over those that would have been sent."""

import json
from dataclasses import replace

import numpy as np
import pytest

from calib.evaluate import counts_line, error_rows, evaluate, predict, pressed
from calib.fit import fit
from edge.calibration import Calibration
from tests.support.synthetic import REST, make, targets


@pytest.fixture(scope="module")
def calibration(quick_fits: None) -> Calibration:
    extract, values = make(120, noise=0.02)
    return fit(REST, targets(values), extract, mm_per_px=None)[0]


def test_errors_are_those_of_the_truth_that_is_given(calibration: Calibration) -> None:
    extract, values = make(200, seed=5)
    values["torsion_deg"] = np.where(np.arange(200) < 100, np.nan, values["torsion_deg"])
    exact = evaluate(calibration, targets(values), extract)
    assert json.loads(json.dumps(exact)).keys() == exact.keys()
    assert (exact["n_frames"], exact["tilt_mae_deg"]) == (200, [None, None])
    assert exact["torsion_mae_deg"] < 0.2
    assert exact["frame_time_us_median"] == 1000.0
    values["displacement_mm"] = values["displacement_mm"] + 0.5
    off = evaluate(calibration, targets(values), extract)
    assert exact["displacement_mae_mm"] < 0.05
    assert off["displacement_mae_mm"] == pytest.approx(0.5, abs=0.05)
    assert off["n_beyond_range"]["displacement_mm"] > 0
    assert off["sigma_coverage_68_each"]["displacement_mm"] < 0.05


def test_direction_error_is_the_smaller_angle(calibration: Calibration) -> None:
    extract, values = make(400, seed=6)
    shear = (values["shear_x_mm"] + 1j * values["shear_y_mm"]) * np.exp(1j * np.radians(-10.0))
    values["shear_x_mm"], values["shear_y_mm"] = shear.real, shear.imag
    report = evaluate(calibration, targets(values), extract)
    assert report["shear_direction_mean_deg"] == pytest.approx(10.0, abs=0.6)
    assert report["shear_direction_median_deg"] == pytest.approx(10.0, abs=0.6)
    assert report["shear_magnitude_mae_mm"] < 0.1


def test_refused_frames_are_counted_and_stay_in_the_errors(calibration: Calibration) -> None:
    extract, values = make(100, seed=7)
    values["displacement_mm"] = values["displacement_mm"] + 3.0 * (np.arange(100) < 10)
    trusted = extract.trusted & (np.arange(100) >= 10)
    report = evaluate(calibration, targets(values), replace(extract, trusted=trusted))
    assert report["n_refused"] == 10
    assert report["displacement_mae_mm"] > 0.25
    assert report["accepted"]["displacement_mae_mm"] < 0.05


def test_a_frame_without_a_value_is_counted_and_not_averaged(calibration: Calibration) -> None:
    extract, values = make(50, seed=8)
    inputs, trusted, touched = extract.inputs.copy(), extract.trusted.copy(), extract.in_contact.copy()
    inputs[3] = np.nan
    trusted[3] = touched[3] = False
    without = replace(extract, inputs=inputs, trusted=trusted, in_contact=touched)
    report = evaluate(calibration, targets(values), without)
    assert report["n_without_value"]["displacement_mm"] == 1
    assert (report["n_refused"], report["n_read_untouched"]) == (1, 0)
    others, name = np.delete(np.arange(50), 3), "displacement_mae_mm"
    of_others = evaluate(calibration, targets(values).rows(others), extract.rows(others))
    assert report[name] == of_others[name] == report["accepted"][name]


def test_a_pressed_frame_that_reads_untouched_is_counted_with_its_zeros(calibration: Calibration) -> None:
    extract, values = make(50, seed=8)
    values["displacement_mm"] = np.where(np.arange(50) < 10, 0.0, 2.0)
    touched = np.arange(50) >= 13  # ten are really untouched, three are not
    report = evaluate(calibration, targets(values), replace(extract, in_contact=touched))
    assert report["n_read_untouched"] == 3
    read, _ = predict(calibration, replace(extract, in_contact=touched))
    off = np.abs(read["displacement_mm"] - values["displacement_mm"])
    np.testing.assert_allclose(off[10:13], 2.0)
    assert report["displacement_mae_mm"] == pytest.approx(off.mean(), abs=1e-4)
    assert "3 pressed but read as untouched" in counts_line(report)


def test_the_table_has_a_row_for_each_known_figure(calibration: Calibration) -> None:
    extract, values = make(50, seed=8)
    report = evaluate(calibration, targets(values), extract)
    rows = {row[0]: row[1:] for row in error_rows(report)}
    within = f"{report['sigma_coverage_68_each']['displacement_mm']:.0%}"
    assert rows["depth"] == (f"{report['displacement_mae_mm']:.4g}",) * 2 + (within, "mm")
    assert "tilt about x" not in rows


@pytest.mark.parametrize(
    ("column", "expected"),
    [
        ({"displacement_mm": [0.0, 1.0, np.nan], "shear_x_mm": [1.0, 1.0, 1.0]}, [False, True, False]),
        ({"force_n": [0.0, 2.0, 0.0]}, [False, True, False]),
        ({"shear_x_mm": [0.0, -1.0, np.nan]}, [False, True, False]),
    ],
)
def test_pressed_frames_are_those_of_the_truth(column: dict[str, list[float]], expected: list[bool]) -> None:
    table = targets({name: np.array(values) for name, values in column.items()})
    assert pressed(table).tolist() == expected
