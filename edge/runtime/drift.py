"""Slow adaptation of the rest frame to what skin and mount do over hours: creep, temperature, settling.

Idea: while the tip is certainly untouched, its pins are at rest. Their offset from the rest frame is learnt
very slowly and subtracted before anything is computed from their motion.

Rules
- Only while certainly untouched: no touch for UNTOUCHED_S without a break, nearly all pins seen, no pin
  further from its adapted place than a small part of the pitch, no fault of camera, image or tracker.
- Slow: a time constant of minutes. A touch of seconds is never learnt.
- Bounded: no pin's offset exceeds `limit_px`. A larger one is a camera that moved, or a tip that needs a
  tare, and is reported (`at_limit`).
- Reported (`offset_px`, `at_limit`) and reversible: `forget` restores the rest frame as it was taken.

A touch too light for the contact detector, held for minutes, can be learnt; the error is at most the limit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edge.types import Array, Rest, Tracks

__all__ = ["LIMIT_PX", "TIME_S", "Drift"]

LIMIT_PX = 0.3  # the noise of a single frame's centroid is some 0.05 px, a light touch moves pins by 1 px
TIME_S = 120.0  # silicone has crept back to a few percent within this time after a press
UNTOUCHED_S = 3.0
SEEN_SHARE = 0.95
NEAR_PITCHES = 0.05  # 1 px of a pitch of 19 px
GAP_S = 0.5  # a pause longer than this is not counted as time at rest
PERIOD_S = 0.05  # of learning: faster has no benefit


class Drift:
    """The learnt offset of each pin of one rest frame.

    limit_px  largest offset in x and in y; 0: nothing is learnt
    time_s    time constant
    """

    def __init__(self, rest: Rest, limit_px: float = LIMIT_PX, time_s: float = TIME_S) -> None:
        self._rest = rest
        self._limit_px = limit_px
        self._time_s = time_s
        self._near_px = NEAR_PITCHES * rest.pattern.pitch_px
        self._offset = np.zeros_like(rest.xy_img)
        self._learnt = False
        self._since_ns: int | None = None
        self._last_ns = 0
        self._at_limit = False

    @property
    def offset_px(self) -> float:
        """Largest offset that is subtracted, px."""
        return float(np.abs(self._offset).max(initial=0.0))

    @property
    def at_limit(self) -> bool:
        """Whether a tenth of the pins or more would need a larger offset than is allowed."""
        return self._at_limit

    def correct(self, tracks: Tracks) -> Tracks:
        """The tracks without the drift; the same object while nothing has been learnt."""
        return replace(tracks, xy_img=tracks.xy_img - self._offset) if self._learnt else tracks

    def learn(self, tracks: Tracks, capture_ns: int, quiet: bool) -> None:
        """Learn from one frame, if it is suitable.

        tracks  as seen, not corrected
        quiet   untouched, and no fault is present
        """
        if self._limit_px == 0.0:
            return
        if not quiet:
            self._since_ns = None
            return
        gap_s = (capture_ns - self._last_ns) * 1e-9
        if 0.0 <= gap_s < PERIOD_S:
            return
        self._last_ns = capture_ns
        away = tracks.xy_img - self._rest.xy_img
        still = 0.0 < gap_s <= GAP_S and self._fit(tracks, away)
        if not still:
            self._since_ns = None
        elif self._since_ns is None:
            self._since_ns = capture_ns
        elif capture_ns - self._since_ns >= UNTOUCHED_S * 1e9:
            wanted = np.where(tracks.seen[:, None], away, self._offset)
            self._offset += (wanted - self._offset) * min(1.0, gap_s / self._time_s)
            np.clip(self._offset, -self._limit_px, self._limit_px, out=self._offset)
            self._learnt = True
            beyond = np.abs(self._offset).max(axis=1) >= 0.999 * self._limit_px
            self._at_limit = bool(np.count_nonzero(beyond) >= 0.1 * len(beyond))

    def forget(self) -> None:
        """Restore the rest frame as it was taken."""
        self._offset = np.zeros_like(self._offset)
        self._learnt = self._at_limit = False
        self._since_ns = None

    def _fit(self, tracks: Tracks, away: Array) -> bool:
        if tracks.n_seen < SEEN_SHARE * len(tracks.seen):
            return False
        off = np.abs(away - self._offset)[tracks.seen]
        return bool(off.max(initial=0.0) < self._near_px + self._limit_px)
