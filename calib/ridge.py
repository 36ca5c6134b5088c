"""Ridge regression on the terms of a polynomial, evaluated by grouped cross-validation.

A rig shows the tip under ideal conditions; in use pins are lost, dazzled or predicted. So the change of the
terms when every pin is off by `FitParams.pin_noise` is computed too, and weights that amplify it are
penalised as much as errors are. A plain ridge, which uses the size of the terms only, picks products of modes
that explain clean frames well and others badly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib.fit_params import PARAMS
from calib.terms import evaluate_terms
from edge.calibration.inputs import FRAME_INPUTS
from edge.types import Array, Complex, Index


@dataclass(frozen=True, slots=True)
class Candidate:
    """One model that was tried: its size, and its rms error on held-out frames with its standard error."""

    name: str
    n_terms: int
    rms: float
    rms_error: float
    ridge: float


ROWS = 256  # frames at a time: a megabyte or two for some hundred terms
#: Penalties on the squares of the weights of terms of unit mean square.
RIDGES = tuple(10.0 ** (k / 2) for k in range(-8, 7))


@dataclass(frozen=True, slots=True)
class InputNoise:
    """Errors that the inputs of each frame may have, the same from run to run, made on demand.

    size         (frames, inputs), of all frames
    coefficient  rms of a mode's coefficient, in the inputs' unit; the terms of a basis that is orthonormal
                 over the pins are off independently of each other
    rows         (n,) the frames that it is wanted for
    """

    size: tuple[int, int]
    coefficient: float
    rows: Index

    def draws(self) -> Complex:
        """(draws, n, inputs) complex128."""
        shape = (PARAMS.noise_draws, *self.size, 2)
        pairs = np.random.default_rng(0).standard_normal(shape) * (self.coefficient / np.sqrt(2))
        noise: Complex = pairs.view(np.complex128)[..., 0]
        for name in ("volume", "p", "peak", "size", "gap", "gap_place"):  # not the modes' noise
            noise[..., FRAME_INPUTS.index(name)] = 0.0
        noise[..., FRAME_INPUTS.index("shear")] = noise[..., FRAME_INPUTS.index("c00")]
        return noise if len(self.rows) == self.size[0] else noise[:, self.rows]


@dataclass(frozen=True, slots=True)
class Terms:
    """Products of inputs, evaluated for some rows at a time: the memory does not grow with the frames.

    inputs   (n, k) complex128
    noise    (draws, n, k) complex128, possible errors of the inputs; None: not considered
    columns  of each term, of `term_columns`
    real     of a real output Re(psi w) = Re psi Re w - Im psi Im w: columns for both
    share    (n,) what each row counts, of `share_of_pose`; None: 1
    """

    inputs: Complex
    noise: Complex | None
    columns: list[list[int]]
    real: bool
    share: Array | None = None

    @property
    def counts(self) -> Array:
        """(n,) what each row counts."""
        return np.ones(len(self.inputs)) if self.share is None else self.share

    def rows(self, rows: Any, scale: Array | float = 1.0) -> Any:
        """(rows, terms, or twice as many) values over the scale."""
        return self._split(evaluate_terms(self.inputs[rows], self.columns)) / scale

    def sums(self, y: Complex) -> _Sums:
        """Sums over the rows, of terms of unit mean square."""
        size = len(self.columns) * (1 + self.real)
        draws = np.empty((0, *self.inputs.shape), np.complex128) if self.noise is None else self.noise
        kind = np.float64 if self.real else np.complex128
        gram, noise = np.zeros((size, size), kind), np.zeros((size, size), kind)
        right = np.zeros((size, y.shape[1]), kind)
        counts = self.counts[:, None]
        for rows in blocks(len(self.inputs)):
            a = self.rows(rows)
            left = (a * counts[rows]).conj().T
            gram += left @ a
            right += left @ (y[rows].real if self.real else y[rows])
            for d in draws[:, rows]:
                above, below = (evaluate_terms(self.inputs[rows] + e, self.columns) for e in (d, -d))
                off = self._split(above - below)
                noise += (off * counts[rows]).conj().T @ off / (4.0 * len(draws))
        power = np.diag(gram).real.reshape(1 + self.real, -1).sum(axis=0)
        scale = np.tile(np.sqrt(power / counts.sum()), 1 + self.real)
        scale[scale < 1e-14] = np.inf  # a term that never occurs gets weight 0
        square = np.outer(scale, scale)
        return _Sums(scale, gram / square, noise / square, right / scale[:, None])

    def _split(self, psi: Complex) -> Any:
        return np.hstack([psi.real, -psi.imag]) if self.real else psi


@dataclass(frozen=True, slots=True)
class _Sums:
    """scale of the terms; gram, noise (terms, terms); right (terms, outputs) with the truth."""

    scale: Array
    gram: Any
    noise: Any
    right: Any

    def directions(self) -> tuple[Array, Any]:
        """(terms,) squared sizes of the terms' independent directions with noise, and these as columns.

        Penalties from 1e-4 of a row up keep the squared condition number harmless.
        """
        e, v = np.linalg.eigh(self.gram + self.noise)
        return np.maximum(e, 0.0), v


def blocks(n: int, most: int = ROWS) -> Iterator[slice]:
    """Some rows of n at a time."""
    return (slice(start, min(n, start + most)) for start in range(0, n, most))


def cross_validate(name: str, terms: Terms, y: Complex, fold: Index) -> list[tuple[Candidate, Complex]]:
    """Held-out predictions with the best ridge, and their error, for each column of y.

    The error is that of the frame as it is, and that of the terms' noise on top.

    The normal matrix of all rows is computed once; that of a fold is this less its own rows. One eigenvalue
    decomposition then serves every ridge and every column.
    """
    sums = terms.sums(y)
    target: Any = y.real if terms.real else y
    counts = terms.counts
    predicted = np.zeros((len(RIDGES), *y.shape), dtype=target.dtype)
    blown_up = np.zeros((len(RIDGES), y.shape[1]))
    folds = int(fold.max()) + 1
    for k in range(folds):
        test = terms.rows(fold == k, sums.scale)
        left = (test * counts[fold == k, None]).conj().T
        e, v = replace(sums, gram=sums.gram - left @ test).directions()
        along, coordinates = test @ v, v.conj().T @ (sums.right - left @ target[fold == k])
        noise_along = v.conj().T @ sums.noise @ v
        for r, ridge in enumerate(RIDGES):
            w = coordinates / (e + ridge)[:, None]
            predicted[r, fold == k] = along @ w
            blown_up[r] += (w.conj() * (noise_along @ w)).sum(axis=0).real / (folds * counts.sum())
    squares = np.abs(predicted - y) ** 2
    found = []
    for j, means in enumerate((np.average(squares, axis=1, weights=counts) + blown_up).T):
        r = int(np.argmin(means))
        candidate = as_candidate(
            name, len(terms.columns), squares[r, :, j], counts, blown_up[r, j], RIDGES[r]
        )
        found.append((candidate, predicted[r, :, j].copy()))  # not all ridges'
    return found


def as_candidate(
    name: str, n_terms: int, squares: Array, counts: Array, noise: float, ridge: float = 0.0
) -> Candidate:
    """Estimates from the squares of held-out errors, and what noise of the inputs adds to their mean."""
    mean = np.average(squares, weights=counts)
    rms = float(np.sqrt(mean + noise))
    # Standard error of a root of a mean of squares, by the delta method.
    deviation = np.sqrt(np.average((squares - mean) ** 2, weights=counts))
    error = float(deviation / np.sqrt(counts.sum()) / (2 * rms)) if rms else 0.0
    return Candidate(name, n_terms, rms, error, ridge)


def cross_validated_terms(psi: Complex, y: Complex, poses: Array) -> Complex:
    """Prediction of each row by a ridge model of these terms fitted without its pose.

    psi      (n, n_terms), of `evaluate_terms`
    y        (n,) complex truth, x + i y
    poses    (n, any): equal rows stay together
    Returns  (n,) complex128
    """
    terms = Terms(psi, None, [[i] for i in range(psi.shape[1])], real=False)
    return cross_validate("", terms, y[:, None], folds_of(poses))[0][1]


def ridge_weights(terms: Terms, y: Complex, ridge: float) -> Complex:
    """(terms,) ridge weights: rows of noise have the target 0."""
    sums = terms.sums(y[:, None])
    e, v = sums.directions()
    w: Any = v @ ((v.conj().T @ sums.right[:, 0]) / (e + ridge)) / sums.scale
    n = len(terms.columns)
    result: Complex = w[:n] + 1j * w[n:] if terms.real else w
    return result


def spread_factor(terms: Terms, ridge: float) -> Complex:
    """Factor L with |L psi|^2 = psi^H (A^H A + noise + ridge)^-1 psi: largest directions, (r, n_terms)."""
    sums = replace(terms, real=False).sums(np.empty((len(terms.inputs), 0), np.complex128))
    e, v = sums.directions()
    # How much each direction matters for frames like these, its variance times its uncertainty, grows with e.
    rows = slice(0, PARAMS.spread_rows)
    result: Complex = v.conj().T[rows] / np.sqrt(e[rows] + ridge)[:, None] / sums.scale
    return result


def folds_of(poses: Array) -> Index:
    """Fold of each row; equal poses share one. Deterministic: poses are dealt out in a fixed random order.

    Poses count in the order of their first rows, so that a table in other axes has the same folds. Of few
    poses that repeat, each is a fold: without several of them a model errs more than one of all.
    """
    group = pose_numbers(poses)
    order = np.random.default_rng(0).permutation(int(group.max(initial=0)) + 1)
    few = len(order) < min(len(group), 2 * PARAMS.process_rows_min)
    folds = len(order) if few else min(PARAMS.folds, len(order))
    return np.asarray(order[group] % folds, dtype=np.int32)


def pose_numbers(poses: Array) -> Index:
    """(n,) number of each row's pose, in the order of their first rows; equal rows share one."""
    _, first, pose = np.unique(poses, axis=0, return_index=True, return_inverse=True)
    number = np.empty(len(first), dtype=np.int32)
    number[np.argsort(first)] = np.arange(len(first))
    return number[pose.ravel()]


def share_of_pose(pose: Index) -> Array:
    """(n,) what each row counts: those of one pose 1 together, because they share what set it apart."""
    return np.asarray(1.0 / np.bincount(pose)[pose])


def error_of_mean(values: Array, share: Array) -> float:
    """Standard error of the mean of values (n,) of which each counts its share."""
    off = values - np.average(values, weights=share)
    return float(np.sqrt(np.average(off**2, weights=share) / share.sum()))


def rounded(value: float, digits: int = 6) -> float:
    """A number with so many significant digits: what the data supports, and a smaller file."""
    return float(f"{value:.{digits}g}")
