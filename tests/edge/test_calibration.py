"""The calibration file: round trip, every kind of damage one line, values with range and sigma."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from calib.fit import tip_of
from calib.sim import Camera, Simulator, Tip
from edge._moments import Models
from edge.calibration import (
    Calibration,
    Moments,
    evaluate_terms,
    frame_inputs,
    term_columns,
    uncalibrated,
)
from edge.errors import CalibrationError
from edge.pins import take_rest
from edge.pipeline import in_order_of
from edge.types import ContactRegion, Features, PinPattern, Rest

PATTERN = PinPattern(4.0, 20.0, np.array([320.0, 240.0]), 200.0, 10.0, 180.0, 2.0, (640, 480))


def content() -> dict[str, Any]:
    """A small valid file as plain data, to be damaged."""
    return {
        "format": "voronoi-touch-calibration",
        "version": 1,
        "sensor": {
            "serial": "A1",
            "size_px": [640, 480],
            "pin_radius_px": 4.0,
            "pitch_px": 20.0,
            "centre_px": [320.0, 240.0],
            "tip_radius_px": 200.0,
            "background": 10.0,
            "brightness": 180.0,
            "noise": 2.0,
            "rest_xy_px": [[300.0, 240.0], [320.0, 240.0], [310.0, 260.0], [330.0, 260.0]],
        },
        "mm_per_px": 0.1,
        "models": [
            {
                "type": "curve",
                "output": "displacement_mm",
                "input": "volume",
                "knots": [[0.0, 0.0], [0.1, 2.0], [0.4, 5.0]],
                "sigma": 0.02,
            },
            {
                "type": "moments",
                "outputs": ["shear_x_mm", "shear_y_mm"],
                "terms": [[], ["shear"], ["shear*", "volume"]],
                "weights": [[0.1, 0.0], [50.0, 0.0], [0.0, 3.0]],
                "valid": [[-2.0, 2.0], [-2.0, 2.0]],
                "sigma": [0.03, 0.04],
                "spread": [[[0.0, 0.0], [30.0, 0.0], [0.0, 0.0]]],
            },
        ],
        "data": {"source": "test", "sha256": "", "n_frames": 0, "created": "2026-01-01"},
    }


def parse(table: dict[str, Any]) -> Calibration:
    return Calibration.parse(msgspec.json.encode(table), "cal.json")


def features(
    volume: float, shear_px: tuple[float, float], contacts: tuple[ContactRegion, ...] = ()
) -> Features:
    return Features(
        area_change=np.zeros(4),
        displacement_px=np.zeros((4, 2)),
        touched=True,
        shear_px=np.array(shear_px),
        volume_px2=volume * math.pi * 200.0**2,
        contacts=contacts,
    )


def test_values_follow_the_models() -> None:
    reading = parse(content()).apply(features(0.05, (4.0, -2.0)), PATTERN)
    assert reading.calibrated
    assert reading.values["displacement_mm"] == pytest.approx(1.0)
    # 0.1 + 50 s + 3i conj(s) volume, with s = (4 - 2i)/200
    assert reading.values["shear_x_mm"] == pytest.approx(0.1 + 1.0 - 3 * 0.01 * 0.05)
    assert reading.values["shear_y_mm"] == pytest.approx(-0.5 + 3 * 0.02 * 0.05)
    assert reading.sigmas["displacement_mm"] == pytest.approx(0.02)
    assert reading.sigmas["shear_x_mm"] == pytest.approx(0.03 * math.sqrt(1 + 900 * (0.02**2 + 0.01**2)))
    assert reading.saturated == frozenset()


def test_out_of_range_is_the_end_of_the_range_and_named() -> None:
    reading = parse(content()).apply(features(0.9, (20.0, 0.0)), PATTERN)
    assert reading.values["displacement_mm"] == 5.0
    assert reading.values["shear_x_mm"] == 2.0
    assert reading.saturated == {"displacement_mm", "shear_x_mm"}


def test_a_missing_feature_is_invalid_not_zero() -> None:
    bare = Features(area_change=np.zeros(4), displacement_px=np.zeros((4, 2)), touched=True)
    reading = parse(content()).apply(bare, PATTERN)
    assert math.isnan(reading.values["displacement_mm"])
    assert math.isnan(reading.values["shear_x_mm"])
    assert reading.saturated == frozenset()


def test_untouched_reads_zero() -> None:
    bare = Features(area_change=np.zeros(4), displacement_px=np.zeros((4, 2)), touched=False)
    reading = parse(content()).apply(bare, PATTERN)
    assert reading.values == {"displacement_mm": 0.0, "shear_x_mm": 0.0, "shear_y_mm": 0.0}


def test_contact_places_are_in_the_tip_frame() -> None:
    contact = ContactRegion(np.array([340.0, 230.0]), 0.3, 100.0, math.nan, 1.0, np.zeros((1, 2)))
    reading = parse(content()).apply(features(0.1, (0.0, 0.0), (contact,)), PATTERN)
    np.testing.assert_allclose(reading.contacts[0, :2], [2.0, -1.0])


def test_the_depth_of_a_single_contact_is_the_frame_s() -> None:
    spot = ContactRegion(np.array([340.0, 230.0]), 0.3, 100.0, math.nan, 1.0, np.zeros((1, 2)))
    one = parse(content()).apply(features(0.05, (0.0, 0.0), (spot,)), PATTERN)
    two = parse(content()).apply(features(0.05, (0.0, 0.0), (spot, spot)), PATTERN)
    assert one.contacts[0, 2] == one.values["displacement_mm"] == pytest.approx(1.0)
    assert np.isnan(two.contacts[:, 2]).all()


def _forced() -> Calibration:
    """With a force model: 2 N at a volume of 0.05, and a scale of 0.1 mm/px."""
    table = content()
    table["models"].append(
        {
            "type": "curve",
            "output": "force_n",
            "input": "volume",
            "knots": [[0.0, 0.0], [0.1, 4.0]],
            "sigma": 0.1,
        }
    )
    return parse(table)


def test_pressure_is_force_over_the_contacts_area() -> None:
    edge = ContactRegion(np.array([340.0, 230.0]), 0.3, 5000.0, math.radians(30.0), 3.0, np.zeros((1, 2)))
    reading = _forced().apply(features(0.05, (0.0, 0.0), (edge,)), PATTERN)
    assert reading.values["force_n"] == pytest.approx(2.0)
    assert reading.values["contact_area_mm2"] == pytest.approx(50.0)
    assert reading.values["pressure_kpa"] == pytest.approx(40.0)
    assert reading.values["orientation_deg"] == pytest.approx(30.0)


def test_without_a_force_gauge_there_is_no_pressure() -> None:
    spot = ContactRegion(np.array([340.0, 230.0]), 0.3, 5000.0, math.nan, 1.0, np.zeros((1, 2)))
    reading = parse(content()).apply(features(0.05, (0.0, 0.0), (spot,)), PATTERN)
    assert "pressure_kpa" not in reading.values
    assert math.isnan(reading.values["orientation_deg"])


def test_slip_speed_needs_a_scale_and_the_time_between_two_frames() -> None:
    slipping = Features(
        area_change=np.zeros(4),
        displacement_px=np.zeros((4, 2)),
        touched=True,
        slip_px=0.5,
        slip_probability=0.9,
    )
    calibrated = parse(content())
    reading = calibrated.apply(slipping, PATTERN, interval_s=0.01)
    assert reading.values["slip_speed_mm_s"] == pytest.approx(0.5 * 0.1 / 0.01)
    assert reading.values["slip_probability"] == 0.9
    for interval in (None, 0.0, -0.01):
        assert "slip_speed_mm_s" not in calibrated.apply(slipping, PATTERN, interval).values
    bare = content()
    bare["mm_per_px"] = None
    assert "slip_speed_mm_s" not in parse(bare).apply(slipping, PATTERN, 0.01).values


def test_an_uncalibrated_tip_counts_its_contacts_and_places_none() -> None:
    spot = ContactRegion(np.array([340.0, 230.0]), 0.3, 100.0, math.nan, 1.0, np.zeros((1, 2)))
    reading = uncalibrated(features(0.1, (0.0, 0.0), (spot, spot)))
    assert len(reading.contacts) == 2
    assert np.isnan(reading.contacts).all()
    assert not reading.values
    assert not reading.calibrated
    assert len(uncalibrated().contacts) == 0


def _rest_of(tip: Tip, seed: int = 0, size: tuple[int, int] = (240, 240)) -> Rest:
    return take_rest([Simulator(Camera(tip=tip, size_px=size), seed=seed).frame().image])


def test_another_sensor_s_pins_are_refused() -> None:
    made_with = tip_of(_rest_of(Tip(127, "hex")))
    own = in_order_of(made_with, _rest_of(Tip(127, "hex"), seed=5))
    assert np.abs(own.xy_img - made_with.rest.xy_img).max() < 1.0
    for other in (Tip(91, "hex"), Tip(127, "rings"), Tip(121, "square")):
        with pytest.raises(CalibrationError, match=r"belongs to another tip|off the calibration's"):
            in_order_of(made_with, _rest_of(other))
    with pytest.raises(CalibrationError, match="240x240, the images are 320x240"):
        in_order_of(made_with, _rest_of(Tip(127, "hex"), size=(320, 240)))


def test_inputs_are_free_of_resolution() -> None:
    f = features(0.05, (4.0, -2.0))
    doubled = Features(
        area_change=f.area_change,
        displacement_px=f.displacement_px,
        touched=True,
        shear_px=2 * f.shear_px if f.shear_px is not None else None,
        volume_px2=4 * f.volume_px2 if f.volume_px2 is not None else None,
    )
    np.testing.assert_allclose(frame_inputs(f, 200.0), frame_inputs(doubled, 400.0))


def test_saved_and_loaded_is_the_same(tmp_path: Path) -> None:
    path = tmp_path / "cal.json"
    made = parse(content())
    made.save(path)
    loaded = Calibration.load(path)
    assert loaded.content == made.content
    assert loaded.content_id == made.content_id
    assert list(tmp_path.iterdir()) == [path]
    assert path.stat().st_mode & 0o777 == 0o644
    path.chmod(0o600)
    made.save(path)
    assert path.stat().st_mode & 0o777 == 0o600


def _damage(*path: str | int, value: Any) -> dict[str, Any]:
    table = content()
    place: Any = table
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return table


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        (_damage("format", value="something"), "format is 'something'"),
        (_damage("version", value=2), "version 2, this program reads version 1"),
        (_damage("mm_per_px", value=0), "`$.mm_per_px`"),
        (_damage("extra", value=1), "unknown field `extra`"),
        (_damage("models", 0, "input", value="smell"), "unknown input 'smell'"),
        (_damage("models", 0, "output", value="taste"), "unknown output 'taste'"),
        (_damage("models", 0, "knots", value=[[0, 0], [1, 2], [2, 1]]), "monotone"),
        (_damage("models", 0, "knots", value=[[0, 0], [0, 1]]), "must increase"),
        (_damage("models", 1, "weights", value=[[1.0, 0.0]]), "a pair of numbers for each of 3 terms"),
        (_damage("models", 1, "outputs", value=["displacement_mm", "shear_y_mm"]), "second model for"),
        (_damage("models", 1, "valid", value=[[2, -2], [-2, 2]]), "[low, high]"),
        (_damage("models", 1, "sigma", value=[0.1, -0.1]), "sigma"),
        (_damage("sensor", "rest_xy_px", value=[]), "at least three"),
    ],
)
def test_damage_is_one_line_that_names_the_key(table: dict[str, Any], expected: str) -> None:
    with pytest.raises(CalibrationError) as caught:
        parse(table)
    message = str(caught.value)
    assert message.startswith("cal.json")
    assert expected in message
    assert "\n" not in message


@pytest.mark.parametrize("raw", [b"", b"a note to self", b"[1, 2]", b"\xff\xfe", b'{"format": '])
def test_text_that_is_no_calibration(tmp_path: Path, raw: bytes) -> None:
    path = tmp_path / "cal.json"
    path.write_bytes(raw)
    with pytest.raises(CalibrationError, match="not a calibration file"):
        Calibration.load(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"absent\.json: cannot be read"):
        Calibration.load(tmp_path / "absent.json")


def test_a_kill_while_writing_leaves_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "cal.json"
    made = parse(content())
    made.save(path)
    script = (
        "import sys; from edge.calibration import Calibration\n"
        "cal = Calibration.load(sys.argv[1]); print('ready', flush=True)\n"
        "while True: cal.save(sys.argv[1])\n"
    )
    with subprocess.Popen([sys.executable, "-c", script, str(path)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        for _ in range(50):
            assert Calibration.load(path).content == made.content
        os.kill(process.pid, signal.SIGKILL)
    assert Calibration.load(path).content == made.content


def test_all_models_in_one_call_are_each_model_in_numpy() -> None:
    """Curves by `numpy.interp`, polynomials by `evaluate_terms`; far out, NaN and several rows included."""
    table = content()
    table["models"][0]["knots"] = [[-0.3, 5.0], [0.0, 4.0], [0.1, 2.0], [0.4, -1.0]]
    model = parse(table).content.models[1]
    assert isinstance(model, Moments)
    rng = np.random.default_rng(3)
    z = rng.normal(0.0, 0.2, (200, 2)) + 1j * rng.normal(0.0, 0.2, (200, 2))
    z[7, 0] = np.nan
    terms = term_columns(model.terms, ("volume", "shear"), "test")
    knots = np.array(table["models"][0]["knots"])
    spread = np.array(model.spread) @ (1, 1j)
    out = np.empty((200, 3, 3))
    polynomial = (
        terms.astype(np.int32),
        np.array(model.weights),
        np.array(model.spread),
        np.array(model.valid),
        np.array(model.sigma),
    )
    Models(2, ((0, knots, 0.02), polynomial)).run(z.view(np.float64), out)
    psi = evaluate_terms(z, terms)
    y = psi @ (np.array(model.weights) @ (1, 1j))
    away = (np.abs(psi @ spread.T) ** 2).sum(axis=1)
    np.testing.assert_allclose(out[:, 0, 0], np.interp(z[:, 0].real, *knots.T), rtol=1e-13)
    assert np.isnan(out[7, :, 0]).all()
    for i, part in enumerate((y.real, y.imag)):
        np.testing.assert_allclose(out[:, 1 + i, 0], np.clip(part, -2.0, 2.0), rtol=1e-12)
        np.testing.assert_allclose(out[:, 1 + i, 1], model.sigma[i] * np.sqrt(1.0 + away), rtol=1e-12)
        np.testing.assert_array_equal(out[:, 1 + i, 2], np.abs(part) > 2.0)
    x = z[:, 0].real
    np.testing.assert_array_equal(out[:, 0, 2], ~((x >= -0.3) & (x <= 0.4)))
    assert 0 < np.count_nonzero(out[:, 1, 2]) < 200


@pytest.mark.parametrize(
    "model",
    [
        (0, np.zeros((1, 2)), 0.1),
        (9, np.zeros((2, 2)), 0.1),
        (0, np.zeros((2, 2), dtype=np.float32), 0.1),
        (np.full((1, 1), 9, np.int32), np.zeros(2), np.zeros((0, 2)), np.zeros(2), np.zeros(1)),
        (np.zeros((1, 1), np.int32), np.zeros(2), np.zeros((1, 3)), np.zeros(2), np.zeros(1)),
        (np.zeros((1, 1), np.int32), np.zeros(2), np.zeros((0, 2)), np.zeros(6), np.zeros(3)),
        (np.zeros((3, 1), np.int32), np.zeros(4), np.zeros((0, 2)), np.zeros(2), np.zeros(1)),
    ],
)
def test_models_that_do_not_fit_their_tables_are_refused(model: Any) -> None:
    with pytest.raises(ValueError, match=r"curve|polynomial|term|items|input"):
        Models(2, (model,))
    sound = Models(2, ((0, np.array([[0.0, 0.0], [1.0, 1.0]]), 0.1),))
    with pytest.raises(ValueError, match=r"run|items"):
        sound.run(np.zeros(3), np.zeros((1, 1, 3)))
    with pytest.raises(ValueError, match="items"):
        sound.run(np.zeros((1, 4)), np.zeros((1, 1, 2)))
