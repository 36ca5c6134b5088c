"""Where a lost pin is, predicted from the pins that are seen.

Idea: the motion is modelled as a random field (`edge.geometry.motion_field`); a lost pin is put at the most
likely place given the seen ones (kriging).

Rules
- An affine motion is continued exactly.
- The motion off that prediction changes little from frame to frame: what is left of the last frame's motion
  is subtracted from all pins before they predict, and added again.
- The equations are kept for the last set of lost pins: a pin that stays dark costs next to nothing a frame.
"""

import threading

import numpy as np

from edge.geometry.layout import must_span
from edge.geometry.motion_field import PREDICTING, Precision
from edge.types import Array, Index, Mask


class LostPins:
    """Predicts lost pins of one tip; keeps the equations for the last set of lost ones.

    lost          (m,) int32, the lost pins, ascending
    gap, gap_img  as in `edge.types.Cells`
    """

    def __init__(self, rest_img: Array, pitch_px: float) -> None:
        self._rest_img, self._pitch_px = rest_img, pitch_px
        self._seen = np.ones(len(rest_img), dtype=np.bool_).tobytes()  # the pins that the equations are of
        self.lost: Index = np.empty(0, np.int32)
        self._weights = np.empty((0, 2 * len(rest_img)))  # of the seen pins' motion in that of the lost ones
        self.gap, self.gap_img = 0.0, None
        self._precision: Precision | None = None
        self._making = threading.Lock()

    @property
    def precision(self) -> Precision:
        """The precision of the motion of all pins; made once, by the thread that needs it first."""
        with self._making:
            if self._precision is None:
                self._precision = Precision(self._rest_img, self._pitch_px, PREDICTING)
            return self._precision

    def update(self, seen: Mask) -> None:
        """Prepare for the pins that are not seen. Raises DegenerateLayout: the others span no plane."""
        key = seen.tobytes()
        if key == self._seen:
            return
        must_span(self._rest_img[seen], "seen pins")
        lost = np.flatnonzero(~seen).astype(np.int32)
        both = np.column_stack([2 * lost, 2 * lost + 1]).ravel()
        rows = self.precision.rows(both)
        inverse = np.linalg.inv(rows[:, both])
        self._weights = -inverse @ rows
        # x and y of a pin: half of the sum over both is its variance along one axis.
        variance = np.diag(inverse).reshape(-1, 2).sum(axis=1) / 2.0
        total = float(variance.sum())
        self.gap = total / len(seen)
        self.gap_img = variance @ self._rest_img[lost] / total if len(lost) else None
        self.lost, self._seen = lost, key

    def fill(self, xy_img: Array, last_img: Array, autocorrelation: float) -> Array:
        """(n, 2) px, the pins of a frame, lost ones at their conditional mean.

        last_img         (n, 2) px, the same of the last frame
        autocorrelation  of the pins' motion off that of their neighbours with that of the last frame; 0: this
                         frame alone counts
        """
        left = autocorrelation * (last_img - self._rest_img)
        motion = xy_img - self._rest_img - left
        motion[self.lost] = 0.0
        filled = xy_img.copy()
        off = (self._weights @ motion.ravel()).reshape(-1, 2)
        filled[self.lost] = (self._rest_img + left)[self.lost] + off
        return filled
