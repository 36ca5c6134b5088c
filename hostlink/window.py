"""All that fingers sent between two looks, as arrays: for learning beside slower cameras.

    while recording:
        image = camera.read()
        for node, window in hand.window().items():        # the first call begins, and gives nothing yet
            window.values[window.valid[:, 3], 3]           # or window.column("force_n")

Rules
- Each sample is in one window, the next one after it came: nothing is lost between two calls, and nothing is
  given twice. What does not fit in between is counted in `lost_n`, with what the link has lost.
- No NaN: a value that is not valid is 0, and its mask is false.
"""

from __future__ import annotations

import threading
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Generic, Protocol, TypeVar

from hostlink.errors import UsageError
from hostlink.events import DetailFrame, Sample
from hostlink.extras import require
from hostlink.wire.fields import FIELDS

if TYPE_CHECKING:
    import numpy as np

__all__ = ["MEASURED", "SampleTimes", "Window", "WindowCollector"]

#: Every measured value of a sample but those of single contacts.
MEASURED: Final = tuple(f.name for f in FIELDS if not f.plain)
SAMPLES_MAX: Final = 1 << 14  # of a finger between two calls: 16 s at 1 kHz, 23 MB
PINS_MAX: Final = 1 << 9  # frames of a finger's pins: 8 s at 60 Hz, 26 MB of 330 pins
_Time = TypeVar("_Time", int, float)  # ns or s
_BEHIND_MAX: Final = 64  # samples that pins may come behind: they give way on the bus


class SampleTimes(Generic[_Time]):
    """When the newest samples of a finger were taken, for the pins that come behind them."""

    def __init__(self) -> None:
        self._times: dict[int, _Time] = {}

    def note(self, sample: int, time: _Time) -> None:
        """The pins by the sample's number."""
        self._times[sample] = time
        if len(self._times) > _BEHIND_MAX:
            del self._times[next(iter(self._times))]

    def of(self, sample: int) -> _Time | None:
        """None: that sample was lost, or is long ago."""
        return self._times.get(sample)


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """One finger's samples, n of them with k values, and m frames of p pins.

    names       of the columns
    time_s      (n,) float64, when the images were taken, on this host's `time.monotonic()`
    error_s     (n,) float64, bounds of these times' errors
    status      (n,) int64, status bits
    values      (n, k) float64, in the units of their names; 0 where not valid
    valid       (n, k) bool
    lost_n      samples lost between the window before and the end of this one
    pin_time_s  (m,) float64, as time_s
    pins        (m, p, 3) float32: dx px, dy px, relative change of the cell's area; 0 where not valid
    pins_valid  (m, p) bool
    """

    names: tuple[str, ...]
    time_s: np.ndarray
    error_s: np.ndarray
    status: np.ndarray
    values: np.ndarray
    valid: np.ndarray
    lost_n: int
    pin_time_s: np.ndarray
    pins: np.ndarray
    pins_valid: np.ndarray

    def column(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """(n,) values and (n,) mask of one name. Raises ValueError: the window has not asked for it."""
        k = self.names.index(name)
        return self.values[:, k], self.valid[:, k]


class _Source(Protocol):
    def on_sample(self, callback: Callable[[Sample], None]) -> Callable[[], None]: ...

    def on_detail(self, callback: Callable[[DetailFrame], None]) -> Callable[[], None]: ...


class WindowCollector:
    """Keeps what a connection receives until it is taken. Raises UsageError: NumPy is not installed."""

    def __init__(self, source: _Source) -> None:
        self._numpy = require("numpy", "data")
        self._lock = threading.Lock()
        self._samples: dict[int, deque[Sample]] = {}
        self._pins: dict[int, deque[tuple[float, DetailFrame]]] = {}
        self._times = defaultdict[int, SampleTimes[float]](SampleTimes[float])
        self._unread: dict[int, int] = {}
        source.on_sample(self._keep)
        source.on_detail(self._keep_pins)

    def _keep(self, sample: Sample) -> None:
        node = sample.finger
        with self._lock:
            kept = self._samples.setdefault(node, deque(maxlen=SAMPLES_MAX))
            self._unread[node] = self._unread.get(node, 0) + (len(kept) == SAMPLES_MAX)
            kept.append(sample)
            self._times[node].note(sample.state.sample, sample.host_time_s)

    def _keep_pins(self, frame: DetailFrame) -> None:
        with self._lock:
            time_s = self._times[frame.node].of(frame.detail.sample)
            if time_s is not None:  # else its sample was lost, and nothing says when it was
                self._pins.setdefault(frame.node, deque(maxlen=PINS_MAX)).append((time_s, frame))

    def take(self, nodes: Iterable[int], names: Sequence[str]) -> dict[int, Window]:
        """The window of each of these fingers. Raises UsageError: no such value."""
        unknown = [name for name in names if name not in MEASURED]
        if unknown:
            raise UsageError(f"window: no value {unknown[0]!r}; known: {', '.join(MEASURED)}")
        with self._lock:
            samples, self._samples = self._samples, {}
            pins, self._pins = self._pins, {}
            unread, self._unread = self._unread, {}
        return {
            node: self._window(tuple(names), samples.get(node, ()), pins.get(node, ()), unread.get(node, 0))
            for node in nodes
        }

    def _window(
        self,
        names: tuple[str, ...],
        samples: Sequence[Sample] | deque[Sample],
        pins: Sequence[tuple[float, DetailFrame]] | deque[tuple[float, DetailFrame]],
        unread_n: int,
    ) -> Window:
        numpy = self._numpy
        rows = [[getattr(s.state, name) for name in names] for s in samples]
        values = numpy.array(rows, numpy.float64).reshape(len(rows), len(names))
        valid = numpy.isfinite(values)
        last = len(pins[-1][1].detail.rows) if pins else 0  # after a calibration a tip may have others
        same = [(time_s, frame) for time_s, frame in pins if len(frame.detail.rows) == last]
        moved = numpy.array([frame.detail.rows for _, frame in same], numpy.float32).reshape(
            len(same), last, 3
        )
        seen = numpy.isfinite(moved).all(axis=2)
        return Window(
            names=names,
            time_s=numpy.array([s.host_time_s for s in samples], numpy.float64),
            error_s=numpy.array([s.host_error_s for s in samples], numpy.float64),
            status=numpy.array([int(s.state.status) for s in samples], numpy.int64),
            values=numpy.where(valid, values, 0.0),
            valid=valid,
            lost_n=unread_n + sum(s.lost_n for s in samples),
            pin_time_s=numpy.array([time_s for time_s, _ in same], numpy.float64),
            pins=numpy.where(seen[..., None], moved, numpy.float32(0.0)),
            pins_valid=seen,
        )
