"""Which pins of a match are certain, and what is assigned anew: slips, missing pins, false blobs."""

import numpy as np
import pytest

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


def test_without_its_blob_a_pin_does_not_keep_another_s() -> None:
    model, now, blob, good = inconsistent(3)
    gone = np.flatnonzero(~good)[-1]
    owner = np.delete(np.arange(N), gone)
    good = good & (blob != gone)
    index = np.full(N, -1, np.int32)
    index[owner] = np.arange(N - 1)
    start = Hypothesis(model, now[owner], np.where(good, index[blob], np.int32(0)), good)
    found, certain = certain_match(start)
    assert np.array_equal(np.flatnonzero(certain), owner)
    assert np.array_equal(owner[found.blob[certain]], owner)


def test_a_dark_pin_stays_unmatched() -> None:
    model, now, _, good = inconsistent(0)
    good[N // 2] = False
    index = np.maximum(np.cumsum(good) - 1, 0).astype(np.int32)
    found, certain = certain_match(Hypothesis(model, now[good], index, good))
    assert np.array_equal(certain, good)
    assert np.array_equal(found.known, good)
    assert np.array_equal(found.blob[good], index[good])


@pytest.mark.parametrize("off_px", [0.0, 3.0])
def test_a_blob_in_the_place_of_a_dark_pin_is_its_own_only_if_it_fits(off_px: float) -> None:
    """And it is the dark pin that is lost, not those beside it."""
    model, now, blob, good = inconsistent(0)
    now[N // 2, 0] += off_px
    _, certain = certain_match(Hypothesis(model, now, blob, good))
    assert np.array_equal(np.flatnonzero(~certain), [N // 2] if off_px else [])


@pytest.mark.parametrize("signs", [False, True])
def test_where_a_row_may_have_slipped_unnoticed_nothing_is_certain(signs: bool) -> None:
    """A rough field alone is no reason: a slip leaves an unmatched pin and an unassigned blob too."""
    model, now, blob, good = inconsistent(0)
    xy = model.tip.rest_xy
    near = np.hypot(*(xy - xy[N // 2]).T) < 3 * PITCH_PX
    now[near] += np.random.default_rng(4).normal(0, 0.05 * PITCH_PX, (int(near.sum()), 2))
    if signs:
        good[N // 2] = False
        now = np.vstack([now, now[N // 2] + 0.5 * PITCH_PX])
        now[N // 2] = 0.0
    _, certain = certain_match(Hypothesis(model, now, blob, good))
    beside = np.hypot(*(xy - xy[N // 2]).T) < 1.1 * PITCH_PX
    assert not np.any(certain & beside) if signs else certain.all()


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


def test_no_pin_is_certain_where_none_is_matched() -> None:
    model, now, blob, _ = inconsistent(0)
    nothing = Hypothesis(model, now, blob, np.zeros(N, bool))
    assert not certain_match(nothing)[1].any()
    nothing.assign(nothing.scale, nothing.freedom)
    assert not nothing.known.any()
    assert nothing.log_posterior == 0.0
