"""Which poses to measure next: those after which the values are most certain, over all poses.

The features of a process are linear in its weights, so that what a frame at some pose will tell does not
depend on what it shows. Before it is taken, only its inputs are unknown: they are predicted from the pose, by
polynomials of the frames that are there.

The pose with the largest variance is at the edge of the range, where little else is; measured there, it
says little about the middle. So each candidate is judged by the variance that it takes away from all of
them, in units of the noise, added over the outputs. Poses of one batch are chosen one after the other, each
with the variance that those before it leave.
"""

from collections.abc import Sequence

import numpy as np

from calib.designs import terms_of_spin
from calib.process_fit import INPUTS, FittedProcess
from calib.ridge import Terms, cross_validate, folds_of, ridge_weights
from calib.terms import evaluate_terms, term_columns
from edge.calibration.inputs import FRAME_INPUTS
from edge.types import Array, Complex

#: Coordinates of a pose, with their spins.
LETTERS = (("place", 1), ("depth", 0), ("tilt", 1), ("shear", 1), ("twist", 0))
FACTORS = 3  # of the products of pose coordinates that predict inputs


def covariances(processes: Sequence[FittedProcess], inputs: Complex) -> list[Complex]:
    """(n, n) of each process: what its weights leave open, over the deviation of the noise.

    inputs  (n, k) complex128, columns `FRAME_INPUTS`, expected at each pose
    """
    result: list[Complex] = []
    for process in processes:
        rows = process.uncertainty.rows(inputs) / deviation(process, inputs)[:, None]
        result.append(rows @ rows.conj().T)
    return result


def deviation(process: FittedProcess, inputs: Complex) -> Array:
    """(n,) of the noise, in the unit of the outputs; of two their mean."""
    noise = process.noise.variance(inputs)
    if process.across is not None:
        noise = (noise + process.across.variance(inputs)) / 2.0
    result: Array = np.sqrt(noise * float((process.sigma**2).mean()))
    return result


def expected_error(process: FittedProcess, inputs: Complex) -> float:
    """Root mean square over the poses of the sigma of each output."""
    learnt = (np.abs(process.uncertainty.rows(inputs)) ** 2).sum(axis=1)
    return float(np.sqrt((learnt + deviation(process, inputs) ** 2).mean()))


def choose(open_: Sequence[Complex], count: int) -> list[int]:
    """The best `count` of some poses, in this order. open_: their `covariances`."""
    left = [covariance.copy() for covariance in open_]
    chosen: list[int] = []
    for _ in range(min(count, len(left[0]))):
        gain = np.zeros(len(left[0]))
        for c in left:
            gain += (np.abs(c) ** 2).mean(axis=0) / (1.0 + np.diag(c).real)
        gain[chosen] = -1.0
        best = int(np.argmax(gain))
        chosen.append(best)
        for c in left:
            c -= np.outer(c[:, best], c[best]) / (1.0 + c[best, best].real)
    return chosen


def predict_inputs(known: Complex, inputs: Complex, wanted: Complex) -> Complex:
    """Inputs expected at some poses, from those of measured ones.

    known    (n, LETTERS) complex128, poses of the rows of `inputs`
    wanted   (m, LETTERS)
    Returns  (m, k) complex128; 0 for what products of so few factors cannot have the spin of
    """
    size = np.sqrt((np.abs(known) ** 2).mean(axis=0))
    size[size == 0] = 1.0
    fold = folds_of(np.hstack([known.real, known.imag]))
    columns = [name for name, _ in LETTERS]
    alphabet = [
        pair
        for name, spin in LETTERS
        for pair in ([(name, 0)] if spin == 0 else [(name, spin), (f"{name}*", -spin)])
    ]
    result = np.zeros((len(wanted), len(FRAME_INPUTS)), dtype=np.complex128)
    for spin in sorted({one.spin for one in INPUTS}):
        terms = terms_of_spin(spin, alphabet, FACTORS)
        ours = [FRAME_INPUTS.index(one.name) for one in INPUTS if one.spin == spin]
        if not terms:
            continue
        values = Terms(known / size, None, term_columns(terms, columns), real=False)
        found = cross_validate("", values, inputs[:, ours], fold)
        there = evaluate_terms(wanted / size, values.columns)
        for column, (candidate, _) in zip(ours, found, strict=True):
            weights = ridge_weights(values, inputs[:, column], candidate.ridge)
            result[:, column] = there @ weights
    real = [FRAME_INPUTS.index(one.name) for one in INPUTS if one.real]
    result[:, real] = result[:, real].real
    return result
