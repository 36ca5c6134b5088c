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

from dataclasses import dataclass

import numpy as np

from edge.geometry.layout import affine_terms
from edge.types import Array, Index


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


#: Rows that are worked on together: the factor of 3,000 knots takes 140 MB, of which no copy is made.
AT_ONCE = 64
#: A contact that is fitted to the motion round it is sharp. The fit takes noise and curl.
SHARP = MotionPrior(((1.0, 0.1), (2.0, 0.3), (4.0, 1.0)), curl=0.02, noise=0.01)
#: The places of missing pins follow the smooth part too.
PREDICTING = MotionPrior(((0.7, 0.05), (1.4, 0.2), (2.8, 0.5), (5.6, 1.0)), curl=0.2, noise=0.05)


class Precision:
    """Inverse covariance of the knots' motion with the affine part free; x and y side by side.

    Positive definite on every set of knots whose complement has three that span a plane. Rows are made when
    they are first wanted, of a Cholesky factor: all would take eight times as long, and as much memory
    again. Those of a block are made together, so that a row does not depend on what was wanted before.

    knots, pitch  (n, 2), and their pitch, same unit
    """

    def __init__(self, knots: Array, pitch: float, prior: MotionPrior) -> None:
        x = (knots - knots.mean(axis=0)) / pitch
        self._size = 2 * len(x)
        self._blocks = [slice(k, min(k + AT_ONCE, self._size)) for k in range(0, self._size, AT_ONCE)]
        self._factor: list[Array] = []  # columns from the diagonal on, its inverse first
        for at in self._blocks:
            begin = at.start // 2
            columns = _covariance(x[begin:], x[begin : at.stop // 2], prior)
            columns[np.diag_indices(at.stop - at.start)] += prior.noise**2
            for before, factor in zip(self._blocks, self._factor, strict=False):
                rows = factor[at.start - before.start :]
                columns -= rows @ rows[:AT_ONCE].T
            columns[:AT_ONCE] = np.linalg.inv(np.linalg.cholesky(columns[:AT_ONCE]))
            columns[AT_ONCE:] = columns[AT_ONCE:] @ columns[:AT_ONCE].T
            self._factor.append(columns)
        affine = np.kron(affine_terms(x, np.zeros(2), 1.0), np.eye(2))  # (2 n, 6), the knots' affine motions
        self._weighted = self._solve(np.array(affine, np.float64))
        self._of_affine = np.linalg.solve(affine.T @ self._weighted, self._weighted.T)
        self._rows: dict[int, Array] = {}  # of the blocks that were wanted

    def rows(self, which: Index) -> Array:
        """(m, 2 n) float64, these rows."""
        blocks = which // AT_ONCE
        for block in map(int, np.unique(blocks)):
            if block not in self._rows:
                at = self._blocks[block]
                columns = self._solve(np.eye(self._size, at.stop - at.start, -at.start))
                self._rows[block] = columns.T - self._weighted[at] @ self._of_affine
        pairs = zip(map(int, blocks), which % AT_ONCE, strict=True)
        return np.array([self._rows[block][row] for block, row in pairs]).reshape(-1, self._size)

    def _solve(self, right: Array) -> Array:
        """(2 n, r) the inverse of the covariance alone, times these columns, which are overwritten."""
        for at, f in zip(self._blocks, self._factor, strict=True):
            right[at] = f[:AT_ONCE] @ right[at]
            right[at.stop :] -= f[AT_ONCE:] @ right[at]
        for at, f in zip(reversed(self._blocks), reversed(self._factor), strict=True):
            right[at] = f[:AT_ONCE].T @ (right[at] - f[AT_ONCE:].T @ right[at.stop :])
        return right


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


def _covariance(x: Array, y: Array, prior: MotionPrior) -> Array:
    """(2 n, 2 m) covariance of the motion at x (n, 2) with that at y (m, 2), without its affine part."""
    dx, dy = (x[:, None, k] - y[:, k] for k in (0, 1))
    r2 = dx * dx + dy * dy
    # A potential of covariance e = exp(-r^2 / 2 w^2) has a gradient of covariance e (1 - d d' / w^2);
    # rotated by 90 degrees, its curl's is e (1 - r^2 / w^2 + d d' / w^2). All are alike * 1 + along d d'.
    alike, along = np.zeros(r2.shape), np.zeros(r2.shape)
    for width, variance in prior.potentials:
        s = r2 / width**2
        e = variance * np.exp(-0.5 * s)
        alike += e * (1.0 + prior.curl * (1.0 - s))
        along += e * ((prior.curl - 1.0) / width**2)
    total = np.empty((2 * len(x), 2 * len(y)))
    total[0::2, 0::2] = alike + along * dx * dx
    total[1::2, 1::2] = alike + along * dy * dy
    total[0::2, 1::2] = total[1::2, 0::2] = along * dx * dy
    return total
