"""Ridge regression on the terms of a polynomial, evaluated by grouped cross-validation.

A rig shows the tip under ideal conditions; in use pins are lost, dazzled or predicted. So the change of the
terms when every pin is off by `FitParams.pin_noise` is computed too, and weights that amplify it are
penalised as much as errors are. A plain ridge, which uses the size of the terms only, picks products of modes
that explain clean frames well and others badly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.fit_params import PARAMS
from edge.calibration.inputs import FRAME_INPUTS, evaluate_terms
from edge.types import Array, Complex, Index

__all__ = [
    "Candidate",
    "cross_validate",
    "cross_validated_terms",
    "folds_of",
    "input_noise",
    "pose_numbers",
    "ridge_weights",
    "rounded",
    "spread_factor",
    "term_values",
]


@dataclass(frozen=True, slots=True)
class Candidate:
    """One model that was tried: its size, and its rms error on held-out frames with its standard error."""

    name: str
    n_terms: int
    rms: float
    rms_error: float
    ridge: float


#: Penalties on the squares of the weights of terms of unit mean square.
RIDGES = tuple(10.0 ** (k / 2) for k in range(-8, 7))


def input_noise(inputs: Complex, coefficient: float) -> Complex:
    """Errors that the inputs of each frame may have: (draws, frames, inputs), the same from run to run.

    coefficient  rms of a mode's coefficient, in the inputs' unit; the terms of a basis that is orthonormal
                 over the pins are off independently of each other
    """
    shape = (PARAMS.noise_draws, *inputs.shape, 2)
    pairs = np.random.default_rng(0).standard_normal(shape) * (coefficient / np.sqrt(2))
    noise: Complex = pairs.view(np.complex128)[..., 0]
    for name in (
        "volume",
        "p",
        "peak",
        "size",
        "gap",
        "gap_place",
    ):  # not the modes' noise
        noise[..., FRAME_INPUTS.index(name)] = 0.0
    noise[..., FRAME_INPUTS.index("shear")] = noise[..., FRAME_INPUTS.index("c00")]
    return noise


def term_values(inputs: Complex, noise: Complex | None, columns: list[list[int]]) -> tuple[Complex, Complex]:
    """The terms of each frame (n, n_terms), and their change by the noise (draws * n, n_terms)."""
    psi = evaluate_terms(inputs, columns)
    if noise is None:
        return psi, psi[:0]
    off = [evaluate_terms(inputs + d, columns) - evaluate_terms(inputs - d, columns) for d in noise]
    return psi, np.concatenate(off) / (2.0 * np.sqrt(len(noise)))


def cross_validate(
    name: str, psi: Complex, moved: Complex, y: Complex, fold: Index, *, real: bool
) -> list[tuple[Candidate, Complex]]:
    """Held-out predictions with the best ridge, and their error, for each column of y.

    The error is that of the frame as it is, and that of the noise `moved` on top.

    The normal matrix of all rows is computed once; that of a fold is this less its own rows. One eigenvalue
    decomposition then serves every ridge and every column: penalties from 1e-4 of a row up keep the
    squared condition number harmless.
    """
    a, off = _scaled(psi, moved, real=real)[:2]
    target: Any = y.real if real else y
    noise = off.conj().T @ off
    gram, right = a.conj().T @ a, a.conj().T @ target
    predicted = np.zeros((len(RIDGES), *y.shape), dtype=np.complex128)
    blown_up = np.zeros((len(RIDGES), y.shape[1]))
    folds = int(fold.max()) + 1
    for k in range(folds):
        test = a[fold == k]
        left = test.conj().T
        e, v = np.linalg.eigh(gram - left @ test + noise)
        along, coordinates = test @ v, v.conj().T @ (right - left @ target[fold == k])
        noise_along = v.conj().T @ noise @ v
        for r, ridge in enumerate(RIDGES):
            w = coordinates / (np.maximum(e, 0.0) + ridge)[:, None]
            predicted[r, fold == k] = along @ w
            blown_up[r] += (w.conj() * (noise_along @ w)).sum(axis=0).real / (folds * len(y))
    squares = np.abs(predicted - y) ** 2
    found = []
    for j, means in enumerate((squares.mean(axis=1) + blown_up).T):
        r = int(np.argmin(means))
        rms = float(np.sqrt(means[r]))
        # Standard error of a root of a mean of squares, by the delta method.
        error = float(squares[r, :, j].std() / np.sqrt(len(y)) / (2 * rms)) if rms else 0.0
        found.append((Candidate(name, psi.shape[1], rms, error, RIDGES[r]), predicted[r, :, j]))
    return found


def cross_validated_terms(psi: Complex, y: Complex, poses: Array) -> Complex:
    """Prediction of each row by a ridge model of these terms fitted without its pose.

    psi      (n, n_terms), of `evaluate_terms`
    y        (n,) complex truth, x + i y
    poses    (n, any): equal rows stay together
    Returns  (n,) complex128
    """
    return cross_validate("", psi, psi[:0], y[:, None], folds_of(poses), real=False)[0][1]


def _scaled(psi: Complex, moved: Complex, *, real: bool) -> tuple[Any, Any, Array]:
    """Terms of unit mean square, their noise in the same measure, and the scale.

    For a real output Re(psi w) = Re psi Re w - Im psi Im w: columns for both.
    """
    scale: Array = np.sqrt((np.abs(psi) ** 2).mean(axis=0))
    scale[scale < 1e-14] = np.inf  # a term that never occurs gets weight 0
    a, off = psi / scale, moved / scale
    if real:
        return np.hstack([a.real, -a.imag]), np.hstack([off.real, -off.imag]), scale
    return a, off, scale


def ridge_weights(psi: Complex, moved: Complex, y: Complex, ridge: float, *, real: bool) -> Complex:
    """Ridge weights of scaled terms: rows of noise have the target 0."""
    a, off, scale = _scaled(psi, moved, real=real)
    u, s, vh = np.linalg.svd(np.concatenate([a, off]), full_matrices=False)
    w: Any = vh.conj().T @ (s / (s**2 + ridge) * (u[: len(a)].conj().T @ (y.real if real else y)))
    result: Complex = (w[: len(scale)] + 1j * w[len(scale) :] if real else w) / scale
    return result


def spread_factor(psi: Complex, moved: Complex, ridge: float) -> Complex:
    """Factor L with |L psi|^2 = psi^H (A^H A + noise + ridge)^-1 psi: largest directions, (r, n_terms)."""
    a, off, scale = _scaled(psi, moved, real=False)
    _, s, vh = np.linalg.svd(np.concatenate([a, off]), full_matrices=False)
    root = 1.0 / np.sqrt(s**2 + ridge)
    # How much each direction matters for frames like these: its variance times its uncertainty.
    rows = np.argsort(-root * s)[-PARAMS.spread_rows :] if len(s) > PARAMS.spread_rows else np.arange(len(s))
    result: Complex = root[rows, None] * vh[rows] / scale
    return result


def folds_of(poses: Array) -> Index:
    """Fold of each row; equal poses share one. Deterministic: poses are dealt out in a fixed random order.

    Poses count in the order of their first rows, so that a table in other axes has the same folds.
    """
    group = pose_numbers(poses)
    order = np.random.default_rng(0).permutation(int(group.max(initial=0)) + 1)
    return np.asarray(order[group] % min(PARAMS.folds, len(order)), dtype=np.int32)


def pose_numbers(poses: Array) -> Index:
    """(n,) number of each row's pose, in the order of their first rows; equal rows share one."""
    _, first, pose = np.unique(poses, axis=0, return_index=True, return_inverse=True)
    number = np.empty(len(first), dtype=np.int32)
    number[np.argsort(first)] = np.arange(len(first))
    return number[pose.ravel()]


def rounded(value: float, digits: int = 6) -> float:
    """A number with so many significant digits: what the data supports, and a smaller file."""
    return float(f"{value:.{digits}g}")
