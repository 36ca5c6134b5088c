"""How likely the data are under a symmetric Gaussian process, and which settings make them likeliest.

Inputs are complex numbers x_k with a spin s_k: turn tip and touch together by t, and x_k is multiplied by
exp(i s_k t). The base kernel is a polynomial in a scalar product with one weight an input (automatic
relevance: what does not help gets weight 0),

    g(x, z) = Re sum_k w_k^2 x_k conj(z_k)           b(x, z) = a1 g + a2 g^2 + a3 g^3

and is made symmetric by its mean over turns R_t, and over the mirror, which takes x to conj(x):

    turning   k(x, z) = mean_t exp(i t) b(x, R_t z)               outputs x + i y that turn with the tip
    even      k(x, z) = mean_t b(x, R_t z) + b(x, conj(R_t z))    outputs that no turn and no mirror changes
    odd       k(x, z) = mean_t b(x, R_t z) - b(x, conj(R_t z))    outputs that change their sign in the mirror

A small part m1 g + m2 g^2 without symmetry takes up what rig and print break; of few poses m1 h + m2 g^2, h
the scalar product of the pins' own motion, as modes of few pins depend on each other. An exponential of the
distance beside the polynomial gained nothing on the published recordings once the contact's place is an input
(depth 0.066, not 0.067 mm; shear 0.72 mm, torsion 1.86 deg), and would need the data's points on the edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import partial

import numpy as np
from scipy.linalg import LinAlgError, block_diag, cho_solve, cholesky
from scipy.linalg.blas import dsyr, zher
from scipy.linalg.lapack import dpotri, zpotri
from scipy.optimize import minimize

from calib.ridge import blocks
from edge.types import Array, Complex, Index


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
    rows: int = 480  # for the best of them; more change the settings by less than their own uncertainty
    steps: int = 40  # of both: more change no error by 1 %
    prior: float = 2e-4  # weight of squared logarithms of the settings against their start: keeps them finite
    bound: float = 12.0  # of those logarithms
    jitter: float = 1e-9  # of the output's variance: the least noise
    asymmetry: float = 0.02  # start of m1, m2


PARAMS = LikelihoodParams()
ROWS = 32  # at a time: the matrices of all turns take a megabyte
#: (scale of the weights, noise's share of the variance, a1, a2, a3): where the search starts.
STARTS = ((0.18, 1e-3, 1.0, 1.0, 1.0), (0.5, 0.02, 1.0, 0.3, 0.1))


@dataclass(frozen=True, slots=True)
class Settings:
    """The choices that the likelihood decides.

    weight      (k,) w of each input
    symmetric   (3,) a1, a2, a3
    asymmetric  (3,) m1, m2, 0; plain: m1 if it is of h, which is 0 there then
    noise       variance, as the others in units of the outputs' own
    start       which of STARTS led there
    """

    weight: Array
    symmetric: Array
    asymmetric: Array
    plain: float
    noise: float
    start: int


@dataclass(frozen=True, slots=True)
class Repeats:
    """How frames of one pose share their noise: all of it is their mean's, but for this variance.

    pose  (n,) its number
    own   variance of a frame about the mean of its pose; no setting, because a truth that is the same in all
          frames of a pose says nothing of it
    """

    pose: Index
    own: float

    @classmethod
    def none(cls, n: int) -> Repeats:
        return cls(np.arange(n, dtype=np.int32), 0.0)

    def first(self, rows: int) -> Repeats:
        return Repeats(self.pose[:rows], self.own)

    def noise(self) -> tuple[Array, Array]:
        """(n, n) covariance of unit noise of the poses; and of the frames about their poses' means."""
        alike = (self.pose[:, None] == self.pose).astype(np.float64)
        return alike, self.own * (np.eye(len(alike)) - alike / alike.sum(axis=1))


class Likelihood:
    """Negative logarithm of the likelihood of (x, y), and its gradient in the settings' logarithms.

    x           (n, k) complex128, of unit mean square each
    spins       (k,) int
    y           (n,) complex128; real but for turning outputs
    asymmetric  whether the part without symmetry is there
    repeats     how frames of one pose share their noise; None: none does
    plain       h of these rows, or of more behind them; None: m1 is of g

    Matrices of all turns are computed for some rows at a time, which a processor's cache holds, and up to
    the diagonal only. A scalar product g = u + v is the sum of two halves, of which one changes its sign in
    the mirror (the imaginary parts), or by half a turn (odd spins): both products come from the same halves.
    Their powers are added, or subtracted if the output changes its sign too:

        (u + v)^n + (u - v)^n = 2 u,  2 (u^2 + v^2),  2 u (u^2 + 3 v^2)
        (u + v)^n - (u - v)^n = 2 v,  4 u v,          2 v (v^2 + 3 u^2)

    The half that stands alone at n = 1 is called `even` below, the other one `odd`.
    """

    def __init__(
        self,
        x: Complex,
        spins: Array,
        y: Complex,
        symmetry: Symmetry,
        *,
        asymmetric: bool,
        repeats: Repeats | None = None,
        plain: Array | None = None,
    ) -> None:
        self._n, self._k = x.shape
        self._plain = plain
        self._alike, self._own = (np.tril(part) for part in (repeats or Repeats.none(self._n)).noise())
        self._turning = symmetry is Symmetry.TURNING
        self._asymmetric = asymmetric
        self._y = y if self._turning else y.real
        angles = 2.0 * np.pi / PARAMS.turns * np.arange(PARAMS.turns // (1 + self._turning))
        turned = _parts(x * np.exp(1j * angles[:, None, None] * spins))
        odd = np.tile(spins % 2 == 0, 2) if self._turning else np.arange(2 * self._k) >= self._k
        self._added = symmetry is Symmetry.EVEN
        if symmetry is Symmetry.ODD:
            odd = ~odd
        self._halves = [(half, _parts(x)[:, half], turned[..., half]) for half in (~odd, odd)]
        phases = [np.cos(angles), np.sin(angles)] if self._turning else [np.ones(len(angles))]
        self._phases = 2.0 / PARAMS.turns * np.stack(phases)
        # Kept from call to call: fresh memory would cost as much time as the numbers in it.
        self._covariance = np.zeros((self._n, self._n), dtype=self._y.dtype, order="F")
        self._blocks = [_Block.empty(rows, *self._phases.shape[::-1]) for rows in blocks(self._n, ROWS)]

    def settings(self, logs: Array, start: int = 0) -> Settings:
        """The settings from what the search moves: logarithms of w, a1..a3, m1, m2, noise."""
        k, values = self._k, np.exp(logs)
        asymmetric = np.append(values[k + 3 : k + 5], 0.0) if self._asymmetric else np.zeros(3)
        plain, asymmetric[0] = (0.0, asymmetric[0]) if self._plain is None else (asymmetric[0], 0.0)
        return Settings(values[:k], values[k : k + 3], asymmetric, plain, float(values[-1]), start)

    def __call__(self, logs: Array) -> tuple[float, Array]:
        s = self.settings(logs)
        covariance = self._covariance
        for block in self._blocks:
            self._fill(block, s)
            part = np.tensordot(s.symmetric, block.powers, 1)
            g = block.even[0] + block.odd[0]
            part[0] += g * (s.asymmetric[0] + g * s.asymmetric[1])
            if self._plain is not None:
                part[0] += s.plain * self._plain[block.rows, : block.rows.stop]
            covariance[block.rows, : block.rows.stop] = part[0] + 1j * part[1] if self._turning else part[0]
        covariance += s.noise * self._alike + self._own
        covariance[np.diag_indices(self._n)] += PARAMS.jitter
        try:  # in place, and up to the diagonal; zeros beyond it
            root = cholesky(covariance, lower=True, overwrite_a=True, check_finite=False)
        except LinAlgError:
            return 1e10, np.zeros_like(logs)
        alpha = cho_solve((root, True), self._y, check_finite=False)
        half = 1.0 if self._turning else 0.5
        value = half * (float((self._y.conj() @ alpha).real) + 2.0 * float(np.log(np.diag(root).real).sum()))
        inverse = (zpotri if self._turning else dpotri)(root, lower=1, overwrite_c=1)[0]
        slope = (zher if self._turning else dsyr)(-1.0, alpha, a=inverse, lower=1, overwrite_a=1)
        slope *= half
        return value, self._gradient(s, slope)

    def _fill(self, block: _Block, s: Settings) -> None:
        weight = np.tile(s.weight**2, 2)
        for products, (half, x, turned) in zip((block.even, block.odd), self._halves, strict=True):
            z = turned[:, : block.rows.stop].transpose(0, 2, 1)
            np.matmul(x[block.rows] * weight[half], z, out=products)
        even, odd = block.even, block.odd
        squares, other = even * even, odd * odd
        second = squares + other if self._added else 2.0 * even * odd
        other *= 3.0
        other += squares
        other *= even
        for mean, power in zip(block.powers, (even, second, other), strict=True):
            mean[:] = np.tensordot(self._phases, power, 1)

    def _gradient(self, s: Settings, slope: Complex) -> Array:
        """slope: of the value in the covariance, up to the diagonal."""
        k, a, m = self._k, s.symmetric, s.asymmetric
        slope *= 2.0  # what is beyond the diagonal counts alike
        slope[np.diag_indices(self._n)] /= 2.0
        noise = float((slope.real * self._alike).sum()) * s.noise
        of_weight, of_a, of_m = np.zeros(2 * k), np.zeros(3), np.zeros(2)
        for block in self._blocks:
            here, even, odd = slope[block.rows, : block.rows.stop], block.even, block.odd
            parts = np.stack([here.real, here.imag] if self._turning else [here])
            of_a += np.tensordot(block.powers, parts, 3)
            of_even = even * even
            of_even += odd * odd
            of_even *= 3.0 * a[2]
            of_even += 2.0 * a[1] * (even if self._added else odd)
            of_even += a[0]
            of_odd = 6.0 * a[2] * even
            of_odd *= odd
            of_odd += 2.0 * a[1] * (odd if self._added else even)
            q = np.tensordot(self._phases.T, parts, 1) if self._turning else self._phases[0, 0] * parts
            of_even *= q
            of_odd *= q
            if self._asymmetric:
                g = even[0] + odd[0]
                linear = g if self._plain is None else self._plain[block.rows, : block.rows.stop]
                of_m += (parts[0] * linear).sum(), (parts[0] * g * g).sum()
                unturned = parts[0] * (m[0] + 2.0 * m[1] * g)
                of_even[0] += unturned
                of_odd[0] += unturned
            for p, (half, x, turned) in zip((of_even, of_odd), self._halves, strict=True):
                along = (p @ turned[:, : block.rows.stop]).sum(axis=0)
                of_weight[half] += (along * x[block.rows]).sum(axis=0)
        weight = 2.0 * s.weight**2 * (of_weight[:k] + of_weight[k:])
        return np.concatenate([weight, of_a * a, of_m * (m[0] + s.plain, m[1]), [noise]])


@dataclass(frozen=True, slots=True)
class _Block:
    """Some rows of the kernel, up to the diagonal.

    even, odd  (turns, rows, columns) halves of the scalar products
    powers     (3, 1 or 2, rows, columns) means of their powers, of a turning output the imaginary part too
    """

    rows: slice
    even: Array
    odd: Array
    powers: Array

    @classmethod
    def empty(cls, rows: slice, turns: int, parts: int) -> _Block:
        size = rows.stop - rows.start, rows.stop
        return cls(rows, np.empty((turns, *size)), np.empty((turns, *size)), np.empty((3, parts, *size)))


def _parts(z: Complex) -> Array:
    return np.concatenate([z.real, z.imag], axis=-1)


def fit_settings(
    x: Complex,
    spins: Array,
    degrees: Array,
    y: Complex,
    symmetry: Symmetry,
    *,
    asymmetric: bool,
    few: bool = False,
    repeats: Repeats | None = None,
    start: int | None = None,
    plain: Array | None = None,
) -> Settings:
    """The settings of largest likelihood: several starts on part of the rows, the best one on more.

    degrees  (k,) of each input's polynomial: high ones start with a smaller weight; 0: it is in none
    few      the data do not decide each weight: those of the polynomials move together, more or less with
             their degree, and so do the others
    repeats  how frames of one pose share their noise; None: none does
    start    the only one of STARTS, at once on more rows; None: all are tried
    plain    (n, n) h; None: m1 is of g
    """
    mode = degrees > 0
    together = np.column_stack([mode, degrees / max(1.0, degrees.max()), ~mode])
    ways = block_diag(together if few else np.eye(len(degrees)), np.eye(6))  # that logarithms may move

    of_rows = partial(Likelihood, spins=spins, symmetry=symmetry, asymmetric=asymmetric, plain=plain)

    def search(first: Array, rows: int) -> tuple[float, Array]:
        likelihood = of_rows(x[:rows], y=y[:rows], repeats=repeats and repeats.first(rows))

        def penalised(moved: Array) -> tuple[float, Array]:
            value, slope = likelihood(first + ways @ moved)
            return value + PARAMS.prior * float(moved @ moved), slope @ ways + 2.0 * PARAMS.prior * moved

        bounds = [(-PARAMS.bound, PARAMS.bound)] * ways.shape[1]
        found = minimize(
            penalised, np.zeros(ways.shape[1]), jac=True, method="L-BFGS-B", bounds=bounds,
            options={"maxiter": PARAMS.steps, "maxcor": 20},
        )  # fmt: skip
        return float(found.fun), first + ways @ found.x

    if start is None:
        tried = [search(_start(degrees, *one), PARAMS.rows_first) for one in STARTS]
        start = min(range(len(tried)), key=lambda i: tried[i][0])
        best = tried[start][1]
    else:
        best = _start(degrees, *STARTS[start])
    best = search(best, PARAMS.rows)[1]
    return of_rows(x[:1], y=y[:1]).settings(best, start)


def _start(degrees: Array, scale: float, noise: float, *symmetric: float) -> Array:
    asymmetric = [PARAMS.asymmetry] * 2
    weights = scale * 0.7 ** np.maximum(1.0, degrees)
    start: Array = np.log(np.concatenate([weights, symmetric, asymmetric, [noise]]))
    return start
