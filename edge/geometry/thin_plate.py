"""The thin-plate spline: the smoothest surface through values at knots."""

import numpy as np

from edge.errors import DegenerateLayout
from edge.geometry.layout import spans
from edge.types import Array


def thin_plate_operators(knots: Array, points: Array) -> tuple[Array, Array, Array]:
    """Matrices that give the spline through values at the knots, and its slopes, at points.

    knots    (n, 2) and points (m, 2), same unit; n >= 3, not all on a line
    Returns  three (m, n) float64: value, derivative along x and along y (per unit of the knots)
    Raises   DegenerateLayout: fewer than 3 knots, or all on a line
    Source   Duchon 1977; Wahba, Spline Models for Observational Data, 1990, section 2.4
    """
    n = len(knots)
    # In this frame the system is well conditioned; the spline does not depend on it.
    centre = knots.mean(axis=0)
    scale = float(np.sqrt(((knots - centre) ** 2).sum(axis=1).mean()))
    if n < 3 or not spans(knots):
        raise DegenerateLayout(f"a surface needs three pins that are not on one line; {n} given")
    x, p = (knots - centre) / scale, (points - centre) / scale
    system = np.zeros((n + 3, n + 3))  # its solution are the weights of the kernels and of a plane
    system[:n, :n] = _kernel(x, x)[0]
    system[:n, n:] = np.column_stack([np.ones(n), x])
    system[n:, :n] = system[:n, n:].T
    one, zero = np.ones((len(p), 1)), np.zeros((len(p), 1))
    value, along_x, along_y = _kernel(p, x)
    along_x = np.hstack([along_x, zero, one, zero]) / scale
    along_y = np.hstack([along_y, zero, zero, one]) / scale
    # The system is symmetric: right S^-1 = (S^-1 right^T)^T; values fill the first n rows of its input.
    # Solved one by one, BLAS keeps a workspace of 2 MB, and of 6 MB where all are solved at once.
    right = np.hstack([value, one, p]), along_x, along_y
    value, along_x, along_y = (np.linalg.solve(system, rows.T)[:n].T for rows in right)
    return value, along_x, along_y


def _kernel(a: Array, b: Array) -> tuple[Array, Array, Array]:
    """r^2 log r, zero at r = 0, and its derivatives along x and y."""
    d = a[:, None, :] - b[None, :, :]
    r2 = (d**2).sum(axis=2)
    log = np.log(np.where(r2 > 0.0, r2, 1.0))
    slope = np.where(r2 > 0.0, log + 1.0, 0.0)
    return 0.5 * r2 * log, d[:, :, 0] * slope, d[:, :, 1] * slope
