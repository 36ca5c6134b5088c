"""Fitting: known laws are found, small ones preferred, and data that cannot support a fit is refused."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.errors import FitError
from calib.evaluate import predict
from calib.extract import Extract
from calib.fit import Choice, ModelKind, Prefer, Search, fit
from calib.fit_params import PARAMS
from calib.fit_warnings import fit_warnings, rest_is_elsewhere
from edge.calibration import Calibration
from edge.calibration.file import Curve, Polynomial
from edge.calibration.inputs import FRAME_INPUTS
from edge.types import Array
from tests.support.refusals import one_line
from tests.support.synthetic import REST, make, of_inputs, targets

pytestmark = pytest.mark.usefixtures("quick_fits")
POLYNOMIALS = Search(kinds=frozenset({ModelKind.POLYNOMIAL}))  # quick, where any model will do


@cache
def _fitted() -> tuple[Extract, dict[str, Array], Calibration, list[Choice]]:
    """Frames, their truth, and what was fitted to them: for tests that only look at it."""
    extract, values = make(120, noise=0.01)
    return extract, values, *fit(REST, targets(values), extract, mm_per_px=0.12, serial="A7")


def test_known_laws_are_found_on_frames_that_were_not_fitted() -> None:
    _, _, calibration, choices = _fitted()
    fresh, true = make(200, seed=1)
    read, _ = predict(calibration, fresh)
    for name, column in true.items():
        inside = np.abs(column - np.mean(column)) < 2 * np.std(column)  # beyond the fitted range it saturates
        assert np.abs(read[name] - column)[inside].mean() < 0.02
    outputs = {("displacement_mm",), ("shear_x_mm", "shear_y_mm"), ("torsion_deg",)}
    assert {c.outputs for c in choices} == outputs


def test_the_smallest_of_equally_good_models_is_taken() -> None:
    extract, values = make(100, noise=0.02)
    mean = extract.inputs[:, 1]  # the paper's: linear in the mean motion
    noise = 0.05 * np.random.default_rng(3).normal(size=100)
    values["shear_x_mm"], values["shear_y_mm"] = 40 * mean.real + 0.2 + noise, 40 * mean.imag
    _, choices = fit(REST, targets(values), extract, mm_per_px=None)
    shear = next(c for c in choices if c.outputs[0] == "shear_x_mm")
    assert (shear.chosen.name, shear.chosen.n_terms) == ("mean motion", 2)  # with the constant: preload
    assert isinstance(shear.model, Polynomial)
    constant = shear.model.weights[shear.model.terms.index([])]
    assert constant[0] == pytest.approx(0.2, abs=0.02)


def test_the_choice_says_what_it_rests_on() -> None:
    extract, values = make(50, noise=0.02)
    for prefer in Prefer:
        _, choices = fit(REST, targets(values), extract, mm_per_px=None, search=Search(prefer))
        for choice in choices:
            best = min(choice.tried, key=lambda c: c.rms)
            assert best.rms <= choice.chosen.rms <= choice.allowed
            assert prefer is Prefer.SPEED or choice.allowed == best.rms
            assert choice.chosen.n_terms <= best.n_terms
            assert best in choice.best_of_kinds.values()
            assert {"polynomial", "process"} <= choice.best_of_kinds.keys()


def test_a_small_model_that_errs_clearly_more_is_not_taken_for_speed() -> None:
    """In few poses one standard error is so large that a polynomial would do which errs 9 % more (rms)."""
    for seed in range(3):
        extract, values = make(30, seed=seed, noise=0.3)
        _, choices = fit(REST, targets(values), extract, mm_per_px=None)
        for choice in choices:
            assert choice.chosen.rms**2 <= 1.1 * min(c.rms for c in choice.tried) ** 2


def test_only_the_kinds_wanted_are_tried() -> None:
    extract, values = make(60, noise=0.02)
    extract.inputs[:, FRAME_INPUTS.index("shear")] = extract.inputs[:, FRAME_INPUTS.index("c00")]

    def tried(*kinds: ModelKind, terms_max: int = 512) -> dict[str, set[str]]:
        search = Search(Prefer.ACCURACY, frozenset(kinds), terms_max)
        _, choices = fit(REST, targets(values), extract, mm_per_px=None, search=search)
        for choice in choices:
            assert choice.chosen.name != ModelKind.PROCESS or choice.chosen.n_terms <= terms_max
        return {choice.outputs[0]: {c.name for c in choice.tried} for choice in choices}

    assert tried(ModelKind.PLAIN)["shear_x_mm"] == {"mean motion"}
    assert tried(ModelKind.PROCESS, terms_max=5)["shear_x_mm"] == {"process"}
    polynomials = tried(ModelKind.POLYNOMIAL)["shear_x_mm"]
    assert len(polynomials) > 5
    assert not polynomials & {"mean motion", "process", "curve"}


def test_the_paper_s_curve_wins_where_depth_follows_the_volume() -> None:
    extract, _ = make(80)
    volume = np.linspace(0.0, 0.3, 80)
    inputs = extract.inputs.copy()
    inputs[:, 0] = volume
    depth = 5.0 * np.sqrt(volume / 0.3)
    _, choices = fit(REST, targets({"displacement_mm": depth}), of_inputs(inputs), mm_per_px=None)
    model = choices[0].model
    assert isinstance(model, Curve)
    outputs = [y for _, y in model.knots]
    assert outputs == sorted(outputs)


def test_progress_is_reported_from_the_first_model_tried() -> None:
    extract, values = make(30, noise=0.02)
    parts: list[float] = []
    _, choices = fit(REST, targets(values), extract, mm_per_px=None, search=POLYNOMIALS, on_part=parts.append)
    assert sum(parts) == pytest.approx(len(choices))
    assert (len(parts) > 10 * len(choices), parts[0] < 0.2) == (True, True)


def test_a_sweep_along_x_calibrates_every_direction() -> None:
    extract, _ = make(120)
    inputs = extract.inputs * 0
    sweep = np.linspace(-0.04, 0.04, 120)
    inputs[:, 1] = inputs[:, 2] = sweep
    values = {"shear_x_mm": 50 * sweep, "shear_y_mm": 0 * sweep}
    calibration, _ = fit(REST, targets(values), of_inputs(inputs), mm_per_px=None)
    read, sigma = predict(calibration, of_inputs(inputs * 1j))
    np.testing.assert_allclose(read["shear_y_mm"], 50 * sweep, atol=1e-3)
    np.testing.assert_allclose(read["shear_x_mm"], 0.0, atol=1e-3)
    np.testing.assert_array_equal(sigma["shear_x_mm"], sigma["shear_y_mm"])


def test_sigma_is_that_of_held_out_frames() -> None:
    extract, values = make(120, noise=0.1)
    calibration, _ = fit(REST, targets(values), extract, mm_per_px=None)
    fresh, true = make(400, seed=9, noise=0.1)
    read, sigma = predict(calibration, fresh)
    for name in true:
        assert 0.55 < np.mean(np.abs(read[name] - true[name]) <= sigma[name]) < 0.8
        assert np.median(sigma[name]) == pytest.approx(0.1, rel=0.35)


def test_untouched_and_uncertain_frames_are_not_fitted() -> None:
    extract, values = make(60, noise=0.01)
    spoilt = {name: column.copy() for name, column in values.items()}
    for column in spoilt.values():
        column[:20] = 1e3
    trusted, touched = extract.trusted.copy(), extract.in_contact.copy()
    trusted[:10] = False
    touched[10:20] = False
    usable = replace(extract, trusted=trusted, in_contact=touched)
    calibration, _ = fit(REST, targets(spoilt), usable, mm_per_px=None, search=POLYNOMIALS)
    assert calibration.content.data.n_frames == 40
    read, _ = predict(calibration, extract)
    assert np.abs(read["displacement_mm"] - values["displacement_mm"])[20:].mean() < 0.05


def test_touches_without_a_contact_take_no_part_in_a_model_of_the_place() -> None:
    extract, values = make(160, noise=0.01)
    place = [FRAME_INPUTS.index(name) for name in ("p", "peak", "size")]
    tilt = 40.0 * extract.inputs[:, place[0]]
    values |= {"tilt_x_deg": tilt.real, "tilt_y_deg": tilt.imag}
    light = np.arange(160) % 4 == 0
    extract.inputs[np.ix_(light, place)] = 0.0
    calibration, _ = fit(REST, targets(values), extract, mm_per_px=None)
    read, sigma = predict(calibration, extract)
    assert np.abs(read["tilt_x_deg"] - tilt.real)[~light].max() < 0.2, "of 40 x 0.02 deg"
    assert np.isnan(read["tilt_x_deg"][light]).all(), "the place alone tells it"
    off = np.abs(read["displacement_mm"] - values["displacement_mm"])
    assert (off < 5 * sigma["displacement_mm"]).all()
    assert off[light].mean() < 0.05


def test_the_scale_comes_from_known_places() -> None:
    extract, values = make(60)
    rng = np.random.default_rng(0)
    place = 8.0 * (rng.uniform(-1, 1, 60) + 1j * rng.uniform(-1, 1, 60))
    contact = np.full_like(extract.contact, 0.2)
    turned = place * np.exp(0.3j)  # a rig whose axes are rotated against the image's
    contact[:, 0] = turned / 0.12 / REST.pattern.tip_radius_px
    values |= {"contact_x_mm": place.real, "contact_y_mm": place.imag}
    placed = replace(extract, contact=contact)
    calibration, _ = fit(REST, targets(values), placed, mm_per_px=None, search=POLYNOMIALS)
    assert calibration.mm_per_px == pytest.approx(0.12, rel=1e-4)


def _shuffled(n: int) -> dict[str, Array]:
    _, values = make(n)
    return {"displacement_mm": np.random.default_rng(0).permutation(values["displacement_mm"])}


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (make(9)[1], r"^table\.csv: 9 of 9 frames can be used, at least 12 \(6 with --prior\) are needed$"),
        ({"displacement_mm": np.full(40, 2.0)}, r"^table\.csv: .*no column varies.*over its 40 frames"),
        (_shuffled(60), r"^table\.csv: .*displacement_mm cannot be predicted from these frames.*image_"),
    ],
    ids=["too few", "no spread", "shuffled"],
)
def test_data_that_support_no_fit_are_refused(values: dict[str, Array], expected: str) -> None:
    extract, _ = make(len(next(iter(values.values()))))
    assert re.search(expected, one_line(FitError, fit, REST, targets(values), extract, mm_per_px=None))


def test_the_reasons_of_unusable_frames_are_reported() -> None:
    extract, values = make(20)
    k = np.arange(20)
    trusted, touched = k < 5, (k < 2) | (k >= 10)
    few = replace(extract, trusted=trusted, in_contact=touched, seen_n=extract.seen_n // (1 + (k == 1)))
    assert one_line(FitError, fit, REST, targets(values), few, mm_per_px=None) == (
        "table.csv: 1 of 20 frames can be used, at least 12 (6 with --prior) are needed; pins not identified "
        "in 15 (first: image_5.png); more than 45% of the pins lost in 1 (first: image_1.png); nothing "
        "touches in 3 (first: image_2.png)"
    )


def test_depth_that_rises_and_falls_with_the_volume_gets_no_curve() -> None:
    """Not monotone: the volume explains nothing, and no other input does."""
    rng = np.random.default_rng(1)
    k = len(FRAME_INPUTS)
    inputs = np.zeros((80, k), dtype=np.complex128)
    volume = np.linspace(0.0, 0.3, 80)
    inputs[:, 0] = volume
    inputs[:, 1:] = 1e-3 * (rng.normal(size=(80, k - 1)) + 1j * rng.normal(size=(80, k - 1)))
    depth = 5 * np.sin(volume / 0.3 * 6 * np.pi)
    with pytest.raises(FitError, match=r"displacement_mm cannot be predicted.*largest errors: image_"):
        fit(REST, targets({"displacement_mm": depth}), of_inputs(inputs), mm_per_px=None)


def test_one_bad_column_does_not_affect_the_others() -> None:
    extract, values = make(60)
    values["torsion_deg"] = np.random.default_rng(0).permutation(values["torsion_deg"])
    reported: list[str] = []
    calibration, _ = fit(REST, targets(values), extract, mm_per_px=None, on_refused=reported.append)
    assert ["torsion_deg" in line for line in reported] == [True]
    assert calibration.outputs == {"displacement_mm", "shear_x_mm", "shear_y_mm"}


def test_a_faint_mode_that_explains_everything_is_not_trusted() -> None:
    """Exact but tiny as a pin's noise, against slightly off and large: with noise the second is better."""

    def frames(seed: int) -> tuple[Extract, Array]:
        extract, _ = make(120, seed=seed)
        rng = np.random.default_rng(seed)
        depth = 3.0 + rng.uniform(-1.0, 1.0, 120)
        inputs = extract.inputs * 1e-6
        inputs[:, FRAME_INPUTS.index("c10")] += 0.02 * (depth + 0.02 * rng.normal(size=120))
        inputs[:, FRAME_INPUTS.index("c21")] += 1e-4 * depth
        return replace(extract, inputs=inputs), depth

    extract, depth = frames(0)
    calibration, _ = fit(REST, targets({"displacement_mm": depth}), extract, mm_per_px=None)
    fresh, true = frames(1)
    off = PARAMS.pin_noise * REST.pattern.pitch_px / REST.pattern.tip_radius_px / np.sqrt(len(REST))
    rng = np.random.default_rng(2)
    pairs = rng.normal(size=(*fresh.inputs.shape, 2)) * off
    noisy = replace(fresh, inputs=fresh.inputs + pairs.view(np.complex128)[..., 0])
    inside = np.abs(true - 3.0) < 0.9
    for seen, limit in ((fresh, 0.03), (noisy, 0.05)):
        read, _ = predict(calibration, seen)
        assert np.abs(read["displacement_mm"] - true)[inside].mean() < limit


def test_presses_that_read_as_untouched_are_counted() -> None:
    extract, values = make(40)
    values["displacement_mm"] = np.linspace(-0.3, 3.6, 40)  # the first four: not pressed
    touched = np.arange(40) >= 10
    (line,) = fit_warnings(targets(values), replace(extract, in_contact=touched), [])
    assert line.startswith("6 of 36 pressed frames read as untouched")
    assert "displacement_mm = 0.6 (image_9.png)" in line
    assert not list(fit_warnings(targets(values), replace(extract, in_contact=touched | True), []))


def test_odd_truth_is_warned_of() -> None:
    extract, _ = make(40)
    names, some = ("displacement_mm", "force_n", "tilt_x_deg", "torsion_deg"), np.linspace(-1.0, 1.0, 40)
    odd = dict(zip(names, (0.0 * some + 2.0, 500.0 * some, 0.4 * some, 0.0 * some), strict=True))
    lines = "; ".join(fit_warnings(targets(odd), extract, []))
    assert "_mm is not fitted: it is 2 in all" in lines
    assert "force_n reaches 500 N, a sample holds 65 N" in lines
    assert (lines.count("radians"), lines.count("exchanged")) == (1, 1)
    elsewhere = replace(extract, inputs=extract.inputs + 0.2)
    assert [len(list(rest_is_elsewhere(REST, one))) for one in (extract, elsewhere)] == [0, 1]


@pytest.mark.parametrize("sticks", [True, False])
def test_a_fit_notices_that_shear_is_a_direction(sticks: bool) -> None:
    extract, values = make(100)
    rng = np.random.default_rng(5)
    felt = extract.inputs[:, FRAME_INPUTS.index("c00")]
    dragged = 50.0 * felt if sticks else felt / np.abs(felt) * rng.uniform(1.0, 5.0, 100)
    values = {"shear_x_mm": dragged.real, "shear_y_mm": dragged.imag}
    _, choices = fit(REST, targets(values), extract, mm_per_px=None, search=POLYNOMIALS)
    lines = list(fit_warnings(targets(values), extract, choices))
    assert [line.startswith("shear is read as a direction") for line in lines] == [True] * (not sticks)
