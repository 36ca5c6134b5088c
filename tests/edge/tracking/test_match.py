"""The arithmetic of the search: no blob twice, and assignments that cost least."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from edge.geometry.lattice import Lattice
from edge.tracking.match import NearestBlob, RegionGrower, assign
from edge.tracking.outliers import LocalAffine
from edge.types import Array
from tests.support.fields import hexagon

PITCH = 18.0
SIDE = 200

pytestmark = pytest.mark.kernels


def pins(rings: int = 3) -> Array:
    return hexagon(rings, PITCH) + SIDE / 2


def raster(blobs: Array) -> NearestBlob:
    """The nearest blob to each pixel is searched exhaustively."""
    grid = np.indices((SIDE, SIDE))[::-1].reshape(2, -1, 1)
    nearest = ((grid - blobs.T[:, None]) ** 2).sum(0).argmin(1).astype(np.int32)
    return NearestBlob(blobs, nearest.reshape(SIDE, SIDE), (0.0, 0.0), 1.0)


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


def test_a_grown_match_uses_no_blob_twice_and_moves_to_its_blobs() -> None:
    rng = np.random.default_rng(12)
    xy = pins()
    motion, seed = rng.normal(0, 3, xy.shape), rng.random(len(xy)) < 0.9
    blobs = xy[rng.random(len(xy)) < 0.8] + rng.normal(0, 3, 2)
    before = motion.copy()
    grower = RegionGrower(LocalAffine(Lattice(xy, PITCH), 0.05), xy, np.full(len(xy), 0.4 * PITCH), 1.2, 1)
    blob, moved, matched = grower.grow(raster(blobs), motion, seed)
    assert 6 < matched.sum() <= len(blobs)
    assert len(np.unique(blob[matched])) == matched.sum()
    np.testing.assert_array_equal(moved[matched], blobs[blob[matched]] - xy[matched])
    np.testing.assert_array_equal(motion, before)


@pytest.mark.parametrize("shape", [(1, 1), (4, 4), (12, 30), (25, 25), (0, 3)])
@pytest.mark.parametrize("whole", [False, True])
def test_no_other_assignment_costs_less(shape: tuple[int, int], whole: bool) -> None:
    rng = np.random.default_rng(3)
    cost = rng.integers(-3, 3, shape).astype(float) if whole else rng.normal(size=shape)
    column = assign(cost)
    assert len(set(column.tolist())) == shape[0]
    least = cost[linear_sum_assignment(cost)].sum()
    assert cost[np.arange(shape[0]), column].sum() == pytest.approx(least, abs=1e-12)
