"""The arithmetic of the search: no blob twice; wrong sizes and indices are refused."""

from __future__ import annotations

import numpy as np
import pytest

from edge.geometry.lattice import Lattice
from edge.tracking.match import NearestBlob, RegionGrower
from edge.tracking.outliers import LocalAffine
from edge.types import Array, Index
from tests.support.fields import hexagon
from tests.support.refusals import refused

PITCH = 18.0
SIDE = 200

pytestmark = pytest.mark.kernels


def pins(rings: int = 3) -> Array:
    return hexagon(rings, PITCH) + SIDE / 2


def table_of(blobs: Array) -> Index:
    """The nearest blob to each pixel, by exhaustive search."""
    grid = np.indices((SIDE, SIDE))[::-1].reshape(2, -1, 1)
    nearest = ((grid - blobs.T[:, None]) ** 2).sum(0).argmin(1)
    table: Index = nearest.reshape(SIDE, SIDE).astype(np.int32)
    return table


def raster(blobs: Array) -> NearestBlob:
    return NearestBlob(blobs, table_of(blobs), (0.0, 0.0), 1.0)


def grower(xy: Array, sweeps: int = 24) -> RegionGrower:
    affine = LocalAffine(Lattice(xy, PITCH), 0.05)
    return RegionGrower(affine, xy, np.full(len(xy), 0.4 * PITCH), 1.2, sweeps)


def test_each_pin_takes_the_nearest_blob_and_none_is_taken_twice() -> None:
    rng = np.random.default_rng(1)
    blobs = rng.uniform(20, 180, (30, 2))
    at = np.floor(rng.uniform(0, SIDE, (4, 37, 2)))
    gate = np.full(37, 25.0)
    blob, square, matched = raster(blobs).match(at, gate)
    distance = ((at[:, :, None] - blobs) ** 2).sum(-1)
    np.testing.assert_allclose(square, distance.min(-1))
    for h in range(4):
        for i in range(37):
            rivals = [square[h, k] for k in range(37) if blob[h, k] == blob[h, i] and square[h, k] < 25.0**2]
            assert matched[h, i] == (square[h, i] < 25.0**2 and square[h, i] == min(rivals))
        assert len(np.unique(blob[h, matched[h]])) == matched[h].sum() > 5


@pytest.mark.parametrize("place", [(-1e300, 5.0), (np.inf, -np.inf), (1e9, 1e9), (np.nan, 3.0)])
def test_places_outside_of_the_table_read_its_border(place: tuple[float, float]) -> None:
    blobs = pins(1)
    blob, _, matched = raster(blobs).match(np.array([[place]]), np.ones(1))
    assert 0 <= blob[0, 0] < len(blobs)
    assert not matched[0, 0]


def test_a_seed_grows_over_the_whole_tip() -> None:
    xy = pins()
    motion = 0.05 * (xy - SIDE / 2) + [4.0, -2.0]
    seed = np.hypot(*(xy - SIDE / 2).T) < 1.1 * PITCH
    order = np.random.default_rng(2).permutation(len(xy))
    blob, moved, matched = grower(xy).grow(raster((xy + motion)[order]), motion, seed)
    assert matched.all()
    np.testing.assert_array_equal(order[blob], np.arange(len(xy)))
    np.testing.assert_allclose(moved, motion)


def test_a_grown_match_uses_no_blob_twice_and_moves_to_its_blobs() -> None:
    rng = np.random.default_rng(12)
    xy = pins()
    motion, seed = rng.normal(0, 3, xy.shape), rng.random(len(xy)) < 0.9
    blobs = xy[rng.random(len(xy)) < 0.8] + rng.normal(0, 3, 2)
    before = motion.copy()
    blob, moved, matched = grower(xy, 1).grow(raster(blobs), motion, seed)
    assert 6 < matched.sum() <= len(blobs)
    assert len(np.unique(blob[matched])) == matched.sum()
    np.testing.assert_array_equal(moved[matched], blobs[blob[matched]] - xy[matched])
    np.testing.assert_array_equal(motion, before)


@pytest.mark.parametrize("blob", [-1, 7, 2**31 - 1])
def test_a_table_that_names_no_blob_is_refused(blob: int) -> None:
    blobs = pins(1)
    table = table_of(blobs)
    table[3, 4] = blob
    refused("blobs of 0 to 6", NearestBlob, blobs, table, (0.0, 0.0), 1.0)


def test_no_blobs_or_no_table_are_refused() -> None:
    table = np.zeros((2, 2), np.int32)
    for blobs, cells in ((np.empty((0, 2)), table), (np.zeros((3, 3)), table), (np.zeros((3, 2)), table[:0])):
        refused("1 or more blobs", NearestBlob, blobs, cells, (0.0, 0.0), 1.0)
    refused("finite", NearestBlob, np.zeros((3, 2)), table, (0.0, np.nan), 1.0)


def test_places_and_gates_of_other_sizes_are_refused() -> None:
    nearest = raster(pins(1))
    for at, gate in (((2, 5, 2), 4), ((2, 5, 2), 6), ((2, 5, 3), 5)):
        refused(r"at \(h, n, 2\)", nearest.match, np.zeros(at), np.ones(gate))


def test_a_seed_of_another_tip_is_refused() -> None:
    xy = pins()
    for motion, seed in (((36, 2), 37), ((37, 2), 36), ((38, 2), 38), ((37, 3), 37)):
        with pytest.raises(ValueError, match=r"motion \(37, 2\)"):
            grower(xy).grow(raster(xy), np.zeros(motion), np.ones(seed, bool))
    affine = LocalAffine(Lattice(xy, PITCH), 0.05)
    for rest, gate in ((xy[1:], 37), (xy, 36), (np.zeros((37, 3)), 37)):
        refused(r"rest_xy \(37, 2\)", RegionGrower, affine, rest, np.ones(gate), 1.2, 24)
