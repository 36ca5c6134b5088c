"""Where a lost pin is, as far as its neighbours know.

The displacement field is completed so that it bends least: the sum over all pins of the squared
difference between a pin's motion and what an affine fit to its neighbours' motion says. Affine motion
bends nothing and is continued exactly; a gap is closed smoothly.
"""

from __future__ import annotations

import numpy as np

from edge.tessellate.layout import affine_terms, must_span
from edge.types import Array, Index, Mask

__all__ = ["Gap", "LostPins"]

#: Lost pins (m,) ascending, their rows (m, n) of the bending matrix, the inverse (m, m) of its block.
Gap = tuple[Index, Array, Array]

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
        self._key = np.ones(len(rest_img), dtype=np.bool_).tobytes()  # the set that the gap is for
        self._gap: Gap = (np.empty(0, np.int32), np.empty((0, len(rest_img))), np.empty((0, 0)))

    def gap(self, seen: Mask) -> Gap:
        """What `edge._cells.place` needs to put the lost pins in.

        Raises   DegenerateLayout: fewer than 3 pins seen, or all on a line
        """
        key = seen.tobytes()
        if key != self._key:
            must_span(self._rest_img[seen], "seen pins")
            lost = np.flatnonzero(~seen).astype(np.int32)
            rows = self._bending[lost]
            inverse = np.linalg.inv(rows[:, lost]).astype(np.float64, copy=False)
            self._gap, self._key = (lost, rows, np.ascontiguousarray(inverse)), key
        return self._gap


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
