"""Base of cameras: opened again after each loss, their rate checked, their frames timed and numbered."""

import threading
import time
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

from edge.errors import SourceError
from edge.sources.live import PARAMS, ThreadedSource, Watch
from edge.sources.options import Options
from edge.types import Clock, Frame, Image


class CameraSource(ThreadedSource):
    """A camera that comes back after it was lost; a subclass opens, reads and closes its device.

    clock_ns  the host's monotonic clock
    """

    def __init__(
        self, name: str, options: Options, retry_s: float, clock_ns: Callable[[], int] = time.monotonic_ns
    ) -> None:
        super().__init__(name)
        self._options, self._retry_s, self._clock_ns = options, retry_s, clock_ns
        self._device: Any = None
        self._reopen = threading.Event()  # set: it is to be opened anew, with other options
        self._watch = Watch()
        self._sequence, self._last_ns = -1, 0
        self._opened_ns = clock_ns()

    @abstractmethod
    def _open(self) -> Any:
        """The device, running. Raises SourceError, RuntimeError."""

    @abstractmethod
    def _read_from(self, device: Any) -> bool:
        """Wait for an image and hand it over; False: the device is lost."""

    @abstractmethod
    def _shut(self, device: Any) -> None:
        """Close the device, which may be gone already."""

    def _check_rate(self, patience_s: float) -> None:
        """Measure the rate. Raises SourceError: no frames, too slow; then it is closed."""
        o = self._options
        least_hz = PARAMS.slow_rel * o.rate_hz if o.check_rate else 0.0
        try:
            self.rate_hz = self.measure_rate(least_hz, patience_s)
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
                        self._closing.wait(self._retry_s)
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
        self._set_condition(self._watch.check(frame))
        self._offer(frame)

    def _hand_over_at(self, image: Image, bits: int, stated_ns: int, now_ns: int, period_ns: float) -> None:
        """Hand over an image of a driver that states a time and no number: lost frames show as gaps in time.

        stated_ns  start of exposure; taken if, on the host's clock, it lies between the opening and now
        period_ns  between two frames; 0: not known
        """
        trusted = self._opened_ns <= stated_ns <= now_ns
        capture_ns = stated_ns if trusted else now_ns
        steps = 1
        if period_ns and self._sequence >= 0:
            steps = max(1, round((capture_ns - self._last_ns) / period_ns))
        if steps > 1:
            self.faults["missed frame"] += steps - 1
        self._sequence, self._last_ns = self._sequence + steps, capture_ns
        clock = Clock.DRIVER if trusted else Clock.HOST
        self._hand_over(Frame(image, capture_ns, self._sequence, clock, bits))
