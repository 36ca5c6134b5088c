"""How likely the data are under a symmetric Gaussian process, and which settings make them likeliest.

Inputs are complex numbers x_k with a spin s_k: turn tip and touch together by t, and x_k is multiplied by
exp(i s_k t). The base kernel is a polynomial in a scalar product with one weight an input (automatic
relevance: what does not help gets weight 0),

    g(x, z) = Re sum_k w_k^2 x_k conj(z_k)           b(x, z) = a1 g + a2 g^2 + a3 g^3

and is made symmetric by its mean over turns R_t, and over the mirror, which takes x to conj(x):

    turning   k(x, z) = mean_t exp(i t) b(x, R_t z)               outputs x + i y that turn with the tip
    even      k(x, z) = mean_t b(x, R_t z) + b(x, conj(R_t z))    outputs that no turn and no mirror changes
    odd       k(x, z) = mean_t b(x, R_t z) - b(x, conj(R_t z))    outputs that change their sign in the mirror

A small part m1 g + m2 g^2 without symmetry takes up what rig and print break. An exponential of the distance
beside the polynomial gained nothing on the published recordings once the contact's place is an input (depth
0.066 against 0.067 mm, shear 0.72 mm and torsion 1.86 deg either way), and would need the data's points on
the edge.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.linalg import LinAlgError, cholesky
from scipy.linalg.lapack import dpotri, zpotri
from scipy.optimize import minimize

from edge.types import Array, Complex

__all__ = ["Likelihood", "LikelihoodParams", "Settings", "Symmetry", "fit_settings"]


class Symmetry(Enum):
    """How outputs behave when tip and touch are turned or mirrored together."""

    TURNING = "turning"
    EVEN = "even"
    ODD = "odd"


@dataclass(frozen=True, slots=True)
class LikelihoodParams:
    """Evidence: docs/tuning.md, "Fit by a Gaussian process"."""

    turns: int = 8  # in the mean: spins that differ by so many count as equal while settings are fitted
    rows_first: int = 200  # for each of the starts
    steps_first: int = 40
    rows: int = 480  # for the best of them; more change the settings by less than their own uncertainty
    steps: int = 60
    prior: float = 2e-4  # weight of squared logarithms of the settings against their start: keeps them finite
    bound: float = 12.0  # of those logarithms
    jitter: float = 1e-9  # of the output's variance: the least noise
    asymmetry: float = 0.02  # start of m1, m2


PARAMS = LikelihoodParams()
#: (scale of the weights, noise's share of the variance, a1, a2, a3): where the search starts.
STARTS = ((0.18, 1e-3, 1.0, 1.0, 1.0), (0.5, 0.02, 1.0, 0.3, 0.1))


@dataclass(frozen=True, slots=True)
class Settings:
    """What the likelihood decides.

    weight      (k,) w of each input
    symmetric   (3,) a1, a2, a3
    asymmetric  (3,) m1, m2, 0
    noise       variance, as the others in units of the outputs' own
    start       which of STARTS led there
    """

    weight: Array
    symmetric: Array
    asymmetric: Array
    noise: float
    start: int


class Likelihood:
    """Negative logarithm of the likelihood of (x, y), and its gradient in the settings' logarithms.

    x           (n, k) complex128, of unit mean square each
    spins       (k,) int
    y           (n,) complex128; real but for turning outputs
    asymmetric  whether the part without symmetry is there
    """

    def __init__(self, x: Complex, spins: Array, y: Complex, symmetry: Symmetry, *, asymmetric: bool) -> None:
        self._n, self._k = x.shape
        self._turning = symmetry is Symmetry.TURNING
        self._asymmetric = asymmetric
        self._y = y if self._turning else y.real
        self._x = np.hstack([x.real, x.imag])
        self._parts = [
            (np.hstack([z.real, z.imag]), factor, phase) for z, factor, phase in _parts(x, spins, symmetry)
        ]

    def settings(self, logs: Array, start: int = 0) -> Settings:
        """From what the search moves: logarithms of w, a1..a3, m1, m2, noise."""
        k, values = self._k, np.exp(logs)
        asymmetric = np.append(values[k + 3 : k + 5], 0.0) if self._asymmetric else np.zeros(3)
        return Settings(values[:k], values[k : k + 3], asymmetric, float(values[-1]), start)

    def __call__(self, logs: Array) -> tuple[float, Array]:
        s = self.settings(logs)
        scaled = self._x * np.tile(s.weight**2, 2)
        products = [scaled @ z.T for z, _, _ in self._parts]
        a, m = s.symmetric, s.asymmetric
        covariance = np.zeros((self._n, self._n), dtype=self._y.dtype)
        for g, (_, factor, phase) in zip(products, self._parts, strict=True):
            b = factor * (g * (a[0] + g * (a[1] + g * a[2])))
            covariance += phase * b if self._turning else b
        # Turns by t and by -t are each other's transposes: half of them are summed, twice.
        covariance = 0.5 * (covariance + covariance.conj().T)
        g = products[0]
        covariance += g * (m[0] + g * m[1])
        covariance[np.diag_indices(self._n)] += s.noise + PARAMS.jitter
        try:
            root = cholesky(covariance, lower=True, overwrite_a=True, check_finite=False)
        except LinAlgError:
            return 1e10, np.zeros_like(logs)
        log_det = 2.0 * float(np.log(np.diag(root).real).sum())
        inverse = (zpotri if self._turning else dpotri)(root, lower=1, overwrite_c=1)[0]
        inverse = np.tril(inverse)
        inverse += np.tril(inverse, -1).conj().T
        alpha = inverse @ self._y
        half = 1.0 if self._turning else 0.5
        value = half * (float((self._y.conj() @ alpha).real) + log_det)
        return value, self._gradient(s, half * (inverse - np.outer(alpha, alpha.conj())), products)

    def _gradient(self, s: Settings, slope: Complex, products: list[Array]) -> Array:
        """slope: of the value in the covariance."""
        k, a, m = self._k, s.symmetric, s.asymmetric
        of_weight, of_a, of_m = np.zeros(2 * k), np.zeros(3), np.zeros(2)
        for i, (g, (z, factor, phase)) in enumerate(zip(products, self._parts, strict=True)):
            q = factor * (slope.real * phase.real + slope.imag * phase.imag if self._turning else slope)
            g2 = g * g
            of_a += (q * g).sum(), (q * g2).sum(), (q * g2 * g).sum()
            p = q * (a[0] + 2.0 * a[1] * g + 3.0 * a[2] * g2)
            if i == 0 and self._asymmetric:
                of_m += (slope.real * g).sum(), (slope.real * g2).sum()
                p += slope.real * (m[0] + 2.0 * m[1] * g)
            of_weight += ((p @ z) * self._x).sum(axis=0)
        weight = 2.0 * s.weight**2 * (of_weight[:k] + of_weight[k:])
        noise = float(np.trace(slope).real) * s.noise
        return np.concatenate([weight, of_a * a, of_m * m[:2], [noise]])


def _parts(x: Complex, spins: Array, symmetry: Symmetry) -> Iterator[tuple[Complex, float, complex]]:
    """Turned (and mirrored) inputs, the share of each in the mean, and the phase of a turning output.

    Turns by t and -t stand for each other.
    """
    turns = PARAMS.turns
    for i in range(turns // 2 + 1):
        t = 2.0 * np.pi * i / turns
        twice = 1.0 if 2 * i in (0, turns) else 2.0
        yield x * np.exp(1j * spins * t), twice / turns, np.exp(1j * t)
    if symmetry is not Symmetry.TURNING:
        sign = 1.0 if symmetry is Symmetry.EVEN else -1.0
        for i in range(turns):
            yield (x * np.exp(2j * np.pi * spins * i / turns)).conj(), sign / turns, 1.0


def fit_settings(
    x: Complex,
    spins: Array,
    degrees: Array,
    y: Complex,
    symmetry: Symmetry,
    *,
    asymmetric: bool,
    start: int | None = None,
) -> Settings:
    """The settings of largest likelihood: several starts on part of the rows, the best one on more.

    degrees  (k,) of each input's polynomial: high ones start with a smaller weight
    start    the only one of STARTS, at once on more rows; None: all are tried
    """

    def search(first: Array, rows: int, steps: int) -> tuple[float, Array]:
        likelihood = Likelihood(x[:rows], spins, y[:rows], symmetry, asymmetric=asymmetric)

        def penalised(logs: Array) -> tuple[float, Array]:
            value, slope = likelihood(logs)
            off = logs - first
            return value + PARAMS.prior * float(off @ off), slope + 2.0 * PARAMS.prior * off

        bounds = [(-PARAMS.bound, PARAMS.bound)] * len(first)
        found = minimize(
            penalised, first, jac=True, method="L-BFGS-B", bounds=bounds,
            options={"maxiter": steps, "maxcor": 20},
        )  # fmt: skip
        return float(found.fun), found.x

    if start is None:
        tried = [search(_start(degrees, *one), PARAMS.rows_first, PARAMS.steps_first) for one in STARTS]
        start = min(range(len(tried)), key=lambda i: tried[i][0])
        best = tried[start][1]
    else:
        best = _start(degrees, *STARTS[start])
    best = search(best, PARAMS.rows, PARAMS.steps)[1]
    return Likelihood(x[:1], spins, y[:1], symmetry, asymmetric=asymmetric).settings(best, start)


def _start(degrees: Array, scale: float, noise: float, *symmetric: float) -> Array:
    asymmetric = [PARAMS.asymmetry] * 2
    start: Array = np.log(np.concatenate([scale * 0.7**degrees, symmetric, asymmetric, [noise]]))
    return start
