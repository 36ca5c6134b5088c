"""The models of a calibration: values, ranges, sigmas, and values without a model."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from edge.calibration import Calibration, uncalibrated
from edge.calibration.inputs import CONTACT_INPUTS, FRAME_INPUTS
from edge.types import Array, Features
from tests.support.calibrations import PATTERN, calibration_content, damaged, parsed, touched_features
from tests.support.fields import contact_region

R = PATTERN.tip_radius_px / 200.0
UNSCALED = parsed(damaged("mm_per_px", value=None))


def test_values_follow_the_models() -> None:
    calibration = parsed(calibration_content())
    reading = calibration.apply(touched_features(0.05, (4.0 * R, -2.0 * R)), PATTERN)
    assert reading.calibrated
    assert reading.values["displacement_mm"] == pytest.approx(1.0)
    # 0.1 + 50 s + 3i conj(s) volume, with s = (4 - 2i)/200
    assert reading.values["shear_x_mm"] == pytest.approx(0.1 + 1.0 - 3 * 0.01 * 0.05)
    assert reading.values["shear_y_mm"] == pytest.approx(-0.5 + 3 * 0.02 * 0.05)
    assert reading.sigmas["displacement_mm"] == pytest.approx(0.02)
    assert reading.sigmas["shear_x_mm"] == pytest.approx(0.03 * math.sqrt(1 + 900 * (0.02**2 + 0.01**2)))
    assert reading.saturated == frozenset()
    reading = calibration.apply(touched_features(0.9, (20.0, 0.0)), PATTERN)  # out of range: clipped
    assert (reading.values["displacement_mm"], reading.values["shear_x_mm"]) == (5.0, 2.0)
    assert reading.saturated == {"displacement_mm", "shear_x_mm"}


def test_a_missing_feature_is_invalid_and_untouched_reads_zero() -> None:
    bare = Features(area_change=np.zeros(4), displacement_px=np.zeros((4, 2)), in_contact=True)
    for touched, value in ((True, math.nan), (False, 0.0)):
        reading = parsed(calibration_content()).apply(replace(bare, in_contact=touched), PATTERN)
        found = [reading.values[name] for name in ("displacement_mm", "shear_x_mm", "shear_y_mm")]
        np.testing.assert_array_equal(found, [value] * 3)
        assert reading.saturated == frozenset()


def test_a_touch_without_a_contact_has_models_without_the_place() -> None:
    content = calibration_content()
    shear = content["models"][1]
    content["models"][1] = shear | {"terms": [[], ["shear"], ["p", "p*", "shear"]]}
    spot = contact_region((320.0, 250.0), 0.3, 100.0, 0.0, 1.0)
    light, pressed = (touched_features(0.05, (4.0 * R, 0.0), found) for found in ((), (spot,)))
    old = parsed(content)
    values = {}
    for name, others in (("own", [shear]), ("none", [])):
        calibration = parsed(content | {"without_contact": others})
        assert calibration.apply(pressed, PATTERN).values == old.apply(pressed, PATTERN).values
        values[name] = calibration.apply(light, PATTERN).values
        assert [values[name]["displacement_mm"]] == [old.apply(light, PATTERN).values["displacement_mm"]]
    expected = parsed(calibration_content()).apply(light, PATTERN).values["shear_y_mm"]
    assert values["own"]["shear_y_mm"] == expected != old.apply(light, PATTERN).values["shear_y_mm"]
    assert math.isnan(values["none"]["shear_x_mm"])


def test_contacts_have_places_in_the_tip_frame_and_a_single_one_the_frame_s_depth() -> None:
    spot = contact_region((340.0, 230.0), 0.3, 100.0, math.nan, 1.0)
    calibration = parsed(calibration_content())
    one, two = (calibration.apply(touched_features(0.05, (0.0, 0.0), (spot,) * n), PATTERN) for n in (1, 2))
    np.testing.assert_allclose(one.contacts[0, :2], [2.0, -1.0])
    assert one.contacts[0, 2] == one.values["displacement_mm"] == pytest.approx(1.0)
    assert np.isnan(two.contacts[:, 2]).all()
    assert "pressure_kpa" not in one.values  # there is no force gauge
    assert math.isnan(one.values["orientation_deg"])


@pytest.mark.parametrize(("far", "outside"), [(4.0, set()), (8.0, {"contact_x_mm"})])
def test_a_contact_beyond_the_calibrated_area_is_out_of_range(far: float, outside: set[str]) -> None:
    table = calibration_content()
    names = ["contact_x_mm", "contact_y_mm"]
    table["models"][1] |= {"outputs": names, "terms": [["p"]], "weights": [[far, 0.0]], "spread": []}
    spot = contact_region((340.0, 230.0), 0.3, 100.0)
    reading = parsed(table).apply(touched_features(0.05, (0.0, 0.0), (spot,)), PATTERN)
    np.testing.assert_allclose(reading.contacts[0, :2], np.minimum(far * np.array([20.0, -10.0]) / 46.0, 2.0))
    assert reading.saturated == outside


def _forced() -> Calibration:
    """With a force model: 2 N at a volume of 0.05, and a scale of 0.1 mm/px."""
    table = calibration_content()
    force = {"type": "curve", "output": "force_n", "input": "volume", "sigma": 0.1}
    table["models"].append(force | {"knots": [[0.0, 0.0], [0.1, 4.0]]})
    return parsed(table)


def test_pressure_is_force_over_the_contacts_area() -> None:
    edge = contact_region((340.0, 230.0), 0.3, 5000.0, math.radians(30.0), 3.0)
    reading = _forced().apply(touched_features(0.05, (0.0, 0.0), (edge,)), PATTERN)
    assert reading.values["force_n"] == pytest.approx(2.0)
    assert reading.values["contact_area_mm2"] == pytest.approx(50.0)
    assert reading.values["pressure_kpa"] == pytest.approx(40.0)
    assert reading.values["orientation_deg"] == pytest.approx(30.0)


def test_slip_speed_needs_a_scale_and_the_time_between_two_frames() -> None:
    changes, motion = np.zeros(4), np.zeros((4, 2))
    slipping = Features(changes, motion, in_contact=True, slip_px=0.5, slip_probability=0.9)
    calibrated = parsed(calibration_content())
    reading = calibrated.apply(slipping, PATTERN, interval_s=0.01)
    assert reading.values["slip_speed_mm_s"] == pytest.approx(0.5 * 0.1 / 0.01)
    assert reading.values["slip_probability"] == 0.9
    for interval in (None, 0.0, -0.01):
        assert "slip_speed_mm_s" not in calibrated.apply(slipping, PATTERN, interval).values
    assert "slip_speed_mm_s" not in UNSCALED.apply(slipping, PATTERN, 0.01).values


@pytest.mark.parametrize("vibration_px", [None, 0.0, 0.25, math.nan])
def test_a_length_that_a_feature_names_is_scaled_to_mm(vibration_px: float | None) -> None:
    changes, motion = np.zeros(4), np.zeros((4, 2))
    shaking = Features(changes, motion, in_contact=True, vibration_px=vibration_px)
    values = parsed(calibration_content()).apply(shaking, PATTERN).values
    expected = None if vibration_px is None else pytest.approx(0.1 * vibration_px, nan_ok=True)
    assert values.get("vibration_mm") == expected
    assert "vibration_mm" not in UNSCALED.apply(shaking, PATTERN).values


def test_an_uncalibrated_tip_counts_its_contacts_and_places_none() -> None:
    spot = contact_region((340.0, 230.0), 0.3, 100.0, math.nan, 1.0)
    reading = uncalibrated(touched_features(0.1, (0.0, 0.0), (spot, spot)))
    np.testing.assert_array_equal(reading.contacts, np.full((2, 3), np.nan))
    assert (reading.values, reading.calibrated) == ({}, False)
    assert len(uncalibrated().contacts) == 0


@pytest.mark.parametrize("tip", ["hex127_flat", "rings331_ball"])
def test_old_files_give_the_same_values(data_dir: Path, tip: str) -> None:
    """Values of frames under a touch, as written down by the program that made the files."""
    old = json.loads((data_dir / "old" / "values-2026-11-21.json").read_text())[tip]
    calibration = Calibration.load(data_dir / "old" / f"{tip}-2026-11-21.json")
    assert calibration.content_id == old["content_id"]
    for row in old["rows"]:
        frame = _complex(row["frame"])
        added = np.full(len(FRAME_INPUTS) - len(frame), np.nan)  # inputs that files of that time do not have
        found = calibration.frame_models.of_inputs(np.append(frame, added))
        assert [*zip(calibration.frame_models.names, found[:, 2], strict=True)] == [
            (r[0], r[3]) for r in row["values"]
        ]
        _assert_alike(found[:, :2], [r[1:3] for r in row["values"]])
        contact = _complex(row["contact"])
        added = np.full(len(CONTACT_INPUTS) - len(contact), np.nan)
        found = calibration.contact_models.of_inputs(np.append(contact, added))
        assert [*calibration.contact_models.names] == [r[0] for r in row["contact_values"]]
        _assert_alike(found[:, :2], [r[1:] for r in row["contact_values"]])


def _assert_alike(found: Array, wanted: list[Any]) -> None:
    """Rows of value and sigma; what widens a sigma is in single precision."""
    for column, rounding in ((0, 1e-12), (1, 1e-5)):
        np.testing.assert_allclose(found[:, column], np.array(wanted)[:, column], rtol=rounding, atol=1e-12)


def _complex(pairs: list[list[float]]) -> Any:
    return np.array(pairs).view(np.complex128)[:, 0]
