"""Base of all live sources: a thread that reads, one slot for the newest frame, and detection of faults.

A slow reader gets the newest frame, and `dropped_n` counts those it missed. A device that is lost, stalls,
freezes or goes dark raises no exception: `condition` says so, and the iterator waits until frames come back.
"""

import atexit
import threading
import time
import zlib
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from edge.errors import SourceError
from edge.params import PARAMS as RUNTIME
from edge.types import Frame, FrameSource
from hostlink.web.limits import WebLimits


@dataclass(frozen=True, slots=True)
class LiveParams:
    """Parameters by name; evidence in docs/tuning.md."""

    first_s: float = 10.0  # for the first frames of a camera that starts
    rate_frames_n: int = RUNTIME.sample_n  # intervals that a rate is measured from: their median
    slow_rel: float = 0.8  # share of the asked rate below which the camera counts as slow
    size_px: tuple[int, int] = (640, 400)  # width and height of a camera that has to be told one
    gain_iso: int = 200  # of an OAK module, if none is asked for; its exposure likewise
    exposure_us: int = 2000
    #: Rate of stills, and of videos that state none: a live replay shows as many as the page draws.
    stills_hz: float = WebLimits().rate_hz


PARAMS = LiveParams()


def stalled_after_s(rate_hz: float | None) -> float:
    """Time without a frame after which a camera of this rate, if it is known, has stalled: two periods of
    the slowest one that does not count as slow, or `stall_s` if that is longer.
    """
    return max(RUNTIME.stall_s, 2.0 / (PARAMS.slow_rel * rate_hz) if rate_hz else 0.0)


def rate_of(times: Sequence[float], per_s: float) -> float:
    """Frames a second by the median step between times, of which `per_s` make a second; 0: none grows."""
    steps = np.diff(times)
    steps = steps[steps > 0]
    return per_s / float(np.median(steps)) if len(steps) else 0.0


class Watch:
    """Detects frozen and black images, frame by frame."""

    _last = _same_n = _same_since_ns = 0

    def check(self, frame: Frame) -> str:
        """ "" or the fault of this frame: "frozen", "black"."""
        rows = np.ascontiguousarray(frame.image[:: -(-frame.image.shape[0] // RUNTIME.sample_n)])
        digest = zlib.crc32(rows.data)
        self._same_n = self._same_n + 1 if digest == self._last else 0
        if not self._same_n:
            self._same_since_ns = frame.capture_ns
        self._last = digest
        long = self._same_n >= 2 and frame.capture_ns - self._same_since_ns >= RUNTIME.stall_s * 1e9
        if int(rows.max(initial=0)) ** 2 < 1 << frame.bits:  # by ratios, nearer to one level than to white
            return "black"
        return "frozen" if long else ""


class ThreadedSource(FrameSource, ABC):
    """Base of live sources; a subclass gives `_work`, which runs in the thread and calls `_offer`."""

    live = True
    recorded = False  # its frames show the present

    def __init__(self, name: str) -> None:
        self.name = name
        self.received_n = self.dropped_n = 0
        self.faults: Counter[str] = Counter()
        self._slot: Frame | None = None
        self._times: list[int] | None = None  # of the frames that arrive while the rate is measured
        self._changed = threading.Condition()
        self._closing = threading.Event()
        self._ended = self._started = False
        self._last_s = 0.0
        self._condition = self._slot_condition = ""
        self.frame_condition = ""  # fault of the frame that `read` gave last: frozen, black, slow
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    # -- for the subclass ---------------------------------------------------------------------

    @abstractmethod
    def _work(self) -> None:
        """Read until `_closing` is set or the stream ends."""

    def _offer(self, frame: Frame) -> None:
        """Hand over a frame; an older one that no one took is dropped."""
        frame = frame.within(self.region)
        with self._changed:
            if self._slot is not None:
                self.dropped_n += 1
            self._slot = frame
            self._slot_condition = self._condition
            self.received_n += 1
            if self._times is not None:
                self._times.append(frame.capture_ns)
            self._last_s = time.monotonic()
            self._changed.notify_all()

    def _set_condition(self, condition: str) -> None:
        """Set the present condition; each appearance of a fault counts once."""
        if condition != self._condition:
            if condition:
                self.faults[condition] += 1
            self._condition = condition

    def _run(self) -> None:
        try:
            self._work()
        except Exception as error:  # noqa: BLE001  (raised again in the loop's thread, by `read`)
            self._failure = error
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify_all()

    # -- for the loop ---------------------------------------------------------------------------

    def start(self) -> None:
        """Start reading, unless started already; the first `read` starts it too."""
        with self._changed:
            if self._started or self._closing.is_set():
                return
            self._started = True
        self._last_s = time.monotonic()
        self._thread.start()

    @property
    def condition(self) -> str:
        """ "" or the present fault: lost, stalled, frozen, black, slow."""
        if self._condition or self._ended or not self._started:
            return self._condition
        waited_s = time.monotonic() - self._last_s
        late = waited_s > RUNTIME.stall_s and waited_s > stalled_after_s(self.rate_hz)
        return "stalled" if late else ""

    @property
    def ended(self) -> bool:
        return self._ended and self._slot is None

    def read(self, timeout_s: float | None = None) -> Frame | None:
        """The newest frame that was not read yet; None: none came in time, or the source has ended."""
        self.start()
        with self._changed:
            self._changed.wait_for(lambda: self._slot is not None or self._ended, timeout_s)
            frame, self._slot = self._slot, None
            self.frame_condition = self._slot_condition if frame is not None else ""
            self._changed.notify_all()
        if frame is None:
            self._raise_failure()
        return frame

    def _raise_failure(self) -> None:
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def peek(self) -> Frame | None:
        """The frame that the next `read` would give, without taking it; for another thread."""
        return self._slot

    def __iter__(self) -> Iterator[Frame]:
        while (frame := self.read()) is not None:
            yield frame

    def close(self) -> None:
        self._closing.set()
        with self._changed:
            self._changed.notify_all()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            # Do not wait for a driver that hangs in the kernel; the thread is a daemon.
            self._thread.join(RUNTIME.close_s)
            if self._thread.is_alive():  # coming back from C++ after the interpreter's end, it would abort
                atexit.register(self._thread.join, RUNTIME.patience_s)
        with self._changed:
            self._slot = None
            self._ended = True
            self._changed.notify_all()

    def measure_rate(self, least_hz: float, patience_s: float) -> float:
        """Measure the frames a second, and discard them; 0: unknown. Raises SourceError: none, or too few."""
        self.start()
        with self._changed:
            # Counted where frames arrive: a late reader must not make the camera look slow.
            times: list[int] = []
            self._times = times
            self._changed.wait_for(lambda: len(times) > PARAMS.rate_frames_n or self._ended, patience_s)
            self._times = None
            self._slot = None
            self.dropped_n = 0
        self._raise_failure()
        if not times:
            raise SourceError(
                f"{self.name}: no frame within {patience_s:g} s; check the cable and who else uses it"
            )
        measured_hz = rate_of(times, 1e9)
        if measured_hz < least_hz:
            raise SourceError(
                f"{self.name}: {measured_hz:.1f} frames/s, at least {least_hz:g} wanted; "
                "shorten exposure_us, light the tip better, or ask for less"
            )
        return measured_hz
