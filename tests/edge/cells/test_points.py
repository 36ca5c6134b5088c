"""The points of a frame: their parts, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from edge.cells.boundary import RimMotion, make_boundary, rim_motion
from edge.cells.missing import LostPins
from edge.cells.points import FramePoints
from edge.types import Array
from tests.support.layouts import PITCH_PX, hexagonal
from tests.support.refusals import refused

pytestmark = pytest.mark.kernels


def made(rings: int = 3) -> tuple[FramePoints, Array, Array, RimMotion]:
    rest = hexagonal(rings)
    around, rim = make_boundary(rest, PITCH_PX)
    motion = rim_motion(rest, rim, around, np.empty((0, 2)), PITCH_PX)
    return FramePoints(rest, motion, around), rest, around, motion


def place(points: FramePoints, xy: Array) -> Array:
    points.place(xy)
    return points.xy_img.copy()


def test_points_round_move_by_the_affine_fit_and_what_the_near_rim_pins_do_beside_it() -> None:
    points, rest, around, motion = made()
    xy = rest + np.random.default_rng(1).normal(0, 2, rest.shape)
    out = place(points, xy)
    moved = (xy - rest)[motion.rim]
    fitted = motion.fit @ moved
    weights = np.zeros((len(around), len(motion.rim)))
    np.put_along_axis(weights, motion.near, motion.weight, axis=1)
    wanted = around + motion.terms @ fitted + weights @ (moved - motion.rim_terms @ fitted)
    assert (out[: len(rest)] == xy).all()
    assert np.allclose(out[len(rest) :], wanted, rtol=0, atol=1e-6)  # weights in single precision


def test_an_affine_motion_is_followed_exactly() -> None:
    points, rest, around, _ = made()
    stretch = np.array([[1.1, 0.05], [-0.02, 0.93]])
    out = place(points, rest @ stretch + [5.0, -3.0])
    assert np.allclose(out[len(rest) :], around @ stretch + [5.0, -3.0], rtol=0, atol=1e-10)


@pytest.mark.parametrize("missing", [[0], [3, 17], [0, 1, 2, 36]])
def test_missing_pins_are_put_at_their_conditional_mean(missing: list[int]) -> None:
    points, rest, _, _ = made()
    xy = rest + np.random.default_rng(2).normal(0, 2, rest.shape)
    seen = np.ones(len(rest), bool)
    seen[missing] = False
    lost = LostPins(rest, PITCH_PX)
    assert lost.update(seen)
    assert not lost.update(seen)
    points.set_missing(*lost.gap)
    xy[missing] = np.nan
    out = place(points, xy)
    both = np.stack([2 * np.array(missing), 2 * np.array(missing) + 1], axis=1).ravel()
    motion = np.where(np.isnan(xy), 0.0, xy - rest).ravel()
    _, rows, inverse = lost.gap
    wanted = rest.ravel()[both] - inverse @ rows @ motion
    assert np.allclose(out[missing].ravel(), wanted, rtol=0, atol=1e-9)
    assert (out[: len(rest)][seen] == xy[seen]).all()


def test_sizes_that_do_not_fit_are_refused() -> None:
    points, rest, around, motion = made()
    n = len(rest)
    for bad in (rest[:-1], np.empty((n, 3)), np.empty((0, 2))):
        refused("is wanted", points.place, np.ascontiguousarray(bad))
    for field in ("rim_terms", "fit", "terms", "near", "weight"):
        short = motion._replace(**{field: getattr(motion, field)[:-1]})
        refused("are wanted", FramePoints, rest, short, around)
    for i in (n, -1):
        rim = motion.rim.copy()
        rim[3] = i
        refused("rim: ", FramePoints, rest, motion._replace(rim=rim), around)
    for i in (len(motion.rim), -1):
        near = motion.near.copy()
        near[3, 1] = i
        refused("near: ", FramePoints, rest, motion._replace(near=near), around)
    for pins in ([n], [-1, 2], [2, 1], [1, 1], list(range(n))):
        m = len(pins)
        with pytest.raises(ValueError, match="missing"):
            points.set_missing(np.array(pins, np.int32), np.zeros((2 * m, 2 * n)), np.zeros((2 * m, 2 * m)))
