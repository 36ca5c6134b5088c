"""The likelihood: its gradient, and the symmetry of its kernel."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from calib.process_likelihood import Likelihood, Symmetry, fit_settings

SPINS = np.array([1, 0, 2, -1])


def _data(n: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    return rng.normal(size=(n, 4)) + 1j * rng.normal(size=(n, 4)), rng.normal(size=n) + 1j * rng.normal(
        size=n
    )


@pytest.mark.parametrize("symmetry", Symmetry)
@pytest.mark.parametrize("asymmetric", [False, True])
def test_the_gradient_is_that_of_the_value(symmetry: Symmetry, asymmetric: bool) -> None:
    x, y = _data(25)
    likelihood = Likelihood(x, SPINS, y, symmetry, asymmetric=asymmetric)
    logs = np.log([0.5, 0.4, 0.3, 0.6, 1.0, 0.4, 0.2, 0.05, 0.03, 0.1])
    _, slope = likelihood(logs)
    numeric = approx_fprime(logs, lambda at: likelihood(at)[0], 1e-6)
    np.testing.assert_allclose(slope, numeric, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("symmetry", Symmetry)
def test_rotated_and_mirrored_data_are_equally_likely(symmetry: Symmetry) -> None:
    x, y = _data(20)
    if symmetry is not Symmetry.TURNING:
        y = y.real.astype(complex)
    logs = np.log([0.5, 0.4, 0.3, 0.6, 1.0, 0.4, 0.2, 0.05, 0.03, 0.1])

    def value(x: np.ndarray, y: np.ndarray) -> float:
        return Likelihood(x, SPINS, y, symmetry, asymmetric=False)(logs)[0]

    t = 2 * np.pi / 8  # of one row alone: the kernel must not change
    turned_x, turned_y = x.copy(), y.copy()
    turned_x[3] *= np.exp(1j * SPINS * t)
    if symmetry is Symmetry.TURNING:
        turned_y[3] *= np.exp(1j * t)
    assert value(turned_x, turned_y) == pytest.approx(value(x, y), rel=1e-9)
    if symmetry is not Symmetry.TURNING:
        mirrored_x, mirrored_y = x.copy(), y.copy()
        mirrored_x[3] = x[3].conj()
        mirrored_y[3] *= 1.0 if symmetry is Symmetry.EVEN else -1.0
        assert value(mirrored_x, mirrored_y) == pytest.approx(value(x, y), rel=1e-9)


def test_irrelevant_inputs_lose_their_weight() -> None:
    x, _ = _data(80)
    y = x[:, 0] + 0.5 * x[:, 2] * x[:, 0].conj()
    settings = fit_settings(x, SPINS, np.ones(4), y, Symmetry.TURNING, asymmetric=False)
    reported, silent = settings.weight[[0, 2]], settings.weight[[1, 3]]
    assert silent.max() < 0.2 * reported.min()
    assert settings.noise < 0.01
