"""Slow adaptation of the rest frame to what skin and mount do over hours: creep, temperature, settling.

Idea: while the tip is certainly untouched, its pins are at rest. Their offset from the rest frame is learnt
very slowly and subtracted before anything is computed from their motion.

Rules
- Only while certainly untouched: no touch in this frame and the one before, nearly all pins seen, no pin
  further from its adapted place than a small part of the pitch, no fault of camera, image or tracker.
- Slow: a time constant of minutes. What creeps back in seconds after a touch leaves no trace above noise.
- Bounded: no pin's offset exceeds `limit_px`. A larger one is a camera that moved, or a tip that needs a
  tare, and is reported (`limit_share`).
- Reported (`offset_px`, `limit_share`), and forgotten with the next rest frame.

A touch too light for the contact detector, held for minutes, can be learnt; the error is at most the limit.
"""

from dataclasses import dataclass

import numpy as np

from edge.params import PARAMS as RUNTIME
from edge.types import Array, Index, Rest, Tracks


@dataclass(frozen=True, slots=True)
class DriftParams:
    """Parameters by name; evidence in docs/tuning.md."""

    limit_px: float = 0.3  # largest offset of a pin in x and in y; 0: nothing is learnt
    time_s: float = 120.0  # time constant


PARAMS = DriftParams()
PERIOD_S = RUNTIME.check_s  # of learning: faster has no benefit


class Drift:
    """The learnt offset of each pin of one rest frame."""

    def __init__(self, rest: Rest, params: DriftParams = PARAMS) -> None:
        self._rest = rest
        self._params = params
        self._near_px = RUNTIME.still_pitches * rest.pattern.pitch_px
        self.limit_share = 0.0  # of the pins that would need a larger offset than is allowed
        self._offset = np.zeros_like(rest.xy_img)
        self.learnt = False  # whether anything is subtracted
        self._last_ns: int | None = None  # the last untouched frame; None: the one before was none

    @property
    def offset_px(self) -> float:
        """Largest offset that is subtracted, px."""
        return float(np.abs(self._offset).max(initial=0.0))

    def offset_of(self, rows: Index | None = None) -> Array:
        """(k, 2) px, to be subtracted from the places of these pins, which are all if there are as many."""
        return self._offset if rows is None or len(rows) == len(self._offset) else self._offset[rows]

    def learn(self, tracks: Tracks, capture_ns: int, quiet: bool) -> None:
        """Learn from one frame, as seen, if it is quiet: untouched, without a gap before it or a fault."""
        p = self._params
        if p.limit_px == 0.0:
            return
        if not quiet:
            self._last_ns = None
            return
        gap_s = -1.0 if self._last_ns is None else (capture_ns - self._last_ns) * 1e-9
        if 0.0 <= gap_s < PERIOD_S:
            return
        off = tracks.xy_img - self._rest.xy_img - self._offset
        enough = tracks.n_seen >= (1.0 - RUNTIME.astray_rel) * len(tracks.seen)
        far_px = np.fmax.reduce(np.abs(off), axis=None, initial=0.0)  # of those that are not NaN
        self._last_ns = capture_ns if enough and far_px < self._near_px + p.limit_px else None
        if gap_s > 0.0 and self._last_ns is not None:
            self._offset += np.where(tracks.seen[:, None], off, 0.0) * min(1.0, gap_s / p.time_s)
            beyond = np.maximum(*np.abs(self._offset).T) > p.limit_px
            np.clip(self._offset, -p.limit_px, p.limit_px, out=self._offset)
            self.learnt = True
            self.limit_share = float(np.mean(beyond))
