"""The noise of a process, and what lost pins add to it: logarithms that are polynomials in a frame's inputs.

The noise differs from frame to frame (a light contact slips and tells less). Its logarithm is a polynomial in
what no turn changes, the likeliest for the errors of frames that were not seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from calib.terms import frame_terms
from edge.calibration.file import Lost
from edge.calibration.inputs import FRAME_INPUTS
from edge.types import Array, Complex

#: The effect of lost pins may depend on these: how much of them is not known, the load, and how far on the
#: contact's side, or ahead of the shear, they are.
LOST_TERMS: list[list[str]] = [
    ["gap"], ["volume"], ["size"], ["p", "p*"], ["c00", "c00*"], ["gap_place", "gap_place*"],
    ["gap_place", "p*"], ["gap_place", "c00*"], ["gap", "gap_place", "p*"], ["volume", "gap_place", "p*"],
]  # fmt: skip
#: The noise may depend on these: load, shear, place.
NOISE_TERMS: tuple[list[str], ...] = (
    ["volume"], ["volume", "volume"], ["c00", "c00*"], ["p", "p*"], ["c00", "c00*", "volume"],
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class NoiseParams:
    """Evidence: docs/tuning.md, "Fit by a Gaussian process"."""

    noise_prior: float = 0.5  # weight of squared coefficients of the noise's logarithm
    losses_min: int = 50  # frames with pins taken away: fewer do not tell what losses do


PARAMS = NoiseParams()
#: Shares of Gaussian errors within one, two and three sigma.
WITHIN = ((1.0, 0.6827), (2.0, 0.9545), (3.0, 0.9973))


def scales_of(standardised: Sequence[Array], levels: int = 2) -> Array:
    """(parts, levels) factors of each part's sigma: as many as should be are within one, two, three."""
    return np.array(
        [[np.quantile(np.abs(z), share) / k for k, share in WITHIN[:levels]] for z in standardised]
    )


def likeliest_scales(standardised: Sequence[Array], poses: float) -> Array:
    """(parts,) means of the factors of `scales_of`, each as certain as errors of so many poses show it.

    Of Gaussian errors both are as certain. Of few with heavy tails, one or two decide the share within two
    sigma; sigma is then what the share within one says. Source: Woodruff, Confidence intervals for medians
    and other position measures, 1952.
    """
    errors = []
    for k, share in WITHIN[:2]:
        off = math.sqrt(share * (1.0 - share) / poses)
        ends = np.clip((share - off, share + off), 0.0, 1.0)
        errors.append([np.ptp(np.quantile(np.abs(z), ends)) / k for z in standardised])
    certain = np.maximum(np.transpose(errors), 1e-9) ** -2
    return np.asarray(np.average(scales_of(standardised), axis=1, weights=certain))


def fit_lost(lossy: Complex, change: Complex, *, turning: bool) -> Lost | None:
    """Likeliest for these changes of the value, over sigma, that the loss of pins brought about."""
    gap, volume = (lossy[:, FRAME_INPUTS.index(name)].real for name in ("gap", "volume"))
    known = np.isfinite(change) & (gap > 0) & (volume > 0)
    if known.sum() < PARAMS.losses_min or not change[known].any():  # a constant alone changes with no pin
        return None
    lossy, gap, volume = lossy[known], gap[known], volume[known]
    parts = [change[known].real, change[known].imag] if turning else [change[known].real]
    psi = frame_terms(lossy, LOST_TERMS).real
    design = np.column_stack([np.ones(len(gap)), np.log(gap), np.log(volume), psi])
    fitted = _fit_log_variance(
        design, np.mean(np.square(parts), axis=0), np.zeros(len(gap)), *np.ones((2, len(gap)))
    )
    # Few losses do much, most do little: no Gaussian, so that sigma is what covers as many as it should.
    deviation = np.exp(0.5 * (design @ fitted))
    scale, gap_power, volume_power, *weights = fitted.tolist()
    scale += 2.0 * math.log(float(scales_of([np.concatenate([part / deviation for part in parts])]).mean()))
    return Lost(scale, gap_power, volume_power, float(gap.max()), LOST_TERMS, weights)


@dataclass(frozen=True, slots=True)
class NoiseModel:
    """Logarithm of the noise's variance: a polynomial within the range that the data showed.

    level  geometric mean of the variance, in the same unit
    """

    terms: list[list[str]]
    weights: Array
    low: float
    high: float
    level: float

    def variance(self, inputs: Complex) -> Array:
        """(n,)"""
        psi = frame_terms(inputs, self.terms).real
        return np.exp(np.clip(psi @ self.weights, self.low, self.high))

    def over(self, level: float) -> NoiseModel:
        """The same in units of this variance."""
        log, weights = math.log(level), self.weights.copy()
        weights[0] -= log
        return NoiseModel(self.terms, weights, self.low - log, self.high - log, self.level / level)


def fit_noise(
    inputs: Complex,
    squares: Array,
    learnt: Array,
    share: Array,
    before: NoiseModel | None = None,
    *,
    constant: bool = False,
) -> NoiseModel:
    """Likeliest for errors with these squares, of which the weights explain `learnt`.

    share   what each counts
    before  another tip's, which this one departs from no further than the errors show; None: a constant
    constant  they show no more than one, or a multiple of the other tip's: nowhere below its, or its mean
    """
    terms = before.terms if before else [[], *(() if constant else NOISE_TERMS)]
    psi = frame_terms(inputs, terms).real
    weights = before.weights if before else np.zeros(len(terms))
    # Beyond the other tip's frames its polynomial says nothing, and may be off by powers of ten.
    expected = np.clip(psi @ weights, before.low, before.high) if before else np.zeros(len(psi))
    times = np.exp(np.clip(expected, -60.0, 60.0))
    change = np.zeros(len(terms))
    if before and constant:
        change[0] = max(0.0, *_fit_log_variance(psi[:, :1], squares, learnt, times, share))
    else:
        change += _fit_log_variance(psi, squares, learnt, times, share)
    shift = float((psi @ change).mean())
    logs = expected + psi @ change
    low, high = float(logs.min()), float(logs.max())
    if before:  # so few cannot show that a frame is read better than most
        high = max(high, before.high + shift)
        low = min(float(logs.mean()), high) if constant else min(low, before.low + shift)
    return NoiseModel(terms, weights + change, low, high, math.exp(float(np.clip(logs, low, high).mean())))


def _fit_log_variance(design: Array, squares: Array, known: Array, times: Array, share: Array) -> Array:
    """Weights b that make errors with these squares likeliest: variance = times exp(design b) + known.

    design   (n, k), the first column 1
    share    (n,) what each error counts
    Returns  (k,); 0 for a column that is the same in all rows
    """
    centre, scale = design.mean(axis=0), design.std(axis=0)
    varies = scale > 0
    unit = np.where(varies, (design - centre) / np.where(varies, scale, 1.0), 0.0)
    unit[:, 0] = 1.0

    def cost(b: Array) -> tuple[float, Array]:
        noise = times * np.exp(np.clip(unit @ b, -60.0, 60.0))
        total = noise + known
        slope = unit.T @ (share * (1.0 / total - squares / total**2) * noise)
        slope[1:] += 2.0 * PARAMS.noise_prior * b[1:]
        penalty = PARAMS.noise_prior * float(b[1:] @ b[1:])
        return float(share @ (np.log(total) + squares / total)) + penalty, slope

    start = np.zeros(design.shape[1])
    start[0] = math.log(max(float((squares / times).mean()), 1e-300))
    b = minimize(cost, start, jac=True, method="L-BFGS-B").x
    weights: Array = np.where(varies, b / np.where(varies, scale, 1.0), 0.0)
    weights[0] = b[0] - float((weights[1:] * centre[1:]).sum())
    return weights
