"""The prior of one tip's motion: what the pins around predict for each, and how far a tip moves as a whole.

Idea: the motion is modelled as a random field (`edge.geometry.motion_field`), so that the pins around each
pin give its place and a variance. The field's scale is not known here: it differs over the tip and is learnt
from the frame (`edge.tracking.hypothesis`).
"""

import numpy as np

from edge.geometry.motion_field import PREDICTING, component_covariance
from edge.tracking.match import Kriging
from edge.tracking.tip import TrackedTip
from edge.types import Array, Index, Mask

#: Keeps the equations solvable where fewer than three pins are known: the inverse of a variance.
UNDETERMINED = 1e-6


class MotionModel:
    """The prior of one tip: what the pins around predict for each.

    Positions in pitches. Of one component of the motion: with as much curl as divergence the two are
    independent.
    """

    def __init__(self, tip: TrackedTip) -> None:
        self.tip = tip
        self.noise = float(np.median(tip.rest.pins.sigma_px)) / tip.lattice.pitch_px  # of a centroid
        near, row = tip.lattice.near, np.arange(len(tip), dtype=np.int32)
        self._x: Array = (tip.lattice.rest_xy - tip.lattice.rest_xy.mean(0)) / tip.lattice.pitch_px
        field = component_covariance(self._x, PREDICTING)
        self._own = float(field[0, 0])
        among = _with_affine(field[near[:, :, None], near[:, None, :]], tip.lattice.offset)
        affine = np.broadcast_to([1.0, 0.0, 0.0], (len(tip), 3))
        own_with = np.concatenate([field[near, row[:, None]], affine], axis=1)
        inverse = np.asarray(np.linalg.inv(among), np.float64)
        self.kriging = Kriging(near, tip.lattice.weight, inverse, own_with, self._own)
        self.weight, self.variance = self.kriging.weights(row, np.ones(near.shape, np.bool_))

    def log_prior(self, motion: Array, known: Mask) -> float:
        """Logarithm of the density of a tip's motion as a whole, against that at rest; motion (n, 2) pitches.

        The mean is subtracted from motion and direction: otherwise a shift of a partly seen tip counts as
        rotation.
        """
        p, moved, around = self.tip.params, motion[known], self.tip.tangential[known]
        shift, around = moved.mean(0), around - around.mean(0)
        rotation = float(np.sum((moved - shift) * around)) / max(float(np.sum(around**2)), 1e-9)
        return -float(shift @ shift) / (2 * p.shift_spread**2) - rotation**2 / (2 * p.rotation_spread**2)

    def from_around(self, motion: Array, known: Mask, rows: Index) -> tuple[Array, Array]:
        """(r, 2) the motion of these pins as predicted by all known pins around them, and (r,) its variance
        against the field's scale; motion (n, 2).
        """
        around = np.zeros(len(known), np.bool_)
        around[self.tip.lattice.near[rows]] = True
        knots = np.flatnonzero(around & known)
        pins = np.union1d(knots, rows)
        among = _with_affine(component_covariance(self._x[pins], PREDICTING), self._x[pins])
        used = np.append(np.searchsorted(pins, knots), len(pins) + np.arange(3))
        with_own = among[np.ix_(used, np.searchsorted(pins, rows))]
        weight = np.linalg.solve(among[np.ix_(used, used)], with_own)
        return weight[:-3].T @ motion[knots], self._own - (weight * with_own).sum(0)


def _with_affine(field: Array, x: Array) -> Array:
    """(..., k + 3, k + 3) the equations of an estimate from pins at x (..., k, 2), whose affine part is free;
    field (..., k, k) their covariance.
    """
    k = x.shape[-2]
    system = np.zeros((*x.shape[:-2], k + 3, k + 3))
    system[..., :k, :k] = field
    system[..., :k, k] = system[..., k, :k] = 1.0
    system[..., :k, k + 1 :] = x
    system[..., k + 1 :, :k] = np.swapaxes(x, -1, -2)
    system[..., k:, k:] = -UNDETERMINED * np.eye(3)
    return system
