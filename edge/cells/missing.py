"""Where a lost pin is, predicted from the pins that are seen.

Idea: the motion is modelled as a random field (`edge.geometry.motion_field`); a lost pin is put at the most
likely place given the seen ones (kriging).

Rules
- An affine motion is continued exactly.
- The equations are kept for the last set of lost pins: a pin that stays dark costs next to nothing a frame.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from edge.geometry.layout import must_span
from edge.geometry.motion_field import PREDICTING, precision
from edge.types import Array, Index, Mask

__all__ = ["Gap", "LostPins"]

#: Lost pins (m,) ascending, their rows (2 m, 2 n) of the precision, the inverse (2 m, 2 m) of its block;
#: x and y of a pin lie side by side.
Gap = tuple[Index, Array, Array]


class LostPins:
    """Predicts lost pins of one tip; keeps the equations for the last set of lost ones.

    rest_img  (n, 2) px
    pitch_px  distance of neighbours
    """

    def __init__(self, rest_img: Array, pitch_px: float) -> None:
        self._rest_img, self._pitch_px = rest_img, pitch_px
        self._seen = np.ones(len(rest_img), dtype=np.bool_).tobytes()  # the pins that `gap` was made for
        self.gap: Gap = (np.empty(0, np.int32), np.empty((0, 2 * len(rest_img))), np.empty((0, 0)))

    @cached_property
    def precision(self) -> Array:
        """Of the motion of all pins; made when it is first needed."""
        return precision(self._rest_img, self._pitch_px, PREDICTING)

    def update(self, seen: Mask) -> bool:
        """Set `gap` to that of the pins that are not seen; returns whether it changed.

        Raises   DegenerateLayout: fewer than 3 pins seen, or all on a line
        """
        key = seen.tobytes()
        if key == self._seen:
            return False
        must_span(self._rest_img[seen], "seen pins")
        lost = np.flatnonzero(~seen).astype(np.int32)
        both = np.column_stack([2 * lost, 2 * lost + 1]).ravel()
        rows = self.precision[both]
        inverse = np.linalg.inv(rows[:, both]).astype(np.float64, copy=False)
        self.gap, self._seen = (lost, rows, inverse), key
        return True
