"""The paper's displacement curve: depth, monotone in the volume of deformation."""

import numpy as np
from scipy.optimize import isotonic_regression

from calib.errors import FitError
from calib.fit_params import PARAMS
from calib.ridge import Candidate, as_candidate, folds_of, rounded
from edge.calibration.file import Curve
from edge.types import Array, Complex, Index

CURVE = "curve of the volume"
#: Knots of the volume that are closer, as a share of the tip's area, are not distinguishable.
KNOT_STEP_MIN = 1e-5


def paper_curve(volume: Array, depth: Array) -> tuple[Curve, Array]:
    """The paper's curve of these frames, and the prediction of each row without its depth; all (n,).

    Raises  FitError: the volume does not vary
    """
    found = fit_curve(volume, depth, folds_of(depth[:, None]))
    if found is None:
        raise FitError("the volume of deformation is the same in all frames: no curve can be fitted")
    return found[0], found[2].real


def fit_curve(volume: Array, depth: Array, fold: Index) -> tuple[Curve, Candidate, Complex] | None:
    """The paper's displacement curve: monotone in the volume of deformation.

    volume   (n,) share of the tip's area
    depth    (n,) mm
    fold     (n,) of the cross-validation
    Returns  the curve of all rows, its held-out error, and the held-out prediction of each row; None: the
             volume does not vary
    """
    predicted = np.zeros(len(depth))
    for k in range(int(fold.max()) + 1):
        x, y = _knots(volume[fold != k], depth[fold != k])
        predicted[fold == k] = np.interp(volume[fold == k], x, y)
    x, y = _knots(volume, depth)
    if len(x) < 2:
        return None
    candidate = as_candidate(CURVE, len(x), (predicted - depth) ** 2, np.ones(len(depth)), noise=0.0)
    sigma = max(1e-6, rounded(float(np.quantile(np.abs(predicted - depth), 0.6827))))
    knots = [(rounded(float(a)), rounded(float(b))) for a, b in zip(x, y, strict=True)]
    curve = Curve(output="displacement_mm", input="volume", knots=knots, sigma=sigma)
    return curve, candidate, predicted.astype(np.complex128)


def _knots(volume: Array, depth: Array) -> tuple[Array, Array]:
    """Monotone regression, averaged to a few knots. Increasing inputs, non-decreasing outputs."""
    order = np.argsort(volume, kind="stable")
    x, y = volume[order], isotonic_regression(depth[order]).x
    parts = np.array_split(np.arange(len(x)), min(PARAMS.knots, max(2, len(x) // 4)))
    kx = np.array([x[p].mean() for p in parts])
    ky = np.array([y[p].mean() for p in parts])
    keep = np.concatenate([[True], np.diff(kx) > KNOT_STEP_MIN])
    return kx[keep], ky[keep]
