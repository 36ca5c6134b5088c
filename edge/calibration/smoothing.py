"""Smoothing of calibrated values over time: off unless a user asks for it.

Each value that has a sigma gets a Kalman filter for itself and its speed, which changes by white noise q.
A frame counts by its sigma. How fast values change the user says: by T, the time in which a sudden step is
followed. In the steady state the filter is, w^4 being q / (mean sigma^2 dt),

    (sqrt(2) w s + w^2) / (s^2 + sqrt(2) w s + w^2)

It answers a step with 1 - exp(-a) (cos a - sin a), a = w t / sqrt(2). That first is 1 at a = pi / 4, hence
w = pi / (2 sqrt(2) T), then overshoots by exp(-pi / 2) = 21 %. A steady motion is not delayed. White noise
falls to sqrt(3 pi dt / (8 T)) of its size, dt from frame to frame.

Rules
- A touch begins with the values that are read: the first two frames are as they are, and their difference is
  the speed. Without a touch nothing is smoothed.
- A value that is not known, and frames without values or after a gap, begin it anew.
- Flags, ranges, sigmas, places of contacts, friction and slip margin stay those of the frame.

Source  Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation" (2001), 6.2.2
"""

import math
from dataclasses import dataclass

from edge import limits
from edge.types import Result


@dataclass(slots=True)
class _Smoothed:
    """A value, its speed, their covariances vv, vs, ss, and the mean square of sigma of so many frames."""

    value: float
    square: float
    speed: float = 0.0
    vv: float = 0.0
    vs: float = 0.0
    ss: float = 0.0
    frames_n: int = 1

    def follow(self, value: float, square: float, step_s: float, rate: float) -> float:
        """The value after a frame; `rate` is w."""
        self.frames_n += 1
        self.square += (square - self.square) / self.frames_n
        if self.frames_n == 2:
            self.value, self.speed = value, (value - self.value) / step_s
            self.vv, self.vs, self.ss = square, square / step_s, 2.0 * square / step_s**2
            return value
        noise = self.square * step_s * rate**4
        self.vv += step_s * (2.0 * self.vs + step_s * self.ss) + noise * step_s**3 / 3.0
        self.vs += step_s * self.ss + noise * step_s**2 / 2.0
        gain, of_speed = self.vv / (self.vv + square), self.vs / (self.vv + square)
        self.ss += noise * step_s - of_speed * self.vs
        self.vv, self.vs = (1.0 - gain) * self.vv, (1.0 - gain) * self.vs
        error = value - self.value - step_s * self.speed
        self.value += step_s * self.speed + gain * error
        self.speed += of_speed * error
        return self.value


class Smoother:
    """Smooths the values of one finger; `step_s` is the time in which a step is followed, > 0."""

    def __init__(self, step_s: float) -> None:
        # A step in less than a sample's unit of time would mean no smoothing.
        self._rate = min(math.pi / (2.0 * math.sqrt(2.0) * step_s), limits.RATE_MAX_HZ)
        self._before_ns = 0
        self._tracks: dict[str, _Smoothed] = {}

    def forget(self) -> None:
        """The touch has ended, or the next frame does not follow from the last one."""
        self._tracks.clear()

    def update(self, result: Result) -> None:
        """Smooth the values of a frame, in place."""
        if result.searched or result.features is None or not result.features.in_contact:
            self.forget()
            return
        reading, step_s = result.reading, (result.frame.capture_ns - self._before_ns) * 1e-9
        self._before_ns = result.frame.capture_ns
        before, self._tracks = self._tracks, {}
        for name, sigma in reading.sigmas.items():
            value = reading.values.get(name, math.nan)
            if not (math.isfinite(value) and 0.0 < sigma < math.inf):
                continue
            if name in before and step_s > 0.0:
                reading.values[name] = before[name].follow(value, sigma * sigma, step_s, self._rate)
                self._tracks[name] = before[name]
            else:
                self._tracks[name] = _Smoothed(value, sigma * sigma)
