"""A symmetric Gaussian process as the polynomial that it is: its terms, their weights, the noise.

The kernel of `calib.process_likelihood` is a polynomial of third degree, so its features are the products of
up to three inputs (or their conjugates). Mean over turns and mirror leaves those of the outputs' own spin and
parity; each has a prior variance that follows from the kernel's weights. Most inputs have weights near 0, and
products whose prior variance is far below the noise are left out: some ten to some hundred are left. With
those it is Bayesian linear regression, exactly.

The noise differs from frame to frame (a light contact slips and tells less): its logarithm is a polynomial in
what no turn changes, fitted to the errors on held-out frames over what the weights leave open.

Those errors are too small, because the settings have seen every frame. So the frames are split into groups,
settings are fitted without each, and sigma is widened until it covers the errors of the group left out as
often as it should: sigma as the edge computes it, from a few rows of the covariance.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import minimize

from calib.process_likelihood import Settings, Symmetry, fit_settings
from edge.calibration.file import TERMS_MAX, Lost
from edge.calibration.inputs import evaluate_terms, term_columns
from edge.types import Array, Complex, Index

__all__ = ["INPUTS", "FittedProcess", "Input", "ProcessParams", "fit_process"]


@dataclass(frozen=True, slots=True)
class Input:
    """One input of the frame that processes use.

    degree  of the polynomial that it is a coefficient of; 0 and 1 count alike
    real    its imaginary part is 0
    """

    name: str
    spin: int
    degree: int
    real: bool = False


INPUTS = (
    *(Input(f"c{a}{d - a}", 1 - 2 * a + d, d) for d in range(6) for a in range(d, -1, -1)),
    Input("p", 1, 1),
    Input("volume", 0, 1, real=True),
    Input("peak", 0, 1, real=True),
    Input("size", 0, 1, real=True),
)
#: What the noise may depend on: load, shear, place.
NOISE_TERMS: tuple[list[str], ...] = (
    ["volume"], ["volume", "volume"], ["c00", "c00*"], ["p", "p*"], ["c00", "c00*", "volume"],
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class ProcessParams:
    """Evidence: docs/tuning.md, "process"."""

    negligible: float = 0.03  # of the noise's variance: a term whose prior variance is smaller is left out
    rows_max: int = 32  # of the covariance's root
    open_share: float = 0.99  # of what the weights leave open, that these rows hold
    apart: float = 0.1  # share of inputs that go their own ways in what the rows must hold
    noise_prior: float = 0.5  # weight of squared coefficients of the noise's logarithm
    constant: float = 0.1  # prior deviation of the constant, in units of the output's own
    one_sigma: float = 0.6827
    losses_min: int = 50  # frames with pins taken away: fewer do not tell three numbers
    groups_max: int = 4  # that settings are fitted without
    rows_cross: int = 480  # with half as many frames, or more, two groups: time
    far: float = 4.0  # times the largest of held-out frames: twice their sigma


PARAMS = ProcessParams()


@dataclass(frozen=True, slots=True)
class FittedProcess:
    """The process in terms of its weights. Units: the outputs' own; sigma of each output.

    terms          input names
    weights        (terms,) complex128
    factor         (rows, terms) complex128, L over sigma
    sigma          (1 or 2,)
    far            largest |L psi|^2 that is no extrapolation
    noise          over sigma^2
    lost           what lost pins add to the variance, over sigma^2; None: not tried
    held_out       (n,) complex128, prediction of each row by weights that have not seen its fold
    """

    terms: list[list[str]]
    weights: Complex
    factor: Complex
    sigma: Array
    far: float
    noise: NoiseModel
    lost: Lost | None
    held_out: Complex


def fit_process(
    inputs: Complex,
    names: Sequence[str],
    moved: Sequence[Complex],
    y: Complex,
    symmetry: Symmetry,
    fold: Index,
    lossy: Complex,
    *,
    all_round: bool,
) -> FittedProcess:
    """Settings of largest likelihood, then the weights.

    inputs     (n, k) complex128, columns `names`, finite
    moved      draws of what the inputs may be off, each (n, k)
    y          (n,) complex128, x + i y, or real
    fold       (n,) rows that stay together when held out
    lossy      (n, losses, k) complex128, the inputs with some of the pins taken away; NaN: not known
    all_round  False: the data went one way only, and cannot tell what is not symmetric
    """
    mean = float(y.real.mean()) if symmetry is Symmetry.EVEN else 0.0
    unit = float(np.sqrt((np.abs(y - mean) ** 2).mean()))
    target = (y - mean) / unit
    prior = partial(_prior, names=names, symmetry=symmetry, all_round=all_round)
    features, settings = prior(inputs, target=target)
    posterior = _posterior(features, inputs, moved, target, settings.noise)
    held_out, learnt = posterior.held_out(fold)
    error = held_out - target
    noise_model = _fit_noise(inputs, names, np.abs(error) ** 2, learnt)
    factor = posterior.factor()
    claimed = learnt / noise_model.level * posterior.share_held(features.rows(inputs), factor)
    expected = np.sqrt(noise_model.variance(inputs, names) + claimed)
    sigma = np.array([_one_sigma(part / expected) for part in _parts(error, symmetry)])
    unseen = _cross_fitted(partial(prior, start=settings.start), inputs, moved, target, fold) - target
    parts = zip(_parts(unseen, symmetry), sigma, strict=True)
    sigma *= unit * max(1.0, _one_sigma(np.array([part / expected / one for part, one in parts])))
    weights = features.of_terms(posterior.weights[None])[0] * unit
    change = (features.rows(lossy.reshape(-1, len(names))) @ posterior.weights).reshape(lossy.shape[:2])
    change = (
        (change - (features.rows(inputs) @ posterior.weights)[:, None]) * unit / np.sqrt((sigma**2).sum())
    )
    weights[0] += mean
    return FittedProcess(
        terms=features.terms,
        weights=weights,
        factor=features.of_terms(factor / math.sqrt(noise_model.level)),
        sigma=np.maximum(sigma, 1e-6),
        far=PARAMS.far * float(learnt.max()) / noise_model.level,
        noise=noise_model,
        lost=_fit_lost(lossy.reshape(-1, len(names)), names, np.abs(change.ravel()) ** 2),
        held_out=held_out * unit + mean,
    )


def _parts(y: Complex, symmetry: Symmetry) -> list[Array]:
    """What is an output of its own."""
    return [y.real, y.imag] if symmetry is Symmetry.TURNING else [y.real]


def _one_sigma(errors: Array) -> float:
    return float(np.quantile(np.abs(errors), PARAMS.one_sigma))


def _posterior(
    features: _Features, inputs: Complex, moved: Sequence[Complex], target: Complex, noise: float
) -> _Posterior:
    design = features.rows(inputs)
    off = [(features.rows(inputs + d) - features.rows(inputs - d)) / 2.0 for d in moved]
    return _Posterior(design, _mean_square(design, off), target if features.turning else target.real, noise)


def _cross_fitted(
    prior: Callable[..., tuple[_Features, Settings]],
    inputs: Complex,
    moved: Sequence[Complex],
    target: Complex,
    fold: Index,
) -> Complex:
    """(n,) prediction of each row: settings have not seen its group, weights not its fold.

    Weights that have not seen the group either would err more than the edge's, which all rows decide.
    """
    predicted = np.empty_like(target)
    n_groups = min(PARAMS.groups_max, max(2, PARAMS.rows_cross // len(target)), int(fold.max()) + 1)
    for group in range(n_groups):
        unseen = fold % n_groups == group
        features, settings = prior(inputs[~unseen], target=target[~unseen])
        predicted[unseen] = _posterior(features, inputs, moved, target, settings.noise).held_out(fold)[0][
            unseen
        ]
    return predicted


def _mean_square(design: Complex, off: Sequence[Complex]) -> Complex:
    """(features, features) sum over the rows of what the features are off, squared; the mean of the draws."""
    square = np.zeros((design.shape[1],) * 2, dtype=design.dtype)
    for rows in off:
        square += rows.conj().T @ rows / len(off)
    return square


def _prior(
    inputs: Complex,
    names: Sequence[str],
    target: Complex,
    symmetry: Symmetry,
    *,
    all_round: bool,
    start: int | None = None,
) -> tuple[_Features, Settings]:
    """The features of the likeliest kernel that are not negligible, and its settings.

    start  the search's only one; None: all are tried
    """
    columns = [names.index(one.name) for one in INPUTS]
    scale = np.sqrt((np.abs(inputs[:, columns]) ** 2).mean(axis=0))
    used = [i for i, rms in enumerate(scale) if rms > 0]
    letters = [INPUTS[i] for i in used]
    order = np.random.default_rng(0).permutation(len(target))  # the likelihood takes the first rows
    settings = fit_settings(
        inputs[order][:, [columns[i] for i in used]] / scale[used],
        np.array([one.spin for one in letters]),
        np.array([float(max(1, one.degree)) for one in letters]),
        target[order],
        symmetry,
        asymmetric=all_round,
        start=start,
    )
    terms: list[list[str]] = [[]]
    prior = [[PARAMS.constant * (all_round or symmetry is Symmetry.EVEN)] * 2]
    for term, power, size in _products(letters, scale[used], settings, symmetry):
        terms.append(term)
        prior.append([math.sqrt(part) / size for part in power])
    features = _Features(names, terms, np.array(prior), symmetry)
    return features.without_negligible(inputs, settings.noise), settings


def _products(
    letters: Sequence[Input], scale: Array, settings: Settings, symmetry: Symmetry
) -> Iterator[tuple[list[str], tuple[float, float], float]]:
    """Products of one, two, three inputs; prior variances of their real and imaginary part; their unit.

    Of a term and its conjugate, which a real output cannot tell apart, only one.
    """
    # Name, spin, share of the scalar product, unit, place of the letter and of its conjugate.
    alphabet = [
        (one.name, one.spin, w * w / (1.0 if one.real else 2.0), unit, 2 * i, 2 * i + (not one.real))
        for i, (one, w, unit) in enumerate(zip(letters, settings.weight, scale, strict=True))
    ]
    alphabet += [(f"{n}*", -s, q, unit, c, i) for n, s, q, unit, i, c in alphabet if i != c]
    turning = symmetry is Symmetry.TURNING
    spin = 1 if turning else 0
    for factors in (1, 2, 3):
        symmetric, asymmetric = settings.symmetric[factors - 1], settings.asymmetric[factors - 1]
        for product in itertools.combinations_with_replacement(alphabet, factors):
            places = [one[4] for one in product]
            if sum(one[1] for one in product) != spin and asymmetric == 0.0:
                continue
            shared = math.factorial(factors) * math.prod(one[2] for one in product)
            shared /= math.prod(math.factorial(n) for n in Counter(places).values())
            same_spin = symmetric if sum(one[1] for one in product) == spin else 0.0
            power = (shared * (same_spin + asymmetric),) * 2
            if not turning:
                conjugate = sorted(one[5] for one in product)
                if sorted(places) > conjugate:
                    continue
                pair = shared * (1.0 if sorted(places) == conjugate else 2.0)
                scalar, torsion = (2.0, 0.0) if symmetry is Symmetry.EVEN else (0.0, 2.0)
                power = (pair * (scalar * same_spin + asymmetric), pair * (torsion * same_spin + asymmetric))
            yield [one[0] for one in product], power, math.prod(one[3] for one in product)


class _Features:
    """Terms with the prior deviation of their weights.

    Of a turning output a weight is complex; of a real one its real and its imaginary part are features of
    their own, and those without prior variance are left out.

    prior  (terms, 2) deviation of the weight's real and imaginary part
    """

    def __init__(
        self, names: Sequence[str], terms: list[list[str]], prior: Array, symmetry: Symmetry
    ) -> None:
        self.names, self.terms, self._prior, self._symmetry = names, terms, prior, symmetry
        self.turning = symmetry is Symmetry.TURNING
        self._columns = term_columns(terms, names)
        self._real, self._imag = np.flatnonzero(prior[:, 0]), np.flatnonzero(prior[:, 1])

    def rows(self, inputs: Complex) -> Complex:
        """Features of each frame, times their prior deviation: (n, features)."""
        psi = evaluate_terms(inputs, self._columns)
        if self.turning:
            result: Complex = psi * self._prior[:, 0]
            return result
        real = psi.real[:, self._real] * self._prior[self._real, 0]
        return np.hstack([real, -psi.imag[:, self._imag] * self._prior[self._imag, 1]])

    def of_terms(self, rows: Complex) -> Complex:
        """Rows (r, features) over the features as rows (r, terms) over the terms."""
        if self.turning:
            result: Complex = rows * self._prior[:, 0]
            return result
        over = np.zeros((len(rows), len(self.terms)), dtype=np.complex128)
        n = len(self._real)
        over.real[:, self._real] = rows[:, :n] * self._prior[self._real, 0]
        over.imag[:, self._imag] = rows[:, n:] * self._prior[self._imag, 1]
        return over

    def without_negligible(self, inputs: Complex, noise: float) -> _Features:
        """Without the terms whose prior variance is far below the noise's. The constant stays first."""
        size = (np.abs(evaluate_terms(inputs, self._columns)) ** 2).mean(axis=0)
        share = (self._prior**2).max(axis=1) * size / noise
        share[0] = np.inf
        kept = np.sort(np.argsort(-share, kind="stable")[:TERMS_MAX])
        kept = kept[share[kept] > PARAMS.negligible]
        return _Features(self.names, [self.terms[i] for i in kept], self._prior[kept], self._symmetry)


class _Posterior:
    """Bayesian linear regression with unit prior variances.

    design  (n, f) features of the rows
    off     (f, f) sum over the rows of what the features may be off, squared
    """

    def __init__(self, design: Any, off: Any, y: Any, noise: float) -> None:
        self._noise, self._y = noise, y
        # Features in which the prior, and what may be off, together have unit precision.
        root = cholesky(np.eye(design.shape[1]) + off / noise, lower=True)
        self._design = design
        self._whitened = solve_triangular(root, design.conj().T, lower=True).conj().T
        gram = design.conj().T @ design
        self._precision = gram + off + noise * np.eye(len(gram))
        self._second_moment = gram / len(design)
        self.weights: Complex = np.linalg.solve(self._precision, design.conj().T @ y)

    def held_out(self, fold: Index) -> tuple[Complex, Array]:
        """Prediction of each row by weights that have not seen its fold; what they leave open of it."""
        a = self._whitened
        inverse = np.linalg.inv(a @ a.conj().T + self._noise * np.eye(len(a)))
        alpha = inverse @ self._y
        error: Any = np.zeros_like(alpha)
        variance = np.zeros(len(a))
        for k in range(int(fold.max()) + 1):
            rows = np.flatnonzero(fold == k)
            covariance = np.linalg.inv(inverse[np.ix_(rows, rows)])
            error[rows] = covariance @ alpha[rows]
            variance[rows] = np.diag(covariance).real
        return (self._y - error).astype(np.complex128), np.maximum(variance - self._noise, 0.0)

    def factor(self) -> Complex:
        """(r, f): |row . features|^2, summed, is the variance that the weights leave open.

        The rows that hold most of it over the data, and over inputs that go their own ways.
        """
        size = np.diag(np.diag(self._second_moment).real)
        held = (1.0 - PARAMS.apart) * self._second_moment + PARAMS.apart * size
        e, v = np.linalg.eigh(held)
        e = np.maximum(e, 1e-12 * e[-1])
        root, inverse_root = (v * np.sqrt(e)) @ v.conj().T, (v / np.sqrt(e)) @ v.conj().T
        covariance = self._noise * np.linalg.inv(self._precision)
        s, u = np.linalg.eigh(root @ covariance @ root)
        s, u = np.maximum(s[::-1], 0.0), u[:, ::-1]
        enough = int(np.searchsorted(np.cumsum(s), PARAMS.open_share * s.sum())) + 1
        rows = slice(0, min(enough, PARAMS.rows_max))
        result: Complex = ((inverse_root @ u[:, rows]) * np.sqrt(s[rows])).T
        return result

    def share_held(self, design: Complex, factor: Complex) -> Array:
        """(n,) of what the weights leave open of these rows, the share that the factor's rows hold."""
        whole = self._noise * (design * np.linalg.solve(self._precision, design.conj().T).T).sum(axis=1).real
        held: Array = (np.abs(design @ factor.T) ** 2).sum(axis=1) / np.maximum(whole, 1e-300)
        return np.minimum(held, 1.0)


def _fit_lost(lossy: Complex, names: Sequence[str], squares: Array) -> Lost | None:
    """Likeliest for changes with these squares, over sigma^2, that the loss of pins brought about."""
    gap, volume = lossy[:, names.index("gap")].real, lossy[:, names.index("volume")].real
    known = np.isfinite(squares) & (gap > 0) & (volume > 0)
    if known.sum() < PARAMS.losses_min:
        return None
    squares, logs = squares[known], np.log([gap[known], volume[known]])
    design = np.vstack([np.ones(len(squares)), logs]).T

    def cost(b: Array) -> tuple[float, Array]:
        log_variance = np.clip(design @ b, -60.0, 60.0)
        ratio = squares * np.exp(-log_variance)
        return float((log_variance + ratio).sum()), design.T @ (1.0 - ratio)

    start = np.array([math.log(float(squares.mean())), 0.0, 0.0])
    scale, gap_power, volume_power = minimize(cost, start, jac=True, method="L-BFGS-B").x.tolist()
    return Lost(scale, gap_power, volume_power, float(gap[known].max()))


@dataclass(frozen=True, slots=True)
class NoiseModel:
    """Logarithm of the noise's variance over its level: a polynomial within the range that the data showed.

    level  geometric mean of the variance, in units of the outputs' own
    """

    terms: list[list[str]]
    weights: Array
    low: float
    high: float
    level: float

    def variance(self, inputs: Complex, names: Sequence[str]) -> Array:
        """(n,) over the level."""
        psi = evaluate_terms(inputs, term_columns(self.terms, names)).real
        return np.exp(np.clip(psi @ self.weights, self.low, self.high))


def _fit_noise(inputs: Complex, names: Sequence[str], squares: Array, learnt: Array) -> NoiseModel:
    """Likeliest for errors with these squares, of which the weights explain `learnt`."""
    terms = [[], *NOISE_TERMS]
    psi = evaluate_terms(inputs, term_columns(terms, names)).real
    scale = psi.std(axis=0)
    scale[0] = 1.0
    terms = [term for term, size in zip(terms, scale, strict=True) if size > 0]
    psi, scale = psi[:, scale > 0], scale[scale > 0]
    centre = np.append(0.0, psi[:, 1:].mean(axis=0))
    unit = (psi - centre) / scale

    def cost(b: Array) -> tuple[float, Array]:
        noise = np.exp(np.clip(unit @ b, -60.0, 60.0))
        total = noise + learnt
        slope = unit.T @ ((1.0 / total - squares / total**2) * noise)
        slope[1:] += 2.0 * PARAMS.noise_prior * b[1:]
        penalty = PARAMS.noise_prior * float(b[1:] @ b[1:])
        return float((np.log(total) + squares / total).sum()) + penalty, slope

    start = np.zeros(len(terms))
    start[0] = math.log(max(float(squares.mean()), 1e-300))
    b = minimize(cost, start, jac=True, method="L-BFGS-B").x
    logs = unit @ b
    level = float(logs.mean())
    weights = b / scale
    weights[0] = b[0] - float((b[1:] * centre[1:] / scale[1:]).sum()) - level
    return NoiseModel(terms, weights, float(logs.min()) - level, float(logs.max()) - level, math.exp(level))
