"""Where a lost pin is, as far as the seen ones know.

Idea: what presses pushes the skin apart along the gradient of some potential; shear and turn are what a curl
adds. So motion is read as a random field, the sum of a smooth curl-free part and a small divergence-free one
and of an affine motion that costs nothing, and a lost pin is where the seen pins make it most likely to be
(kriging). Pins that say two things each about one potential close a gap better than two surfaces, one
through each component, that know nothing of each other.

Rules
- An affine motion is continued exactly.
- Lengths in pitches: one table of widths serves every tip.
- The equations are kept for the last set of lost pins: a pin that stays dark costs a frame next to nothing.
Source  as in edge.features.divergence.
"""

from __future__ import annotations

import numpy as np

from edge.tessellate.layout import affine_terms, must_span
from edge.types import Array, Index, Mask

__all__ = ["Gap", "LostPins"]

#: Lost pins (m,) ascending, their rows (2 m, 2 n) of the precision, the inverse (2 m, 2 m) of its block;
#: x and y of a pin lie side by side.
Gap = tuple[Index, Array, Array]

#: Width of a potential in pitches, and the variance of its motion; share of the divergence-free part; noise
#: of a pin against the motion's unit. Rms error of lost pins' places over that of a field that bends least
#: (sum of squares off affine fits to the neighbours), 30 % lost anywhere / 12 % in one place:
#:
#:                                    331 pins: ball, flat    127 pins: ball, flat     published, 331
#:     widths of `divergence`             .52/.68  .58/.89        1.00/.91  .61/.65          .89/.86
#:     as here, but uncoupled (curl 1)    .77/.86  .64/.87        1.07/1.02 .71/.78          .85/.94
#:     as here                            .56/.62  .63/.80        .88/.83   .67/.71          .82/.72
WIDTHS = ((0.7, 0.05), (1.4, 0.2), (2.8, 0.5), (5.6, 1.0))
CURL = 0.2
NOISE = 0.05


class LostPins:
    """Predicts lost pins of one tip; keeps the equations for the last set of lost ones.

    rest_img  (n, 2) px
    pitch_px  distance of neighbours
    """

    def __init__(self, rest_img: Array, pitch_px: float) -> None:
        self._rest_img = rest_img
        self._precision = _precision(rest_img, pitch_px)
        self._key = np.ones(len(rest_img), dtype=np.bool_).tobytes()  # the set that the gap is for
        self._gap: Gap = (np.empty(0, np.int32), np.empty((0, 2 * len(rest_img))), np.empty((0, 0)))

    def gap(self, seen: Mask) -> Gap:
        """What `edge._cells.place` needs to put the lost pins in.

        Raises   DegenerateLayout: fewer than 3 pins seen, or all on a line
        """
        key = seen.tobytes()
        if key != self._key:
            must_span(self._rest_img[seen], "seen pins")
            lost = np.flatnonzero(~seen).astype(np.int32)
            both = np.column_stack([2 * lost, 2 * lost + 1]).ravel()
            rows = self._precision[both]
            inverse = np.linalg.inv(rows[:, both]).astype(np.float64, copy=False)
            self._gap, self._key = (lost, rows, np.ascontiguousarray(inverse)), key
        return self._gap


def _precision(xy: Array, pitch_px: float) -> Array:
    """(2 n, 2 n) inverse covariance of the pins' motion with the affine part free.

    Positive on every set of pins that leaves three others that span a plane.
    """
    inverse = np.linalg.inv(_covariance(xy, pitch_px))
    affine = np.kron(affine_terms(xy, xy.mean(axis=0), pitch_px), np.eye(2))
    weighted = inverse @ affine
    precision: Array = inverse - weighted @ np.linalg.solve(affine.T @ weighted, weighted.T)
    return precision


def _covariance(xy: Array, pitch_px: float) -> Array:
    """(2 n, 2 n) covariance of the pins' motion but for its affine part."""
    n = len(xy)
    d = (xy[:, None, :] - xy[None, :, :]) / pitch_px
    r2 = (d**2).sum(axis=2)
    covariance = np.zeros((n, 2, n, 2))
    outer, unit = d[:, :, :, None] * d[:, :, None, :], np.eye(2)
    for width, variance in WIDTHS:
        # Of a potential of covariance exp(-r^2 / 2 w^2): its gradient's, and with a quarter turn its curl's.
        bell = variance * np.exp(-0.5 * r2 / width**2)[..., None, None]
        along, across = outer / width**2, (r2 / width**2)[..., None, None] * unit - outer / width**2
        part = bell * ((unit - along) + CURL * (unit - across))
        covariance += part.transpose(0, 2, 1, 3)
    flat = covariance.reshape(2 * n, 2 * n)
    flat[np.diag_indices(2 * n)] += NOISE**2
    return flat
