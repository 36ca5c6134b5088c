"""What a match of a whole tip does not show: slipped rows assigned anew, two blobs in one place."""

import numpy as np

from edge.tracking.hypothesis import Hypothesis, certain_match
from edge.tracking.motion_model import MotionModel
from edge.tracking.tip import TrackedTip
from edge.types import Array, Index, Mask
from tests.support.layouts import PITCH_PX, hexagonal, rest_of

N = 169


def model_of(xy: Array) -> MotionModel:
    return MotionModel(TrackedTip.of(rest_of(xy)))


def moved(xy: Array) -> Array:
    """By a few px, with the noise of centroids."""
    return np.asarray(xy + np.array([2.0, -1.0]) + np.random.default_rng(3).normal(0, 0.05, xy.shape))


def inconsistent(rows: int) -> tuple[MotionModel, Array, Index, Mask]:
    """Model, blobs (n, 2) with blob i that of pin i, and a match: as many rows slipped by one pin.

    In each of them a pin has the blob of the next one, which is lost, as is the one after that.
    """
    xy = hexagonal(7)
    blob, good = np.arange(N, dtype=np.int32), np.ones(N, bool)
    heights = np.unique(np.round(xy[:, 1], 3))
    for height in heights[len(heights) // 2 :][:rows]:
        row = np.flatnonzero(np.abs(xy[:, 1] - height) < 1e-2)
        row = row[np.argsort(xy[row, 0])]
        first, second, third = row[len(row) // 2 - 1 : len(row) // 2 + 2]
        blob[first] = second
        good[[second, third]] = False
    return model_of(xy), moved(xy), blob, good


def test_slipped_rows_get_their_own_blobs_back() -> None:
    model, now, blob, good = inconsistent(2)
    assert np.sum(good & (blob != np.arange(N))) == 2
    found, certain = certain_match(Hypothesis(model, now, blob, good))
    assert certain.all()
    assert np.array_equal(found.blob, np.arange(N))


def test_of_two_blobs_in_one_place_one_is_certain_at_most() -> None:
    model, now, blob, good = inconsistent(0)
    near = np.hypot(*(now - now[N // 2]).T) < 3 * PITCH_PX
    now[near] = now[N // 2] + 0.45 * (now[near] - now[N // 2])
    found, certain = certain_match(Hypothesis(model, now, blob, good))
    pairs = model.tip.lattice.pairs
    gap = np.hypot(*(now[pairs[:, 0]] - now[pairs[:, 1]]).T)
    too_near = gap < model.tip.lattice.distance_min_px
    assert np.any(too_near & found.known[pairs].all(1))
    assert not np.any(too_near & certain[pairs].all(1))
