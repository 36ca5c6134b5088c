"""Which blob each pin has for certain: the assignment of largest posterior, by a prior of the skin's motion.

Idea: the motion is modelled as a random field (`edge.geometry.motion_field`), so that the pins around each
pin give its place and a variance. How much the skin bends differs over the tip: the field's scale is learnt
at each pin from how well the ones around are predicted, which makes the likelihood a Student t. A blob is a
pin's own if that is clearly more likely than that the pin is missing and the blob is false; how often either
happens is counted in the frame.

Rules
- Pins that are worse off than all around them go first; the others are then judged without them.
- A row that slipped by one pin is smooth in itself. It leaves an unmatched pin at one end and an unassigned
  blob at the other, and it needs a field so rough that a step of a pitch goes unnoticed. Where all three are
  found, nothing is certain. A false blob or a missing pin may hide one of the signs; a rougher field yet is
  enough then.
- What is not certain is assigned anew, all at once, as the certain pins predict it; again and again while
  that makes more pins certain.
- A pin that is left out here is found again by `follow`; a swapped one would stay.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from edge.geometry.lattice import PARAMS
from edge.geometry.motion_field import PREDICTING, component_covariance
from edge.tracking.tip import TrackedTip
from edge.types import Array, Index, Mask

__all__ = ["MotionModel", "certain_match"]

#: Keeps the equations solvable where fewer than three pins are known: the inverse of a variance.
UNDETERMINED = 1e-6


class MotionModel:
    """The prior of one tip: what the pins around predict for each.

    Positions in pitches. Of one component of the motion: with as much curl as divergence the two are
    independent.
    """

    def __init__(self, tip: TrackedTip) -> None:
        self.tip = tip
        near, row = tip.lattice.near, np.arange(len(tip), dtype=np.int32)
        x = (tip.rest_xy - tip.rest_xy.mean(0)) / tip.pitch_px
        field = component_covariance(x, PREDICTING)
        self._own = float(field[0, 0])
        self._all = _with_affine(field, x)
        self._among = _with_affine(field[near[:, :, None], near[:, None, :]], tip.lattice.offset)
        affine = np.broadcast_to([1.0, 0.0, 0.0], (len(tip), 3))
        self._with = np.concatenate([field[near, row[:, None]], affine], axis=1)
        self.weight, self.variance = self.from_near(row, np.ones(near.shape, np.bool_))

    def from_near(self, rows: Index, known: Mask) -> tuple[Array, Array]:
        """(r, k) the weights of the known ones among the near pins (r, k) in the prediction of these pins,
        and (r,) its variance against the field's scale.
        """
        known = np.concatenate([known, np.ones((len(rows), 3), np.bool_)], axis=1)
        both = known[:, :, None] & known[:, None, :]
        among = np.where(both, self._among[rows], np.eye(known.shape[1]))
        with_own = np.where(known, self._with[rows], 0.0)
        weight = np.linalg.solve(among, with_own[..., None])[..., 0]
        return weight[:, :-3], self._own - (weight * with_own).sum(1)

    def from_around(self, motion: Array, known: Mask, rows: Index) -> tuple[Array, Array]:
        """(r, 2) the motion of these pins as predicted by all known pins around them, and (r,) its variance
        against the field's scale; motion (n, 2).
        """
        n = len(known)
        around = np.zeros(n, np.bool_)
        around[self.tip.lattice.near[rows]] = True
        knots = np.flatnonzero(around & known)
        used = np.append(knots, [n, n + 1, n + 2])
        with_own = self._all[np.ix_(used, rows)]
        weight = np.linalg.solve(self._all[np.ix_(used, used)], with_own)
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


def certain_match(model: MotionModel, blob_xy: Array, blob: Index, matched: Mask) -> tuple[Index, Mask, Mask]:
    """The match (n,) with what was uncertain assigned anew: the blob of each pin, and (n,) where it has one;
    (n,) the pins that are certain.

    blob_xy  (m, 2) px, all blobs
    blob     (n,) index of the blob of each pin, where matched
    """
    found = _Hypothesis(model, blob_xy, blob, matched)
    certain = found.certain()
    while 0 < np.count_nonzero(certain) < min(len(certain), len(blob_xy)):
        again = _Hypothesis(model, blob_xy, found.blob, certain)
        again.assign(found.scale, found.freedom)
        more = again.certain()
        if np.count_nonzero(more) <= np.count_nonzero(certain):
            break
        found, certain = again, more
    return found.blob, found.known, certain


class _Hypothesis:
    """A match that changes, and how well each pin is predicted by the others.

    blob, known       (n,) as of `Match`
    mean, variance    (n, 2) motion of each pin as predicted, pitches, and (n,) its variance against the scale
    square            (n,) of the distance from there, square pitches
    scale, freedom    (n,) variance of the field at each pin, square pitches, and its degrees of freedom
    """

    def __init__(self, model: MotionModel, blob_xy: Array, blob: Index, known: Mask) -> None:
        self._model, self._tip, self._blob_xy = model, model.tip, blob_xy
        self.blob, self.known = blob.copy(), known.copy()
        self._weight, self.variance = model.weight.copy(), model.variance.copy()
        self._weighted = np.ones(len(known), np.bool_)  # the pins that the weights are for
        self.mean = self.square = self.scale = self.freedom = np.zeros(0)

    def certain(self) -> Mask:
        """(n,) the pins with a clear posterior, once those that are unlikely are no longer known."""
        p, adjacent = self._tip.params, self._tip.lattice.adjacent
        while self.known.any():
            self._predict()
            density = _log_density(self.square, self.variance * self.scale, self.freedom)
            odds = np.where(self.known, density - self._log_chance(), np.inf)
            worst = (odds < 0) & (odds <= np.append(odds, np.inf)[adjacent].min(1))
            if not worst.any():
                clear = odds > np.log(p.posterior_min / (1 - p.posterior_min))
                return self._apart(self.known & clear & ~self._may_have_slipped(), odds)
            self.known = self.known & ~worst
        return self.known

    def assign(self, scale: Array, freedom: Array) -> None:
        """Give unassigned blobs to unmatched pins; predicted again from the assignment until it no longer
        changes.
        """
        tip, pins, free = self._tip, _rows(~self.known), _rows(self._unassigned())
        at, blob_at = tip.rest_xy[pins] / tip.pitch_px, self._blob_xy[free] / tip.pitch_px
        mean, variance = self._model.from_around(self._motion(), self.known, pins)
        chosen = np.full(len(pins), -1)
        for _ in range(tip.params.assign_rounds):
            square = ((at[:, None] + mean[:, None] - blob_at) ** 2).sum(2)
            density = _log_density(square, (variance * scale[pins])[:, None], freedom[pins, None])
            odds = density - self._log_chance()
            pin, blob = linear_sum_assignment(-np.maximum(odds, 0))
            pin, blob = np.stack([pin, blob])[:, odds[pin, blob] > 0]
            before, chosen = chosen, np.full(len(pins), -1)
            chosen[pin] = free[blob]
            if np.array_equal(before, chosen):
                break
            self.known[pins], self.blob[pins] = chosen >= 0, np.maximum(chosen, 0)
            self._predict()
            mean, variance, scale, freedom = self.mean[pins], self.variance[pins], self.scale, self.freedom

    def _predict(self) -> None:
        """Each pin from the known ones near, and the scale of the field from their predictions' errors."""
        p, near, motion = self._tip.params, self._tip.lattice.near, self._motion()
        rows = _rows((self.known != self._weighted)[near].any(1))
        self._weight[rows], self.variance[rows] = self._model.from_near(rows, self.known[near[rows]])
        self._weighted = self.known.copy()
        self.mean = (self._weight[..., None] * motion[near]).sum(1)
        self.square = ((motion - self.mean) ** 2).sum(1)
        ratio = self.square / self.variance
        # Of the frame by the median, which outliers do not move; half the square is that of one component.
        of_frame = float(np.median(ratio[self.known])) / (2 * np.log(2)) + np.finfo(np.float64).eps
        around = np.where(self.known[near], self._tip.lattice.weight, 0.0)
        of_near = (around * ratio[near]).sum(1) / 2
        self.freedom = p.scale_freedom + around.sum(1)
        self.scale = (p.scale_freedom * of_frame + of_near) / self.freedom

    def _motion(self) -> Array:
        """(n, 2) pitches."""
        return np.asarray((self._blob_xy[self.blob] - self._tip.rest_xy) / self._tip.pitch_px, np.float64)

    def _unassigned(self) -> Mask:
        """(m,) the blobs that no known pin has."""
        free = np.ones(len(self._blob_xy), np.bool_)
        free[self.blob[self.known]] = False
        return free

    def _log_chance(self) -> float:
        """Logarithm of the odds that a pin is missing times the density of false blobs, per square pitch;
        both as the frame has them, and one more.
        """
        n, known_n = len(self.known), int(np.count_nonzero(self.known))
        missing = (n - known_n + 1) / (n + 2)
        area = n * np.sqrt(0.75)  # of so many pins
        false = (len(self._blob_xy) - known_n + 1) / area
        return float(np.log(false * missing / (1 - missing)))

    def _apart(self, certain: Mask, odds: Array) -> Mask:
        """(n,) without the less likely of two that are too near to each other: one is a reflection, or both
        are the same pin.
        """
        first, second = self._tip.lattice.pairs.T
        gap = np.hypot(*(self._blob_xy[self.blob[first]] - self._blob_xy[self.blob[second]]).T)
        near = certain[first] & certain[second] & (gap < self._tip.lattice.distance_min_px)
        certain[np.where(odds[first] < odds[second], first, second)[near]] = False
        return certain

    def _may_have_slipped(self) -> Mask:
        """(n,) the pins where the field is rough, and signs of a slip are in reach of the neighbours."""
        p, lattice = self._tip.params, self._tip.lattice
        by_unmatched = (~self.known[lattice.near] & (lattice.weight > 0)).any(1)
        by_unassigned = np.zeros(len(self.known), np.bool_)
        unassigned = self._blob_xy[self._unassigned()]
        if len(unassigned):
            apart, _ = cKDTree(unassigned).query(self._blob_xy[self.blob])
            by_unassigned = apart < PARAMS.near_reach * self._tip.pitch_px
        spread = (self.freedom * self.variance * self.scale + self.square) / (self.freedom + 2)
        rough, rougher = spread > p.slip_spread**2, spread > p.slip_spread_hidden**2
        return np.asarray((by_unmatched & by_unassigned & rough) | ((by_unmatched | by_unassigned) & rougher))


def _rows(mask: Mask) -> Index:
    return np.flatnonzero(mask).astype(np.int32)


def _log_density(square: Array, variance: Array, freedom: Array) -> Array:
    """Logarithm of the density of a Student t in the plane, at this square of the distance from its
    middle.
    """
    return np.asarray(
        -np.log(2 * np.pi * variance) - (freedom / 2 + 1) * np.log1p(square / (freedom * variance))
    )
