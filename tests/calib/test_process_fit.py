"""Processes: the law is found, sigma follows the noise; the effect of lost pins; the likelihood."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from calib.process_fit import FittedProcess, fit_process
from calib.process_likelihood import Likelihood, Repeats, Symmetry, fit_settings
from calib.process_noise import likeliest_scales, scales_of
from calib.terms import evaluate_terms, term_columns
from edge.calibration.inputs import FRAME_INPUTS
from edge.types import Complex, Index
from tests.support.synthetic import make


def _inputs(n: int, seed: int) -> Complex:
    return make(n, seed)[0].inputs


def _shear(inputs: Complex) -> Complex:
    c00, p = (inputs[:, FRAME_INPUTS.index(name)] for name in ("c00", "p"))
    return np.asarray(50.0 * c00 + 900.0 * p**2 * c00.conj())


def _noise(inputs: Complex, seed: int, *, stepped: bool = False) -> Complex:
    """Larger where the load is small; stepped: ten times as large below a certain load."""
    rng, load = np.random.default_rng(seed), inputs[:, 0].real
    size = np.where(load < 0.012, 0.3, 0.03) if stepped else 0.3 * np.exp(-60.0 * load)
    return size * _normal(rng, len(inputs))


def _normal(rng: np.random.Generator, *shape: int) -> Complex:
    """Both parts standard normal."""
    return np.asarray(np.tensordot((1, 1j), rng.normal(size=(2, *shape)), 1))


def _fitted(
    inputs: Complex,
    y: Complex,
    lossy: Complex | None = None,
    pose: Index | None = None,
    symmetry: Symmetry = Symmetry.TURNING,
) -> FittedProcess:
    lossy = np.empty((len(y), 0, inputs.shape[1]), np.complex128) if lossy is None else lossy
    pose = np.arange(len(y), dtype=np.int32) if pose is None else pose
    fold = (pose % 10).astype(np.int32)
    return fit_process(inputs, [], y, symmetry, fold, lossy, all_round=True, pose=pose)


def _predicted(fitted: FittedProcess, inputs: Complex) -> tuple[Complex, Complex]:
    """Values, and the sigmas of both parts as a complex number."""
    psi = evaluate_terms(inputs, term_columns(fitted.terms, FRAME_INPUTS))
    learnt = (np.abs(psi @ fitted.factor.T) ** 2).sum(axis=1)
    value = psi @ fitted.weights
    assert fitted.across is not None
    along, across = (one.variance(inputs) for one in (fitted.noise, fitted.across))
    share = value.real**2 / np.abs(value) ** 2
    parts = share * along + (1 - share) * across, share * across + (1 - share) * along
    x, y = (s * np.sqrt(learnt + part) for s, part in zip(fitted.sigma, parts, strict=True))
    return value, x + 1j * y


def _within(error: Complex, sigma: Complex) -> float:
    """Share of the errors of both parts within one sigma."""
    return float(np.mean(np.abs([error.real, error.imag]) < [sigma.real, sigma.imag]))


def test_a_law_is_found_and_sigma_follows_the_noise() -> None:
    inputs, fresh = _inputs(150, 0), _inputs(400, 1)
    fitted = _fitted(inputs, _shear(inputs) + _noise(inputs, 2))
    value, sigma = _predicted(fitted, fresh)
    error = value - _shear(fresh) - _noise(fresh, 3)
    light = fresh[:, 0].real < 0.012
    for rows in (light, ~light):
        assert 0.5 < _within(error[rows], sigma[rows]) < 0.85
    assert np.abs(sigma[light]).mean() > 2.0 * np.abs(sigma[~light]).mean()
    assert np.abs(value - _shear(fresh))[~light].mean() < 0.1


@pytest.mark.parametrize("seed", [0, 10, 20])
def test_sigma_covers_fresh_frames_after_few_frames_and_with_noise_in_steps(seed: int) -> None:
    """Settings that may follow every frame, and a covariance cut to a few rows, gave 50 % (seed 20)."""
    inputs, fresh = _inputs(120, seed), _inputs(400, seed + 1)
    fitted = _fitted(inputs, _shear(inputs) + _noise(inputs, seed + 2, stepped=True))
    value, sigma = _predicted(fitted, fresh)
    error = value - _shear(fresh) - _noise(fresh, seed + 3, stepped=True)
    assert 0.58 < _within(error, sigma) < 0.8


def test_sigma_along_a_vector_is_larger_if_its_length_is_less_known() -> None:
    """Like a slipping contact: the length of its shear is uncertain, the direction is not."""
    inputs, fresh = _inputs(150, 0), _inputs(400, 1)

    def seen(rows: Complex, seed: int) -> Complex:
        rng, shear = np.random.default_rng(seed), _shear(rows)
        off = 0.4 * rng.normal(size=len(rows)) + 0.04j * rng.normal(size=len(rows))
        return np.asarray(shear + off * shear / np.abs(shear))

    fitted = _fitted(inputs, seen(inputs, 2))
    value, sigma = _predicted(fitted, fresh)
    error = value - seen(fresh, 3)
    ratio, steep = sigma.real / sigma.imag, np.abs(value.imag / value.real)
    assert np.median(ratio[steep < 1 / 3]) > 2.5
    assert np.median(ratio[steep > 3]) < 1 / 2.5
    assert 0.6 < _within(error, sigma) < 0.8


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
    lossy[..., FRAME_INPUTS.index("gap_place")] = 0.0
    lossy[..., FRAME_INPUTS.index("c00")] += 0.01 * gap * _normal(rng, 100, 3)
    lost = _fitted(inputs, _shear(inputs) + _noise(inputs, 2), lossy).lost
    assert lost is not None
    assert 1.6 < lost.gap_power < 2.4
    assert abs(lost.volume_power) < 0.3
    assert lost.gap_max == gap.max()
    assert _fitted(inputs, _shear(inputs), None).lost is None


def test_repeats_of_a_pose_count_as_one() -> None:
    """They share how the tip was set down; counted as six, they make the model sure of what was chance."""
    x, y = _data(24)
    pose = np.repeat(np.arange(24, dtype=np.int32), 3)
    once = Likelihood(x, SPINS, y, Symmetry.TURNING, asymmetric=True)
    repeated = Likelihood(
        x[pose], SPINS, y[pose], Symmetry.TURNING, asymmetric=True, repeats=Repeats(pose, 0.01)
    )
    logs = np.random.default_rng(6).normal(size=(2, 10))
    (first, slope), (second, _) = (once(one) for one in logs)
    assert repeated(logs[0])[1] == pytest.approx(slope, rel=1e-5, abs=1e-5)
    assert repeated(logs[0])[0] - repeated(logs[1])[0] == pytest.approx(first - second, rel=1e-6)
    inputs = _inputs(100, 4)
    y, pose = _shear(inputs) + _noise(inputs, 5), np.repeat(np.arange(100, dtype=np.int32), 6)
    alone, six = _fitted(inputs, y), _fitted(inputs[pose], y[pose], pose=pose)
    assert six.sigma == pytest.approx(alone.sigma, rel=0.1)
    left_open = [(np.abs(one.uncertainty.rows(inputs)) ** 2).sum(axis=1).mean() for one in (six, alone)]
    assert left_open[0] == pytest.approx(left_open[1], rel=0.3)


def test_a_value_does_not_follow_what_differs_within_a_pose() -> None:
    """The skin creeps under a load that is the same, along an input that tells of the load, too."""
    rng, loads = np.random.default_rng(7), np.random.default_rng(8).uniform(0.2, 1.0, 30)
    pose = np.repeat(np.arange(30, dtype=np.int32), 8)
    inputs = np.zeros((len(pose), len(FRAME_INPUTS)), dtype=np.complex128)
    creep = rng.normal(0.0, 0.03, len(pose))
    for name, crept, off in (("volume", 1.0, 0.0), ("peak", 0.0, 0.03)):
        inputs[:, FRAME_INPUTS.index(name)] = loads[pose] + crept * creep + rng.normal(0.0, off, 30)[pose]
    steady = _fitted(inputs, (5.0 * loads[pose]).astype(np.complex128), pose=pose, symmetry=Symmetry.EVEN)
    value = evaluate_terms(inputs, term_columns(steady.terms, FRAME_INPUTS)) @ steady.weights
    within = np.array([value.real[pose == k].std() for k in range(30)]).mean()
    assert within < 0.05


def test_few_repeated_poses_decide_few_weights() -> None:
    """They err less than a weight for each input, which one frame a pose is given, and sigma follows."""
    errors, within = [], []
    for seed in range(2):
        inputs, fresh = _inputs(30, seed), _inputs(300, seed + 50)
        pose = np.repeat(np.arange(30, dtype=np.int32), 4)
        y = _shear(inputs) + _noise(inputs, seed + 2)
        for fitted in (_fitted(inputs, y), _fitted(inputs[pose], y[pose], pose=pose)):
            value, sigma = _predicted(fitted, fresh)
            errors.append(np.abs(value - _shear(fresh)).mean())
            within.append(_within(value - _shear(fresh) - _noise(fresh, seed + 3), sigma))
    assert np.mean(errors[1::2]) < np.mean(errors[::2])
    assert 0.6 < np.mean(within[1::2]) < 0.8


def test_two_poses_far_off_do_not_decide_sigma() -> None:
    few = np.linspace(-1.5, 1.5, 27)
    few[:2] = 5.0, -6.0
    repeated = [np.repeat(few, 10)]
    assert likeliest_scales(repeated, 27.0) == pytest.approx(scales_of(repeated)[:, 0], rel=0.1)


def test_a_depth_is_zero_at_rest_unless_it_counts_from_elsewhere() -> None:
    inputs = _inputs(300, 7)
    volume = inputs[:, FRAME_INPUTS.index("volume")].real
    light = volume < np.median(volume)
    for offset in (0.0, 400.0):
        depth = 200.0 * volume + 4000.0 * volume**2 + offset
        y = depth[light][:30].astype(np.complex128)
        fitted = _fitted(inputs[light][:30], y, symmetry=Symmetry.EVEN)
        value = evaluate_terms(inputs, term_columns(fitted.terms, FRAME_INPUTS)) @ fitted.weights
        off = np.abs(value.real - depth)
        assert off[light].mean() < 0.15
        assert offset or off[~light].mean() < 0.1 * depth[~light].mean()


SPINS = np.array([1, 0, 2, -1])


def _data(n: int) -> tuple[Complex, Complex]:
    return _normal(np.random.default_rng(2), n, 4), _normal(np.random.default_rng(3), n)


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
    turned_y[3] *= np.exp(1j * t) if symmetry is Symmetry.TURNING else 1.0
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
