"""Replays a recording as if it were live.

Deadlines are absolute, so that rounding and late wake-ups do not add up. Frames get the time of their
deadline on the host's monotonic clock, so that latency has the same meaning as with a camera.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

from edge.sources.live import ThreadedSource
from edge.types import Clock, Frame, FrameSource


class Paced(ThreadedSource):
    """A live source over a recording, which it closes.

    loop     start again at the end, for ever; times and sequence numbers continue
    rest_n   so many first images are each given when the one before has been read; time waits for that
    """

    recorded = True  # its frames come live, but do not show the present

    def __init__(
        self,
        source: FrameSource,
        *,
        speed: float = 1.0,
        loop: bool = False,
        rest_n: int = 0,
        clock_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        super().__init__(source.name)
        self.source = source
        self.size_px, self.polarity, self.lens = source.size_px, source.polarity, source.lens
        self.region, source.region = source.region, None
        self.rate_hz, self._speed = source.rate_hz * speed, speed
        self._loop, self._rest_n, self._clock_ns = loop, rest_n, clock_ns

    def _due(self) -> Iterator[tuple[int, Frame]]:
        """(ns since the start, frame with its new sequence number)."""
        period_ns = 1e9 / self.rate_hz if self.rate_hz else 1e9 / 30
        due_ns = -period_ns
        sequence_shift = 0
        while True:
            previous: Frame | None = None
            for frame in self.source:
                own_ns = frame.capture_ns - previous.capture_ns if previous else 0
                due_ns += own_ns / self._speed if own_ns > 0 else period_ns  # its clock may stand still
                previous = frame
                yield round(due_ns), replace(frame, sequence=frame.sequence + sequence_shift)
            if not self._loop or previous is None:
                return
            sequence_shift += previous.sequence + 1

    def _work(self) -> None:
        start_ns = self._clock_ns()
        period_ns = 1e9 / self.rate_hz if self.rate_hz else 0.0
        for n, (due_ns, frame) in enumerate(self._due()):
            if n < self._rest_n:
                with self._changed:  # until the loop has taken the frame that was offered last
                    self._changed.wait_for(lambda: self._slot is None or self._closing.is_set())
                start_ns = max(start_ns, self._clock_ns() - due_ns)
            wait_ns = start_ns + due_ns - self._clock_ns()
            if wait_ns > 0:
                self._closing.wait(wait_ns / 1e9)
            elif period_ns and -wait_ns > period_ns:
                self.faults["late"] += 1  # the recording cannot be read as fast as its rate
            if self._closing.is_set():
                return
            self._offer(replace(frame, capture_ns=start_ns + due_ns, clock=Clock.HOST))

    def close(self) -> None:
        super().close()
        self.source.close()
