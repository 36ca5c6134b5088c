"""Where a lost pin is, as far as its neighbours know.

The displacement field is completed so that it bends least: the sum over all pins of the squared
difference between a pin's motion and what an affine fit to its neighbours' motion says. Affine motion
bends nothing and is continued exactly; a gap is closed smoothly.
"""

from __future__ import annotations

import numpy as np

from edge.tessellate.layout import affine_terms, must_span
from edge.types import Array, Index, Mask

__all__ = ["LostPins"]

# Neighbours that predict a pin: within this many pitches. Two rings of a hexagonal lattice.
NEIGHBOUR_PITCHES = 2.1
# Motion is called affine-predictable from this many neighbours on; fewer, and their mean is taken.
NEIGHBOURS_MIN = 4
# Share of the mean stiffness; affine motion of a tip is continued to 1e-8 of it.
RIDGE = 1e-12


class LostPins:
    """Predicts lost pins of one tip; keeps the equations for the last set of lost ones.

    rest_img  (n, 2) px
    pitch_px  distance of neighbours
    """

    def __init__(self, rest_img: Array, pitch_px: float) -> None:
        self._rest_img = rest_img
        self._bending = _bending_matrix(rest_img, pitch_px)
        self._key = b""  # the set that the two below are for
        self._lost: Index = np.empty(0, dtype=np.int32)
        self._rows: Array = np.empty((0, 0))  # (lost, n), of the bending matrix
        self._inverse: Array = np.empty((0, 0))  # (lost, lost), of its block

    def fill(self, xy: Array, seen: Mask) -> Array:
        """A copy of `xy` with the lost pins put in.

        xy       (n, 2) px; rows that are not seen are not read
        Raises   DegenerateLayout: fewer than 3 pins seen, or all on a line
        """
        key = seen.tobytes()
        if key != self._key:
            must_span(self._rest_img[seen], "seen pins")
            self._lost = np.flatnonzero(~seen).astype(np.int32)
            self._rows = self._bending[self._lost]
            self._inverse = np.linalg.inv(self._rows[:, self._lost]).astype(np.float64, copy=False)
            self._key = key
        lost = self._lost
        motion = xy - self._rest_img
        shift = motion[seen.argmax()].copy()  # taken out, so that a far origin costs no digits
        motion -= shift
        motion[lost] = 0.0
        full = np.array(xy)
        full[lost] = self._rest_img[lost] + shift - self._inverse @ (self._rows @ motion)
        return full


def _bending_matrix(xy: Array, pitch_px: float) -> Array:
    """(n, n) symmetric, positive on every set of pins that leaves three others that span a plane.

    u^T B u is the sum over pins of (u_i - what its neighbours predict)^2: the prediction is an affine
    fit, so that any affine motion costs nothing.
    """
    n = len(xy)
    residual = np.eye(n)
    for i in range(n):
        to_other = xy - xy[i]
        distance = np.hypot(to_other[:, 0], to_other[:, 1])
        distance[i] = np.inf
        reach = max(NEIGHBOUR_PITCHES * pitch_px, float(np.partition(distance, min(n, 6) - 1)[min(n, 6) - 1]))
        near = np.flatnonzero(distance <= reach)
        near = near[near != i]
        spread = (
            distance[near] ** 2 - distance[near].min() ** 2
        )  # far from every pin, the nearest still count
        weight = np.exp(-0.5 * spread / pitch_px**2)
        terms = affine_terms(xy[near], xy[i], pitch_px)
        root = np.sqrt(weight)[:, None]
        if len(near) >= NEIGHBOURS_MIN:
            residual[i, near] -= np.linalg.pinv(terms * root, rcond=1e-6)[0] * root[:, 0]
        else:
            residual[i, near] -= weight / weight.sum()
    # The faintest pull to the first seen pin's motion keeps the solution unique where a whole
    # separate group of pins is lost.
    bending: Array = residual.T @ residual
    bending += RIDGE * np.trace(bending) / n * np.eye(n)
    return bending
