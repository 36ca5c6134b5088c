"""The calibration file: round trip; damage and hostile content are one line, before anything is built."""

import random
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np
import pytest

from edge import limits
from edge.calibration import Calibration
from edge.calibration.file import FACTORS_MAX, TERMS_MAX
from edge.calibration.inputs import FRAME_INPUTS
from edge.errors import CalibrationError
from tests.support.calibrations import PATTERN, PINS, calibration_content, damaged, parsed, touched_features
from tests.support.memory import bounded_memory
from tests.support.refusals import one_line
from tests.support.seeds import SEED


def test_saved_and_loaded_is_the_same(tmp_path: Path) -> None:
    path = tmp_path / "cal.json"
    made = parsed(calibration_content())
    made.save(path)
    loaded = Calibration.load(path)
    assert loaded.content == made.content
    assert loaded.content_id == made.content_id
    assert list(tmp_path.iterdir()) == [path]
    path.chmod(0o600)
    made.save(path)
    assert path.stat().st_mode & 0o777 == 0o600


PLACED = calibration_content()["models"][1] | {"terms": [[], ["p"], ["shear"]]}
DAMAGE: list[tuple[str, Any, str]] = [
    ("format", "something", "not a calibration file: its format is 'something'"),
    ("version", 2, "has version 2, this program reads version 1"),
    ("mm_per_px", 0, "mm_per_px: must be a number from 0.0001 to 10 or null"),
    ("extra", 1, "unknown key 'extra'"),
    ("models.0.input", "smell", "models[0].input: unknown input 'smell'"),
    ("models.0.output", "taste", "models[0]: unknown output 'taste'"),
    ("models.0.type", "network", "models[0].type: unknown value 'network'"),
    ("models.0.knots", [[0, 0], [1, 2], [2, 1]], "models[0].knots: the output must be monotone"),
    ("models.0.knots", [[0, 0], [1, -3]], "models[0].knots: 'displacement_mm' is never above 0; a press is"),
    ("models.0.knots", [[0, 0], [0, 1]], "models[0].knots[1]: the input must increase"),
    ("models.0.knots", [[0, 0]], "models[0].knots: must have at least 2 items"),
    ("models.1.weights", [[1.0, 0.0]], "models[1].weights: 1 pairs of numbers for 3"),
    ("models.1.spread", [[[1.0, 0.0]]], "models[1].spread[0]: 1 pairs of numbers for 3"),
    ("models.1.terms.2", ["shear", "smell"], "models[1].terms[2]: unknown input 'smell'"),
    ("models.1.outputs", ["displacement_mm", "shear_y_mm"], "second model for"),
    ("models.1.outputs", ["shear_x_mm"] * 2, "models[1]: a second model for 'shear_x_mm'"),
    ("models.1.outputs", ["shear_x_mm", "contact_x_mm"], "unknown output 'contact_x_mm'"),
    ("models.1.valid", [[2, -2], [-2, 2]], "models[1].valid: give a range [low, high]"),
    ("models.1.sigma", [0.1, -0.1], "models[1].sigma[1]: must be a number from 1e-09 to 1000000"),
    ("models.1.sigma", [0.1], "models[1].sigma: give one for each of 2 outputs"),
    ("without_contact", [PLACED], "without_contact[0]: give a model without p, peak and size"),
    ("without_contact", [PLACED | {"outputs": ["torsion_deg"]}], "without_contact[0]: give a model"),
    ("sensor.serial", "a\nb", "sensor.serial: "),
    ("sensor.rest_xy_px", [], "sensor.rest_xy_px: must have at least 12 items"),
]


@pytest.mark.parametrize(("place", "value", "expected"), DAMAGE)
def test_damage_is_one_line_that_names_the_place(place: str, value: Any, expected: str) -> None:
    message = refusal(msgspec.json.encode(damaged(*path_of(place), value=value)))
    assert expected in message
    assert "$" not in message


def path_of(place: str) -> list[str | int]:
    return [int(key) if key.isdigit() else key for key in place.split(".")]


def refusal(raw: bytes) -> str:
    """The one line with which a file is refused."""
    message = one_line(CalibrationError, Calibration.parse, raw, "cal.json")
    assert message.startswith("cal.json: ")
    assert len(message) < 400
    return message


LINE_OF_PINS = {
    "rest_xy_px": [[100.0 + 20.0 * k, 240.0 + 0.01 * (k % 3)] for k in range(20)],
    "centre_px": [290.0, 240.0], "tip_radius_px": 190.0,
}  # fmt: skip
#: A tip of which only two groups of pins are left, on either side.
TWO_GROUPS = {"rest_xy_px": [[x + dx, y] for x, y in PINS for dx in (-150.0, 150.0)], "tip_radius_px": 196.0}
SENSOR = calibration_content()["sensor"]
#: Files that stopped a finger, or could have: all parse as JSON and have the right keys.
HOSTILE: list[tuple[str, Any, str]] = [
    ("models.1.terms", [[]] * 100_000, f"models[1].terms: must have at most {TERMS_MAX} items"),
    ("models.1.terms.2", ["shear"] * 15_000, f"models[1].terms[2]: must have at most {FACTORS_MAX} items"),
    ("models.0.output", "x" * 1_000_000, "models[0].output: must have at most 64 characters"),
    ("models", [calibration_content()["models"][0]] * 1000, "models: must have at most 17 items"),
    ("sensor.rest_xy_px", [*PINS, [15_000.0, 9.0]], "(15000, 9) is outside of the image (640x480)"),
    ("sensor.rest_xy_px", [[0.1 * k, 0.0] for k in range(5000)], "must have at most 3060 items"),
    ("sensor.rest_xy_px", [*PINS, PINS[4]], "0 px from another pin, where the others are 20 px apart"),
    ("sensor", SENSOR | LINE_OF_PINS, "most of the tip's pins missing, or all on one line?"),
    ("sensor", SENSOR | TWO_GROUPS, "sensor.rest_xy_px: 38 pins 20 px apart cover 11% of the tip's circle"),
    ("sensor.size_px", [8192, 8192], "sensor.size_px: 8192x8192 pixels are too many"),
    ("sensor.pin_radius_px", 40.0, "pin_radius_px: 40"),
    ("sensor.tip_radius_px", 460.0, "sensor.tip_radius_px: 460, but the outermost pin is 40 px"),
    ("sensor.pitch_px", 60.0, "pitch_px: 60, but the rest pins are 20"),
    ("views", [calibration_content() | {"version": 2}], "views[0]: give one view, of the format, version,"),
    ("views", [calibration_content() | {"models": [{}]}], "views[0].models[0]: lacks type"),
    ("views", [damaged("sensor", "pitch_px", value=60.0)], "views[0].sensor.pitch_px: 60, but the rest pins"),
]  # fmt: skip


@pytest.mark.parametrize(("place", "value", "expected"), HOSTILE, ids=lambda text: str(text)[:40])
def test_a_hostile_file_is_refused_before_anything_is_built(place: str, value: Any, expected: str) -> None:
    raw = msgspec.json.encode(damaged(*path_of(place), value=value))
    with bounded_memory(2_000_000 + 40 * len(raw)):
        message = refusal(raw)
    assert expected in message


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        (b"", "not a calibration file: no JSON"),
        (b"[1, 2]", "not a calibration file: must be a table {...}, is a list"),
        (b"\xff\xfe", "not a calibration file: no JSON"),
        (b'{"format": "a\xff"}', "is not UTF-8 text"),
        (b"[" * 200_000, "not a calibration file: "),
        (b'{"format":"voronoi-touch-calibration","version":1,"sensor":' + b"[" * 200_000, "too deeply"),
        (b" " * (limits.FILE_BYTES + 1), "larger than 2048 KiB"),
    ],
    ids=["empty", "list", "binary", "latin", "deep list", "deep sensor", "long"],
)
def test_a_file_that_is_no_calibration_is_refused(tmp_path: Path, raw: bytes, expected: str) -> None:
    assert expected in refusal(raw)
    path = tmp_path / "cal.json"
    path.write_bytes(raw)
    with pytest.raises(CalibrationError, match=r"cal\.json: "):
        Calibration.load(path)


@pytest.mark.parametrize("number", [b"NaN", b"Infinity", b"-Infinity", b"1e400", b"-1e999", b"null", b"true"])
@pytest.mark.parametrize(
    "place",
    [
        "sensor.pitch_px", "sensor.rest_xy_px.3", "models.0.knots.1", "models.0.sigma", "models.1.weights.2",
        "models.1.valid.0", "models.1.spread.0",
    ],
)  # fmt: skip
def test_no_number_of_a_file_is_nan_or_infinite(place: str, number: bytes) -> None:
    path, content = path_of(place), cast(Any, calibration_content())
    for key in path:
        content = content[key]
    value: Any = "HERE"
    while isinstance(content, list):
        value, content = [value, *([0.0] * (len(content) - 1))], content[0]
    raw = msgspec.json.encode(damaged(*path, value=value)).replace(b'"HERE"', number)
    refusal(raw)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    for path, stated in (
        (tmp_path / "absent.json", "absent.json: cannot be read: No such file"),
        (tmp_path, "a folder or a device; give a file"),
        (Path("/dev/zero"), "a folder or a device; give a file"),
    ):
        assert stated in one_line(CalibrationError, Calibration.load, path)


_NUMBERS = [0, -1, 1, 0.5, -0.5, 3, 20.0, 1e-9, 1e-45, -1e-300, 1e6, 1e15, -1e15, 1e16, 1e300, 2**63, 10**40]
_OTHERS: list[Any] = [None, True, "", "shear", "c00*", "x" * 2000, [], {}, [[]], [0.0, 0.0], ["shear"] * 6]


def _changed(value: Any, rng: random.Random, near: bool) -> Any:
    """The same file with one place different: a number beside it; or another kind, shorter, longer, twice."""
    if isinstance(value, list | dict) and value and (near or rng.random() < 0.6):
        table = value if isinstance(value, dict) else dict(enumerate(value))
        key = rng.choice(list(table))
        table = table | {key: _changed(table[key], rng, near)}
        return table if isinstance(value, dict) else list(table.values())
    if near:
        factor, more = rng.choice([-1.0, 0.0, 0.99, 1.01, 2.0, 1e3]), rng.choice([0.0, 1e-3, 1.0])
        return value * factor + more if isinstance(value, float) else value
    if isinstance(value, list) and value and rng.random() < 0.8:
        return rng.choice([value[1:], [*value, value[0]], value * 30, value * 3000])
    if isinstance(value, dict) and value and rng.random() < 0.8:
        *others, (key, last) = value.items()
        return dict(others) if rng.random() < 0.5 else value | {f"{key}x": last}
    return rng.choice(_NUMBERS) if rng.random() < 0.7 else rng.choice(_OTHERS)


@pytest.mark.generative
@pytest.mark.parametrize("seed", range(8))
def test_any_file_is_refused_in_one_line_or_gives_bounded_values(seed: int) -> None:
    """Loading ends in a calibration whose values are finite and within their range, or in one line."""
    rng = random.Random(8 * SEED + seed)
    features = touched_features(0.05, (1.0, -0.5))
    accepted = 0
    for _ in range(150):
        table = calibration_content()
        for _ in range(rng.choice([1, 1, 2, 4])):
            table = _changed(table, rng, near=rng.random() < 0.5)
        raw = msgspec.json.encode(table)
        if rng.random() < 0.1:
            raw = raw[: rng.randrange(len(raw))]
        try:
            calibration = Calibration.parse(raw, "cal.json")
        except CalibrationError:
            refusal(raw)
            continue
        accepted += 1
        assert 12 <= len(calibration.rest) <= limits.PINS_MAX
        reading = calibration.apply(features, PATTERN)
        for name, value in reading.values.items():
            assert abs(value) <= 1e6, name
        for sigma in reading.sigmas.values():
            assert 0 < sigma < float("inf")
    assert accepted > 5


def test_the_largest_file_that_is_accepted_runs_in_bounded_memory() -> None:
    """Every limit reached at once: a finger must be able to run it."""
    names = [name for name in FRAME_INPUTS if name != "volume"]
    rng = random.Random(1)
    content = calibration_content()
    content["models"] = [
        {
            "type": "moments",
            "outputs": [output],
            "terms": [[rng.choice(names) for _ in range(FACTORS_MAX)] for _ in range(TERMS_MAX)],
            "weights": [[1.0, 0.0]] * TERMS_MAX,
            "valid": [[-1.0, 1.0]],
            "sigma": [0.1],
            "spread": [[[1, 0]] * TERMS_MAX] * 16,
        }
        for output in ("displacement_mm", "force_n", "torsion_deg", "contact_area_mm2")
    ]
    with bounded_memory(64_000_000):
        calibration = parsed(content)
        calibration.apply(touched_features(0.05, (1.0, 0.0)), PATTERN)
    assert np.isfinite(calibration.rest.xy_img).all()
