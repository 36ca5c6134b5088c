"""Kriging from the known pins near: against the equations solved as a whole, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from edge.tracking.match import Kriging
from tests.support.refusals import refused

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


@pytest.mark.kernels
def test_squares_around_are_as_with_the_pin_where_it_is_predicted() -> None:
    weight, error, variance = RNG.normal(size=(N, K)), RNG.normal(size=(N, 2)), RNG.random(N) + 0.1
    known = RNG.random(N) < 0.7
    motion = RNG.normal(size=(N, 2))
    one = kriging()
    np.testing.assert_allclose(one.predict(weight, motion), (weight[..., None] * motion[NEAR]).sum(1))
    square, counts = one.square_around(error, variance, weight, known)
    for i in range(N):
        moved = error.copy()
        if known[i]:  # the errors of the others if the error of this one were none
            has = i == NEAR
            moved += (weight * has).sum(1)[:, None] * error[i]
        near = NEAR[i][known[NEAR[i]]]
        part = AROUND[i][known[NEAR[i]]]
        want = (part * (moved[near] ** 2).sum(1) / variance[near]).sum() / 2
        assert square[i] == pytest.approx(want)
        assert counts[i] == pytest.approx(part.sum())


@pytest.mark.kernels
def test_sizes_that_do_not_fit_are_refused() -> None:
    one = kriging()
    refused("are wanted", Kriging, NEAR, AROUND[1:], np.linalg.inv(SYSTEM), RIGHT, 2.0)
    refused("pins of 0 to", Kriging, NEAR + np.int32(1), AROUND, np.linalg.inv(SYSTEM), RIGHT, 2.0)
    refused("pins of 0 to", one.weights, np.array([N], np.int32), np.ones((1, K), bool))
    refused("are wanted", one.weights, np.array([0], np.int32), np.ones((1, K + 1), bool))
    refused("are wanted", one.predict, np.ones((N, K)), np.ones((N + 1, 2)))
    with pytest.raises(ValueError, match="are wanted"):
        one.square_around(np.ones((N, 2)), np.ones(N), np.ones((N, K)), np.ones(N + 1, bool))
    with pytest.raises(ValueError, match="is wanted"):
        one.square_around(np.ones((N, 2)), np.ones(N), np.ones((N, K + 1)), np.ones(N, bool))
