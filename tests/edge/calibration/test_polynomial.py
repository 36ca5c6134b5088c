"""The kernel of curves and polynomials: against NumPy."""

import numpy as np
import pytest

from edge.calibration.file import Curve, Polynomial
from edge.calibration.inputs import evaluate_terms, term_columns
from edge.calibration.polynomial import ModelKernel

pytestmark = pytest.mark.kernels

INPUTS = ("volume", "shear", "c10")
CURVE = Curve("force_n", "volume", [(-0.3, 5.0), (0.0, 4.0), (0.1, 2.0), (0.4, -1.0)], 0.02)


def polynomial(outputs: int, spread_rows: int, seed: int = 0) -> Polynomial:
    """Terms of none to four factors."""
    rng = np.random.default_rng(seed)
    names = [*INPUTS, *(f"{name}*" for name in INPUTS)]
    terms = [[], *([str(name) for name in rng.choice(names, n)] for n in (1, 1, 2, 2, 3, 4))]

    def pairs() -> list[tuple[float, float]]:
        return [(float(x), float(y)) for x, y in rng.normal(0, 3, (len(terms), 2))]

    return Polynomial(
        outputs=["shear_x_mm", "shear_y_mm"][:outputs],
        terms=terms,
        weights=pairs(),
        valid=[(-2.0, 2.0), (-1.0, 3.0)][:outputs],
        sigma=[0.03, 0.04][:outputs],
        spread=[pairs() for _ in range(spread_rows)],
    )


@pytest.mark.parametrize(("outputs", "spread_rows"), [(1, 0), (2, 1), (1, 3), (2, 4), (2, 5), (1, 8)])
def test_all_models_in_one_call_agree_with_numpy(outputs: int, spread_rows: int) -> None:
    """Curves by `numpy.interp`, polynomials by `evaluate_terms`; far out and NaN included."""
    rng = np.random.default_rng(3)
    z = rng.normal(0.0, 0.2, (200, 3)) + 1j * rng.normal(0.0, 0.2, (200, 3))
    z[7, 0] = np.nan
    model = polynomial(outputs, spread_rows)
    out = np.full((200, 1 + outputs, 3), np.nan)
    kernel = ModelKernel(INPUTS, (CURVE, model))
    for row, outputs_of_row in zip(z, out, strict=True):
        kernel.run(row.view(np.float64), outputs_of_row)
    x = z[:, 0].real
    np.testing.assert_allclose(out[:, 0, 0], np.interp(x, *np.array(CURVE.knots).T), rtol=1e-13)
    np.testing.assert_array_equal(out[:, 0, 1], CURVE.sigma)
    np.testing.assert_array_equal(out[:, 0, 2], ~((x >= -0.3) & (x <= 0.4)))
    psi = evaluate_terms(z, term_columns(model.terms, INPUTS))
    y = psi @ (np.array(model.weights) @ (1, 1j))
    spread = np.array(model.spread).reshape(-1, len(model.terms), 2) @ (1, 1j)
    widened = np.sqrt(1.0 + (np.abs(psi @ spread.T) ** 2).sum(axis=1))
    assert np.isnan(out[7, 0, 0])
    assert np.isnan(y[7])
    for i, part in enumerate((y.real, y.imag)[:outputs]):
        low, high = model.valid[i]
        np.testing.assert_allclose(out[:, 1 + i, 0], np.clip(part, low, high), rtol=1e-12)
        np.testing.assert_allclose(out[:, 1 + i, 1], model.sigma[i] * widened, rtol=1e-6)
        np.testing.assert_array_equal(out[:, 1 + i, 2], (part < low) | (part > high))
        assert 0 < np.count_nonzero(out[:, 1 + i, 2]) < 200


def test_models_that_are_not_wanted_are_nan_and_change_nothing() -> None:
    z = np.array([0.1 + 0.2j, -0.3j, 0.2 + 0.1j])
    kernel = ModelKernel(INPUTS, (CURVE, polynomial(2, 4)))
    whole, part = np.empty((3, 3)), np.empty((3, 3))
    kernel.run(z.view(np.float64), whole)
    for wanted in ([True, False], [False, True], [False, False], [True, True]):
        kernel.want(np.array(wanted))
        kernel.run(z.view(np.float64), part)
        is_there = np.repeat(wanted, [1, 2])
        np.testing.assert_array_equal(part[is_there], whole[is_there])
        assert np.isnan(part[~is_there, :2]).all()
        assert (part[~is_there, 2] == 0.0).all()
