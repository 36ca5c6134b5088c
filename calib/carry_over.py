"""A calibration of one tip tells of another one: its models are the prior of the other tip's.

Inputs are modes of motion over the tip's radius, so that they mean the same on both, whatever the number and
the places of the pins. What differs (gel, dome, lens) changes the first tip's weights m to

    w = u m + c + s u m + sum_k l_k n_k u m + e |m| + o

    u    turns the outputs of two into the other rig's axes, so that they fit best; the sign of one that a
         mirror changes
    c    an offset
    s    one share for all: the values grow or shrink
    l_k  a share for each input, as often (n_k) as it is a factor of the term: it is seen on another scale
    e    of each weight on its own, in proportion to its size
    o    what the frames of the first tip left open

Each kind of change has one variance (that of o is known), which is the likeliest for the new tip's frames;
ten frames are enough for so few numbers. All changes are linear, so the result is a process with the same
terms as any other, and the first tip's file is no longer needed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
from scipy.linalg import LinAlgError, cho_solve, cholesky
from scipy.optimize import minimize

from calib.designs import GROUPS
from calib.process_likelihood import Repeats, Symmetry
from calib.process_noise import NoiseModel
from calib.terms import frame_terms
from edge.calibration.file import CalibrationFile, Lost, Polynomial, Process
from edge.calibration.inputs import MODES
from edge.types import Array, Complex


@dataclass(frozen=True, slots=True)
class CarryParams:
    """Evidence: docs/tuning.md, "Another tip"."""

    change: float = 0.05  # variance of each kind of change where the search for it starts, a share
    prior: float = 0.01  # weight of squared logarithms of the variances against their start
    bound: float = 12.0  # of those logarithms
    rows: int = 480  # frames that variances are fitted to
    jitter: float = 1e-9  # of the output's variance: the least noise


PARAMS = CarryParams()
SPINS = {name: 1 - int(name[1]) + int(name[2]) for name in MODES} | {"shear": 1, "p": 1, "gap_place": 1}


@dataclass(frozen=True, slots=True)
class KnownModel:
    """A model of another tip. Units: the outputs' own.

    terms      input names; the first is [], the constant
    weights    (terms,) complex128
    open_rows  (rows, terms) complex128: |row . terms|^2, summed, is the variance of each output that its
             frames left open
    sigma      of each output, root of the mean square
    noise      along the value; across it, None: the same; both None: not known
    lost       what lost pins add to the variance, over sigma^2; None: not known
    valid      [low, high] of each output
    """

    terms: list[list[str]]
    weights: Complex
    open_rows: Complex
    sigma: float
    noise: NoiseModel | None
    across: NoiseModel | None
    lost: Lost | None
    valid: list[tuple[float, float]]

    def values(self, inputs: Complex) -> Complex:
        """(n,) complex128; of one output its real part counts."""
        result: Complex = frame_terms(inputs, self.terms) @ self.weights
        return result

    def in_the_image(self, inputs: Complex) -> KnownModel:
        """The same, turning with the image: mirrored if the first rig's axes were, as spins of terms show.

        inputs  (n, k) complex128, columns `FRAME_INPUTS`: what the size of the terms is taken from
        """
        size = np.abs(frame_terms(inputs, self.terms)) ** 2
        power = size.mean(axis=0) * np.abs(self.weights) ** 2
        spins = np.array([_spin_of(term) for term in self.terms])
        if power[spins == 1].sum() >= power[spins == -1].sum():
            return self
        terms = [[name[:-1] if name.endswith("*") else f"{name}*" for name in term] for term in self.terms]
        return replace(self, terms=terms, weights=self.weights.conj(), open_rows=self.open_rows.conj())

    def scaled(self, unit: float, offset: float) -> KnownModel:
        """The values in units of `unit`, counted from `offset`."""
        weights = self.weights / unit
        weights[0] -= offset / unit
        along, across = (one and one.over(unit**2) for one in (self.noise, self.across))
        rows, sigma = self.open_rows / unit, self.sigma / unit
        return replace(self, weights=weights, open_rows=rows, sigma=sigma, noise=along, across=across)

    def lost_over(self, sigma: float) -> Lost | None:
        """The variance that lost pins add, over the square of another sigma."""
        if self.lost is None:
            return None
        return msgspec.structs.replace(self.lost, scale=self.lost.scale + 2.0 * math.log(self.sigma / sigma))


def known_models(content: CalibrationFile) -> dict[tuple[str, ...], KnownModel]:
    """The models of a frame's values by outputs that are linear in weights, thus not curves."""
    known = {}
    for group in GROUPS:
        for model in content.models:
            if not isinstance(model, Polynomial | Process) or tuple(model.outputs) != group.outputs:
                continue
            if not group.of_contact:
                known[group.outputs] = _known(model)
    return known


def _known(model: Polynomial | Process) -> KnownModel:
    rows = model.spread if isinstance(model, Polynomial) else model.factor
    sigma = math.sqrt(float(np.mean(np.square(model.sigma))))
    terms, weights = list(model.terms), _complex(model.weights)
    open_rows = sigma * np.array([_complex(row) for row in rows], np.complex128).reshape(-1, len(terms))
    if [] not in terms:
        terms, weights = [[], *terms], np.insert(weights, 0, 0.0)
        open_rows = np.insert(open_rows, 0, 0.0, axis=1)
    order = sorted(range(len(terms)), key=lambda i: terms[i] != [])  # stable: the constant first
    along = across = lost = None
    if isinstance(model, Process):
        lost = model.lost
        along = _noise(model.noise_terms, model.noise_weights, model.noise_range, sigma)
        across = _noise(model.noise_terms, model.across_weights, model.across_range, sigma)
    return KnownModel(
        [terms[i] for i in order],
        weights[order],
        open_rows[:, order],
        sigma,
        along,
        across,
        lost,
        model.valid,
    )


def _complex(row: Sequence[tuple[float, float]]) -> Complex:
    return np.array([complex(re, im) for re, im in row], dtype=np.complex128)


def _noise(
    terms: list[list[str]], weights: list[float], limits: tuple[float, float], sigma: float
) -> NoiseModel | None:
    if not weights or terms[:1] != [[]]:
        return None
    return NoiseModel(terms, np.array(weights), *limits, level=math.exp(sum(limits) / 2.0)).over(sigma**-2)


def _spin_of(term: Sequence[str]) -> int:
    return sum(-SPINS.get(name[:-1], 0) if name.endswith("*") else SPINS.get(name, 0) for name in term)


def changed(
    known: KnownModel,
    inputs: Complex,
    target: Any,
    symmetry: Symmetry,
    repeats: Repeats,
) -> tuple[Complex, Complex, float]:
    """The likeliest prior of another tip's weights, in the unit of the target.

    known    in that unit, `scaled`, and `in_the_image`
    inputs   (n, k) complex128, columns `FRAME_INPUTS`
    target   (n,) complex128, of one output real
    repeats  how frames of one pose share their noise
    Returns  mean (terms,) of the weights; root (terms, features) of their covariance, of one output with
             real features; and the variance of the noise
    """
    turning = symmetry is Symmetry.TURNING
    rows = slice(0, PARAMS.rows)
    psi = frame_terms(inputs[rows], known.terms)
    target = target[rows] if turning else target[rows].real
    mean = known.weights
    if symmetry is not Symmetry.EVEN:
        along = complex(np.vdot(psi @ mean, target) if turning else (psi @ mean).real @ target)
        mean = mean * (along / abs(along) if along else 1.0)
    kinds = list(_kinds(known, mean, turning=turning))
    residual = target - psi @ mean if turning else target - (psi @ mean).real
    products = []
    for kind in kinds:
        features = psi @ kind if turning else (psi @ kind).real
        products.append(features @ features.conj().T)
    noise = (1.0 + turning) * known.sigma**2  # of two outputs together
    variances, noise = _likeliest(products, residual, noise, repeats.first(PARAMS.rows), turning=turning)
    roots = [math.sqrt(v) * kind for v, kind in zip(variances, kinds, strict=True)]
    return mean, np.hstack(roots), noise


def _kinds(known: KnownModel, mean: Complex, *, turning: bool) -> Sequence[Complex]:
    """Roots of the weights' covariance by each kind of change; the variance of the last one is known."""
    n = len(mean)
    moving = mean.copy()
    moving[0] = 0.0
    letters = sorted({name.rstrip("*") for term in known.terms for name in term})
    counts = np.array([[[name.rstrip("*") for name in t].count(one) for t in known.terms] for one in letters])
    open_rows = known.open_rows * math.sqrt(1.0 + turning)
    if turning:
        size = np.sqrt(np.abs(moving) ** 2 + (np.abs(open_rows) ** 2).sum(axis=0))
        size[0] = 0.0
        each: Complex = np.diag(size.astype(np.complex128))
    else:  # the real and the imaginary part of a weight are two features
        real = np.sqrt(moving.real**2 + (open_rows.real**2).sum(axis=0))
        imag = np.sqrt(moving.imag**2 + (open_rows.imag**2).sum(axis=0))
        real[0] = imag[0] = 0.0
        each = np.hstack([np.diag(real) + 0j, 1j * np.diag(imag)])
    constant = np.eye(n, 1, dtype=np.complex128)
    by_input = (counts.reshape(-1, n) * moving).T
    return constant, moving[:, None], by_input, each[:, np.abs(each).any(axis=0)], open_rows.T


def _likeliest(
    products: Sequence[Any], residual: Any, noise: float, repeats: Repeats, *, turning: bool
) -> tuple[list[float], float]:
    """Variances of the kinds of change, of the last one 1, and of the noise: the likeliest."""
    half = 1.0 if turning else 0.5
    start = np.log([*[PARAMS.change] * (len(products) - 1), max(noise, PARAMS.jitter)])
    eye = np.eye(len(residual))
    alike, own = repeats.noise()

    def cost(logs: Array) -> tuple[float, Array]:
        v = np.exp(logs)
        covariance = v[-1] * alike + own + PARAMS.jitter * eye + products[-1]
        for variance, product in zip(v[:-1], products[:-1], strict=True):
            covariance = covariance + variance * product
        try:
            root = cholesky(covariance, lower=True)
        except LinAlgError:
            return 1e10, np.zeros_like(logs)
        alpha = cho_solve((root, True), residual)
        slope = cho_solve((root, True), eye) - np.outer(alpha, alpha.conj())
        gradient = [float((slope.conj() * product).sum().real) for product in products[:-1]]
        gradient.append(float((slope.real * alike).sum()))
        value = float((residual.conj() @ alpha).real) + 2.0 * float(np.log(np.diag(root).real).sum())
        off = logs - start
        return (
            half * value + PARAMS.prior * float(off @ off),
            half * v * np.array(gradient) + 2.0 * PARAMS.prior * off,
        )

    bounds = [(s - PARAMS.bound, s + PARAMS.bound) for s in start]
    found = np.exp(minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds).x)
    return [*found[:-1].tolist(), 1.0], float(found[-1])
