"""Kriging from the known pins near: against the equations solved as a whole."""

import numpy as np
import pytest

from edge.tracking.kriging import Kriging

N, K = 30, 8
RNG = np.random.default_rng(7)


def equations() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """near, around, all equations of each pin, and their right sides: of a random covariance."""
    near = np.stack([RNG.permutation(np.delete(np.arange(N), i))[:K] for i in range(N)]).astype(np.int32)
    root, x = RNG.normal(size=(N, N)), RNG.normal(size=(N, 2))
    field = root @ root.T / N + 0.1 * np.eye(N)
    system = np.zeros((N, K + 3, K + 3))
    system[:, :K, :K] = field[near[:, :, None], near[:, None, :]]
    terms = np.concatenate([np.ones((N, K, 1)), x[near] - x[:, None]], axis=2)
    system[:, :K, K:], system[:, K:, :K] = terms, terms.transpose(0, 2, 1)
    system[:, K:, K:] = -1e-6 * np.eye(3)
    right = np.concatenate(
        [field[near, np.arange(N)[:, None]], np.broadcast_to([1.0, 0.0, 0.0], (N, 3))], axis=1
    )
    return near, RNG.random((N, K)), system, right


NEAR, AROUND, SYSTEM, RIGHT = equations()


def kriging() -> Kriging:
    return Kriging(NEAR, AROUND, np.linalg.inv(SYSTEM), RIGHT, 2.0)


@pytest.mark.kernels
def test_weights_solve_the_equations_of_the_known() -> None:
    known = np.concatenate([np.arange(K) < np.arange(K + 1)[:, None], RNG.random((N, K)) < 0.6])
    rows = RNG.integers(0, N, len(known)).astype(np.int32)
    weight, variance = kriging().weights(rows, known)
    assert not weight[~known].any()
    for row, has, got, left in zip(rows, known, weight, variance, strict=True):
        used = np.flatnonzero(np.append(has, [True] * 3))
        want = np.linalg.solve(SYSTEM[row][np.ix_(used, used)], RIGHT[row, used])
        scale = np.abs(want).max()
        np.testing.assert_allclose(got[has], want[:-3], atol=1e-6 * scale)
        assert left == pytest.approx(2.0 - want @ RIGHT[row, used], abs=1e-6 * scale)
