"""The rest lattice and smooth motion fields over it.

Idea: pins sit on one skin, so their motion is a smooth function of the rest position. Two views of it:
a vector polynomial over the whole tip (coarse, needs no neighbours), and a local affine map a pin from
its neighbours (fine, reaches as far as there are neighbours). Both are linear in the motion, so the
designs are made once a rest frame and each fit is a few small matrix products, for many hypotheses at
once: arrays of `disagreement` and `Polynomial` carry a leading axis h of hypotheses.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import Delaunay, QhullError, cKDTree

from edge import _track
from edge.errors import DegenerateLayout
from edge.types import Array, Mask

__all__ = ["Lattice", "Polynomial"]

# Edges of the rest Delaunay longer than this many pitches bridge the hull's bays and tie pins that are
# no neighbours: a hexagonal lattice has edges of 1, a square one of 1 and 1.41.
LONGEST_EDGE = 1.7
# Two rings of a hexagonal lattice: enough that an affine map survives a third of them lost.
N_NEAR = 18
# Reach of the second ring, and the width of the Gaussian weight, in pitches.
NEAR_REACH = 2.6
NEAR_WIDTH = 1.6
# Ridge on the local gradient, in neighbours' weights: below three neighbours the map turns into a shift.
GRADIENT_RIDGE = 0.05
# No two tracks come nearer than half a pitch, or this share of their distance at rest where that is less.
APART = 0.5
APART_OF_REST = 0.85
N_CLOSE = 8


class Lattice:
    """Neighbours of each pin at rest, and local affine prediction from them.

    edge    (e, 2) int, Delaunay edges, each once, none longer than LONGEST_EDGE pitches
    corner  (t, 3) int, Delaunay triangles of such edges
    ring    (n, k) int, Delaunay neighbours, filled up with n
    near    (n, N_NEAR) int, nearest pins; map: these, their weights and places, as `_track` has them
    mean    (n, n) sparse: `predict` where every pin is known, as one product
    step_px (n,) distance to the next pin, a median over the neighbourhood: the unit of every gate
    close   (n, N_CLOSE) int, nearest pins
    pair, apart_px  (p, 2) int, (p,) those as pairs, each once, and the least distance that tracks keep
    """

    def __init__(self, rest_xy: Array, pitch_px: float) -> None:
        """Raises DegenerateLayout: fewer than 4 pins, or all on a line."""
        n = len(rest_xy)
        if n < 4:
            raise DegenerateLayout(f"{n} pins in the rest frame; tracking needs at least 4")
        try:
            corners = Delaunay(rest_xy).simplices
        except QhullError:
            raise DegenerateLayout("all pins of the rest frame lie on one line") from None
        edge = np.unique(
            np.sort(np.vstack([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])), axis=0
        )
        length = np.hypot(*(rest_xy[edge[:, 0]] - rest_xy[edge[:, 1]]).T)
        self.edge = edge[length < LONGEST_EDGE * pitch_px]
        sides = rest_xy[corners] - rest_xy[np.roll(corners, 1, axis=1)]
        self.corner = corners[(np.hypot(sides[..., 0], sides[..., 1]) < LONGEST_EDGE * pitch_px).all(1)]
        along = rest_xy[self.edge[:, 1]] - rest_xy[self.edge[:, 0]]
        sixfold = np.angle(np.sum(np.exp(6j * np.arctan2(along[:, 1], along[:, 0])))) / 6
        self.direction_rad = float(sixfold)
        self.rest_xy = rest_xy
        self.pitch_px = pitch_px
        both = np.vstack([self.edge, self.edge[:, ::-1]])
        both = both[np.argsort(both[:, 0], kind="stable")]
        degree = np.bincount(both[:, 0], minlength=n)
        self.ring = np.full((n, max(1, int(degree.max()))), n)
        column = np.arange(len(both)) - np.repeat(np.cumsum(degree) - degree, degree)
        self.ring[both[:, 0], column] = both[:, 1]
        self._ring = self.ring.astype(np.int32)

        distance, near = cKDTree(rest_xy).query(rest_xy, k=min(N_NEAR, n - 1) + 1)
        self.near = near[:, 1:]
        distance = distance[:, 1:] / pitch_px
        self.weight = np.where(distance < NEAR_REACH, np.exp(-0.5 * (distance / NEAR_WIDTH) ** 2), 0.0)
        offset = (rest_xy[self.near] - rest_xy[:, None]) / pitch_px
        self.map = (
            np.ascontiguousarray(self.near, np.int32),
            self.weight,
            np.ascontiguousarray(offset),
            GRADIENT_RIDGE,
        )
        # The local map of a full neighbourhood, read at the pin itself, is a constant weighted mean.
        one, seen = np.eye(n), np.ones(n, bool)
        self.mean = csr_array(
            np.stack([self.predict(one[[k, k]].T, seen)[0][:, 0] for k in range(n)], axis=1)
        )
        # Rows may be much denser one way than the other; what can be mistaken is the nearest neighbour.
        nearest_px = distance[:, 0] * pitch_px
        self.step_px: Array = np.median(nearest_px[near[:, :N_CLOSE]], axis=1)
        # Nearest neighbours, and how near they may come: pins that are close at rest may stay so.
        self.close = near[:, 1 : 1 + N_CLOSE]
        both = np.sort(np.stack([np.repeat(np.arange(n), self.close.shape[1]), self.close.ravel()], axis=1))
        self.pair, first = np.unique(both, axis=0, return_index=True)
        apart = distance[:, : self.close.shape[1]].ravel()[first]
        self.apart_px = np.minimum(APART, APART_OF_REST * apart) * pitch_px

    def predict(self, motion: Array, known: Mask) -> tuple[Array, Array, Array]:
        """Motion of each pin as its known neighbours have it; the pin itself has no say.

        motion (n, 2) px, whatever where not known; known (n,) bool
        Returns (n, 2) motion, (n,) sum of the neighbours' weights, (n, 2, 2) gradient per pitch
        """
        n = len(known)
        value, support, gradient = np.empty((n, 2)), np.empty(n), np.empty((n, 2, 2))
        _track.predict(np.ascontiguousarray(motion), known, self.map, value, support, gradient)
        return value, support, gradient

    def disagreement(self, motion: Array, known: Mask) -> Array:
        """(h, n) px, how far each motion is off the mean of its known Delaunay neighbours'; inf: unknown."""
        off = np.empty(known.shape)
        _track.disagree(np.ascontiguousarray(motion), known, self._ring, self.ring.shape[0], off)
        return off


class Polynomial:
    """Least-squares vector polynomials of the rest position, Legendre products up to a total degree."""

    def __init__(self, rest_xy: Array, degree: int) -> None:
        centre = (rest_xy.min(0) + rest_xy.max(0)) / 2
        unit = (rest_xy - centre) / np.abs(rest_xy - centre).max()
        x = legendre.legvander(unit[:, 0], degree)
        y = legendre.legvander(unit[:, 1], degree)
        terms = [(d - j, j) for d in range(degree + 1) for j in range(d + 1)]
        basis = np.stack([x[:, i] * y[:, j] for i, j in terms], axis=1)
        self._basis: Array = np.asarray(basis, np.float64)
        # A light ridge that grows with the degree: rim pins without a match must not let it swing.
        self._ridge = np.array([0.01 * (1 + i + j) ** 1.5 if i + j > 1 else 1e-6 for i, j in terms])
        self._outer: dict[int, NDArray[np.float64]] = {}
        for d in range(1, degree + 1):
            b = self._basis[:, : (d + 1) * (d + 2) // 2]
            self._outer[d] = (b[:, :, None] * b[:, None, :]).reshape(len(b), -1)

    def smooth(self, motion: Array, weight: Array, degree: int) -> Array:
        """motion (h, n, 2) px, weight (h, n) >= 0 -> (h, n, 2) the fitted polynomial at every pin."""
        p = (degree + 1) * (degree + 2) // 2
        basis = self._basis[:, :p]
        normal = (weight @ self._outer[degree]).reshape(-1, p, p) + np.diag(self._ridge[:p])
        terms = np.linalg.solve(normal, basis.T @ (motion * weight[..., None]))
        return np.asarray(basis @ terms, np.float64)
