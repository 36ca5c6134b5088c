"""Base of cameras: opened again after each loss, their rate checked, their frames timed and numbered."""

import logging
import threading
import time
from abc import abstractmethod
from typing import Any

from edge.errors import SourceError
from edge.params import PARAMS as RUNTIME
from edge.sources.live import PARAMS, ThreadedSource, Watch
from edge.sources.options import Options
from edge.types import Clock, Frame, Image

log = logging.getLogger(__name__)


class CameraSource(ThreadedSource):
    """A camera that comes back after it was lost; a subclass opens, reads and closes its device."""

    retry_s, patience_s = RUNTIME.announced_s, PARAMS.first_s  # between attempts to open; of measuring a rate
    _clock_ns = staticmethod(time.monotonic_ns)

    def __init__(self, name: str, options: Options) -> None:
        super().__init__(name)
        self._options = options
        self._device: Any = None
        self._reopen = threading.Event()  # set: it is to be opened anew, with other options
        self._watch = Watch()
        self._sequence, self._last_ns = -1, 0
        self._stated_ns = 0  # the last time that the driver stated
        self._step_ns, self._long_n = 0, 0  # to the last frame; so many in a row were too long
        self._opened_ns = self._clock_ns()

    @property
    def terms(self) -> str:
        """The size and rate that were asked for, and those that the camera gives."""
        o, (width, height) = self._options, self.size_px
        asked = f"{o.width}x{o.height}" if o.width else "its own size"
        asked += f" at {o.rate_hz:g}/s" if o.rate_hz else " at its own rate"
        return f"asked for {asked}, gives {width}x{height} at {self.rate_hz:.1f}/s"

    @abstractmethod
    def _open(self) -> Any:
        """The device, running. Raises SourceError, RuntimeError."""

    @abstractmethod
    def _read_from(self, device: Any) -> bool:
        """Wait for an image and hand it over; False: the device is lost."""

    @abstractmethod
    def _shut(self, device: Any) -> None:
        """Close the device, which may be gone already."""

    def _check_rate(self) -> None:
        """Measure the rate. Raises SourceError: no frames, too slow; then it is closed."""
        o = self._options
        least_hz = PARAMS.slow_rel * o.rate_hz if o.check_rate else 0.0
        try:
            self.rate_hz = self.measure_rate(least_hz, self.patience_s)
        except SourceError:
            self.close()
            raise

    def _work(self) -> None:
        try:
            while not self._closing.is_set():
                if self._device is None:
                    self._opened_ns = self._clock_ns()
                    try:
                        self._device = self._open()
                    except (SourceError, RuntimeError):  # still away, or booting: `condition` stays "lost"
                        self._closing.wait(self.retry_s)
                elif self._reopen.is_set():
                    self._reopen.clear()
                    self._release()
                elif not self._read_from(self._device):
                    if not self._closing.is_set():
                        self._set_condition("lost")
                    self._release()
        finally:
            self._release()

    def _release(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            self._shut(device)

    def _hand_over(self, frame: Frame) -> None:
        self._set_condition(self._watch.check(frame) or ("slow" if self._slow else ""))
        self._offer(frame)

    def _hand_over_at(self, image: Image, bits: int, stated_ns: int, now_ns: int, period_ns: float) -> None:
        """Hand over an image of a driver that states a time and no number: lost frames show as gaps in time.

        stated_ns  start of exposure; taken if it moves and, on the host's clock, lies between opening and now
        period_ns  between two frames; 0: not known
        """
        trusted = self._opened_ns <= stated_ns <= now_ns
        if trusted and stated_ns == self._stated_ns:
            trusted = False
            if not self.faults["repeated time"]:
                log.warning("%s: its driver's time stands still; the host's is taken", self.name)
            self.faults["repeated time"] += 1
        self._stated_ns = stated_ns
        capture_ns = stated_ns if trusted else now_ns
        steps = self._steps(capture_ns - self._last_ns, period_ns) if period_ns and self._sequence >= 0 else 1
        if steps > 1:
            self.faults["missed frame"] += steps - 1
        self._sequence, self._last_ns = self._sequence + steps, capture_ns
        clock = Clock.DRIVER if trusted else Clock.HOST
        self._hand_over(Frame(image, capture_ns, self._sequence, clock, bits))

    @property
    def _slow(self) -> bool:
        """Whether fewer images come than at the start; two steps that are too long may be by chance."""
        return self._long_n > 2

    def _steps(self, step_ns: int, period_ns: float) -> int:
        """Frames from the last one to this: more than one if some were lost, one if poor light slows them."""
        was_slow, before_ns, self._step_ns = self._slow, self._step_ns, step_ns
        self._long_n = self._long_n + 1 if step_ns * PARAMS.slow_rel > period_ns else 0
        if self._slow:
            if not was_slow:
                advice = "light the tip better, or set exposure_us and gain"
                rates = 1e9 / step_ns, 1e9 / period_ns
                log.warning("%s: %.0f images/s instead of %.0f; %s", self.name, *rates, advice)
            period_ns = min(before_ns, step_ns)
        return max(1, round(step_ns / period_ns))
