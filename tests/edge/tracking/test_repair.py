"""Inconsistent places of a match: assigned anew where that can be proven, lost where it cannot."""

from __future__ import annotations

import numpy as np

from edge.tracking.repair import repair
from edge.tracking.tip import TrackedTip
from edge.types import Array, Index, Mask
from tests.edge.tracking.test_tracker import hexagonal, rest_at

N = 169


def inconsistent(rows: int) -> tuple[TrackedTip, Array, Index, Mask]:
    """TrackedTip, blobs (n, 2) with blob i that of pin i, and a match: as many rows slipped by one pin.

    In each of them a pin has the blob of the next one, which is lost, as is the one after that.
    """
    xy = hexagonal(7)
    tip = TrackedTip.of(rest_at(xy))
    rng = np.random.default_rng(3)
    now = xy + np.array([2.0, -1.0]) + rng.normal(0, 0.05, xy.shape)
    blob, good = np.arange(N, dtype=np.int32), np.ones(N, bool)
    heights = np.unique(np.round(xy[:, 1], 3))
    for height in heights[len(heights) // 2 :][:rows]:
        row = np.flatnonzero(np.abs(xy[:, 1] - height) < 1e-2)
        row = row[np.argsort(xy[row, 0])]
        first, second, third = row[len(row) // 2 - 1 : len(row) // 2 + 2]
        blob[first] = second
        good[[second, third]] = False
    return tip, now, blob, good


def test_slipped_rows_get_their_own_blobs_back() -> None:
    tip, now, blob, good = inconsistent(2)
    assert np.sum(good & (blob != np.arange(N))) == 2
    repaired, found = repair(tip, now, blob, good)
    assert found.all()
    assert np.array_equal(repaired, np.arange(N))


def test_without_its_blob_a_pin_does_not_keep_another_s() -> None:
    """Of three rows one has lost a blob: counts do not agree, and pins that do not fit are lost, not the
    others.
    """
    tip, now, blob, good = inconsistent(3)
    gone = np.flatnonzero(~good)[-1]
    owner = np.delete(np.arange(N), gone)
    good = good & (blob != gone)
    index = np.full(N, -1, np.int32)
    index[owner] = np.arange(N - 1)
    repaired, found = repair(tip, now[owner], np.where(good, index[blob], np.int32(0)), good)
    assert np.all(owner[repaired[found]] == np.flatnonzero(found))
    assert np.count_nonzero(found) > N - 30


def test_a_dark_pin_without_an_unassigned_blob_near_stays_unmatched() -> None:
    tip, now, _, good = inconsistent(0)
    good[N // 2] = False
    owner = np.flatnonzero(good)
    index = np.zeros(N, np.int32)
    index[owner] = np.arange(len(owner))
    repaired, found = repair(tip, now[owner], index, good)
    assert np.array_equal(found, good)
    assert np.array_equal(repaired, index)
