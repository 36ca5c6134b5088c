"""A match of pins and blobs: its posterior, and which of its pins are certain.

Idea: the pins around each pin give its place and a variance (`MotionModel`). How much the skin bends differs
over the tip: the field's scale is learnt at each pin from how well the ones around are predicted, which makes
the likelihood a Student t. A blob is a pin's own if that is clearly more likely than that the pin is missing
and the blob is false; how often either happens is counted in the frame.

Rules
- Pins that are worse off than all around them go first; the others are then evaluated without them.
- A row that slipped by one pin is smooth in itself. It leaves an unmatched pin at one end and an unassigned
  blob at the other, and it needs a field so rough that a step of a pitch goes unnoticed. Where all three are
  found, nothing is certain. A false blob or a missing pin may hide one of the signs; a rougher field yet is
  enough then.
- What is not certain is assigned anew, all at once, as the certain pins predict it; again and again while
  that makes more pins certain.
- A pin that is left out here is found again by `follow`; a swapped one would stay.
"""

from __future__ import annotations

from math import lgamma, log

import numpy as np

from edge.geometry.lattice import THIRD_RING
from edge.geometry.neighbours import nearest_of
from edge.tracking.match import assign
from edge.tracking.motion_model import MotionModel
from edge.types import Array, Index, Mask


def certain_match(found: Hypothesis) -> tuple[Hypothesis, Mask]:
    """The match with what was uncertain assigned anew, and (n,) its pins that are certain."""
    certain = found.certain()
    while 0 < np.count_nonzero(certain) < min(len(certain), len(found.blob_xy)):
        again = Hypothesis(found.model, found.blob_xy, found.blob, certain)
        again.assign(found.scale, found.freedom)
        more = again.certain()
        if np.count_nonzero(more) <= np.count_nonzero(certain):
            break
        found, certain = again, more
    return found, certain


class Hypothesis:
    """Which blob each pin has, without those that are more likely missing.

    blob, known       (n,) the blob of each pin, and whether it has one
    mean, variance    (n, 2) motion of each pin as predicted, pitches, and (n,) its variance against the scale
    square            (n,) of the distance from there, square pitches
    scale, freedom    (n,) variance of the field at each pin, square pitches, and its degrees of freedom
    log_posterior     against that all pins are missing and all blobs false
    log_together      of it, because pins are missing together instead of at random
    """

    def __init__(self, model: MotionModel, blob_xy: Array, blob: Index, known: Mask) -> None:
        """blob_xy (m, 2) px, all blobs; blob, known (n,) what is matched with what."""
        self.model, self._tip, self.blob_xy = model, model.tip, blob_xy
        self.blob, self.known = blob.copy(), known.copy()
        self._weight, self.variance = model.weight.copy(), model.variance.copy()
        self._weighted = np.ones(self._weight.shape, np.bool_)  # the pins that the weights are for
        self.mean = self.square = self.scale = self.freedom = self._density = np.zeros(len(known))
        self._drop_unlikely()

    @property
    def known_n(self) -> int:
        return int(np.count_nonzero(self.known))

    @property
    def spread(self) -> Array:
        """(n,) variance of each pin's place as predicted, with the noise of a centroid, square pitches."""
        return np.asarray(self.variance * self.scale + self.model.noise**2)

    @property
    def motion(self) -> Array:
        """(n, 2) pitches; meaningless where not known."""
        return np.asarray(
            (self.blob_xy[self.blob] - self._tip.lattice.rest_xy) / self._tip.lattice.pitch_px, np.float64
        )

    def _log_posterior_at_random(self) -> float:
        """Log posterior as if pins were missing at random. All numbers of missing pins and of false blobs,
        which are anywhere on the tip, are alike. The likelihood of the places is that of each pin by its
        neighbours (Besag, Statistical analysis of non-lattice data, The Statistician 24, 1975).
        """
        n, m, known_n = len(self.known), len(self.blob_xy), self.known_n
        if not known_n:
            return 0.0
        ways = lgamma(n + 1) - lgamma(known_n + 1) - lgamma(n - known_n + 1)
        ways += lgamma(m + 1) - lgamma(m - known_n + 1)
        places = self._density[self.known].sum() + known_n * np.log(self._area)
        return float(places - ways + self.model.log_prior(self.motion, self.known))

    def _log_together(self) -> float:
        """A hidden side takes pins that are beside each other: a lattice that slipped by one step away from
        there leaves a row of pins without blobs at the far rim, and fits as well in all else. So the share of
        missing pins is another, and unknown, for each number of missing neighbours; the likelihood is that of
        each pin by its neighbours again.
        """
        n, known_n = len(self.known), self.known_n
        at_random = lgamma(known_n + 1) + lgamma(n - known_n + 1) - lgamma(n + 1)
        nothing = np.zeros(n, np.bool_)
        return self._log_missing(self.known) - self._log_missing(nothing) - at_random

    def _log_missing(self, known: Mask) -> float:
        """Logarithm of the probability that just these pins are known."""
        adjacent = self._tip.lattice.adjacent
        around_n = np.append(~known, False)[adjacent].sum(1)
        have = np.bincount(around_n[known], minlength=adjacent.shape[1] + 1).tolist()
        have_not = np.bincount(around_n[~known], minlength=adjacent.shape[1] + 1).tolist()
        return sum(
            lgamma(a + 1) + lgamma(b + 1) - lgamma(a + b + 2) for a, b in zip(have, have_not, strict=True)
        )

    def differs(self, other: Hypothesis) -> bool:
        """Whether it has less than half of the other's identities."""
        same = self.known & other.known & (self.blob == other.blob)
        return 2 * int(np.count_nonzero(same)) < other.known_n

    def certain(self) -> Mask:
        """(n,) the pins with a clear posterior."""
        odds = self._odds()
        least = self._tip.params.posterior_min
        clear = odds > log(least / (1 - least))
        return self._apart(self.known & clear & ~self._may_have_slipped(), odds)

    def assign(self, scale: Array, freedom: Array) -> None:
        """Give unassigned blobs to unmatched pins; predicted again from the assignment while that gives more
        pins a blob, or as many a likelier one: it could go round thousands of assignments.
        """
        if not self.known.any():
            return
        tip, pins, free = self._tip, _rows(~self.known), _rows(self._unassigned())
        pitch_px = tip.lattice.pitch_px
        at, blob_at = tip.lattice.rest_xy[pins] / pitch_px, self.blob_xy[free] / pitch_px
        mean, variance = self.model.from_around(self.motion, self.known, pins)
        before = (0, 0.0)
        while True:
            square = ((at[:, None] + mean[:, None] - blob_at) ** 2).sum(2)
            density = self._log_density(square, (variance * scale[pins])[:, None], freedom[pins, None])
            odds = density - self._log_chance()
            # Any pin may stay without a blob, at no cost.
            blob = assign(np.hstack([-np.maximum(odds, 0), np.zeros((len(pins), len(pins)))]))
            pin = _rows(blob < len(free))
            pin = pin[odds[pin, blob[pin]] > 0]
            chosen = np.full(len(pins), -1, np.int32)
            chosen[pin] = free[blob[pin]]
            now = (len(pin), float(odds[pin, blob[pin]].sum()))
            if now <= before:
                break
            before = now
            self.known[pins], self.blob[pins] = chosen >= 0, np.maximum(chosen, 0)
            self._predict(np.ones(len(self.known), np.bool_))
            mean, variance, scale, freedom = self.mean[pins], self.variance[pins], self.scale, self.freedom
        self._drop_unlikely()

    def _drop_unlikely(self) -> None:
        """Pins that are more likely missing are no longer known."""
        adjacent = self._tip.lattice.adjacent
        while self.known.any():
            self._predict(self.known)
            self._density = self._log_density(self.square, self.variance * self.scale, self.freedom)
            odds = self._odds()
            worst = (odds < 0) & (odds <= np.append(odds, np.inf)[adjacent].min(1))
            if not worst.any():
                break
            self.known = self.known & ~worst
        self.log_together = self._log_together()
        self.log_posterior = self._log_posterior_at_random() + self.log_together

    def _odds(self) -> Array:
        """(n,) logarithm of the odds that a known pin has its blob; infinite elsewhere."""
        return np.where(self.known, self._density - self._log_chance(), np.inf)

    def _predict(self, wanted: Mask) -> None:
        """Each wanted pin from the known ones near, and the scale of the field from the errors of the known
        ones' predictions.
        """
        p, kriging, motion = self._tip.params, self.model.kriging, self.motion
        known_near = self.known[self._tip.lattice.near]
        rows = _rows((known_near != self._weighted).any(1) & wanted)
        self._weight[rows], self.variance[rows] = kriging.weights(rows, known_near[rows])
        self._weighted[rows] = known_near[rows]
        self.mean = kriging.predict(self._weight, motion)
        error = motion - self.mean
        self.square = (error**2).sum(1)
        # The frame's is by the median, which outliers do not move; half the square is that of one component.
        of_frame = float(np.median((self.square / self.variance)[self.known])) / (2 * np.log(2))
        # That of the pins near is taken as if the pin were where it is predicted: an outlier is no evidence
        # of a rough field.
        of_near, near_n = kriging.square_around(error, self.variance, self._weight, self.known)
        self.freedom = p.scale_freedom + near_n
        self.scale = (p.scale_freedom * of_frame + of_near) / self.freedom

    @property
    def _area(self) -> float:
        """Area of the tip, square pitches."""
        return float(len(self.known) * np.sqrt(0.75))

    def _unassigned(self) -> Mask:
        """(m,) the blobs that no known pin has."""
        free = np.ones(len(self.blob_xy), np.bool_)
        free[self.blob[self.known]] = False
        return free

    def _log_density(self, square: Array, variance: Array, freedom: Array) -> Array:
        """Logarithm of the density of a centroid at this square of the distance from where it is predicted
        with this variance: a Student t in the plane.
        """
        spread = variance + self.model.noise**2
        return np.asarray(
            -np.log(2 * np.pi * spread) - (freedom / 2 + 1) * np.log1p(square / (freedom * spread))
        )

    def _log_chance(self) -> float:
        """Log of the odds of a missing pin times the density of false blobs, per square pitch, as counted."""
        n, known_n = len(self.known), self.known_n
        missing = (n - known_n + 1) / (n + 2)
        false = (len(self.blob_xy) - known_n + 1) / self._area
        return float(np.log(false * missing / (1 - missing)))

    def _apart(self, certain: Mask, odds: Array) -> Mask:
        """(n,) without the less likely of two too near to each other: a reflection, or the same pin twice."""
        first, second = self._tip.lattice.pairs.T
        gap = np.hypot(*(self.blob_xy[self.blob[first]] - self.blob_xy[self.blob[second]]).T)
        near = certain[first] & certain[second] & (gap < self._tip.lattice.distance_min_px)
        certain[np.where(odds[first] < odds[second], first, second)[near]] = False
        return certain

    def _may_have_slipped(self) -> Mask:
        """(n,) the pins where the field is rough, and signs of a slip are in reach of the neighbours."""
        p, lattice = self._tip.params, self._tip.lattice
        by_unmatched = (~self.known[lattice.near] & (lattice.weight > 0)).any(1)
        by_unassigned = np.zeros(len(self.known), np.bool_)
        unassigned = self.blob_xy[self._unassigned()]
        if len(unassigned):
            apart, _ = nearest_of(unassigned, self.blob_xy[self.blob])
            by_unassigned = apart[:, 0] < THIRD_RING * self._tip.lattice.pitch_px
        spread = (self.freedom * self.variance * self.scale + self.square) / (self.freedom + 2)
        rough, rougher = spread > p.slip_spread**2, spread > (2.0 * p.slip_spread) ** 2
        return np.asarray((by_unmatched & by_unassigned & rough) | ((by_unmatched | by_unassigned) & rougher))


def _rows(mask: Mask) -> Index:
    return np.flatnonzero(mask).astype(np.int32)
