"""The kernel of models: against plain products and sums; outputs not wanted, inputs not known, or out of
range.
"""

import math
from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np
import pytest

from calib.terms import evaluate_terms, term_columns
from edge.calibration.evaluation import ModelKernel
from edge.calibration.file import Curve, Lost, Model, Polynomial, Process
from edge.errors import CalibrationError
from edge.types import Array, Complex
from tests.support.calibrations import calibration_content, parsed
from tests.support.refusals import one_line

pytestmark = pytest.mark.kernels

INPUTS = ("volume", "gap", "a", "b", "c")
RNG = np.random.default_rng(5)


def _pairs(n: int, rng: np.random.Generator) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in rng.normal(size=(n, 2))]


DEFAULTS: dict[str, Any] = {
    "far": 1e12,
    "noise_terms": [[], ["volume"], ["a", "a*"]],
    "noise_weights": [0.1, -0.4, 0.2],
    "noise_range": (-1.0, 1.0),
    "lost": Lost(-0.5, 1.5, 1.0, 2.0, [["b", "c*"], ["a"]], [0.3, -0.2]),
}


def _process(outputs: list[str], n_terms: int, rows: int, seed: int, **other: Any) -> Process:
    rng = np.random.default_rng(seed)
    letters = ["a", "a*", "b", "b*", "c", "volume"]
    terms = [
        [],
        *([str(name) for name in rng.choice(letters, rng.integers(1, 4))] for _ in range(n_terms - 1)),
    ]
    return Process(
        outputs=outputs,
        terms=terms,
        weights=_pairs(n_terms, rng),
        valid=[(-1e6, 1e6)] * len(outputs),
        sigma=[0.5, 0.7][: len(outputs)],
        factor=[_pairs(n_terms, rng) for _ in range(rows)],
        **(DEFAULTS | other),
    )


ACROSS: dict[str, Any] = {"across_weights": [-0.7, 0.1, 0.3], "across_range": (-2.0, 0.5)}
MODELS = [
    _process(["x", "y"], 30, 7, 1, **ACROSS),
    _process(["s"], 11, 4, 2),
    _process(["t"], 5, 0, 3, lost=None),
]


def _frame(gap: float = 0.0) -> Complex:
    z = RNG.normal(size=len(INPUTS)) + 1j * RNG.normal(size=len(INPUTS))
    z[0], z[1] = abs(z[0]), gap
    return z


def _run(models: Sequence[Model], z: Complex) -> Array:
    return ModelKernel(INPUTS, models).of_inputs(z)


def _plainly(model: Process, z: Complex) -> list[tuple[float, float]]:
    """Value and sigma of each output, by the definitions in the file."""
    row = dict(zip(INPUTS, z, strict=True)) | {f"{n}*": v.conj() for n, v in zip(INPUTS, z, strict=True)}

    def products(terms: list[list[str]]) -> Complex:
        return np.array([math.prod((row[name] for name in term), start=1 + 0j) for term in terms])

    psi = products(model.terms)
    value = complex(psi @ (np.array(model.weights) @ (1, 1j)))
    rows = [complex(psi @ (np.array(r) @ (1, 1j))) for r in model.factor]
    two = len(model.outputs) == 2
    learnt = sum(abs(r) ** 2 if two else r.real**2 for r in rows)
    noise = products(model.noise_terms).real

    def limited(weights: list[float], limits: tuple[float, float]) -> float:
        return math.exp(min(max(float(noise @ weights), limits[0]), limits[1]))

    along = across = limited(model.noise_weights, model.noise_range)
    if model.across_weights:
        across = limited(model.across_weights, model.across_range)
    variance = learnt
    gap, volume = z[1].real, z[0].real
    if gap > 0 and model.lost is not None:
        lost = model.lost
        scale = math.exp(lost.scale + float(products(lost.terms).real @ lost.weights))
        variance += scale * gap**lost.gap_power * volume**lost.volume_power
    if not two:
        return [(value.real, model.sigma[0] * math.sqrt(variance + along))]
    # The covariance of the noise, turned from the value's direction into the axes.
    u = value / abs(value)
    turn = np.array([[u.real, -u.imag], [u.imag, u.real]])
    noise_xy = np.diag(turn @ np.diag([along, across]) @ turn.T)
    return [
        (part, s * math.sqrt(variance + float(n)))
        for part, s, n in zip([value.real, value.imag], model.sigma, noise_xy, strict=True)
    ]


@pytest.mark.parametrize("gap", [0.0, 0.3])
def test_values_and_sigmas_are_those_of_the_definition(gap: float) -> None:
    for _ in range(5):
        z = _frame(gap)
        expected = [pair for model in MODELS for pair in _plainly(model, z)]
        found = _run(MODELS, z)
        np.testing.assert_allclose(found[:, :2], expected, rtol=1e-10)
        assert not found[:, 2].any()


def test_features_not_in_demand_are_none_and_change_nothing() -> None:
    z = _frame()
    everything = _run(MODELS, z)
    kernel = ModelKernel(INPUTS, MODELS)
    for wanted in ({"x"}, {"s", "t"}, {"x", "t"}, set[str](), None):
        kernel.want(None if wanted is None else frozenset(wanted))
        found = kernel.of_inputs(z)
        is_there = np.array(
            [wanted is None or not wanted.isdisjoint(m.outputs) for m in MODELS for _ in m.outputs]
        )
        np.testing.assert_array_equal(found[is_there], everything[is_there])
        assert np.isnan(found[~is_there, :2]).all()


@pytest.mark.parametrize(("outputs", "rows"), [(1, 0), (2, 1), (1, 3), (2, 4), (2, 5), (1, 8)])
def test_curves_and_polynomials_agree_with_numpy(outputs: int, rows: int) -> None:
    """Far out and NaN included."""
    rng = np.random.default_rng(3)
    letters = [*INPUTS, *(f"{name}*" for name in INPUTS)]
    terms = [[], *([str(name) for name in rng.choice(letters, n)] for n in (1, 1, 2, 2, 3, 4))]
    ranges, factor = [(-2.0, 2.0), (-1.0, 3.0)][:outputs], [_pairs(len(terms), rng) for _ in range(rows)]
    model = Polynomial(
        ["x", "y"][:outputs], terms, _pairs(len(terms), rng), ranges, [0.03, 0.04][:outputs], factor
    )
    curve = Curve("s", "volume", [(-0.3, 5.0), (0.0, 4.0), (0.1, 2.0), (0.4, -1.0)], 0.02)
    z: Complex = rng.normal(0.0, 0.5, (200, 2 * len(INPUTS))).view(np.complex128)
    z[7, 0] = np.nan
    kernel = ModelKernel(INPUTS, (curve, model))
    out = np.array([kernel.of_inputs(row) for row in z])
    x = z[:, 0].real
    np.testing.assert_allclose(out[:, 0, 0], np.interp(x, *np.array(curve.knots).T), rtol=1e-13)
    np.testing.assert_array_equal(out[:, 0, 1], curve.sigma)
    np.testing.assert_array_equal(out[:, 0, 2], (x < -0.3) | (x > 0.4))
    psi = evaluate_terms(z, term_columns(terms, INPUTS))
    y = psi @ (np.array(model.weights) @ (1, 1j))
    spread = np.array(factor).reshape(-1, len(terms), 2) @ (1, 1j)
    widened = np.sqrt(1.0 + (np.abs(psi @ spread.T) ** 2).sum(axis=1))
    for i, part in enumerate((y.real, y.imag)[:outputs]):
        low, high = model.valid[i]
        np.testing.assert_allclose(out[:, 1 + i, 0], np.clip(part, low, high), rtol=1e-12)
        np.testing.assert_allclose(out[:, 1 + i, 1], model.sigma[i] * widened, rtol=1e-12)
        np.testing.assert_array_equal(out[:, 1 + i, 2], (part < low) | (part > high))
        assert 0 < np.count_nonzero(out[:, 1 + i, 2]) < 200


def test_more_lost_pins_than_the_fit_has_tried_or_an_unknown_input_give_no_value() -> None:
    found = _run(MODELS, _frame(gap=2.5))
    assert np.isnan(found[:3, 0]).all()
    assert np.isfinite(found[3, 0])  # its fit has no model of lost pins
    assert np.isnan(_run(MODELS, _frame(gap=math.nan))[:3, 0]).all()
    z = _frame()
    z[2] = math.nan
    found = _run(MODELS, z)
    assert np.isnan(found[:, 0]).all()
    assert not found[:, 2].any()


def test_a_value_out_of_range_is_reported_and_set_to_the_range_s_end() -> None:
    z = _frame()
    near, beyond = (_run([_process(["s"], 11, 4, 2, far=far)], z)[0] for far in (1e6, 1e-6))
    assert (near[2], beyond[2]) == (0, 1)  # far from the data
    assert beyond[0] == near[0]
    value, sigma, _ = _run([MODELS[1]], z)[0]
    low = msgspec.structs.replace(MODELS[1], valid=[(value + 1.0, value + 2.0)])
    high = msgspec.structs.replace(MODELS[1], valid=[(value - 2.0, value - 1.0)])
    np.testing.assert_allclose(_run([low], z)[0], [value + 1.0, sigma, 1.0])
    assert _run([high], z)[0, 0] == value - 1.0


LOST = {"scale": 0.1, "gap_power": 1.0, "volume_power": 0.5, "gap_max": 2.0}


def _with_process(**changes: Any) -> dict[str, Any]:
    table = calibration_content()
    moments = table["models"][1]
    del moments["spread"]
    table["models"][1] = moments | {
        "type": "process", "terms": [[], ["c00"], ["p", "p*", "c00"]],
        "factor": [[[0.0, 0.0], [30.0, 0.0], [0.0, 0.0]]], "far": 10.0, "noise_terms": [[], ["volume"]],
        "noise_weights": [0.1, -2.0], "noise_range": [-1.0, 1.0], "lost": LOST,
    } | changes  # fmt: skip
    return table


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"terms": [[], ["c00"], ["smell"]]}, "terms[2]: unknown input 'smell'"),
        ({"noise_terms": [["smell"], []]}, "noise_terms[0]: unknown input 'smell'"),
        ({"noise_weights": [0.1]}, "noise_weights: 1 numbers for 2 terms"),
        ({"noise_range": [1.0, -1.0]}, "noise_range: give [low, high]"),
        ({"factor": [[[1.0, 0.0]]]}, "factor[0]: 1 pairs of numbers for 3 terms"),
        ({"across_weights": [0.1]}, "across_weights: 1 numbers for 2 terms"),
        ({"across_range": [1.0, -1.0]}, "across_range: give [low, high]"),
        ({"lost": {"scale": 0.1}}, "lost: "),
        ({"lost": LOST | {"terms": [["smell"]], "weights": [1.0]}}, "lost.terms[0]: unknown input"),
        ({"lost": LOST | {"terms": [["gap"]]}}, "lost.weights: 0 numbers for 1 terms"),
        ({"terms": [[]] * 513}, "terms: must have at most 512 items"),
    ],
)
def test_damage_to_a_process_is_one_line_that_names_the_place(changes: dict[str, Any], expected: str) -> None:
    assert "shear_x_mm" in parsed(_with_process()).outputs
    message = one_line(CalibrationError, parsed, _with_process(**changes))
    assert message.startswith("cal.json: ")
    assert f"models[1].{expected}" in message


def test_only_values_of_a_frame_have_a_process() -> None:
    of_contacts = _with_process(outputs=["contact_x_mm", "contact_y_mm"])
    assert "only values of a frame can have one" in one_line(CalibrationError, parsed, of_contacts)
