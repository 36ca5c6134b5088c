"""Coarse motion of a whole tip: polynomials fitted to the nearest blobs, from several starts at once.

Idea: a field of low degree cannot follow single pins; it fits only if most of its pins are right. From
several shifts of the rest frame the degree rises from affine to 4; in each round blobs are matched one to one
and the field is fitted again. Arrays carry a leading axis h of hypotheses.
"""

import numpy as np
from numpy.typing import NDArray

from edge.tracking.match import NearestBlob
from edge.tracking.tip import TrackedTip
from edge.types import Array, Mask


class PolynomialField:
    """Least-squares vector polynomials of the rest position, Legendre products up to a total degree."""

    def __init__(self, rest_xy: Array, degree: int) -> None:
        centre = (rest_xy.min(0) + rest_xy.max(0)) / 2
        unit = (rest_xy - centre) / np.abs(rest_xy - centre).max()
        legendre = [np.ones_like(unit), unit]  # by their recurrence: NumPy's module takes 4 ms to import
        for k in range(2, degree + 1):
            legendre.append((legendre[-1] * unit * (2 * k - 1) - legendre[-2] * (k - 1)) / k)
        terms = [(d - j, j) for d in range(degree + 1) for j in range(d + 1)]
        basis = np.stack([legendre[i][:, 0] * legendre[j][:, 1] for i, j in terms], axis=1)
        self._basis: Array = np.asarray(basis, np.float64)
        # A small ridge that grows with the degree: without it the field diverges at rim pins without a match.
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


class CoarseFit:
    """Fits of one tip, from a grid of shifts and from the tip scaled up or down."""

    def __init__(self, tip: TrackedTip) -> None:
        self._tip = tip
        p = tip.params
        self._field = PolynomialField(tip.lattice.rest_xy, max(p.coarse_degrees))
        # A grid of one standard deviation of the tip's mean motion, to a pitch any way.
        steps_n = round(1.0 / p.shift_spread)
        k = range(-steps_n, steps_n + 1)
        grid = [(a + b / 2, b * np.sqrt(0.75)) for a in k for b in k if abs(a + b) <= steps_n]
        step_px = p.shift_spread * tip.lattice.pitch_px
        shifts = np.array(grid)[:, None, :] * step_px + np.zeros((len(tip), 1))
        out = tip.lattice.rest_xy - tip.rest.pattern.centre_img
        swollen = out * (np.median(tip.lattice.local_pitch_px) / max(np.hypot(*out.T).max(), 1e-9))
        self._starts = tip.lattice.rest_xy + np.concatenate([shifts, swollen[None], -swollen[None]])

    def fit(self, blobs: NearestBlob, guesses: list[Array]) -> tuple[Array, Mask]:
        """Motions (h, n, 2) px, and which pins have a blob (h, n); guesses (n, 2) px are more starts."""
        p, lattice = self._tip.params, self._tip.lattice
        rest_xy, local_pitch, blob_xy = lattice.rest_xy, lattice.local_pitch_px, blobs.all_xy
        at = np.concatenate([np.stack(guesses), self._starts]) if guesses else self._starts
        gate_px, anywhere = p.gate * local_pitch, np.full(len(self._tip), np.inf)
        for degree in p.coarse_degrees:
            blob, square, matched = blobs.match(at, anywhere)
            weight = np.where(matched, np.exp(-0.5 * square / gate_px**2), 0.0)
            if degree > 1:  # where the affine rounds end, the best go on
                best = np.argsort(-weight.sum(1), kind="stable")[: p.coarse_n]
                blob, weight = blob[best], weight[best]
            at = rest_xy + self._field.smooth(blob_xy[blob] - rest_xy, weight, degree)
        blob, _, matched = blobs.match(at, gate_px)
        return blob_xy[blob] - rest_xy, matched
