"""The skin's motion as a random field: the sum of a curl-free part, a small divergence-free one and an affine
motion.

Idea: a press moves the skin along the gradient of a potential; shear and rotation add a curl. Each pin then
gives two measurements of one potential, and the best linear estimate anywhere between the pins is a constant
matrix times the pins' motion (Gaussian process with matrix-valued kernels, kriging). Compared with a separate
surface for each component, which ignores the other, this resolves more and fills gaps better.

Rules
- Kernels are Gaussian potentials of several widths: a press contributes to each.
- An affine motion is unpenalised (it has its own six unknowns) and is continued exactly.
- Lengths in pitches, so that one table of widths serves every tip.

Source  Narcowich and Ward, Generalized Hermite interpolation via matrix-valued conditionally positive
        definite functions, Math. Comp. 63, 1994; Wahlstrom et al., Modeling magnetic fields using
        Gaussian processes, ICASSP 2013 (curl-free and divergence-free kernels).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edge.geometry.layout import affine_terms
from edge.types import Array

__all__ = ["PREDICTING", "SHARP", "MotionPrior", "component_covariance", "divergence_operator", "precision"]


@dataclass(frozen=True, slots=True)
class MotionPrior:
    """Assumptions about the motion; measured in docs/tuning.md, "Motion field".

    potentials  width of each potential in pitches, and the variance of its motion
    curl        variance of the divergence-free part against the curl-free one; at 1 the components are
                independent
    noise       of a pin, standard deviation against the motion's unit
    """

    potentials: tuple[tuple[float, float], ...]
    curl: float
    noise: float


#: For the divergence within a contact: sharp, but noisy where pins are badly seen.
SHARP = MotionPrior(((1.0, 0.1), (2.0, 0.3), (4.0, 1.0)), curl=0.02, noise=0.01)
#: For the places of missing pins.
PREDICTING = MotionPrior(((0.7, 0.05), (1.4, 0.2), (2.8, 0.5), (5.6, 1.0)), curl=0.2, noise=0.05)


def divergence_operator(knots: Array, points: Array, pitch: float, prior: MotionPrior) -> Array:
    """The matrix that gives the divergence of a motion at points from the motion at the knots.

    knots    (n, 2) and points (m, 2), any unit; at least three knots that are not on a line
    pitch    of the knots, same unit
    Returns  (m, 2 n) float64, per unit; columns are x and y of the first knot, of the second, ...
    """
    n, m = len(knots), len(points)
    centre = knots.mean(axis=0)
    x, p = (knots - centre) / pitch, (points - centre) / pitch
    # Unknowns: 2 n weights of the kernels, then 6 of an affine field (x part, y part).
    system = np.zeros((2 * n + 6, 2 * n + 6))
    system[: 2 * n, : 2 * n] = _covariance(x, prior)
    affine = _affine_basis(x)
    system[: 2 * n, 2 * n :] = affine
    system[2 * n :, : 2 * n] = affine.T
    right = np.zeros((m, 2 * n + 6))
    right[:, : 2 * n] = _divergence_covariance(p, x, prior)
    right[:, 2 * n + 2] = 1.0  # d/dx of the x part
    right[:, 2 * n + 5] = 1.0  # d/dy of the y part
    # The system is symmetric: right S^-1 = (S^-1 right^T)^T; motion fills the first 2 n rows of its input.
    return np.asarray(np.linalg.solve(system, right.T)[: 2 * n].T / pitch, np.float64)


def precision(knots: Array, pitch: float, prior: MotionPrior) -> Array:
    """(2 n, 2 n) float64, inverse covariance of the knots' motion with the affine part free; x and y side by
    side.

    Positive definite on every set of knots whose complement has three that span a plane.

    knots, pitch  (n, 2), and their pitch, same unit
    """
    x = (knots - knots.mean(axis=0)) / pitch
    inverse = np.linalg.inv(_covariance(x, prior))
    affine = _affine_basis(x)
    weighted = inverse @ affine
    return np.asarray(inverse - weighted @ np.linalg.solve(affine.T @ weighted, weighted.T), np.float64)


def component_covariance(x: Array, prior: MotionPrior) -> Array:
    """(n, n) float64, covariance of one component of the motion as it is measured, without its affine part,
    where there is as much curl as divergence: the components are independent then.

    x  (n, 2) pitches
    """
    r2 = ((x[:, None] - x) ** 2).sum(axis=2)
    total: Array = np.zeros_like(r2)
    for width, variance in prior.potentials:
        s = r2 / width**2
        total += variance * (2.0 - s) * np.exp(-0.5 * s)
    total[np.diag_indices(len(x))] += prior.noise**2
    return total


def _affine_basis(x: Array) -> Array:
    """(2 n, 6) the affine motions of knots at x (n, 2)."""
    return np.asarray(np.kron(affine_terms(x, np.zeros(2), 1.0), np.eye(2)), np.float64)


def _covariance(x: Array, prior: MotionPrior) -> Array:
    """(2 n, 2 n) covariance of the measured motion at x (n, 2), without its affine part."""
    n = len(x)
    d = x[:, None, :] - x[None, :, :]
    outer, unit = d[..., :, None] * d[..., None, :], np.eye(2)
    r2 = (d**2).sum(axis=2)[..., None, None]
    total: Array = np.zeros((n, n, 2, 2))
    for width, variance in prior.potentials:
        # For a potential of covariance exp(-r^2 / 2 w^2): that of its gradient and, rotated by 90 degrees, of
        # its curl.
        along, s = outer / width**2, r2 / width**2
        part = (unit - along) + prior.curl * ((1.0 - s) * unit + along)
        total += np.asarray(variance * np.exp(-0.5 * s) * part, np.float64)
    flat = total.transpose(0, 2, 1, 3).reshape(2 * n, 2 * n)
    flat[np.diag_indices(2 * n)] += prior.noise**2
    return flat


def _divergence_covariance(p: Array, x: Array, prior: MotionPrior) -> Array:
    """(m, 2 n) covariance of the divergence at p (m, 2) with the motion at x (n, 2): of the curl-free part
    alone.
    """
    d = p[:, None, :] - x[None, :, :]
    r2 = (d**2).sum(axis=2)[..., None]
    total: Array = np.zeros_like(d)
    for width, variance in prior.potentials:
        total -= variance * d * (4.0 / width**2 - r2 / width**4) * np.exp(-0.5 * r2 / width**2)
    return total.reshape(len(p), -1)
