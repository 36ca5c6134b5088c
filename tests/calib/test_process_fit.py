"""Processes: the law is found, sigma follows the noise, and the effect of lost pins is learnt."""

from __future__ import annotations

import numpy as np
import pytest

from calib.process_fit import FittedProcess, fit_process
from calib.process_likelihood import Symmetry
from edge.calibration.inputs import FRAME_INPUTS, evaluate_terms, term_columns
from edge.types import Array, Complex
from tests.support.synthetic import make

FOLDS = 10


def _inputs(n: int, seed: int) -> Complex:
    return make(n, seed)[0].inputs


def _shear(inputs: Complex) -> Complex:
    c00, p = (inputs[:, FRAME_INPUTS.index(name)] for name in ("c00", "p"))
    result: Complex = 50.0 * c00 + 900.0 * p**2 * c00.conj()
    return result


def _noise(inputs: Complex, seed: int) -> Complex:
    """Larger where the load is small."""
    rng = np.random.default_rng(seed)
    size = 0.3 * np.exp(-60.0 * inputs[:, 0].real)
    noise: Complex = size * (rng.normal(size=len(inputs)) + 1j * rng.normal(size=len(inputs)))
    return noise


def _stepped_noise(inputs: Complex, seed: int) -> Complex:
    """Ten times as large below a certain load."""
    rng = np.random.default_rng(seed)
    size = np.where(inputs[:, 0].real < 0.012, 0.3, 0.03)
    noise: Complex = size * (rng.normal(size=len(inputs)) + 1j * rng.normal(size=len(inputs)))
    return noise


def _fitted(inputs: Complex, y: Complex, lossy: Complex | None = None) -> FittedProcess:
    none = np.empty((len(y), 0, inputs.shape[1]), dtype=np.complex128)
    fold = (np.arange(len(y)) % FOLDS).astype(np.int32)
    return fit_process(
        inputs, FRAME_INPUTS, [], y, Symmetry.TURNING, fold, none if lossy is None else lossy, all_round=True
    )


def _predicted(fitted: FittedProcess, inputs: Complex) -> tuple[Complex, Array]:
    """Values, and the sigma of each part."""
    psi = evaluate_terms(inputs, term_columns(fitted.terms, FRAME_INPUTS))
    learnt = (np.abs(psi @ fitted.factor.T) ** 2).sum(axis=1)
    return psi @ fitted.weights, np.sqrt(fitted.noise.variance(inputs, FRAME_INPUTS) + learnt) * fitted.sigma[
        0
    ]


def test_a_law_is_found_and_sigma_follows_the_noise() -> None:
    inputs, fresh = _inputs(250, 0), _inputs(400, 1)
    fitted = _fitted(inputs, _shear(inputs) + _noise(inputs, 2))
    value, sigma = _predicted(fitted, fresh)
    error = value - _shear(fresh) - _noise(fresh, 3)
    light = fresh[:, 0].real < 0.012
    for rows in (light, ~light):
        parts = np.abs([error[rows].real, error[rows].imag]) / sigma[rows]
        assert 0.5 < np.mean(parts < 1.0) < 0.85
    assert sigma[light].mean() > 2.0 * sigma[~light].mean()
    assert np.abs(value - _shear(fresh))[~light].mean() < 0.1


@pytest.mark.parametrize("seed", [0, 10, 20])
def test_sigma_covers_fresh_frames_after_few_frames_and_with_noise_in_steps(seed: int) -> None:
    """Settings that may follow every frame, and a covariance cut to a few rows, gave 50 % (seed 20)."""
    inputs, fresh = _inputs(120, seed), _inputs(400, seed + 1)
    fitted = _fitted(inputs, _shear(inputs) + _stepped_noise(inputs, seed + 2))
    value, sigma = _predicted(fitted, fresh)
    error = value - _shear(fresh) - _stepped_noise(fresh, seed + 3)
    assert 0.58 < np.mean(np.abs([error.real, error.imag]) < sigma) < 0.85


def test_far_from_the_data_the_variance_is_larger_than_before() -> None:
    inputs = _inputs(80, 0)
    fitted = _fitted(inputs, _shear(inputs) + _noise(inputs, 2))
    psi = evaluate_terms(10.0 * inputs, term_columns(fitted.terms, FRAME_INPUTS))
    assert np.median((np.abs(psi @ fitted.factor.T) ** 2).sum(axis=1)) > fitted.far


def test_the_effect_of_lost_pins_is_learnt_as_a_power_of_the_gap() -> None:
    inputs = _inputs(100, 0)
    rng = np.random.default_rng(5)
    lossy = np.repeat(inputs[:, None], 3, axis=1)
    gap = rng.uniform(0.01, 1.0, size=(100, 3))
    lossy[..., FRAME_INPUTS.index("gap")] = gap
    shape = (100, 3)
    lossy[..., FRAME_INPUTS.index("c00")] += (
        0.01 * gap * (rng.normal(size=shape) + 1j * rng.normal(size=shape))
    )
    lost = _fitted(inputs, _shear(inputs) + _noise(inputs, 2), lossy).lost
    assert lost is not None
    assert 1.6 < lost.gap_power < 2.4
    assert abs(lost.volume_power) < 0.3
    assert lost.gap_max == gap.max()
    assert _fitted(inputs, _shear(inputs), None).lost is None
